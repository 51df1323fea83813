"""Poses at the limit (10): where the second camera of a pair just reaches the seam.

Camera 1 of two neighbours stays. Camera 2 moves on the great circle through both, about
the centre of the workspace, until phi = phi_max at the seam, which is d = d_max of eq.
(9) with D1 and D2 of the poses themselves. Past it the pair leaves a gap.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from geometry.poses import look_at
from planning.model.device_poses import moved_to
from planning.model.planned import PlannedCamera
from planning.model.requirements import Workspace
from planning.scene.workspace.admissible import admissible
from planning.scene.workspace.mount_settings import settable

from .baseline_limits import BaselineLimits
from .baseline_rows import check_seam
from .camera_moves import aims_and_rolls
from .seams import SampledSurface, Seam, both_orders, find_seams, neighbouring_pairs

_Array = NDArray[np.float64]

# Share of the seam that may be past the limit: on a rough surface the tightest samples
# are past it wherever the camera stands.
SHARES_PAST = (0.0, 0.1, 0.3)
BISECTIONS = 14
# Samples of a seam that are looked at, at most.
_SEAM = 64
# Nearer to camera 1, or to the other side of the object, than this isn't looked at.
_LEAST_TURN = np.radians(2.0)


def limit_poses(
    cameras: Sequence[PlannedCamera],
    surface: SampledSurface,
    measured_by: NDArray[np.bool_],
    limits: BaselineLimits,
    *,
    only: int | None = None,
    shares_past: Sequence[float] = SHARES_PAST,
    bisections: int = BISECTIONS,
) -> list[PlannedCamera]:
    """Return cameras at d_max from a neighbour, in both orders of every pair.

    A camera keeps the point that it looks at, and its roll. Existing ones stay;
    positions that aren't admissible are left out.

    `only` is the camera to move, None: every one. Each pose leaves one of `shares_past`
    of the seam past the limit.
    """
    space = limits.workspace
    aims, rolls = aims_and_rolls(cameras, measured_by, surface.points, space)
    orders = [
        (first, second)
        for first, second in both_orders(neighbouring_pairs(measured_by, surface))
        if not cameras[second].existing and only in (None, second)
    ]
    limit: list[PlannedCamera] = []
    for seam in find_seams(orders, surface, measured_by):
        if not seam.shares_border:
            continue
        one, two = (cameras[i] for i in seam.cameras)
        aim, roll = aims[seam.cameras[1]], float(rolls[seam.cameras[1]])
        moved, now = _along_arc(one, two, aim, roll, space)
        slack = _slack_along(one, moved, surface, _thinned(seam), limits)
        for share in shares_past:
            turn = _last_turn(slack, share, now, bisections)
            if turn is not None and _may_stand(moved(turn), space):
                poses = settable(space, two, moved(turn).world_from_device[None])
                limit += [moved_to(two, pose) for pose in poses]
    return limit


def _thinned(seam: Seam) -> Seam:
    step = max(1, -(-len(seam.points) // _SEAM))
    return replace(seam, points=seam.points[::step], beyond=seam.beyond[::step])


def _may_stand(camera: PlannedCamera, space: Workspace) -> bool:
    offset = camera.world_from_device[:3, 3] - np.array(space.centre)
    return bool(admissible(space, space.camera_radius_m, offset[None])[0])


def _along_arc(
    one: PlannedCamera,
    two: PlannedCamera,
    aim: _Array,
    roll: float,
    space: Workspace,
) -> tuple[Callable[[float], PlannedCamera], float]:
    """Camera 2 by its angle from camera 1 about the centre; that angle now [rad]."""
    centre, up = np.array(space.centre), np.array(space.up)
    start, end = (c.world_from_device[:3, 3] - centre for c in (one, two))
    radius = float(np.linalg.norm(end))
    start, end = start / np.linalg.norm(start), end / radius
    across = end - (end @ start) * start
    sine = float(np.linalg.norm(across))
    across = across / sine if sine > 0.0 else across

    def at(turn: float) -> PlannedCamera:
        towards = np.cos(turn) * start + np.sin(turn) * across
        pose = look_at(centre + radius * towards, aim, up, roll=roll)
        return replace(two, world_from_device=pose)

    return at, float(np.arctan2(sine, end @ start))


def _slack_along(
    one: PlannedCamera,
    moved: Callable[[float], PlannedCamera],
    surface: SampledSurface,
    seam: Seam,
    limits: BaselineLimits,
) -> Callable[[float, float], float]:
    """Slack of (10) by camera 2's angle, with a share of the seam past the limit."""

    def slack(turn: float, share: float) -> float:
        test = check_seam((one, moved(turn)), surface, seam, limits.max_incidence)
        return float(np.sort(test.slack)[int(share * (len(seam.points) - 1))])

    return slack


def _last_turn(
    slack: Callable[[float, float], float], share: float, now: float, bisections: int
) -> float | None:
    """Return the turn next to the present one at which the slack is used up."""
    least, most = _LEAST_TURN, np.pi - _LEAST_TURN
    if not least < now < most:
        return None
    low, high = (now, most) if slack(now, share) >= 0.0 else (least, now)
    if not (slack(low, share) >= 0.0 > slack(high, share)):
        return None
    for _ in range(bisections):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if slack(middle, share) >= 0.0 else (low, middle)
    return low
