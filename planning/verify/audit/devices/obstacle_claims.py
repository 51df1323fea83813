"""Claims about obstacles: whether they stand where the rig file puts them."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from geometry.arrays import Array
from planning.model.devices.bodies import Obstacle
from planning.model.document.input_records import ObstacleRecord
from planning.model.plan import RigPlan
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings

from .solid_claims import lacks_of_solid
from .workspace_claims import room_from_world
from .zone_claims import origin_of, turned

_ROUNDING = 1e-9
# A prism of 64 sides has that much less surface than its cylinder, about.
_FACETED = 0.005


def audit_obstacles(case: AuditCase, findings: AuditFindings) -> None:
    """Check names and shapes against rig.obstacle and the keep-out zones that block.

    The file of a mesh isn't at hand; that it was read rightly is taken on trust. What
    stands still about a turntable does so at every step.
    """
    obstacles, stated = case.plan.surface.obstacles, list(_stated(case.plan))
    names = [name for name, _, _ in stated]
    there = [(name, station) for name, station, _ in stated]
    if not findings.holds(
        [(obstacle.name, obstacle.station) for obstacle in obstacles] == there,
        "obstacles",
        f"surface.npz holds {[o.name for o in obstacles]}, the rig states {names}",
    ):
        return
    first: dict[str, Array] = {}
    for obstacle, (_, station, table) in zip(obstacles, stated, strict=True):
        back = room_from_world(case.plan, station)
        corners = obstacle.mesh.corners.reshape(-1, 3)
        corners = corners @ back[:3, :3].T + back[:3, 3]
        if table.shape != "mesh":
            _audit_shape(case.plan, obstacle, corners, table, findings)
            continue
        same = first.setdefault(table.name, corners)
        findings.holds(
            corners.shape == same.shape and np.abs(corners - same).max() <= _ROUNDING,
            f"obstacle {obstacle.name!r}",
            "doesn't stand in the room where it does at the first step",
        )


def _stated(plan: RigPlan) -> Iterator[tuple[str, str, ObstacleRecord]]:
    """Yield name, station and table of each obstacle; of one that stands still by step.

    Those that turn with a part come first.
    """
    rig, steps = plan.document.rig, []
    zones = rig.workspace.get("keep_out") or []
    solid = [_solid(zone) for zone in zones if zone.get("blocks", True)]
    still = set[str]()
    if rig.turntable is not None and plan.document.stations is not None:
        still = {*rig.turntable.still, *(zone.name for zone in solid)}
        steps = [one.id for one in plan.document.stations.stations]
    every = [*rig.obstacle, *solid]
    yield from ((t.name, "", t) for t in every if t.name not in still)
    for table in every:
        if table.name in still:
            yield from ((f"{table.name} ({s})", s, table) for s in steps)


def _solid(zone: Mapping[str, Any]) -> ObstacleRecord:
    """Return a keep-out volume that blocks as the box that it is."""
    parts = {key: zone[key] for key in ("name", "centre_mm", "turn_deg", "size_mm")}
    return ObstacleRecord(shape="box", **parts)


def _audit_shape(
    plan: RigPlan,
    obstacle: Obstacle,
    corners: Array,
    table: ObstacleRecord,
    findings: AuditFindings,
) -> None:
    """Compare extent in the shape's own frame, and area, with what is stated.

    Corners (n, 3) are those of its faces, in the room.
    """
    space = plan.requirements.workspace
    centre, up = np.array(space.centre), np.array(space.up)
    origin = origin_of(plan)
    turn = turned(np.radians(table.turn_deg))
    middle = 1e-3 * np.array(table.centre_mm or (0.0, 0.0, 0.0))
    sides, area = _sides_and_area(table)
    if table.shape == "table":
        if table.centre_mm is None:
            heights = (plan.surface.mesh.corners.reshape(-1, 3) - centre) @ up
            origin, middle = centre, heights.min() * up
        third = int(np.argmax(np.abs(up)))
        axes = np.roll(np.eye(3), third - 2, axis=0)
        axes = axes if up[third] > 0.0 else axes @ np.diag([1.0, -1.0, -1.0])
        turn = turn @ axes
        middle = middle - 0.5 * sides[2] * turn[:, 2]
    local = (corners - origin - middle) @ turn
    ends = np.stack([local.min(axis=0), local.max(axis=0)])
    off = float(np.abs(ends - 0.5 * sides * [[-1.0], [1.0]]).max())
    key = f"obstacle {obstacle.name!r}"
    findings.holds(
        off <= _ROUNDING, key, f"differs from the rig's by {1e3 * off:.3g} mm"
    )
    findings.number(f"{key} (area)", obstacle.mesh.area, area, _FACETED * area)
    shape = local.reshape(-1, 3, 3)
    lacks = lacks_of_solid(
        shape, obstacle.mesh.faces, sides, round=table.shape == "cylinder"
    )
    findings.holds(not lacks, key, lacks)


def _sides_and_area(table: ObstacleRecord) -> tuple[Array, float]:
    """Sides of the box about a shape [m], and the shape's own area [m²]."""
    if table.shape == "cylinder":
        radius, height = (
            1e-3 * (table.radius_mm or 0.0),
            1e-3 * (table.height_mm or 0.0),
        )
        sides = np.array([2.0 * radius, 2.0 * radius, height])
        return sides, 2.0 * np.pi * radius * (radius + height)
    x, y, z = sides = 1e-3 * np.array(table.size_mm)
    return sides, 2.0 * (x * y + y * z + z * x)
