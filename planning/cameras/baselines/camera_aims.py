"""Where cameras look and how they are rolled: what they keep as they move."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from geometry.poses import look_at
from planning.model.planned import PlannedCamera
from planning.model.requirements import Workspace

_Array = NDArray[np.float64]


def aims_of(
    poses: _Array,
    measured: NDArray[np.bool_],
    points: _Array,
    workspace: Workspace,
) -> _Array:
    """Return points on the axes at the mean depth of what each camera measures."""
    centre = np.array(workspace.centre)
    aims = np.empty((len(poses), 3))
    for c, pose in enumerate(poses):
        mine = measured[:, c]
        looked = points[mine].mean(axis=0) if mine.any() else centre
        depth = (looked - pose[:3, 3]) @ pose[:3, 2]
        aims[c] = pose[:3, 3] + depth * pose[:3, 2]
    return aims


def rolls_of(poses: _Array, aims: _Array, up: _Array) -> _Array:
    """Return the turn of each device about its axis against `look_at` without roll."""
    level = look_at(poses[:, :3, 3], aims, up)
    x = poses[:, :3, 0]
    return np.arctan2(
        np.einsum("ij,ij->i", x, level[:, :3, 1]),
        np.einsum("ij,ij->i", x, level[:, :3, 0]),
    )


def at_poses(cameras: Sequence[PlannedCamera], poses: _Array) -> list[PlannedCamera]:
    """Return the cameras at other poses, shape (k, 4, 4)."""
    return [
        replace(camera, world_from_device=pose)
        for camera, pose in zip(cameras, poses, strict=True)
    ]
