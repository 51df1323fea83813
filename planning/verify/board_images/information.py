"""What images of a board tell about the errors of all devices together.

By errors of devices marks shift in their images by G, by errors of the board's pose,
which nobody knows, by B. In units of the deviation of a mark an image tells::

    I = sum G^T G - (sum G^T B) (sum B^T B)^-1 (sum B^T G)
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array, Mask
from geometry.devices import ParallelModel
from planning.model.devices.planned import PlannedCamera
from planning.model.requirements import Requirements

from .device_errors import N_ERRORS, Device, crosses, shifts_of

# Fewer marks aren't recognised as the board's.
_LEAST_MARKS = 6
# Of what marks tell most about the board's pose: what they tell less of is open.
_OPEN = 1e-12


@dataclass(frozen=True, eq=False)
class BoardImage:
    """One pose of the board: what devices see or light of it.

    Attributes:
        world_from_board: Shape (4, 4) [m].
        marks: How many marks each device has, (d,); a projector lights what a camera
            sees.
        told: Information on the errors of all devices, (10 d, 10 d).
    """

    world_from_board: Array
    marks: Array
    told: Array


def board_image(
    devices: Sequence[Device],
    limits: Requirements,
    pose: Array,
    marks: Array,
    mark_px: float,
) -> BoardImage:
    """Return what a board held at a pose tells; marks (n, 3) are in its frame."""
    points = marks @ pose[:3, :3].T + pose[:3, 3]
    seen = np.array([_faces(device, limits, points, pose[:3, 2]) for device in devices])
    camera = np.array([isinstance(device, PlannedCamera) for device in devices])
    seen &= (seen.sum(axis=1) >= _LEAST_MARKS)[:, None]
    seen[~camera] &= seen[camera].any(axis=0)
    seen &= (seen.sum(axis=1) >= _LEAST_MARKS)[:, None]
    size = N_ERRORS * len(devices)
    of_devices, both = np.zeros((size, size)), np.zeros((size, 6))
    of_board = np.zeros((6, 6))
    for k, device in enumerate(devices):
        here = points[seen[k]]
        if not len(here):
            continue
        shifts = shifts_of(device, here)
        turned = -crosses(here - pose[:3, 3])
        moved = np.concatenate([turned, np.broadcast_to(np.eye(3), turned.shape)], 2)
        g = shifts.pixels.reshape(-1, N_ERRORS) / mark_px
        b = (shifts.inverses @ moved).reshape(-1, 6) / mark_px
        rows = slice(N_ERRORS * k, N_ERRORS * (k + 1))
        of_devices[rows, rows], both[rows] = g.T @ g, g.T @ b
        of_board += b.T @ b
    told = of_devices
    if seen.any():
        # Marks in a line leave the board's turn about it open, and tell nothing by it.
        told = told - both @ np.linalg.pinv(of_board, _OPEN, hermitian=True) @ both.T
    return BoardImage(pose, seen.sum(axis=1), 0.5 * (told + told.T))


def _faces(device: Device, limits: Requirements, points: Array, normal: Array) -> Mask:
    """Return which points of a board lie in a device's field, sharp and facing it."""
    pose, optics = device.world_from_device, device.device
    offsets = points - pose[:3, 3]
    kind = limits.camera if isinstance(device, PlannedCamera) else limits.projector
    if isinstance(optics, ParallelModel):
        along = np.broadcast_to(pose[:3, 2], offsets.shape)
        reach = offsets @ pose[:3, 2]
    else:
        reach = np.linalg.norm(offsets, axis=1)
        along = offsets / reach[:, None]
    near, far = optics.range_m
    facing = -(along @ normal) >= np.cos(kind.max_incidence)
    return (
        facing
        & (reach >= near)
        & (reach <= far)
        & optics.in_field(offsets @ pose[:3, :3])
    )
