"""Which positions the workspace admits: points, cells of positions, bodies, parts.

Positions are offsets x = Q - centre from the workspace's centre. The depth of x in a
box is its distance from the nearest face, negative outside::

    l = |A (x - c)| - h,   depth = -max(l) inside,   -|max(l, 0)| outside

It changes by no more than x does, so what holds of the middle of a ball with its
radius to spare holds of the whole ball.
"""

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import lengths
from geometry.directions.cube_map import angle_between
from geometry.shapes.boxes import OrientedBox, boxes_overlap
from planning.model.devices.bodies import Box
from planning.model.requirements import Workspace

_Array = NDArray[np.float64]
_ROUNDING = 1e-9


def is_zoned(workspace: Workspace) -> bool:
    """Return whether a box, keep-out volumes or mounting planes cut the shell."""
    return bool(workspace.box or workspace.keep_out or workspace.mounting)


def depth(box: Box, offsets: _Array) -> _Array:
    """Return how deep positions lie in a box, shape (n,) [m]; negative outside."""
    beyond = np.abs((offsets - np.array(box.centre_m)) @ np.array(box.axes).T)
    beyond = beyond - np.array(box.half_m)
    outside = lengths(np.maximum(beyond, 0.0))
    return np.where(outside > 0.0, -outside, -beyond.max(axis=1))


def stands(
    workspace: Workspace, offsets: _Array, reach: _Array | float = _ROUNDING
) -> NDArray[np.bool_]:
    """Return whether zones let devices stand at positions (n, 3), shape (n,).

    Of balls of radius `reach` [m]: whether no single zone forbids all of it.
    """
    allowed = np.ones(len(offsets), dtype=bool)
    if workspace.box is not None:
        allowed &= depth(workspace.box, offsets) >= -reach
    if workspace.mounting:
        near = [depth(plane, offsets) >= -reach for plane in workspace.mounting]
        allowed &= np.any(near, axis=0)
    for zone in workspace.keep_out:
        allowed &= depth(zone, offsets) <= reach
    return allowed


def admissible(
    workspace: Workspace,
    radius_m: tuple[float, float],
    offsets: _Array,
    *,
    slack: float = 0.0,
) -> NDArray[np.bool_]:
    """Return whether positions (n, 3) keep shell, cone, floor and zones, shape (n,).

    `slack` is of radii, as a share; of cosines; of heights in [m].
    """
    distance = lengths(offsets)
    low, high = radius_m[0] * (1.0 - slack), radius_m[1] * (1.0 + slack)
    inside = (distance >= low - _ROUNDING) & (distance <= high + _ROUNDING)
    # Every direction is within pi, whatever the rounding of its cosine.
    if workspace.half_angle < np.pi:
        along = offsets @ np.array(workspace.axis)
        inside &= along >= distance * (np.cos(workspace.half_angle) - slack)
    if workspace.floor_m is not None:
        inside &= offsets @ np.array(workspace.up) >= workspace.floor_m - slack
    inside[inside] = stands(workspace, offsets[inside])
    return inside


def may_be_admissible(
    workspace: Workspace, outwards: _Array, angle: _Array, low_m: _Array, high_m: _Array
) -> NDArray[np.bool_]:
    """Return which cells of the shell may hold a position that all limits allow.

    The arguments are those of `may_stand`; any radius is of the shell.
    """
    axis, up = np.array(workspace.axis), np.array(workspace.up)
    least = np.maximum(0.0, angle_between(outwards, axis) - angle)
    possible = least <= workspace.half_angle + _ROUNDING
    possible &= may_stand(workspace, outwards, angle, low_m, high_m)
    if workspace.floor_m is not None:
        rise = np.cos(np.maximum(0.0, angle_between(outwards, up) - angle))
        highest = rise * np.where(rise > 0, high_m, low_m)
        possible &= highest >= workspace.floor_m - _ROUNDING
    return possible


def broken_by_body(workspace: Workspace, box: OrientedBox) -> tuple[str, ...]:
    """Return what a body in the world reaches into or through."""
    centre = np.array(workspace.centre)
    broken: list[str] = []
    if workspace.floor_m is not None:
        heights = (box.corners - centre) @ np.array(workspace.up)
        broken += [] if np.all(heights >= workspace.floor_m) else ["the floor"]
    if workspace.box is not None:
        inside = np.abs(_in_world(workspace.box, centre).local(box.corners))
        kept = np.all(inside <= np.array(workspace.box.half_m))
        broken += [] if kept else ["the walls of the room"]
    for zone in workspace.keep_out:
        if boxes_overlap(_in_world(zone, centre), box):
            broken.append(f"the keep-out volume {zone.name!r}")
    return tuple(broken)


def _in_world(zone: Box, centre: _Array) -> OrientedBox:
    return OrientedBox(
        centre + np.array(zone.centre_m), np.array(zone.axes), np.array(zone.half_m)
    )


def may_stand(
    workspace: Workspace,
    outwards: _Array,
    angle: _Array | float,
    low_m: _Array | float,
    high_m: _Array | float,
) -> NDArray[np.bool_]:
    """Return which cells of the shell may hold a position that zones allow.

    A cell has the directions within `angle` [rad] of the unit `outwards`, shape (n, 3),
    and the radii from `low_m` to `high_m` [m]; (n,) or one number each. All of it lies
    in a ball about its middle, of radius ``(high - low) / 2 + 2 high sin(angle / 2)``.
    """
    middles = np.asarray(0.5 * (low_m + high_m))[..., None] * outwards
    half_turn = np.minimum(0.5 * np.asarray(angle), 0.5 * np.pi)
    reach = 0.5 * (high_m - low_m) + 2.0 * high_m * np.sin(half_turn) + _ROUNDING
    return stands(workspace, middles, reach)


def half_spaces(workspace: Workspace, offset: _Array) -> tuple[_Array, _Array]:
    """Return a convex part of what zones allow, about an admissible position.

    x is in it iff ``normals @ x >= offsets``: the box of the workspace, the mounting
    plane that holds the position, and for each keep-out volume the far side of the face
    that the position, shape (3,), is farthest beyond. Unit normals, (k, 3), and offsets
    in [m], (k,).
    """
    held = [] if workspace.box is None else [workspace.box]
    if workspace.mounting:
        depths = [depth(plane, offset[None])[0] for plane in workspace.mounting]
        held.append(workspace.mounting[int(np.argmax(depths))])
    normals: list[_Array] = [np.empty((0, 3))]
    offsets: list[_Array] = [np.empty(0)]
    for box in held:
        sides = np.concatenate([np.array(box.axes), -np.array(box.axes)])
        normals.append(sides)
        offsets.append(sides @ np.array(box.centre_m) - np.tile(box.half_m, 2))
    for zone in workspace.keep_out:
        local = np.array(zone.axes) @ (offset - np.array(zone.centre_m))
        face = int(np.argmax(np.abs(local) - np.array(zone.half_m)))
        away = np.copysign(1.0, local[face]) * np.array(zone.axes[face])
        normals.append(away[None])
        offsets.append(np.array([away @ np.array(zone.centre_m) + zone.half_m[face]]))
    return np.concatenate(normals), np.concatenate(offsets)
