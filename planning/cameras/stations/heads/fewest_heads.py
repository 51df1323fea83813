"""The search for the fewest heads, until samples that are fresh confirm them."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from geometry.arrays import Ints, Mask
from planning.scene.draws import DRAWS
from solvers import CoverSolution, solve_max_coverage

from .head_cover import HeadCover, HeadSets
from .head_poses import HeadSource, PlacedHead

_ROUNDS = 4
# Of a lattice's spacing: how far around a head it is moved, round by round.
_SCALES = (1.0, 0.5, 0.25)
# Counted work of the cover whose bound is told, and of each other cover.
_PROOF_BUDGET, _BUDGET = 1e9, 5e7
# Of what is asked, at most that a head less is lacking before it is moved together.
_NEARLY = 0.06
# Times that one of two heads that collide is left out and the others are sought anew.
_EXCHANGES = 30
_NONE: Ints = np.empty(0, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class FoundHeads:
    """The fewest heads of the candidates, and what is proved of their number.

    Attributes:
        heads: All candidates.
        cover: What is asked of them.
        chosen: Those taken, at most as many as are allowed, (k,).
        needed: So many are enough, allowed or not; None: none were found that are and
            whose housings keep off each other.
        lower_bound: Proven least number of the candidates.
        proof: What proves it.
        greedy: As many a greedy choice takes; None: it never gets there.
        fresh: What is asked of other samples, on which those chosen were tried.
    """

    heads: tuple[PlacedHead, ...]
    cover: HeadCover
    chosen: Ints
    needed: int | None
    lower_bound: int
    proof: str
    greedy: int | None
    fresh: HeadCover

    def with_one_more(self, source: HeadSource) -> "FoundHeads | None":
        """Return one head more: the best of so many, or that which adds most.

        None: no other head adds anything and has room.
        """
        count, seed = len(self.chosen) + 1, source.scene.seed
        more = solve_max_coverage(
            *(self.cover.whole.problem, count),
            warm_start=self.chosen,
            seed=seed,
            budget=_BUDGET,
        ).selected
        together = [self.heads[k] for k in more]
        if len(more) < count or source.colliding(together) is not None:
            more = _apart(source, self.heads, self.cover, count, self.chosen)
        return None if len(more) < count else replace(self, chosen=more)

    @property
    def taken(self) -> tuple[PlacedHead, ...]:
        """The heads chosen."""
        return tuple(self.heads[k] for k in self.chosen)


def fewest_heads(source: HeadSource, n: int, most: int) -> FoundHeads:
    """Return the fewest heads of about n poses and of others close around.

    Args:
        source: Gives poses.
        n: Poses of the lattice.
        most: Heads allowed.
    """
    scene, heads = source.scene, source.over(n)
    sets = HeadSets.of(scene, heads, scene.target_samples(DRAWS.cameras))
    heads, sets, known = _with_better(source, heads, sets, n)
    fewest = _fewest_of(source, heads, sets, most, known)
    fresh = _fresh(source, heads, 0)
    for draw in range(_ROUNDS):
        met = fewest.needed is not None and fewest.needed <= most
        if not met or not fresh.lacking(fewest.chosen):
            break
        sets = sets.with_samples(fresh.sets)
        fewest = _fewest_of(source, heads, sets, most, known)
        fresh = _fresh(source, heads, 1 + draw)
    cover, chosen, needed, solution = fewest
    bound, proof = cover.proved(solution, seed=scene.seed, budget=_PROOF_BUDGET)
    whole, met = _greedy(cover)
    greedy = len(whole) if met else None
    return FoundHeads(heads, cover, chosen, needed, bound, proof, greedy, fresh)


def _fresh(source: HeadSource, heads: tuple[PlacedHead, ...], draw: int) -> HeadCover:
    """What is asked of samples that no cover saw yet."""
    target = source.scene.target_samples(DRAWS.fresh_cameras.later(1 + draw))
    return HeadCover.of(source.scene, HeadSets.of(source.scene, heads, target))


class _Fewest(NamedTuple):
    """The fewest of one draw's samples, as of `FoundHeads`, before what is proved."""

    cover: HeadCover
    chosen: Ints
    needed: int | None
    solution: CoverSolution


def _with_better(
    source: HeadSource, heads: tuple[PlacedHead, ...], sets: HeadSets, n: int
) -> tuple[tuple[PlacedHead, ...], HeadSets, Ints]:
    """Return heads, and others around them as long as those save one.

    And which of them are the fewest that were found so, none if none were.
    """
    cover, known = HeadCover.of(source.scene, sets), np.empty(0, dtype=np.int64)
    chosen, _ = cover.fewest(seed=source.scene.seed, budget=_BUDGET)
    for count in range(len(chosen) - 1, 0, -1):
        moved = _moved_together(source, heads, cover, n, count)
        if moved is None:
            break
        known = np.arange(len(heads), len(heads) + count)
        heads = heads + moved
        sets = sets.beside(HeadSets.of(source.scene, moved, sets.target))
        cover = HeadCover.of(source.scene, sets)
    return heads, sets, known


def _fewest_of(
    source: HeadSource,
    heads: tuple[PlacedHead, ...],
    sets: HeadSets,
    most: int,
    known: Ints,
) -> _Fewest:
    """Return the fewest of some heads whose housings don't collide.

    The solution is of any, colliding or not. Those known may be fewer than the search
    finds.
    """
    cover, seed = HeadCover.of(source.scene, sets), source.scene.seed
    chosen, solution = cover.fewest(seed=seed, budget=_PROOF_BUDGET)
    if len(known) and len(known) < len(chosen) and not cover.lacking(known):
        chosen = known
    if source.colliding([heads[k] for k in chosen]) is not None:
        chosen = _fewest_apart(source, heads, cover, chosen)
    needed = None if cover.lacking(chosen) else len(chosen)
    if needed is None or needed > most:
        few = solve_max_coverage(cover.whole.problem, most, seed=seed, budget=_BUDGET)
        chosen = few.selected
        if source.colliding([heads[k] for k in chosen]) is not None:
            chosen = _apart(source, heads, cover, most)
    return _Fewest(cover, chosen, needed, solution)


def _fewest_apart(
    source: HeadSource, heads: tuple[PlacedHead, ...], cover: HeadCover, chosen: Ints
) -> Ints:
    """Return the fewest heads found that are enough and don't collide, or the most.

    Of two that do, the one that measures less isn't offered again, so many times; then
    each is taken that adds most beside the others.
    """
    measured, left = cover.sets.measured.sum(axis=0), cover
    for _ in range(_EXCHANGES):
        source.scene.check_cancelled()
        pair = source.colliding([heads[k] for k in chosen])
        if pair is None:
            return chosen
        worse = min((int(chosen[k]) for k in pair), key=lambda k: (measured[k], k))
        left = left.without(worse)
        others, _ = left.fewest(seed=source.scene.seed, budget=_BUDGET)
        if left.lacking(others):
            break
        chosen = others
    return _apart(source, heads, cover, len(heads))


def _apart(
    source: HeadSource,
    heads: tuple[PlacedHead, ...],
    cover: HeadCover,
    most: int,
    begin: Ints = _NONE,
) -> Ints:
    """Return heads, at most so many, each that adds most and has room beside others."""
    free = np.ones(len(heads), dtype=bool)

    def clear(taken: int) -> Mask:
        for k in np.flatnonzero(free):
            free[k] = source.colliding([heads[taken], heads[k]]) is None
        free[taken] = False
        return free

    return _greedy(cover, most, begin, clear)[0]


def _moved_together(
    source: HeadSource,
    every: tuple[PlacedHead, ...],
    cover: HeadCover,
    n: int,
    count: int,
) -> tuple[PlacedHead, ...] | None:
    """Return so many heads that are enough, moved from those that nearly are.

    One after the other takes the pose around it with which least is lacking.
    """
    scene = source.scene
    whole = cover.whole.problem
    few = solve_max_coverage(whole, count, seed=scene.seed, budget=_BUDGET)
    heads = [every[k] for k in few.selected]
    sets = cover.sets.take(few.selected)
    everywhere = replace(cover, sets=sets)
    lacking = everywhere.lacking(np.arange(len(heads)))
    if lacking > _NEARLY * cover.quotas.total:
        return None
    for scale in _SCALES:
        for k in range(len(heads)):
            scene.check_cancelled()
            around = source.around(heads[k], n, scale)
            if not around:
                continue
            offered = HeadSets.of(scene, around, cover.sets.target)
            others = sets.take(np.delete(np.arange(len(heads)), k))
            short = _lacking_with_each(cover, others, offered)
            best = int(np.argmin(short))
            if short[best] < lacking:
                lacking, heads[k] = int(short[best]), around[best]
                sets = sets.with_at(k, offered.take(np.array([best])))
            if lacking == 0 and source.colliding(heads) is None:
                return tuple(heads)
    return None


def _lacking_with_each(cover: HeadCover, others: HeadSets, offered: HeadSets) -> Ints:
    """Return how many rows are lacking of other heads and each one offered, (k,)."""
    n, covers = others.lit.shape[1], replace(cover, sets=others.beside(offered)).covers
    served = np.any(covers[:, :n], axis=1, keepdims=True) | covers[:, n:]
    return np.array([cover.short(column).sum() for column in served.T], dtype=np.int64)


def _greedy(
    cover: HeadCover,
    most: int | None = None,
    begin: Ints = _NONE,
    clear: Callable[[int], Mask] | None = None,
) -> tuple[Ints, bool]:
    """Return heads, each that adds most to what is lacking, and whether all is served.

    `clear` says of a head that is taken which others may be taken yet.
    """
    rows = cover.quotas.regions.row
    covers, chosen = cover.covers, begin.tolist()
    served, free = (
        np.any(covers[:, begin], axis=1),
        np.ones(covers.shape[1], dtype=bool),
    )
    if clear is not None:
        for taken in chosen:
            free = clear(taken)
    while True:
        short = cover.short(served)
        met = not short.any()
        wanted = ~served & (short > 0)[rows]
        gains = np.where(free, covers[wanted].sum(axis=0), 0)
        if met or len(chosen) == most or not gains.any():
            return np.sort(np.array(chosen, dtype=np.int64)), met
        chosen.append(int(np.argmax(gains)))
        served |= covers[:, chosen[-1]]
        free = free if clear is None else clear(chosen[-1])
