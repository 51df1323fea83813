"""Whether one projector fewer does, from poses between the candidates.

A lattice of poses may need one projector more than free poses do, by a handful of
samples. So where the best of one projector fewer fall short by little, poses close
around them are offered too, and of all the ones that together light most are taken,
again and again, from less and less far. Where that comes near, it begins anew from
other poses, at last from a finer lattice.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from planning.proofs.quotas import Quotas, RegionFloors
from planning.proofs.selection import cover_problem
from solvers import solve_max_coverage

from .candidate_set import CandidateSet, CandidateSource

# Poses in between have been seen to win a twentieth of what is required.
_SHORT = 0.05
# How far out they are offered, in spacings of the lattice.
_SCALES = (1.0, 1.0, 0.5, 0.5, 0.25, 0.25, 0.125)
# Gains of rounds shrink: what is short by more than so many isn't won any more,
_GAINS = 4
# unless it is short by less than this: then each scale is tried.
_NEAR = 0.015
# With floors of regions a search goes on until so much of all is lit beyond what is
# required, and a standard error beyond the floors: fresh samples should confirm it.
_SPARE, _AIMED = 0.01, 1.0
# Searches that start apart, each of which may end in a place of its own; and how many
# where one of them came so near.
_STARTS, _MOST_STARTS = 2, 4
# Poses kept from round to round.
_KEPT = 800
# Counted work of each choice, of which no proof is asked; the latter with floors.
_BUDGET, _FLOORED_BUDGET = 1e8, 3e8
_NONE = np.empty(0, dtype=np.int64)


def one_fewer(
    source: CandidateSource,
    lattice: CandidateSet,
    n_projectors: int,
    *,
    finer: Callable[[], CandidateSet],
    reached: NDArray[np.bool_],
    thorough: bool = True,
) -> CandidateSet | None:
    """Return poses that light what is required, with existing ones; None if none do.

    Args:
        source: Gives poses around others.
        lattice: Poses spread over the workspace. Poses around a larger cover don't
            belong to them: they lead astray.
        n_projectors: One fewer than are known to be enough; at least 1.
        finer: A lattice of more poses, existing ones first; asked for where it comes
            near.
        reached: Samples that any known pose lights: what is required is a share of
            these and of those that the poses returned light, shape (n,).
        thorough: Whether to begin in more places than one, and to follow near misses
            at every scale.
    """
    near, starts = (_NEAR, _STARTS) if thorough else (0.0, 1)
    n_lattice, nearest = len(lattice.projectors), np.inf
    for start in range(_MOST_STARTS):
        poses = _begin(lattice if start < _STARTS else finer(), start)
        best, short, found = _NONE, np.inf, None
        for attempt, scale in enumerate((*_SCALES, None)):
            seed = lattice.scene.seed + start * (len(_SCALES) + 1) + attempt
            best, missing, required, spared = _most_lit(
                poses, n_projectors, reached, best, seed
            )
            movable = best[best >= poses.n_existing]
            found = poses.take(movable) if missing <= 0 else None
            if found is not None and (spared or scale is None):
                return found
            gain, short = short - missing, missing
            nearest = min(nearest, missing / required)
            hopeful = missing <= max(0, min(_SHORT * required, _GAINS * gain))
            if scale is None or not (hopeful or missing <= near * required):
                break
            between = source.around(poses.of(movable), n_lattice, scale)
            # They join the others: the best may be of both.
            poses, best = _without_idle(poses, best)
            poses = poses.extended(between)
        if nearest > near and start + 1 >= starts:
            break
    return None


def _begin(lattice: CandidateSet, start: int) -> CandidateSet:
    """The whole lattice, or a random half of it: another place to begin."""
    if start % 2 == 0:
        return lattice
    n = len(lattice.projectors)
    half = np.random.default_rng([lattice.scene.seed, start]).random(n) < 0.5
    return lattice.take(np.flatnonzero(half | (np.arange(n) < lattice.n_existing)))


def _without_idle(
    poses: CandidateSet, best: NDArray[np.int64]
) -> tuple[CandidateSet, NDArray[np.int64]]:
    """Leave out poses that light least in the place of any one of the best."""
    lit = poses.lit.astype(np.float32)
    alone = lit[:, best] * (lit[:, best].sum(axis=1, keepdims=True) == 1.0)
    dark = ~lit[:, best].any(axis=1, keepdims=True)
    # What opens where one of the best goes, and what is dark already.
    gains = (lit.T @ (alone + dark)).max(axis=1)
    gains[: poses.n_existing] = gains[best] = np.inf
    kept = np.sort(np.argsort(-gains, kind="stable")[:_KEPT])
    return poses.take(kept), np.searchsorted(kept, best)


def _most_lit(
    poses: CandidateSet,
    n_projectors: int,
    reached: NDArray[np.bool_],
    start: NDArray[np.int64],
    seed: int,
) -> tuple[NDArray[np.int64], int, int, bool]:
    """Return the poses that light most, what they miss, and what is required.

    Last whether fresh samples should confirm it.
    """
    share = poses.scene.requirements.dominant_coverage
    regions = RegionFloors.of(poses.scene, poses.samples)
    aims = Quotas.of(regions, reached, share, spare=_AIMED)
    best = solve_max_coverage(
        cover_problem(poses.lit, aims, poses.n_existing),
        n_projectors,
        warm_start=start,
        seed=seed,
        budget=_FLOORED_BUDGET if regions.share else _BUDGET,
    ).selected
    lit = np.any(poses.lit[:, best], axis=1)
    quotas = Quotas.of(regions, reached | lit, share)
    spared = lit.sum() >= (1.0 + _SPARE) * quotas.total and aims.enough(lit)
    spared = bool(spared) or not regions.share
    return best, quotas.lacking(lit), quotas.total, spared
