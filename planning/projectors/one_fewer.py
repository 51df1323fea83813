"""Whether one projector fewer does, from poses between the candidates.

A lattice of poses may need one projector more than free poses do, by a handful of
samples. So where the best of one projector fewer fall short by little, poses close
around them are offered too, some of them farther from the object, and of all the ones
that together miss least are taken, again and again, from less and less far. Where that
comes near, it begins anew from other poses, at last from a finer lattice.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from planning.proofs.quotas import Quotas, RegionFloors, missed_shares
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
# Standard errors above the floors from which it begins: where floors are met and too
# little of all is lit, poses in between win that; where a region is dark, they don't.
_BEGUN = 0.0, 2.0
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
            spares = _BEGUN if not attempt else (_AIMED * (short <= 0.0),)
            best, missing, spared = _most_lit(
                poses, n_projectors, reached, best, seed, spares
            )
            movable = best[best >= poses.n_existing]
            found = poses.take(movable) if missing <= 0.0 else None
            if found is not None and (spared or scale is None):
                return found
            gain, short = short - missing, missing
            nearest = min(nearest, missing)
            hopeful = missing <= max(0.0, min(_SHORT, _GAINS * gain))
            if scale is None or not (hopeful or missing <= near):
                break
            between = source.around(poses.of(movable), n_lattice, scale, far=True)
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
    spares: tuple[float, ...],
) -> tuple[NDArray[np.int64], float, bool]:
    """Return the poses found that miss least, how much, and if fresh samples should.

    Floors are looked for so many standard errors up, by one search each.
    """
    share = poses.scene.requirements.dominant_coverage
    regions = RegionFloors.of(poses.scene, poses.samples)
    found = [start] if start.size else []
    for spare in spares if regions.share else (0.0,):
        sought = Quotas.of(regions, reached, share, spare=spare)
        best = solve_max_coverage(
            cover_problem(poses.lit, sought, poses.n_existing, poses.stock),
            n_projectors,
            warm_start=start,
            seed=seed,
            budget=_FLOORED_BUDGET if regions.share else _BUDGET,
        ).selected
        found.append(_swapped(poses, sought, best) if regions.share else best)

    def missing(chosen: NDArray[np.int64]) -> tuple[float, int]:
        lit = np.any(poses.lit[:, chosen], axis=1)
        quotas = Quotas.of(regions, reached | lit, share)
        counts = regions.counts(lit)
        return float(missed_shares(quotas, counts[:, None])[0]), -int(counts.sum())

    best = min(found, key=missing)
    lit = np.any(poses.lit[:, best], axis=1)
    aims = Quotas.of(regions, reached | lit, share, spare=_AIMED)
    spared = lit.sum() >= (1.0 + _SPARE) * aims.total and aims.enough(lit)
    return best, missing(best)[0], bool(spared) or not regions.share


def _swapped(
    poses: CandidateSet, quotas: Quotas, chosen: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Change a pose at a time, each time for what misses least, of these lights most.

    What misses least needn't light most at any price of regions, and such are what
    covers are looked for by.
    """
    numbers = np.arange(quotas.regions.n_rows)[:, None]
    of_number = (quotas.regions.row == numbers).astype(np.float32)

    def counted(samples: NDArray[np.bool_]) -> NDArray[np.int64]:
        """How many of some samples of each row each pose lights."""
        lit = poses.lit[samples].astype(np.float32)
        return (of_number[:, samples] @ lit).astype(np.int64)

    best: tuple[float, int] = np.inf, 0
    while True:
        swaps: list[tuple[tuple[float, int], NDArray[np.int64]]] = [(best, chosen)]
        lights = poses.lit[:, chosen].sum(axis=1)
        gained = counted(lights == 0)
        for i in range(poses.n_existing, len(chosen)):
            rest, own = np.delete(chosen, i), poses.lit[:, chosen[i]]
            kept = quotas.regions.counts(lights > own)[:, None]
            counts = gained + counted(own & (lights == 1)) + kept
            missed, total = missed_shares(quotas, counts), counts.sum(axis=0)
            if poses.stock is not None:
                missed[poses.stock.left(rest)[poses.stock.kinds] <= 0] = np.inf
            into = int(np.lexsort((-total, missed))[0])
            swapped = np.unique(np.append(rest, into))
            swaps.append(((float(missed[into]), -int(total[into])), swapped))
        found, chosen = min(swaps, key=lambda pair: pair[0])
        if found == best:
            return chosen
        best = found
