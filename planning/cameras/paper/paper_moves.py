"""One camera fewer: which may go, and how the rest closes the gap it leaves."""

import numpy as np

from planning.cameras.baselines.limit_poses import limit_poses

from .route_problem import Cameras, CameraSet, RouteProblem

# Turns about the centre by which cameras close a gap [rad].
_TURNS = np.radians([3.0, 8.0, 18.0])
_AZIMUTHS = 6
_SWEEPS = 3
# Share of a seam that may be past the limit where a camera moves to it.
_GIVEN_UP = (0.1,)
_BISECTIONS = 8
# A gap wider than this share of what is required isn't closed by turns like these.
_CLOSABLE = 0.2


def one_fewer(
    ground: RouteProblem, stand: CameraSet, most: int = 3
) -> CameraSet | None:
    """Return the best of one camera fewer, the gap closed; None where none may go."""
    best: CameraSet | None = None
    for out in stand.least_missed(len(ground.given))[:most]:
        rest = stand.without(out)
        if ground.required - rest.rows <= _CLOSABLE * ground.required:
            rest = _closed(ground, rest)
        if best is None or rest.rows > best.rows:
            best = rest
        if best.rows >= ground.required:
            break
    return best


def _closed(ground: RouteProblem, stand: CameraSet) -> CameraSet:
    """Move cameras over the gap until enough is measured, or too little helps."""
    for sweep in range(_SWEEPS):
        short = ground.required - stand.rows
        if short <= 0:
            break
        before = stand.rows
        stand = swept(ground, stand, to_limit=sweep == 0)
        # Less than half of what is missing won't do in what is left of the sweeps.
        if 2 * (stand.rows - before) < short:
            break
    return stand


def swept(
    ground: RouteProblem, stand: CameraSet, *, to_limit: bool = False
) -> CameraSet:
    """Move one camera after the other to where all together measure most."""
    for camera in range(len(ground.given), len(stand.cameras)):
        offered = _turned(ground, stand, camera)
        if to_limit:
            offered += _to_limit(ground, stand, camera)
        stand = _moved(ground, stand, camera, offered)
    return stand


def _moved(
    ground: RouteProblem, stand: CameraSet, camera: int, offered: Cameras
) -> CameraSet:
    """Return the stand with a camera at the best of its poses, or as it was."""
    if not offered:
        return stand
    others = stand.without(camera).measured.any(axis=1)
    gain = ground.measure(offered)[~others].sum(axis=0)
    best = int(np.argmax(gain))
    if gain[best] <= stand.rows - int(others.sum()):
        return stand
    cameras = list(stand.cameras)
    cameras[camera] = offered[best]
    moved = CameraSet(tuple(cameras), ground.together(cameras))
    return moved if moved.rows > stand.rows else stand


def _turned(ground: RouteProblem, stand: CameraSet, camera: int) -> Cameras:
    """Poses around one, turned about the centre."""
    centre = np.array(ground.limits.workspace.centre)
    pose = stand.cameras[camera].world_from_device
    outwards = pose[:3, 3] - centre
    outwards = outwards / np.linalg.norm(outwards)
    # Side by side a device's own x may lie along the line to the centre.
    x = pose[:3, 0] - (pose[:3, 0] @ outwards) * outwards
    x = x / np.linalg.norm(x)
    y = np.cross(outwards, x)
    azimuth = 2.0 * np.pi * np.arange(_AZIMUTHS) / _AZIMUTHS
    aside = np.cos(azimuth)[:, None] * x + np.sin(azimuth)[:, None] * y
    turned = [np.cos(t) * outwards + np.sin(t) * aside for t in _TURNS]
    return ground.stand(np.concatenate(turned))


def _to_limit(ground: RouteProblem, stand: CameraSet, camera: int) -> Cameras:
    """Poses of one at d_max from its neighbours."""
    parts = ground.parts(stand.measured)
    found = limit_poses(
        stand.cameras,
        parts,
        ground.limits,
        only=camera,
        given_up=_GIVEN_UP,
        bisections=_BISECTIONS,
    )
    return tuple(found)
