"""Where the paper's route begins: the most promising rings, grown and thinned."""

import numpy as np
from numpy.typing import NDArray

from .camera_rings import camera_rings
from .route_problem import CameraSet, RouteProblem

_Array = NDArray[np.float64]

# Rings that are grown where they must, of either rank.
_RINGS = 2
# Directions looked at for a camera that is added over a hole; poses tried.
_OVER_HOLE = 12
_TRIED = 4
_MOST = 64


def starts(problem: RouteProblem) -> list[CameraSet]:
    """Return the rings that promise most, grown and thinned."""
    return [
        _thinned(problem, grown(problem, _compatible(problem, ring)))
        for ring in _promising(problem)
    ]


def _promising(problem: RouteProblem) -> list[CameraSet]:
    """The most promising rings; at least the existing cameras, where there is none."""
    thinned = [_thinned(problem, ring) for ring in _measured_rings(problem)]
    best: dict[int, None] = {}
    for order in (rank, rank_without_one):
        ranks = [order(problem, ring) for ring in thinned]
        best |= dict.fromkeys(sorted(range(len(ranks)), key=ranks.__getitem__)[:_RINGS])
    return [thinned[i] for i in best]


def _measured_rings(problem: RouteProblem) -> list[CameraSet]:
    """The existing cameras, alone and with each ring; all are measured in one go."""
    rings = [
        problem.stand(directions)
        for directions in camera_rings(
            problem.surface.points,
            problem.limits.workspace,
            problem.device,
            problem.ring_radius,
            problem.limits.max_incidence,
        )
    ]
    fixed = problem.measure(problem.fixed)
    measured = problem.measure([camera for ring in rings for camera in ring])
    sets, end = [CameraSet(problem.fixed, fixed)], 0
    for ring in rings:
        first, end = end, end + len(ring)
        both = np.concatenate([fixed, measured[:, first:end]], axis=1)
        sets.append(CameraSet((*problem.fixed, *ring), both))
    return sets


def rank(problem: RouteProblem, placed: CameraSet) -> tuple[int, int, int]:
    """Least for what meets the requirement with fewest, then for most measured."""
    short = max(problem.required - placed.count, 0)
    return short, len(placed.cameras), -placed.count


def rank_without_one(problem: RouteProblem, placed: CameraSet) -> tuple[int, int, int]:
    """The same, but last for what most is measured of with one camera fewer."""
    short, count, measured = rank(problem, placed)
    free = placed.least_missed(len(problem.fixed))
    return short, count, -placed.without(free[0]).count if free else measured


def _compatible(problem: RouteProblem, placed: CameraSet) -> CameraSet:
    """Those whose bodies are compatible, the one that measures most placed first."""
    n_fixed = len(problem.fixed)
    together = problem.together(placed.cameras)
    if np.array_equal(together, placed.measured):
        return placed
    kept = problem.placed(problem.fixed)
    order = np.argsort(-placed.measured[:, n_fixed:].sum(axis=0), kind="stable")
    for i in order:
        trial = problem.placed((*kept.cameras, placed.cameras[n_fixed + int(i)]))
        if trial.count > kept.count:
            kept = trial
    return kept


def grown(problem: RouteProblem, placed: CameraSet) -> CameraSet:
    """Return a set with cameras added until enough is measured, or none helps."""
    while placed.count < problem.required and len(placed.cameras) < _MOST:
        more = one_more(problem, placed)
        if more is None:
            break
        placed = more
    return placed


def one_more(problem: RouteProblem, placed: CameraSet) -> CameraSet | None:
    """Return the set with the camera that measures most of what isn't measured yet."""
    hole = np.flatnonzero(~placed.measured.any(axis=1))
    poses = problem.stand(_over(problem, hole)) if len(hole) else ()
    if not poses:
        return None
    gain = problem.measure(poses)[hole].sum(axis=0)
    for i in np.argsort(-gain, kind="stable")[:_TRIED]:
        more = problem.placed((*placed.cameras, poses[int(i)]))
        if gain[i] and more.count > placed.count:
            return more
    return None


def _over(problem: RouteProblem, hole: NDArray[np.int64]) -> _Array:
    """Directions from the centre of places square over samples that face apart."""
    chosen: list[int] = []
    normals = problem.surface.normals[hole]
    nearest = np.full(len(hole), -2.0)
    middle = normals.sum(axis=0)
    while len(chosen) < min(_OVER_HOLE, len(hole)):
        # First the one most like all, then always the one least like those taken.
        pick = int(np.argmin(nearest) if chosen else np.argmax(normals @ middle))
        chosen.append(pick)
        nearest = np.maximum(nearest, normals @ normals[pick])
    over = problem.surface.points[hole] + problem.ring_radius * normals
    places = over[chosen] - np.array(problem.limits.workspace.centre)
    return places / np.linalg.norm(places, axis=1, keepdims=True)


def _thinned(problem: RouteProblem, placed: CameraSet) -> CameraSet:
    """Drop cameras as long as the others measure enough."""
    enough = min(problem.required, placed.count)
    while len(placed.cameras) > len(problem.fixed):
        fewer = placed.without(placed.least_missed(len(problem.fixed))[0])
        if fewer.count < enough:
            break
        placed = fewer
    return placed
