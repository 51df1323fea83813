"""One camera fewer: which may go, and how the others close the hole it leaves."""

import numpy as np

from planning.cameras.baselines.limit_poses import limit_poses

from .route_problem import Cameras, CameraSet, RouteProblem

# Turns about the centre by which cameras close a hole [rad].
_TURNS = np.radians([3.0, 8.0, 18.0])
_AZIMUTHS = 6
_SWEEPS = 3
# Share of a seam that may be past the limit where a camera moves to it.
_SHARES_PAST = (0.1,)
_BISECTIONS = 8
# A hole wider than this share of what is required isn't closed by turns like these.
_CLOSABLE = 0.2


def one_fewer(
    problem: RouteProblem, placed: CameraSet, most: int = 3
) -> CameraSet | None:
    """Return the best of one camera fewer, the hole closed; None where none may go."""
    best: CameraSet | None = None
    for out in placed.least_missed(len(problem.fixed))[:most]:
        fewer = placed.without(out)
        if problem.required - fewer.count <= _CLOSABLE * problem.required:
            fewer = _closed(problem, fewer)
        if best is None or fewer.count > best.count:
            best = fewer
        if best.count >= problem.required:
            break
    return best


def _closed(problem: RouteProblem, placed: CameraSet) -> CameraSet:
    """Move cameras over the hole until enough is measured, or too little helps."""
    for sweep in range(_SWEEPS):
        short = problem.required - placed.count
        if short <= 0:
            break
        before = placed.count
        placed = swept(problem, placed, to_limit=sweep == 0)
        # Less than half of what is missing won't do in what is left of the sweeps.
        if 2 * (placed.count - before) < short:
            break
    return placed


def swept(
    problem: RouteProblem, placed: CameraSet, *, to_limit: bool = False
) -> CameraSet:
    """Move one camera after the other to where all together measure most."""
    for camera in range(len(problem.fixed), len(placed.cameras)):
        poses = _turned(problem, placed, camera)
        if to_limit:
            poses += tuple(
                limit_poses(
                    placed.cameras,
                    problem.surface,
                    placed.measured,
                    problem.limits,
                    only=camera,
                    shares_past=_SHARES_PAST,
                    bisections=_BISECTIONS,
                )
            )
        if poses:
            placed = _moved(problem, placed, camera, poses)
    return placed


def _moved(
    problem: RouteProblem, placed: CameraSet, camera: int, poses: Cameras
) -> CameraSet:
    """Return the set with a camera at the best of some poses, or as it was."""
    others = placed.without(camera).measured.any(axis=1)
    gain = problem.measure(poses)[~others].sum(axis=0)
    best = int(np.argmax(gain))
    if gain[best] <= placed.count - int(others.sum()):
        return placed
    cameras = list(placed.cameras)
    cameras[camera] = poses[best]
    moved = problem.placed(cameras)
    return moved if moved.count > placed.count else placed


def _turned(problem: RouteProblem, placed: CameraSet, camera: int) -> Cameras:
    """Poses around one, turned about the centre."""
    centre = np.array(problem.limits.workspace.centre)
    pose = placed.cameras[camera].world_from_device
    outwards = pose[:3, 3] - centre
    outwards = outwards / np.linalg.norm(outwards)
    # In a tiled placement a device's own x may lie along the line to the centre.
    x = pose[:3, 0] - (pose[:3, 0] @ outwards) * outwards
    x = x / np.linalg.norm(x)
    y = np.cross(outwards, x)
    azimuth = 2.0 * np.pi * np.arange(_AZIMUTHS) / _AZIMUTHS
    aside = np.cos(azimuth)[:, None] * x + np.sin(azimuth)[:, None] * y
    turned = [np.cos(t) * outwards + np.sin(t) * aside for t in _TURNS]
    return problem.stand(np.concatenate(turned))
