"""Where mounts are, and what they can be set to: the nearest poses that can be bolted.

A mount's place is on the grid, pan and tilt of the housing are whole steps, and its
roll is one of those allowed. Where the place or the roll changes, the device is aimed
anew at what it looked at, before pan and tilt are rounded.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from geometry.poses import horizontal_axes, pan_tilt_roll, turns_of
from planning.model.devices.bodies import Mount
from planning.model.requirements import Workspace
from planning.scene.placed_bodies import Device, kind_of

from .admissible import admissible

_Array = NDArray[np.float64]

_CORNERS = np.array(list(product((0.0, 1.0), repeat=3)))
# Sine of the angle between a thread and forward below which right takes its place.
_ALONG = 1e-6
_VERTICAL = 0.5 * np.pi + 1e-9
# Each leaves a tenth of the error of the one before, as offsets are short.
_ROUNDS = 8


def settable(workspace: Workspace, device: Device, poses: _Array) -> _Array:
    """Return the poses next to these, (n, 4, 4), that a device's mount can be set to.

    All of them, as they are, where the mount can be set to any; else without those of
    which no neighbour is in the workspace, and each once, (m, 4, 4).
    """
    mount = workspace.mount_of(kind_of(device))
    if mount is None or not mount.is_stepped or not len(poses):
        return poses
    radius = getattr(workspace, f"{kind_of(device)}_radius_m")
    centre, middle = np.array(workspace.centre), device.device.middle_ray
    away = np.linalg.norm(poses[:, :3, 3] - centre, axis=1)
    aims = poses[:, :3, 3] + away[:, None] * (poses[:, :3, :3] @ middle)
    found, kept = poses.copy(), np.zeros(len(poses), dtype=bool)
    for places in _places(mount, workspace, poses):
        at = np.flatnonzero(~kept)
        looks = _Looks(mount, np.array(workspace.up), middle, aims[at])
        tried, good = looks.from_places(places[at], poses[at, :3, :3])
        good &= admissible(workspace, radius, tried[:, :3, 3] - centre)
        found[at[good]], kept[at[good]] = tried[good], True
    found = found[kept]
    _, first = np.unique(np.round(found, 9), axis=0, return_index=True)
    return found[np.sort(first)]


def device_from_mount(mount: Mount) -> _Array | None:
    """Return the frame of a mount in device coordinates, (4, 4) [m], if it has one."""
    if mount.axis is None:
        return None
    z = np.array(mount.axis)
    forward = np.array([0.0, 0.0, 1.0]) - z[2] * z
    if np.linalg.norm(forward) < _ALONG:
        forward = np.array([1.0, 0.0, 0.0]) - z[0] * z
    x = forward / np.linalg.norm(forward)
    frame = np.eye(4)
    frame[:3, :3] = np.column_stack([x, np.cross(z, x), z])
    frame[:3, 3] = mount.place_m
    return frame


def _places(mount: Mount, workspace: Workspace, poses: _Array) -> list[_Array]:
    """Where mounts may be, nearest first: as they are, or corners of a grid cell."""
    places = poses[:, :3, 3] + poses[:, :3, :3] @ np.array(mount.place_m)
    if mount.grid_m is None:
        return [places]
    steps = (places - np.array(workspace.origin_m)) / mount.grid_m
    corners = np.floor(steps)[:, None] + _CORNERS
    order = np.argsort(np.linalg.norm(corners - steps[:, None], axis=2), axis=1)
    ordered = np.take_along_axis(corners, order[..., None], axis=1)
    return list(
        np.array(workspace.origin_m) + mount.grid_m * np.swapaxes(ordered, 0, 1)
    )


@dataclass(frozen=True, eq=False)
class _Looks:
    """Devices of one mount that look at aims (n, 3) [m] along their middle ray."""

    mount: Mount
    up: _Array
    middle: _Array
    aims: _Array

    def from_places(
        self, places: _Array, turns: _Array
    ) -> tuple[_Array, NDArray[np.bool_]]:
        """Return poses with mounts at places (n, 3) [m], and which can be set, (n,)."""
        mount, offset = self.mount, np.array(self.mount.place_m)
        angles = pan_tilt_roll(turns, self.up)
        if mount.rolls or mount.grid_m is not None:
            roll = _nearest(angles[:, 2], mount.rolls)
            # The optical centre moves about the mount as the device is turned.
            for _ in range(_ROUNDS):
                ways = self.aims - places + turns @ offset
                angles = self._aimed(ways, roll)
                turns = turns_of(angles, self.up)
            if not mount.rolls:
                # Tilted past the vertical is turned around.
                angles = pan_tilt_roll(turns, self.up)
        for axis, step in enumerate((mount.pan_step, mount.tilt_step)):
            if step is not None:
                angles[:, axis] = step * np.round(angles[:, axis] / step)
        poses = np.tile(np.eye(4), (len(places), 1, 1))
        poses[:, :3, :3] = turns_of(angles, self.up)
        poses[:, :3, 3] = places - poses[:, :3, :3] @ offset
        return poses, np.abs(angles[:, 1]) <= _VERTICAL

    def _aimed(self, ways: _Array, roll: _Array) -> _Array:
        """Pan, tilt and roll with which the middle of the image looks along ways.

        Of the middle ray a is level, to the right, b down and c forward; the rise of
        the way is ``c sin(tilt) - b cos(tilt)``.
        """
        first, second = horizontal_axes(self.up)
        ways = ways / np.linalg.norm(ways, axis=1, keepdims=True)
        x, y, c = self.middle
        a, b = x * np.cos(roll) - y * np.sin(roll), x * np.sin(roll) + y * np.cos(roll)
        rise = np.clip(ways @ self.up / np.hypot(b, c), -1.0, 1.0)
        tilt = np.arcsin(rise) + np.arctan2(b, c)
        forward = c * np.cos(tilt) + b * np.sin(tilt)
        heading = np.arctan2(ways @ second, ways @ first)
        return np.column_stack([heading - np.arctan2(-a, forward), tilt, roll])


def _nearest(roll: _Array, allowed: tuple[float, ...]) -> _Array:
    """The allowed roll next to each, or each itself where any is."""
    if not allowed:
        return roll
    off = np.remainder(roll[:, None] - allowed + np.pi, 2.0 * np.pi) - np.pi
    return np.array(allowed)[np.argmin(np.abs(off), axis=1)]
