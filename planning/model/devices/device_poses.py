"""Poses of devices as written, and projectors moved with their ring frames."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from geometry.arrays import Array
from geometry.poses import inverse

from .planned import PlannedCamera, PlannedProjector

_D = TypeVar("_D", PlannedProjector, PlannedCamera)

_POSITION_DECIMALS = 5
DECIMALS = 12


def poses_of(devices: Sequence[PlannedProjector | PlannedCamera]) -> Array:
    """Return the poses of devices, shape (k, 4, 4)."""
    return np.stack([device.world_from_device for device in devices])


def rounded_pose(pose: Array) -> Array:
    """Return a pose as it will be written: positions to 0.01 mm."""
    result = np.round(pose, DECIMALS)
    result[:3, 3] = np.round(pose[:3, 3], _POSITION_DECIMALS)
    return result + 0.0


def moved_to(device: _D, world_from_device: Array) -> _D:
    """Return a device at another pose; the ring frame of a projector moves along.

    One that is the device's own stays so to the last bit: of a code it must be.
    """
    moved = replace(device, world_from_device=world_from_device)
    if isinstance(moved, PlannedCamera):
        return moved
    if np.array_equal(moved.world_from_ring, device.world_from_device):
        return replace(moved, world_from_ring=world_from_device)
    device_from_ring = inverse(device.world_from_device) @ moved.world_from_ring
    return replace(moved, world_from_ring=world_from_device @ device_from_ring)
