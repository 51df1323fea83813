"""Claims about the zones that devices keep to: whose they are, and who breaks them."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planning.model.plan import RigPlan
from planning.model.requirements import Workspace
from planning.model.zones import Box
from planning.verify.audit.ledger import Ledger, as_number, entries

_ROUNDING = 1e-9


def zone_excess(
    offsets: NDArray[np.float64], space: Workspace
) -> list[NDArray[np.float64]]:
    """Return how far positions break each kind of zone, each (n,) [m]; <= 0 if kept.

    Outside the box or the nearest mounting plane by the farthest face that they lie
    beyond; inside a keep-out volume by the nearest face.

    Args:
        offsets: Positions less the centre of the workspace, shape (n, 3).
        space: The workspace claimed.
    """
    found = [_room_inside(zone, offsets) for zone in space.keep_out]
    if space.box is not None:
        found.append(-_room_inside(space.box, offsets))
    if space.mounting:
        beyond = [-_room_inside(plane, offsets) for plane in space.mounting]
        found.append(np.min(beyond, axis=0))
    return found


def audit_zones(plan: RigPlan, ledger: Ledger) -> None:
    """Check that the zones are boxes, and those of the rig."""
    space = plan.requirements.workspace
    key = "requirements.workspace"
    rig = ledger.read("rig", "workspace")
    rig = rig if isinstance(rig, dict) else {}
    room = [] if space.box is None else [space.box]
    for name, boxes in (
        ("box", room),
        ("keep_out", space.keep_out),
        ("mounting", space.mounting),
    ):
        stated = [rig] if name == "box" and "min_mm" in rig else entries(rig.get(name))
        ledger.holds(
            len(boxes) == len(stated),
            f"{key}.{name}",
            f"holds {len(boxes)}, but rig.workspace states {len(stated)}",
        )
        for place, box in enumerate(boxes):
            _audit_box(f"{key}.{name}.{place}", box, ledger)
    _audit_stated(space, rig, ledger)
    _audit_shell(space, rig, ledger)


def _audit_shell(space: Workspace, rig: Mapping[str, Any], ledger: Ledger) -> None:
    """Compare floor and radii with the rig's: s + R -+ p, side by side from s - p."""
    key = "requirements.workspace"
    floor = as_number(rig.get("floor_mm"))
    stated = None if floor is None else floor * 1e-3
    ledger.holds(
        not rig
        or (
            (space.floor_m is None) == (stated is None)
            and abs((space.floor_m or 0.0) - (stated or 0.0)) <= _ROUNDING
        ),
        f"{key}.floor_m",
        f"{space.floor_m!r} m, but rig.workspace states {stated!r} m",
    )
    standoff, play = (
        as_number(ledger.read("rig", name))
        for name in ("standoff_m", "standoff_play_m")
    )
    if standoff is None or play is None:
        return
    middle = standoff + space.object_radius_m
    for kind, radius, own in (
        ("projector", space.projector_radius_m, space.projector_standoff_m),
        ("camera", space.camera_radius_m, space.camera_standoff_m),
    ):
        low = middle if own is None else standoff
        truth = np.array([low - play, middle + play])
        name = f"{key}.{kind}_radius_m"
        ledger.array(name, list(radius), truth, _ROUNDING, "by rig.standoff_m")
        ledger.holds(
            own is None or abs(own - standoff) <= _ROUNDING,
            f"{key}.{kind}_standoff_m",
            f"{own!r} m, but rig.standoff_m is {standoff:g} m",
        )


def _room_inside(box: Box, offsets: NDArray[np.float64]) -> NDArray[np.float64]:
    """Least distance to any of the six planes, negative beyond one, shape (n,)."""
    room = np.full(len(offsets), np.inf)
    for direction, half in zip(box.axes, box.half_m, strict=True):
        along = offsets @ np.array(direction) - np.dot(box.centre_m, direction)
        room = np.minimum(room, np.minimum(half - along, half + along))
    return room


def _audit_box(key: str, box: Box, ledger: Ledger) -> None:
    turn = np.array(box.axes)
    error = float(np.abs(turn @ turn.T - np.eye(3)).max())
    ledger.holds(
        error <= _ROUNDING and np.linalg.det(turn) > 0.0,
        f"{key}.axes",
        f"are no rotation: A A^T differs from the identity by {error:.2g}",
    )
    ledger.holds(
        all(half > 0.0 for half in box.half_m),
        f"{key}.half_m",
        f"{list(box.half_m)} m must be positive",
    )


def _audit_stated(space: Workspace, rig: Mapping[str, Any], ledger: Ledger) -> None:
    """Compare each zone with the millimetres and degrees of the rig."""
    key = "requirements.workspace"
    if space.box is not None and "min_mm" in rig:
        low, high = np.array(rig["min_mm"]) * 1e-3, np.array(rig["max_mm"]) * 1e-3
        stated = _corners(np.eye(3), 0.5 * (low + high), 0.5 * (high - low))
        _same(f"{key}.box", space.box, stated, ledger)
    for place, (box, table) in enumerate(
        zip(space.keep_out, entries(rig.get("keep_out")), strict=False)
    ):
        turn = _turned(np.radians(table["turn_deg"]))
        half = np.array(table["size_mm"]) * 0.5e-3
        stated = _corners(turn, np.array(table["centre_mm"]) * 1e-3, half)
        _same(f"{key}.keep_out.{place}", box, stated, ledger)
    for place, (box, table) in enumerate(
        zip(space.mounting, entries(rig.get("mounting")), strict=False)
    ):
        _audit_plane(f"{key}.mounting.{place}", box, table, ledger)


def _audit_plane(key: str, box: Box, table: Mapping[str, Any], ledger: Ledger) -> None:
    normal = np.array(table["normal"], dtype=np.float64)
    sizes = [*table["extent_mm"], table["thickness_mm"]]
    for name, claimed, truth in (
        ("centre_m", box.centre_m, np.array(table["centre_mm"]) * 1e-3),
        ("half_m", box.half_m, np.array(sizes) * 0.5e-3),
        ("axes.2", box.axes[2], normal / np.linalg.norm(normal)),
    ):
        whose = "that of rig.workspace"
        ledger.array(f"{key}.{name}", list(claimed), truth, _ROUNDING, whose)
    if table.get("along") is not None:
        off = float(np.dot(box.axes[1], table["along"]))
        ledger.holds(
            abs(off) <= _ROUNDING * float(np.linalg.norm(table["along"]))
            and np.dot(box.axes[0], table["along"]) > 0.0,
            f"{key}.axes.0",
            f"{list(box.axes[0])} doesn't run along rig.workspace's {table['along']}",
        )


def _turned(angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rz Ry Rx: turns about the fixed x, y and z axes, one after the other."""
    turn = np.eye(3)
    for axis, angle in enumerate(angles):
        one, two = (axis + 1) % 3, (axis + 2) % 3
        step = np.eye(3)
        step[one, one] = step[two, two] = np.cos(angle)
        step[one, two], step[two, one] = -np.sin(angle), np.sin(angle)
        turn = step @ turn
    return turn


def _corners(
    turn: NDArray[np.float64],
    centre: NDArray[np.float64],
    half: NDArray[np.float64],
) -> NDArray[np.float64]:
    """The eight corners, first axis slowest, shape (8, 3)."""
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1], indexing="ij"))
    return centre + (signs.reshape(3, -1).T * half) @ turn.T


def _same(key: str, box: Box, stated: NDArray[np.float64], ledger: Ledger) -> None:
    own = _corners(np.array(box.axes).T, np.array(box.centre_m), np.array(box.half_m))
    off = float(np.abs(own - stated).max())
    ledger.holds(
        off <= _ROUNDING,
        key,
        f"{box.name!r} differs from rig.workspace's by {1e3 * off:.3g} mm at a corner",
    )
