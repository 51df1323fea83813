"""Where the paper's route begins: the most promising rings, grown and thinned."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .ring_seeds import Ring, ring_seeds
from .route_problem import CameraSet, RouteProblem

_Array = NDArray[np.float64]

# Rings that are grown where they must, of either rank.
_SEEDS = 2
# Directions looked at for a camera that is added, over what is left; poses tried.
_OVER_LEFT = 12
_TRIED = 4
_MOST = 64


def seeds(ground: RouteProblem) -> list[CameraSet]:
    """Rings that promise most, grown and thinned."""
    return [
        _thinned(ground, grown(ground, _bearing(ground, ring)))
        for ring in _rings(ground)
    ]


def _rings(ground: RouteProblem) -> list[CameraSet]:
    """The most promising rings; at least the given cameras, where there is none."""
    space = ground.limits.workspace
    rings = list(
        ring_seeds(
            ground.points,
            space,
            ground.device,
            ground.ring_radius,
            ground.limits.max_incidence,
        )
    )
    given = CameraSet(ground.given, ground.measure(ground.given))
    stands = [given, *_stood(ground, rings, given)]
    thinned = [_thinned(ground, stand) for stand in stands]
    best: dict[int, None] = {}
    for order in (rank, rank_by_spare):
        ranks = [order(ground, stand) for stand in thinned]
        best |= dict.fromkeys(sorted(range(len(ranks)), key=ranks.__getitem__)[:_SEEDS])
    return [thinned[i] for i in best]


def _stood(
    ground: RouteProblem, rings: Sequence[Ring], given: CameraSet
) -> list[CameraSet]:
    """Rings with what their cameras measure, all looked at in one go."""
    groups = [ground.stand(ring.directions) for ring in rings]
    every = [camera for group in groups for camera in group]
    if not every:
        return []
    measured = ground.measure(every)
    ends = np.cumsum([len(group) for group in groups])
    return [
        CameraSet(
            (*given.cameras, *group),
            np.concatenate(
                [given.measured, measured[:, end - len(group) : end]], axis=1
            ),
        )
        for group, end in zip(groups, ends, strict=True)
    ]


def rank(ground: RouteProblem, stand: CameraSet) -> tuple[int, int, int]:
    """Least for what meets the requirement with fewest, then for most measured."""
    short = max(ground.required - stand.rows, 0)
    return short, len(stand.cameras), -stand.rows


def rank_by_spare(ground: RouteProblem, stand: CameraSet) -> tuple[int, int, int]:
    """The same, but last for what most is measured of with one camera fewer."""
    short, count, rows = rank(ground, stand)
    free = stand.least_missed(len(ground.given))
    return short, count, -stand.without(free[0]).rows if free else rows


def _bearing(ground: RouteProblem, stand: CameraSet) -> CameraSet:
    """Those that bear each other's bodies, the one that measures most set first."""
    n_given = len(ground.given)
    together = ground.together(stand.cameras) if stand.cameras else stand.measured
    if np.array_equal(together, stand.measured):
        return stand
    kept = CameraSet(ground.given, ground.together(ground.given))
    order = np.argsort(-stand.measured[:, n_given:].sum(axis=0), kind="stable")
    for i in order:
        cameras = (*kept.cameras, stand.cameras[n_given + int(i)])
        trial = CameraSet(cameras, ground.together(cameras))
        if trial.rows > kept.rows:
            kept = trial
    return kept


def grown(ground: RouteProblem, stand: CameraSet) -> CameraSet:
    """Return a stand with cameras added until enough is measured, or none helps."""
    while stand.rows < ground.required and len(stand.cameras) < _MOST:
        more = one_more(ground, stand)
        if more is None:
            break
        stand = more
    return stand


def one_more(ground: RouteProblem, stand: CameraSet) -> CameraSet | None:
    """Return the stand with the camera that measures most of what is left."""
    left = np.flatnonzero(~stand.measured.any(axis=1))
    offered = ground.stand(_over(ground, left))
    if not len(left) or not offered:
        return None
    gain = ground.measure(offered)[left].sum(axis=0)
    for i in np.argsort(-gain, kind="stable")[:_TRIED]:
        cameras = (*stand.cameras, offered[int(i)])
        more = CameraSet(cameras, ground.together(cameras))
        if gain[i] and more.rows > stand.rows:
            return more
    return None


def _over(ground: RouteProblem, left: NDArray[np.int64]) -> _Array:
    """Directions from the centre of places square over samples that face apart."""
    chosen: list[int] = []
    normals = ground.normals[left]
    nearest = np.full(len(left), -2.0)
    middle = normals.sum(axis=0)
    while len(chosen) < min(_OVER_LEFT, len(left)):
        # First the one most like all, then always the one least like those taken.
        pick = int(np.argmin(nearest) if chosen else np.argmax(normals @ middle))
        chosen.append(pick)
        nearest = np.maximum(nearest, normals @ normals[pick])
    rows = left[chosen]
    centre = np.array(ground.limits.workspace.centre)
    places = ground.points[rows] + ground.ring_radius * ground.normals[rows] - centre
    return places / np.linalg.norm(places, axis=1, keepdims=True)


def _thinned(ground: RouteProblem, stand: CameraSet) -> CameraSet:
    """Drop cameras as long as the rest measures enough."""
    enough = min(ground.required, stand.rows)
    while len(stand.cameras) > len(ground.given):
        fewer = stand.without(stand.least_missed(len(ground.given))[0])
        if fewer.rows < enough:
            break
        stand = fewer
    return stand
