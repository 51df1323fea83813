"""How cameras move: the points that they look at stay, and their rolls."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.poses import look_at
from planning.model.devices.device_poses import moved_to, poses_of
from planning.model.devices.planned import PlannedCamera
from planning.model.requirements import Workspace
from planning.scene.workspace.admissible import admissible
from planning.scene.workspace.mount_settings import settable

_Array = NDArray[np.float64]

# Programs end on a limit to their own rounding.
_SLACK = 1e-7


@dataclass(frozen=True, eq=False)
class Looks:
    """Points that cameras look at [m], ups, (k, 3) each, and rolls (k,)."""

    aims: _Array
    ups: _Array
    rolls: _Array


def at_poses(cameras: Sequence[PlannedCamera], poses: _Array) -> list[PlannedCamera]:
    """Return the cameras at other poses, shape (k, 4, 4)."""
    return [moved_to(camera, pose) for camera, pose in zip(cameras, poses, strict=True)]


def looks_of(
    cameras: Sequence[PlannedCamera],
    measured: NDArray[np.bool_],
    points: _Array,
    workspace: Workspace,
    up: _Array | None = None,
) -> Looks:
    """Return where cameras look: to the mean depth of what each measures.

    Rolls are against `up`, shape (3,); without against their own up, and hence none.
    """
    poses = poses_of(cameras)
    aims = np.empty((len(poses), 3))
    for c, pose in enumerate(poses):
        mine = measured[:, c]
        looked = points[mine].mean(axis=0) if mine.any() else np.array(workspace.centre)
        depth = (looked - pose[:3, 3]) @ pose[:3, 2]
        aims[c] = pose[:3, 3] + depth * pose[:3, 2]
    if up is None:
        return Looks(aims, -poses[:, :3, 1], np.zeros(len(poses)))
    level = look_at(poses[:, :3, 3], aims, up)
    x = poses[:, :3, 0]
    along, aside = (np.einsum("ij,ij->i", x, level[:, :3, k]) for k in (0, 1))
    return Looks(aims, np.tile(up, (len(poses), 1)), np.arctan2(aside, along))


def between(
    cameras: Sequence[PlannedCamera],
    now: Looks,
    centres: _Array,
    then: Looks,
    share: float | _Array,
    workspace: Workspace,
) -> _Array | None:
    """Return poses (k, 4, 4) part of the way to centres (k, 3) [m] and other looks.

    Existing cameras stay; mounts take the next settings that they have. None where a
    camera can't stand so.
    """
    start = poses_of(cameras)
    shares = np.broadcast_to(share, len(start))
    places = centres_between(start[:, :3, 3], centres, shares, workspace)
    targets = now.aims + shares[:, None] * (then.aims - now.aims)
    rolls = now.rolls + shares * (then.rolls - now.rolls)
    for c, camera in enumerate(cameras):
        if camera.existing:
            continue
        pose = look_at(places[c], targets[c], now.ups[c], roll=float(rolls[c]))
        settings = settable(workspace, camera, pose[None])
        if not len(settings):
            return None
        start[c] = settings[0]
    free = [not camera.existing for camera in cameras]
    offsets = start[free, :3, 3] - np.array(workspace.centre)
    radius = workspace.camera_radius_m
    return start if admissible(workspace, radius, offsets, slack=_SLACK).all() else None


def centres_between(
    start: _Array, end: _Array, share: _Array, workspace: Workspace
) -> _Array:
    """Return centres part of the way, on arcs about the centre or straight on a plane.

    Centres are (k, 3) in [m]; `share` of the way is in [0, 1] for each, (k,).
    """
    if workspace.mounting:
        # An arc would leave the plane.
        return start + share[:, None] * (end - start)
    middle = np.array(workspace.centre)
    start, end = start - middle, end - middle
    r0, r1 = np.linalg.norm(start, axis=1), np.linalg.norm(end, axis=1)
    start, end = start / r0[:, None], end / r1[:, None]
    angle = np.arccos(np.clip(np.einsum("ij,ij->i", start, end), -1.0, 1.0))
    sine = np.maximum(np.sin(angle), 1e-12)
    near = angle < 1e-9
    a = np.where(near, 1.0 - share, np.sin((1.0 - share) * angle) / sine)
    b = np.where(near, share, np.sin(share * angle) / sine)
    mixed = a[:, None] * start + b[:, None] * end
    mixed = mixed / np.linalg.norm(mixed, axis=1, keepdims=True)
    return middle + (r0 + share * (r1 - r0))[:, None] * mixed
