"""The K sets that cover the most, exactly, as far as counted work reaches.

Branch and bound over columns. A node has chosen some sets, may still take r of its
candidates, and is bounded by multipliers on the rows still open (``relaxation``) and by
the r largest gains. With two sets left, all pairs are settled by one matrix product::

    w(i or j) = g_i + g_j - sum_e u_e a_ei a_ej

Integer-valued weights make that product exact, whatever the BLAS and its threads.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .reductions import ReducedCover
from .relaxation import ROUNDING, tighten
from .status import WorkBudget

_ROW_BLOCK = 4096
_PAIR_BLOCK = 256
# A dense multiply-add costs this share of a unit.
_DENSE_UNIT = 1.0 / 12.0


@dataclass(frozen=True, eq=False)
class TupleSearch:
    """Answer of :func:`best_tuple`.

    Attributes:
        selected: The best selection that reaches the target, or None.
        weight: Integer-valued weight that it covers, 0 without one.
        upper_bound: No K sets cover more than this.
        complete: Whether the search space is exhausted.
        pairs_only: Whether no branching was needed beyond pairs.
    """

    selected: NDArray[np.int64] | None
    weight: float
    upper_bound: float
    complete: bool
    pairs_only: bool


def best_tuple(
    cover: ReducedCover,
    n_sets: int,
    *,
    target: float,
    multipliers: NDArray[np.float64],
    budget: WorkBudget,
    first: bool = False,
) -> TupleSearch:
    """Find K sets that cover at least a target, the most if all of the budget lasts.

    Args:
        cover: The cover.
        n_sets: K, at least 1.
        target: Integer-valued weight below which nothing is of interest.
        multipliers: Row multipliers in [0, w] that bound the root, shape (n_e,).
        budget: Work; when it ends, the bound of what is left open is returned.
        first: Whether any selection that reaches the target will do.
    """
    search = _Search(cover, target, budget, first)
    every = np.arange(cover.n_sets)
    upper = search.branch(every, cover.weights, multipliers, n_sets, [])
    found = search.selected
    # What was pruned is below the target, which an incumbent has raised.
    return TupleSearch(
        selected=None if found is None else np.array(sorted(found), dtype=np.int64),
        weight=search.weight,
        upper_bound=max(upper, search.target) if search.cut else search.target,
        complete=not search.cut,
        pairs_only=search.nodes == 0,
    )


class _Search:
    """Depth-first search; holds the incumbent."""

    def __init__(
        self, cover: ReducedCover, target: float, budget: WorkBudget, first: bool
    ) -> None:
        self.cover = cover
        self.target = target
        self.budget = budget
        self.first = first
        self.selected: list[int] | None = None
        self.weight = 0.0
        self.cut = False
        self.nodes = 0
        self._total = cover.total
        # Improvements below this share of the total are rounding, not weight.
        self._least = max(1.0, np.floor(self._total * ROUNDING))

    def offer(self, chosen: list[int], weight: float) -> None:
        """Keep a selection that reaches the target, and ask for more from then on."""
        if weight >= self.target:
            self.selected, self.weight = chosen, weight
            self.target = weight + self._least

    @property
    def done(self) -> bool:
        return self.first and self.selected is not None

    def branch(
        self,
        candidates: NDArray[np.int64],
        open_weights: NDArray[np.float64],
        multipliers: NDArray[np.float64],
        r: int,
        chosen: list[int],
    ) -> float:
        """Settle one node; return a bound on the weight of what it leaves open."""
        if self.done:
            return 0.0
        covered = self._total - float(open_weights.sum())
        if candidates.size == 0 or r == 0:
            self.offer(chosen, covered)
            return covered
        rows = self.cover.by_set[candidates]
        gains = np.asarray(rows @ open_weights)
        self.budget.spend(2.0 * rows.nnz + 8.0 * open_weights.size)
        r = min(r, candidates.size)
        if r == 1:
            best = int(np.argmax(gains))
            self.offer([*chosen, int(candidates[best])], covered + float(gains[best]))
            return covered + float(gains[best])

        bound, prices, multipliers = self._bound(
            rows, open_weights, multipliers, gains, covered, r
        )
        if bound < self.target:
            return 0.0
        if self.budget.exhausted:
            self.cut = True
            return bound
        # One of the sets is at least the mean, so every other bound is a floor.
        keep = self._may_help(gains, covered, 0.0, r) & self._may_help(
            prices, covered, float(np.sum(open_weights - multipliers)), r
        )
        candidates, gains, prices = candidates[keep], gains[keep], prices[keep]
        if candidates.size == 0:
            return 0.0
        if r == 2:
            return self._pairs(candidates, open_weights, gains, covered, chosen, bound)
        return self._children(candidates, open_weights, multipliers, prices, r, chosen)

    def _may_help(
        self, values: NDArray[np.float64], covered: float, rest: float, r: int
    ) -> NDArray[np.bool_]:
        """Columns that reach the target together with the r - 1 best others."""
        top = np.sort(values)[::-1][: r - 1].sum()
        return (covered + rest + top + values) * (1.0 + ROUNDING) >= self.target

    def _bound(
        self,
        rows: "object",
        open_weights: NDArray[np.float64],
        multipliers: NDArray[np.float64],
        gains: NDArray[np.float64],
        covered: float,
        r: int,
    ) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
        """Return the better of the gain and the multiplier bound, and its prices."""
        multipliers = np.minimum(multipliers, open_weights)
        prices = np.asarray(rows @ multipliers)  # type: ignore[operator]
        rest = float(np.sum(open_weights - multipliers))
        by_gain = covered + float(np.sort(gains)[::-1][:r].sum())
        by_price = covered + rest + float(np.sort(prices)[::-1][:r].sum())
        bound = min(by_gain, by_price) * (1.0 + ROUNDING)
        return bound, prices, multipliers

    def _children(
        self,
        candidates: NDArray[np.int64],
        open_weights: NDArray[np.float64],
        multipliers: NDArray[np.float64],
        prices: NDArray[np.float64],
        r: int,
        chosen: list[int],
    ) -> float:
        self.nodes += 1
        covered = self._total - float(open_weights.sum())
        rest = float(np.sum(open_weights - multipliers))
        order = np.argsort(-prices, kind="stable")
        candidates, prices = candidates[order], prices[order]
        dearest = np.concatenate([[0.0], np.cumsum(prices)])
        upper = 0.0
        for i in range(candidates.size):
            last = min(i + r, candidates.size)
            bound = (covered + rest + float(dearest[last] - dearest[i])) * (
                1.0 + ROUNDING
            )
            if bound < self.target or self.done:
                break
            if self.budget.exhausted:
                self.cut = True
                return max(upper, bound)
            s = int(candidates[i])
            left = open_weights.copy()
            start, stop = self.cover.by_set.indptr[s : s + 2]
            left[self.cover.by_set.indices[start:stop]] = 0.0
            below = self.branch(
                candidates[i + 1 :], left, multipliers, r - 1, [*chosen, s]
            )
            upper = max(upper, below)
        return upper

    def _pairs(
        self,
        candidates: NDArray[np.int64],
        open_weights: NDArray[np.float64],
        gains: NDArray[np.float64],
        covered: float,
        chosen: list[int],
        bound: float,
    ) -> float:
        """Settle all pairs of candidates by matrix products."""
        order = np.argsort(-gains, kind="stable")
        candidates, gains = candidates[order], gains[order]
        n = candidates.size
        rows = np.flatnonzero(open_weights > 0)
        weights = open_weights[rows]
        work = _DENSE_UNIT * 0.5 * n * n * rows.size + 4.0 * n * rows.size
        if work > self.budget.remaining:
            self.cut = True
            self.budget.spend(self.budget.remaining)
            return bound
        self.budget.spend(work)
        dense = self.cover.by_set[candidates][:, rows].astype(np.float32).toarray()
        upper = 0.0
        for top in range(0, n, _PAIR_BLOCK):
            need = self.target - covered
            stop = int(np.searchsorted(-gains, -(need - gains[top]), side="right"))
            if stop <= top:
                break
            block = dense[top : min(top + _PAIR_BLOCK, stop)]
            pair = gains[top : top + len(block), None] + gains[None, top:stop]
            for e in range(0, rows.size, _ROW_BLOCK):
                part = slice(e, e + _ROW_BLOCK)
                weighted = block[:, part] * weights[part]
                pair -= weighted @ dense[top:stop, part].astype(np.float64).T
            i, j = np.unravel_index(int(np.argmax(pair)), pair.shape)
            weight = covered + float(pair[i, j])
            if i == j:
                self.offer([*chosen, int(candidates[top + i])], weight)
            else:
                pairing = [int(candidates[top + i]), int(candidates[top + j])]
                self.offer([*chosen, *pairing], weight)
            upper = max(upper, weight)
        return upper
