"""Claims about the zones that devices keep to: whose they are, and who breaks them."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planning.model.bodies import Box
from planning.model.requirements import Workspace
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.predicates.audit_optics import in_frame
from planning.verify.audit.predicates.occlusion import Block, block_of_zone

_Array = NDArray[np.float64]
_KEY = "requirements.workspace"
_ROUNDING = 1e-9


def zone_excess(offsets: _Array, space: Workspace) -> list[_Array]:
    """Return how far positions break each kind of zone, each (n,) [m]; <= 0 if kept.

    Outside the box or the nearest mounting plane by the farthest face that they lie
    beyond; inside a keep-out volume by the nearest face.

    Args:
        offsets: Positions less the centre of the workspace, shape (n, 3).
        space: The workspace claimed.
    """
    excess = [_depth_inside(zone, offsets) for zone in space.keep_out]
    if space.box is not None:
        excess.append(-_depth_inside(space.box, offsets))
    if space.mounting:
        beyond = [-_depth_inside(plane, offsets) for plane in space.mounting]
        excess.append(np.min(beyond, axis=0))
    return excess


def audit_zones(case: AuditCase, findings: AuditFindings) -> None:
    """Check that the zones are boxes, and floor, radii and zones those of the rig."""
    space, rig = case.plan.requirements.workspace, case.plan.document.rig
    _audit_shell(case, findings)
    tables: Mapping[str, Any] = rig.workspace
    rooms = [tables] if "min_mm" in tables else []
    for name, boxes, stated, same in (
        ("box", [] if space.box is None else [space.box], rooms, _audit_room),
        ("keep_out", space.keep_out, tables.get("keep_out") or [], _audit_volume),
        ("mounting", space.mounting, tables.get("mounting") or [], _audit_plane),
    ):
        findings.holds(
            len(boxes) == len(stated),
            f"{_KEY}.{name}",
            f"holds {len(boxes)}, but rig.workspace states {len(stated)}",
        )
        for place, box in enumerate(boxes):
            _audit_box(f"{_KEY}.{name}.{place}", box, findings)
        for place, (box, table) in enumerate(zip(boxes, stated, strict=False)):
            same(f"{_KEY}.{name}.{place}", box, table, findings)


def _audit_shell(case: AuditCase, findings: AuditFindings) -> None:
    """Compare floor and radii with the rig's: s + R -+ p, tiled from s - p."""
    space, rig = case.plan.requirements.workspace, case.plan.document.rig
    floor = rig.workspace.get("floor_mm")
    stated = None if floor is None else 1e-3 * floor
    findings.holds(
        not rig.workspace
        or (
            (space.floor_m is None) == (stated is None)
            and abs((space.floor_m or 0.0) - (stated or 0.0)) <= _ROUNDING
        ),
        f"{_KEY}.floor_m",
        f"{space.floor_m!r} m, but rig.workspace states {stated!r} m",
    )
    standoff, play = rig.standoff_m, rig.standoff_play_m
    if standoff is None or play is None:
        return
    middle = standoff + space.object_radius_m
    for kind in case.kinds:
        tiled = kind.standoff_m
        truth = [(middle if tiled is None else standoff) - play, middle + play]
        key = f"{_KEY}.{kind.name}_radius_m"
        findings.array(key, kind.shell, truth, _ROUNDING, "by rig.standoff_m")
        findings.holds(
            tiled is None or abs(tiled - standoff) <= _ROUNDING,
            f"{_KEY}.{kind.name}_standoff_m",
            f"{tiled!r} m, but rig.standoff_m is {standoff:g} m",
        )


def _depth_inside(box: Box, offsets: _Array) -> _Array:
    """Least distance to any of the six planes, negative beyond one, shape (n,)."""
    block = block_of_zone(box, np.zeros(3))
    local = in_frame(block.world_from_box, offsets)
    return np.min(block.half - np.abs(local), axis=1)


def _audit_box(key: str, box: Box, findings: AuditFindings) -> None:
    """Check that axes are a rotation, and sides positive."""
    turn = np.array(box.axes)
    error = float(np.abs(turn @ turn.T - np.eye(3)).max())
    findings.holds(
        error <= _ROUNDING and np.linalg.det(turn) > 0.0,
        f"{key}.axes",
        f"are no rotation: A A^T differs from the identity by {error:.2g}",
    )
    findings.holds(
        min(box.half_m) > 0.0,
        f"{key}.half_m",
        f"{list(box.half_m)} m must be positive",
    )


def _audit_room(
    key: str, box: Box, table: Mapping[str, Any], findings: AuditFindings
) -> None:
    """Compare the room with the least and largest corner that are stated."""
    low, high = 1e-3 * np.array(table["min_mm"]), 1e-3 * np.array(table["max_mm"])
    stated = Block.at(box.name, np.eye(3), 0.5 * (low + high), 0.5 * (high - low))
    _audit_corners(key.removesuffix(".0"), box, stated, findings)


def _audit_volume(
    key: str, box: Box, table: Mapping[str, Any], findings: AuditFindings
) -> None:
    """Compare a keep-out volume with the centre, size and turns that are stated."""
    turn = turned(np.radians(table["turn_deg"]))
    centre, size = (1e-3 * np.array(table[name]) for name in ("centre_mm", "size_mm"))
    stated = Block.at(box.name, turn, centre, 0.5 * size)
    _audit_corners(key, box, stated, findings)


def _audit_plane(
    key: str, box: Box, table: Mapping[str, Any], findings: AuditFindings
) -> None:
    """Compare a mounting plane with centre, extent and normal that are stated."""
    normal = np.array(table["normal"], dtype=np.float64)
    sizes = [*table["extent_mm"], table["thickness_mm"]]
    for name, claimed, truth in (
        ("centre_m", box.centre_m, 1e-3 * np.array(table["centre_mm"])),
        ("half_m", box.half_m, 0.5e-3 * np.array(sizes)),
        ("axes.2", box.axes[2], normal / np.linalg.norm(normal)),
    ):
        whose = "that of rig.workspace"
        findings.array(f"{key}.{name}", claimed, truth, _ROUNDING, whose)
    if table.get("along") is not None:
        off = float(np.dot(box.axes[1], table["along"]))
        findings.holds(
            abs(off) <= _ROUNDING * float(np.linalg.norm(table["along"]))
            and np.dot(box.axes[0], table["along"]) > 0.0,
            f"{key}.axes.0",
            f"{list(box.axes[0])} doesn't run along rig.workspace's {table['along']}",
        )


def turned(angles: _Array) -> _Array:
    """Rz Ry Rx: turns about the fixed x, y and z axes, one after the other."""
    turn = np.eye(3)
    for axis, angle in enumerate(angles):
        one, two = (axis + 1) % 3, (axis + 2) % 3
        step = np.eye(3)
        step[one, one] = step[two, two] = np.cos(angle)
        step[one, two], step[two, one] = -np.sin(angle), np.sin(angle)
        turn = step @ turn
    return turn


def _audit_corners(key: str, box: Box, stated: Block, findings: AuditFindings) -> None:
    """Compare the corners of a zone with those that are stated."""
    claimed = block_of_zone(box, np.zeros(3))
    off = float(np.abs(claimed.corners - stated.corners).max())
    findings.holds(
        off <= _ROUNDING,
        key,
        f"{box.name!r} differs from rig.workspace's by {1e3 * off:.3g} mm at a corner",
    )
