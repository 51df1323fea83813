"""Claims about obstacles: whether they stand where the rig file puts them."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from geometry.arrays import Array
from planning.model.obstacles import Obstacle
from planning.model.plan import RigPlan
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings

from .zone_claims import turned

_ROUNDING = 1e-9
# A prism of 64 sides has that much less surface than its cylinder, about.
_FACETED = 0.005


def audit_obstacles(case: AuditCase, findings: AuditFindings) -> None:
    """Check names and shapes against rig.obstacle and the keep-out zones that block.

    The file of a mesh isn't at hand; that it was read rightly is taken on trust.
    """
    rig, obstacles = case.plan.document.rig, case.plan.surface.obstacles
    zones = rig.workspace.get("keep_out") or []
    solid = [{**zone, "shape": "box"} for zone in zones if zone.get("blocks", True)]
    stated = [*rig.obstacle, *solid]
    names = [table["name"] for table in stated]
    if not findings.holds(
        [obstacle.name for obstacle in obstacles] == names,
        "obstacles",
        f"surface.npz holds {[o.name for o in obstacles]}, the rig states {names}",
    ):
        return
    for obstacle, table in zip(obstacles, stated, strict=True):
        if table["shape"] != "mesh":
            _audit_shape(case.plan, obstacle, table, findings)


def _audit_shape(
    plan: RigPlan, obstacle: Obstacle, table: Mapping[str, Any], findings: AuditFindings
) -> None:
    """Compare extent, extreme vertices and area with those of the shape that is stated.

    In the shape's own frame every vertex lies on the box, or on both rims of the
    cylinder, that bounds it, and the area is that of the shape.
    """
    space = plan.requirements.workspace
    centre, up = np.array(space.centre), np.array(space.up)
    turn = turned(np.radians(table.get("turn_deg", [0.0, 0.0, 0.0])))
    middle = 1e-3 * np.array(table.get("centre_mm", [0.0, 0.0, 0.0]))
    sides = 1e-3 * np.array(table.get("size_mm") or _bounding(table))
    if table["shape"] == "table":
        if "centre_mm" not in table:
            heights = (plan.surface.mesh.corners.reshape(-1, 3) - centre) @ up
            middle = heights.min() * up
        third = int(np.argmax(np.abs(up)))
        axes = np.roll(np.eye(3), third - 2, axis=0)
        axes = axes if up[third] > 0.0 else axes @ np.diag([1.0, -1.0, -1.0])
        turn = turn @ axes
        middle = middle - 0.5 * sides[2] * turn[:, 2]
    local = (obstacle.mesh.corners.reshape(-1, 3) - centre - middle) @ turn
    off = float(np.abs(_excess(table, local, 0.5 * sides)).max())
    extent = np.stack([-local.min(axis=0), local.max(axis=0)])
    off = max(off, float(np.abs(extent - 0.5 * sides).max()))
    key = f"obstacle {obstacle.name!r}"
    findings.holds(
        off <= _ROUNDING, key, f"differs from the rig's by {1e3 * off:.3g} mm"
    )
    area = _area(table, sides)
    findings.number(f"{key} (area)", obstacle.mesh.area, area, _FACETED * area)


def _bounding(table: Mapping[str, Any]) -> list[float]:
    """Sides of the box about a cylinder [mm]."""
    return [2.0 * table["radius_mm"], 2.0 * table["radius_mm"], table["height_mm"]]


def _excess(table: Mapping[str, Any], local: Array, half: Array) -> Array:
    """How far vertices lie off the corners of the box, or off the rims, any shape."""
    beyond = np.abs(local) - half
    if table["shape"] != "cylinder":
        return beyond
    radial = np.linalg.norm(local[:, :2], axis=1)
    # The middles of both ends are vertices as well.
    radial = np.where(radial > _ROUNDING, radial - half[0], 0.0)
    return np.stack([radial, beyond[:, 2]])


def _area(table: Mapping[str, Any], sides: Array) -> float:
    if table["shape"] == "cylinder":
        radius, height = 0.5 * sides[0], sides[2]
        return 2.0 * np.pi * radius * (radius + height)
    x, y, z = sides
    return 2.0 * (x * y + y * z + z * x)
