"""Claims about the zones that devices keep to: whose they are, and who breaks them."""

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from geometry.arrays import Array
from planning.model.devices.bodies import Box
from planning.model.plan import RigPlan
from planning.model.requirements import Workspace
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.predicates.occlusion import Block, block_of_zone

_KEY = "requirements.workspace"
_ROUNDING = 1e-9
# Axes are written to as many.
_LAST_DIGITS = 1e-14


def zone_excess(offsets: Array, space: Workspace) -> list[Array]:
    """Return how far positions break each kind of zone, each (n,) [m]; <= 0 if kept.

    Outside the box or the nearest mounting plane by the farthest face that they lie
    beyond; inside a keep-out volume by the nearest face. Offsets (n, 3) are positions
    less the centre of the workspace.
    """
    excess = [depth_inside(zone, offsets) for zone in space.keep_out]
    if space.box is not None:
        excess.append(-depth_inside(space.box, offsets))
    if space.mounting:
        beyond = [-depth_inside(plane, offsets) for plane in space.mounting]
        excess.append(np.min(beyond, axis=0))
    return excess


def depth_inside(box: Box, offsets: Array) -> Array:
    """Return the least distance to any of six planes, negative beyond one, (n,) [m]."""
    block = block_of_zone(box, np.zeros(3))
    return np.min(block.half - np.abs(block.local(offsets)), axis=1)


def audit_zones(case: AuditCase, findings: AuditFindings) -> None:
    """Check that the zones are boxes, and floor, radii and zones those of the rig."""
    space, findings = case.plan.requirements.workspace, findings.at(_KEY)
    tables: Mapping[str, Any] = case.plan.document.rig.workspace
    stated = tables.get("origin")
    findings.holds(
        space.origin == stated,
        "origin",
        f"{space.origin!r}, but rig.workspace states {stated!r}",
    )
    _audit_shell(case, findings)
    _audit_cone(tables, space, findings)
    off = np.array(space.centre) - origin_of(case.plan)
    rooms = [_as_volume(tables)] if "min_mm" in tables else []
    planes = partial(_audit_plane, up=np.array(space.up))
    for name, boxes, stated, same in (
        ("box", [] if space.box is None else [space.box], rooms, _audit_volume),
        ("keep_out", space.keep_out, tables.get("keep_out") or [], _audit_volume),
        ("mounting", space.mounting, tables.get("mounting") or [], planes),
    ):
        findings.holds(
            len(boxes) == len(stated),
            name,
            f"holds {len(boxes)}, but rig.workspace states {len(stated)}",
        )
        for place, box in enumerate(boxes):
            below = findings.at(name if name == "box" else f"{name}.{place}")
            _audit_box(box, below)
            if place < len(stated):
                same(box, off, stated[place], findings=below)


def _audit_shell(case: AuditCase, findings: AuditFindings) -> None:
    """Compare floor and radii with the rig's: s + R -+ p, tiled from s - p."""
    space, rig = case.plan.requirements.workspace, case.plan.document.rig
    floor = rig.workspace.get("floor_mm")
    off = np.array(space.centre) - origin_of(case.plan)
    stated = None if floor is None else 1e-3 * floor - float(off @ np.array(space.up))
    findings.holds(
        not rig.workspace
        or (
            (space.floor_m is None) == (stated is None)
            and abs((space.floor_m or 0.0) - (stated or 0.0)) <= _ROUNDING
        ),
        "floor_m",
        f"{space.floor_m!r} m, but rig.workspace states {stated!r} m",
    )
    standoff, play = rig.standoff_m, rig.standoff_play_m
    if standoff is None or play is None:
        return
    middle = standoff + space.object_radius_m
    # A head's devices stand beside its origin, to which the standoff counts, and about
    # a turntable's axis the object's centre turns as well.
    play += _lever_m(case.plan) + _off_axis_m(case.plan)
    for kind in case.kinds:
        radius, name = f"{kind.name}_radius_m", f"{kind.name}_standoff_m"
        tiled = getattr(space, name)
        truth = [(middle if tiled is None else standoff) - play, middle + play]
        findings.same(radius, kind.shell, truth, "by rig.standoff_m", _ROUNDING)
        findings.holds(
            tiled is None or abs(tiled - standoff) <= _ROUNDING,
            name,
            f"{tiled!r} m, but rig.standoff_m is {standoff:g} m",
        )


def _audit_cone(
    stated: Mapping[str, Any], space: Workspace, findings: AuditFindings
) -> None:
    """Compare the cone with the rig's, and the shape that the rig names with its keys.

    Without a cone all of the shell is open, about the direction up.
    """
    if not stated:
        return
    angle, along = stated.get("half_angle_deg"), stated.get("axis")
    half, whose = np.radians(angle or 180.0), "by rig.workspace"
    findings.same("half_angle", space.half_angle, half, whose, _ROUNDING)
    axis = np.array(space.up if along is None else along)
    findings.same("axis", space.axis, axis / np.linalg.norm(axis), whose, _ROUNDING)
    shape = "shell" if angle is None else "cone"
    findings.holds(
        stated.get("shape") == ("box" if "min_mm" in stated else shape)
        and (angle is None) == (along is None),
        "half_angle",
        f"rig.workspace has shape {stated.get('shape')!r}, half_angle_deg {angle!r} "
        f"and axis {along!r}, which don't go together",
    )


def _lever_m(plan: RigPlan) -> float:
    """How far from a head's origin a device of it is at most [m]; 0 without a head."""
    head, planned = plan.document.rig.head, plan.document.stations
    if head is None or planned is None:
        return 0.0
    places = [np.array(device.head_from_device)[:3, 3] for device in head.devices]
    return float(max(np.sqrt(place @ place) for place in places))


def _off_axis_m(plan: RigPlan) -> float:
    """How far the object's centre is from a turntable's axis [m]; 0 without one."""
    stations = plan.document.stations
    if stations is None or stations.axis is None or stations.point_m is None:
        return 0.0
    off = np.array(plan.requirements.workspace.centre) - np.array(stations.point_m)
    return float(np.linalg.norm(np.cross(off, np.array(stations.axis))))


def origin_of(plan: RigPlan) -> Array:
    """Return where places of the rig file count from, in the world, (3,) [m]."""
    if plan.document.rig.workspace.get("origin") == "mesh":
        return np.zeros(3)
    return np.array(plan.requirements.workspace.centre)


def _audit_box(box: Box, findings: AuditFindings) -> None:
    turn = np.array(box.axes)
    error = float(np.abs(turn @ turn.T - np.eye(3)).max())
    findings.holds(
        error <= _ROUNDING and np.linalg.det(turn) > 0.0,
        "axes",
        f"are no rotation: A A^T differs from the identity by {error:.2g}",
    )
    findings.holds(
        min(box.half_m) > 0.0,
        "half_m",
        f"{list(box.half_m)} m must be positive",
    )


def _as_volume(table: Mapping[str, Any]) -> dict[str, Any]:
    low, high = np.array(table["min_mm"]), np.array(table["max_mm"])
    centre, turn = 0.5 * (low + high), np.zeros(3)
    return {"centre_mm": centre, "size_mm": high - low, "turn_deg": turn}


def _audit_volume(
    box: Box, off: Array, table: Mapping[str, Any], findings: AuditFindings
) -> None:
    turn = turned(np.radians(table["turn_deg"]))
    centre, size = (1e-3 * np.array(table[name]) for name in ("centre_mm", "size_mm"))
    stated = Block(box.name, turn, centre, 0.5 * size)
    claimed = block_of_zone(box, off)
    error = float(np.abs(claimed.corners - stated.corners).max())
    findings.holds(
        error <= _ROUNDING,
        "",
        f"{box.name!r} differs from rig.workspace's by {1e3 * error:.3g} mm at a "
        f"corner",
    )


def _audit_plane(
    box: Box, off: Array, table: Mapping[str, Any], up: Array, findings: AuditFindings
) -> None:
    normal = np.array(table["normal"], dtype=np.float64)
    normal /= np.linalg.norm(normal)
    sizes = [*table["extent_mm"], table["thickness_mm"]]
    for name, claimed, truth in (
        ("centre_m", off + box.centre_m, 1e-3 * np.array(table["centre_mm"])),
        ("half_m", box.half_m, 0.5e-3 * np.array(sizes)),
        ("axes.2", box.axes[2], normal),
    ):
        findings.same(name, claimed, truth, "that of rig.workspace", _ROUNDING)
    along = table.get("along")
    along = _level(normal, up) if along is None else np.array(along)
    aside, ahead = abs(np.dot(box.axes[1], along)), np.dot(box.axes[0], along)
    findings.holds(
        aside <= _ROUNDING * np.linalg.norm(along) + _LAST_DIGITS and ahead > 0.0,
        "axes.0",
        f"{list(box.axes[0])} doesn't run along rig.workspace's {along.tolist()}",
    )


def _level(normal: Array, up: Array) -> Array:
    """Where a plane runs that doesn't say: up x n, level, by its components.

    On a level plane along x, or y if up is x.
    """
    (a, b, c), (x, y, z) = up, normal
    level = np.array([b * z - c * y, c * x - a * z, a * y - b * x])
    if np.linalg.norm(level) > _ROUNDING:
        return level
    return np.eye(3)[1 if abs(a) > 0.5 else 0]


def turned(angles: Array) -> Array:
    """Rz Ry Rx: turns about the fixed x, y and z axes, one after the other."""
    turn = np.eye(3)
    for axis, angle in enumerate(angles):
        one, two = (axis + 1) % 3, (axis + 2) % 3
        step = np.eye(3)
        step[one, one] = step[two, two] = np.cos(angle)
        step[one, two], step[two, one] = -np.sin(angle), np.sin(angle)
        turn = step @ turn
    return turn
