"""Poses at the limit (10): where the second camera of a pair just reaches the seam.

Camera 1 of two neighbours stays. Camera 2 moves on the great circle through both, about
the centre of the workspace, until phi = phi_max at the seam, which is d = d_max of eq.
(9) with D1 and D2 of the poses themselves. Past it the pair leaves a gap.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from geometry.poses import look_at
from planning.model.planned import PlannedCamera
from planning.scene.workspace.zone_positions import admissible

from .baseline_rows import check_seam
from .camera_spread import aims_of, rolls_of
from .seams import Adjacency, Seam, find_seam, neighbouring_pairs
from .spread_problem import SpreadLimits

_Array = NDArray[np.float64]

# Share of the seam that may be past the limit: on a rough surface the tightest samples
# are past it wherever the camera stands.
GIVEN_UP = (0.0, 0.1, 0.3)
BISECTIONS = 14
# Samples of a seam that are looked at, at most.
_SEAM = 64
# Nearer to camera 1, or to the other side of the object, than this isn't looked at.
_LEAST_TURN = np.radians(2.0)


@dataclass(frozen=True, eq=False)
class Parts:
    """Samples of the target, and which camera measures which.

    Attributes:
        points: In [m], shape (n, 3).
        normals: Unit face normals, shape (n, 3).
        adjacent: Near samples of each.
        measured_by: Which camera measures which, shape (n, k).
    """

    points: _Array
    normals: _Array
    adjacent: Adjacency
    measured_by: NDArray[np.bool_]


def limit_poses(
    cameras: Sequence[PlannedCamera],
    parts: Parts,
    limits: SpreadLimits,
    *,
    only: int | None = None,
    given_up: Sequence[float] = GIVEN_UP,
    bisections: int = BISECTIONS,
) -> list[PlannedCamera]:
    """Return cameras at d_max from a neighbour, in both orders of every pair.

    A camera keeps the point that it looks at, and its roll. Those that stand already
    stay; positions that aren't admissible are left out.

    Args:
        cameras: As they stand.
        parts: What they measure.
        limits: What binds.
        only: The camera to move; None: every one.
        given_up: Shares of the seam that may be past the limit, a pose for each.
        bisections: Halvings of the angle between the cameras.
    """
    weights = np.ones(len(parts.points))
    pairs = neighbouring_pairs(parts.measured_by, weights, parts.adjacent)
    poses = np.stack([camera.world_from_device for camera in cameras])
    aims = aims_of(poses, parts.measured_by, parts.points, limits.workspace)
    rolls = rolls_of(poses, aims, np.array(limits.workspace.up))
    found: list[PlannedCamera] = []
    for first, second in [order for pair in pairs for order in (pair, pair[::-1])]:
        if cameras[second].existing or only not in (None, second):
            continue
        seam = find_seam(first, second, parts.points, parts.measured_by, parts.adjacent)
        seam = _thinned(seam)
        if len(seam.points) and seam.shares_border:
            arc = _Arc.through(cameras, first, second, limits)
            moved = arc.camera(aims[second], float(rolls[second]))
            found += _at_limit(
                cameras, parts, seam, arc, moved, limits, given_up, bisections
            )
    return found


def _thinned(seam: Seam) -> Seam:
    step = max(1, -(-len(seam.points) // _SEAM))
    return replace(seam, points=seam.points[::step], beyond=seam.beyond[::step])


@dataclass(frozen=True, eq=False)
class _Arc:
    """The great circle through two cameras, from the first on."""

    camera2: PlannedCamera
    centre: _Array
    start: _Array
    across: _Array
    radius: float
    turn: float
    up: _Array

    @classmethod
    def through(
        cls,
        cameras: Sequence[PlannedCamera],
        first: int,
        second: int,
        limits: SpreadLimits,
    ) -> "_Arc":
        centre = np.array(limits.workspace.centre)
        one, two = (
            cameras[i].world_from_device[:3, 3] - centre for i in (first, second)
        )
        radius = float(np.linalg.norm(two))
        start, end = one / np.linalg.norm(one), two / radius
        across = end - (end @ start) * start
        sine = float(np.linalg.norm(across))
        across = across / sine if sine > 0.0 else across
        turn = float(np.arctan2(sine, end @ start))
        up = np.array(limits.workspace.up)
        return cls(cameras[second], centre, start, across, radius, turn, up)

    def camera(self, aim: _Array, roll: float) -> Callable[[float], PlannedCamera]:
        """Return camera 2 as a function of its angle from camera 1."""

        def at(turn: float) -> PlannedCamera:
            towards = np.cos(turn) * self.start + np.sin(turn) * self.across
            pose = look_at(self.centre + self.radius * towards, aim, self.up, roll=roll)
            return replace(self.camera2, world_from_device=pose)

        return at


def _at_limit(
    cameras: Sequence[PlannedCamera],
    parts: Parts,
    seam: Seam,
    arc: _Arc,
    moved: Callable[[float], PlannedCamera],
    limits: SpreadLimits,
    given_up: Sequence[float],
    bisections: int,
) -> list[PlannedCamera]:
    """Camera 2 where it reaches all of the seam just so, and where most of it."""
    pair = list(cameras)

    def slack(turn: float) -> _Array:
        pair[seam.cameras[1]] = moved(turn)
        test = check_seam(pair, parts.points, parts.normals, seam, limits.max_incidence)
        return np.sort(test.slack)

    found: list[PlannedCamera] = []
    for share in given_up:
        rank = int(share * (len(seam.points) - 1))
        turn = _last_turn(lambda at, k=rank: float(slack(at)[k]), arc.turn, bisections)
        if turn is None:
            continue
        camera = moved(turn)
        offset = camera.world_from_device[:3, 3] - arc.centre
        space = limits.workspace
        if admissible(space, space.camera_radius_m, offset[None])[0]:
            found.append(camera)
    return found


def _last_turn(
    slack: Callable[[float], float], now: float, bisections: int
) -> float | None:
    """Return the turn next to the present one at which the slack is used up."""
    if not _LEAST_TURN < now < np.pi - _LEAST_TURN:
        return None
    low, high = (now, np.pi - _LEAST_TURN) if slack(now) >= 0.0 else (_LEAST_TURN, now)
    if not (slack(low) >= 0.0 > slack(high)):
        return None
    for _ in range(bisections):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if slack(middle) >= 0.0 else (low, middle)
    return low
