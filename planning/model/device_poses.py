"""Poses of devices: ring frames, projectors moved with theirs, and poses as written."""

from dataclasses import replace
from typing import TypeVar

import numpy as np

from geometry.arrays import Array
from geometry.devices import ParallelModel, PinholeModel
from geometry.poses import inverse

from .planned import PlannedCamera, PlannedProjector

_D = TypeVar("_D", PlannedProjector, PlannedCamera)

_POSITION_DECIMALS = 5
DECIMALS = 12


def rounded_pose(pose: Array) -> Array:
    """Return a pose as it will be written: positions to 0.01 mm."""
    result = np.round(pose, DECIMALS)
    result[:3, 3] = np.round(pose[:3, 3], _POSITION_DECIMALS)
    return result + 0.0


def ring_frame(
    world_from_device: Array,
    device: PinholeModel | ParallelModel,
    tilt: float,
    azimuth: float,
) -> Array:
    """Return ``world_from_ring``.

    Args:
        world_from_device: Pose of the projector, shape (4, 4).
        device: Its optics; a pinhole's rings are turned against the ray of its image
            centre, so that lens shift doesn't move them off the object.
        tilt: Angle of the ring axis against that ray in [rad] (diverging), or shift of
            the axis in the device plane in [m] (parallel).
        azimuth: Direction of the tilt, from the device's +x towards +y in [rad].
    """
    c, s = np.cos(azimuth), np.sin(azimuth)
    if isinstance(device, ParallelModel):
        return world_from_device @ shifted_frame(np.array([tilt * c, tilt * s]))
    middle = device.middle_ray
    aside = np.array([c, s, 0.0])
    aside -= middle * (aside @ middle)
    aside /= np.linalg.norm(aside)
    return world_from_device @ frame_along(np.cos(tilt) * middle + np.sin(tilt) * aside)


def shifted_frame(shift: Array) -> Array:
    """Return a frame moved in its x-y plane by a shift, shape (2,) [m]."""
    frame = np.eye(4)
    frame[:2, 3] = shift
    return frame


def frame_along(z: Array) -> Array:
    """Return a frame whose z is a unit vector and whose x lies across +y."""
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    frame = np.eye(4)
    frame[:3, :3] = np.column_stack([x, np.cross(z, x), z])
    return frame


def moved_to(device: _D, world_from_device: Array) -> _D:
    """Return a device at another pose; the ring frame of a projector moves along."""
    moved = replace(device, world_from_device=world_from_device)
    if isinstance(moved, PlannedCamera):
        return moved
    device_from_ring = inverse(device.world_from_device) @ moved.world_from_ring
    return replace(moved, world_from_ring=world_from_device @ device_from_ring)
