"""Branch and bound on groups of alike sets, for partial covers.

In a cover by visibility each place is offered many times over: columns beside each
other differ in few rows, so a fractional solution spreads over all of them, and closing
one set, or taking one, changes next to nothing. A node is split by a *group*, the sets
that are alike to one of them (by the Jaccard index of their rows): either none of it is
taken, or at least one. Groups split further until the bound of what is left falls
below the target. Nodes are bounded many at a time (``group_bounds``), best bound first.
Sets that no selection of enough weight takes, by what they pay (``relaxation``), are
left out before.

References:
    Ryan and Foster, "An integer programming approach to scheduling", 1981, for
    branching on what several columns have in common.
"""

import heapq
from dataclasses import replace
from itertools import count

import numpy as np
from numpy.typing import NDArray

from solvers.covers.answers import ExactSearch, Incumbent
from solvers.covers.bounds.reduced_cover import ReducedCover
from solvers.covers.bounds.relaxation import sets_worth_taking
from solvers.covers.search.prices import Prices
from solvers.status import WorkBudget

from .group_bounds import GroupPart, PartBounds
from .group_parts import children, only_selection

# Larger covers aren't searched: the dense copy takes four bytes an entry, the table
# of what is alike four for each pair of sets.
_MAX_DENSE = 60_000_000
_MAX_SETS = 4_000
# Share of the work that may go into that table.
_PREPARED = 0.25
# Parts bounded together, and bytes of parts kept open.
_BATCH = 48
_MAX_OPEN = 600_000_000
# Steps for the whole, and for a part that starts from its parent's multipliers.
_FIRST_STEPS, _STEPS = 200, 40


def best_by_groups(
    cover: ReducedCover,
    n_sets: int,
    *,
    target: float,
    multipliers: NDArray[np.float64],
    budget: WorkBudget,
    first: bool = False,
    prices: Prices | None = None,
) -> ExactSearch:
    """Find K sets of a simple cover, as `pairs.best_pair` does, K at least 1.

    Where the budget ends, the bound of what is left open is returned. With prices, the
    cover has floors that they are of, the multipliers are the priced cover's, and sets
    that miss a floor are none.
    """
    # A table of what is alike that leaves no work to use it is made for nothing.
    if _table_units(cover) > _PREPARED * budget.remaining:
        return ExactSearch(None, 0.0, cover.total, complete=False)
    prices = Prices.even(cover) if prices is None else prices
    kept = sets_worth_taking(
        prices.priced, min(n_sets, cover.n_sets), multipliers, prices.demand(target)
    )
    budget.spend(float(cover.by_set.nnz))
    if kept.size <= n_sets:
        best = Incumbent(cover, target, first=first)
        if not cover.floored or np.all(cover.covered_by(kept) >= cover.quotas):
            best.offer(kept, cover.weight_of(kept))
        return ExactSearch(best.selected, best.weight, best.refuted, complete=True)
    if kept.size * cover.weights.size > _MAX_DENSE or kept.size > _MAX_SETS:
        return ExactSearch(None, 0.0, cover.total, complete=False)
    prices = replace(prices, cover=cover.of_sets(kept))
    budget.spend(_table_units(prices.cover))
    found = _Tree(prices, n_sets, target, budget, first=first).run(multipliers)
    if found.selected is None:
        return found
    return replace(found, selected=kept[found.selected])


class _Tree(Incumbent):
    """Search over groups; it is its own incumbent."""

    def __init__(
        self,
        prices: Prices,
        n_sets: int,
        target: float,
        budget: WorkBudget,
        *,
        first: bool,
    ) -> None:
        cover = prices.cover
        super().__init__(cover, target, first=first)
        self.cover, self.n_sets, self.budget = cover, n_sets, budget
        self.prices = prices
        self._names = count()
        self._open: list[tuple[float, int, GroupPart]] = []
        least, priced = self._least_priced, prices.priced
        self.bounds = PartBounds(priced, n_sets, least, budget, leaves_out=True)
        self._alike = likeness(self.bounds.covers, cover.weights)
        sets, floors = np.arange(cover.quotas.size), cover.quotas > 0
        floors &= cover.floored
        of_set = (cover.row_sets == sets[floors, None]) * cover.weights
        # Weight of each set in each row set with a floor, (n_s, n_floors).
        self._shares = cover.by_set @ of_set.T
        self._floors = cover.quotas[floors]

    def run(self, multipliers: NDArray[np.float64]) -> ExactSearch:
        whole = self.bounds.whole(multipliers / self.prices.priced.weights)
        self._take([whole], _FIRST_STEPS)
        most = _MAX_OPEN // (4 * self.cover.weights.size + 5 * self.cover.n_sets)
        while self._promising:
            if self.done or self.budget.exhausted or len(self._open) > most:
                # What the clock cut before it was bounded may cover everything.
                bound = self.prices.weight(-self._open[0][0])
                bound = min(bound, self.cover.total)
                upper = max(self.weight, bound // self.cover.grain * self.cover.grain)
                return ExactSearch(self.selected, self.weight, upper, complete=False)
            split: list[GroupPart] = []
            while self._promising and len(split) < _BATCH:
                part = heapq.heappop(self._open)[2]
                split += children(part, self.n_sets, self._alike)
            self._take(split, _STEPS)
        return ExactSearch(self.selected, self.weight, self.refuted, complete=True)

    @property
    def _promising(self) -> bool:
        return bool(self._open) and -self._open[0][0] >= self._least_priced

    @property
    def _least_priced(self) -> float:
        """Priced weight below which nothing is of interest."""
        return self.prices.demand(self.target)

    def _take(self, parts: list[GroupPart], steps: int) -> None:
        """Bound parts, look at what they would take, and keep those still open."""
        still: list[GroupPart] = []
        parts = [part for part in parts if self._may_meet_floors(part)]
        for part in self.bounds.lowered(parts, steps):
            only = only_selection(part, self.n_sets)
            if only is not None:
                self._try(np.sort(only))
                continue
            if part.costliest.size:
                self._try(np.sort(part.costliest))
            still.append(part)
        for part in still:
            if part.bound >= self._least_priced:
                heapq.heappush(self._open, (-part.bound, next(self._names), part))

    def _may_meet_floors(self, part: GroupPart) -> bool:
        """Whether a part's sets could meet each floor if they had no row in common."""
        if not self._floors.size:
            return True
        spare = self.n_sets - len(part.groups)
        most = sum((self._shares[g].max(axis=0) for g in part.groups), np.zeros(1))
        if spare:
            others = np.where(part.closed[:, None], 0.0, self._shares)
            most = most + np.partition(others, -spare, axis=0)[-spare:].sum(axis=0)
        return bool(np.all(most >= self._floors))

    def _try(self, chosen: NDArray[np.int64]) -> None:
        covered = self.bounds.covers[chosen].any(axis=0)
        weights = self.cover.by_row_set(np.where(covered, self.cover.weights, 0.0))
        if np.all(weights >= self.cover.quotas) or not self.cover.floored:
            self.offer(chosen, float(weights.sum()))


def _table_units(cover: ReducedCover) -> float:
    return cover.n_sets * cover.n_sets * cover.weights.size / 16.0


def likeness(
    covers: NDArray[np.float32], weights: NDArray[np.float64]
) -> NDArray[np.float32]:
    """Return the weighted Jaccard index of each pair of sets, shape (n_s, n_s).

    1 of two that cover nothing.
    """
    # Whole numbers below 2^12 for rows: sums are exact, so ties fall alike everywhere.
    scale = max(1.0, float(weights.sum()) / float(1 << 23))
    whole = np.maximum(np.floor(weights / scale), 1.0).astype(np.float32)
    both = (covers * whole) @ covers.T
    alone = both.diagonal()
    either = alone[:, None] + alone[None, :] - both
    alike = np.ones(both.shape, dtype=np.float32)
    np.divide(both, either, out=alike, where=either > 0.0)
    return alike
