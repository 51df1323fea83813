"""The K sets that cover the most, exactly, as far as counted work reaches.

Branch and bound over columns. A node has chosen some sets, may still take r of its
candidates, and is bounded by multipliers on the rows still open (``relaxation``) and by
the r largest gains. With two sets left, what all pairs leave open is a matrix product
over the open rows::

    left(i, j) = sum_e u_e (1 - a_ei) (1 - a_ej)

Integer-valued weights make it exact, whatever the BLAS and its threads.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solvers.covers.bounds.reductions import ReducedCover
from solvers.covers.bounds.relaxation import rounding, tighten
from solvers.status import WorkBudget

from .incumbent import Incumbent

# Larger covers aren't searched: the dense copy takes a byte an entry.
_MAX_DENSE = 200_000_000
_PAIR_BLOCK = 256
_FIRST_ROWS = 64
# Pairs are looked at one by one once fewer than this fraction is left.
_FEW_PAIRS = 64
# A dense multiply-add costs this share of a unit.
_DENSE_UNIT = 1.0 / 8.0
# What a node costs however small it is.
_CALL_UNITS = 1e5
_NODE_STEPS = 20


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
    if cover.n_sets * cover.weights.size > _MAX_DENSE:
        return TupleSearch(None, 0.0, cover.total, complete=False, pairs_only=False)
    search = _Search(cover, target, budget, first)
    every = np.arange(cover.n_sets)
    upper = search.branch(every, cover.weights, multipliers, n_sets, [])
    found = search.selected
    return TupleSearch(
        selected=None if found is None else np.array(sorted(found), dtype=np.int64),
        weight=search.weight,
        upper_bound=max(upper, search.refuted) if search.cut else search.refuted,
        complete=not search.cut,
        pairs_only=search.nodes == 0,
    )


class _Search(Incumbent[list[int]]):
    """Depth-first search; it is its own incumbent."""

    def __init__(
        self, cover: ReducedCover, target: float, budget: WorkBudget, first: bool
    ) -> None:
        super().__init__(cover, target, first=first)
        self.cover = cover
        self.budget = budget
        self.cut = False
        self.nodes = 0
        self.dense = cover.by_set.astype(bool).toarray()
        # Rows that few columns cover refute most.
        servers = np.diff(cover.by_row.indptr)
        self.row_order = np.argsort(servers, kind="stable")
        self._total = cover.total
        self._rounding = rounding(cover.weights.size)

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
        gains = self._sums(candidates, open_weights)
        self.budget.spend(8.0 * open_weights.size + _CALL_UNITS)
        r = min(r, candidates.size)
        if r == 1:
            best = int(np.argmax(gains))
            self.offer([*chosen, int(candidates[best])], covered + float(gains[best]))
            return covered + float(gains[best])

        bound, prices, multipliers = self._bound(
            candidates, open_weights, multipliers, gains, covered, r
        )
        if bound < self.target:
            return 0.0
        if self.budget.exhausted:
            self.cut = True
            return bound
        keep = self._may_help(gains, covered, 0.0, r) & self._may_help(
            prices, covered, float(np.sum(open_weights - multipliers)), r
        )
        candidates, gains = candidates[keep], gains[keep]
        if candidates.size == 0:
            return 0.0
        firsts = self._must_take(candidates, open_weights)
        if not np.any(firsts):
            return 0.0
        if r == 2:
            return self._pairs(
                candidates, open_weights, gains, firsts, covered, chosen, bound
            )
        rows = self.cover.by_set[candidates]
        step = tighten(
            rows,
            open_weights,
            r,
            self.target - covered,
            multipliers,
            self.budget,
            max_steps=_NODE_STEPS,
        )
        if covered + step.bound < self.target:
            return 0.0
        prices = np.asarray(rows @ step.multipliers)
        return self._children(
            candidates, open_weights, step.multipliers, prices, firsts, r, chosen
        )

    def _sums(
        self, candidates: NDArray[np.int64], values: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return each candidate's sum of values over the rows that it serves."""
        by_set = self.cover.by_set
        self.budget.spend(float(by_set.nnz))
        # Taking candidates out first costs more than the sums of all.
        return np.asarray(by_set @ values)[candidates]

    def _must_take(
        self, candidates: NDArray[np.int64], open_weights: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        """Return which columns one must be taken from: those of the scarcest row.

        A row is indispensable if it outweighs all that may stay uncovered; where none
        is, any column may come first.
        """
        indispensable = np.flatnonzero(open_weights > self._total - self.target)
        if indispensable.size == 0:
            return np.ones(candidates.size, dtype=bool)
        may_serve = np.zeros(self.cover.n_sets)
        may_serve[candidates] = 1.0
        by_row = self.cover.by_row
        servers = np.asarray(by_row @ may_serve)[indispensable]
        self.budget.spend(float(by_row.nnz))
        row = int(indispensable[int(np.argmin(servers))])
        return self.dense[candidates, row]

    def _may_help(
        self, values: NDArray[np.float64], covered: float, rest: float, r: int
    ) -> NDArray[np.bool_]:
        """Columns that reach the target together with the r - 1 best others."""
        top = np.sort(values)[::-1][: r - 1].sum()
        return (covered + rest + top + values) * (1.0 + self._rounding) >= self.target

    def _bound(
        self,
        candidates: NDArray[np.int64],
        open_weights: NDArray[np.float64],
        multipliers: NDArray[np.float64],
        gains: NDArray[np.float64],
        covered: float,
        r: int,
    ) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
        """Return the better of the gain and the multiplier bound, and its prices."""
        multipliers = np.minimum(multipliers, open_weights)
        prices = self._sums(candidates, multipliers)
        rest = float(np.sum(open_weights - multipliers))
        by_gain = covered + float(np.sort(gains)[::-1][:r].sum())
        by_price = covered + rest + float(np.sort(prices)[::-1][:r].sum())
        bound = min(by_gain, by_price) * (1.0 + self._rounding)
        return bound, prices, multipliers

    def _children(
        self,
        candidates: NDArray[np.int64],
        open_weights: NDArray[np.float64],
        multipliers: NDArray[np.float64],
        prices: NDArray[np.float64],
        firsts: NDArray[np.bool_],
        r: int,
        chosen: list[int],
    ) -> float:
        """Take each possible first column in turn, then never again."""
        self.nodes += 1
        floor = self._total - float(np.sum(multipliers))
        order = np.argsort(-prices, kind="stable")
        candidates, prices, firsts = candidates[order], prices[order], firsts[order]
        alive = np.ones(candidates.size, dtype=bool)
        upper = 0.0
        for i in np.flatnonzero(firsts):
            alive[i] = False
            others = prices[np.flatnonzero(alive)[: r - 1]]
            bound = (floor + float(prices[i] + others.sum())) * (1.0 + self._rounding)
            if self.done:
                break
            if bound < self.target:
                continue
            if self.budget.exhausted:
                self.cut = True
                return max(upper, bound)
            s = int(candidates[i])
            left = open_weights.copy()
            start, stop = self.cover.by_set.indptr[s : s + 2]
            left[self.cover.by_set.indices[start:stop]] = 0.0
            below = self.branch(
                candidates[alive], left, multipliers, r - 1, [*chosen, s]
            )
            upper = max(upper, below)
        return upper

    def _partners(self, gains: NDArray[np.float64], i: int, covered: float) -> int:
        """Leading columns, sorted by gain, that may reach the target with i."""
        need = self.target - covered - gains[i]
        return int(np.searchsorted(-gains, -need, side="right"))

    def _pairs(
        self,
        candidates: NDArray[np.int64],
        open_weights: NDArray[np.float64],
        gains: NDArray[np.float64],
        firsts: NDArray[np.bool_],
        covered: float,
        chosen: list[int],
        bound: float,
    ) -> float:
        """Settle all pairs of a first column and any other."""
        order = np.argsort(-gains, kind="stable")
        # The better of a pair meets the need with every partner that can.
        order = order[: self._partners(gains[order], 0, covered)]
        candidates, gains = candidates[order], gains[order]
        every = bool(np.all(firsts))
        leads = np.flatnonzero(firsts[order])
        rows = self.row_order[open_weights[self.row_order] > 0]
        self.budget.spend(2.0 * candidates.size * rows.size + _CALL_UNITS)
        missed = ~self.dense[np.ix_(candidates, rows)]
        upper = 0.0
        for block in np.split(leads, np.arange(_PAIR_BLOCK, leads.size, _PAIR_BLOCK)):
            # Where any column may lead, partners before the leader were leaders.
            head = int(block[0]) if every and block.size else 0
            stop = self._partners(gains, int(block[0]), covered) if block.size else 0
            if stop <= head:
                break
            if self.budget.exhausted:
                self.cut = True
                return bound
            i, j, left = self._best_pair(
                missed[block], missed[head:stop], open_weights[rows]
            )
            if left is None:
                continue
            weight = self._total - left
            ends = sorted({int(block[i]), head + j})
            self.offer([*chosen, *(int(candidates[s]) for s in ends)], weight)
            upper = max(upper, weight)
        return upper

    def _best_pair(
        self,
        ones: NDArray[np.bool_],
        others: NDArray[np.bool_],
        weights: NDArray[np.float64],
    ) -> tuple[int, int, float | None]:
        """Return the pair that leaves the least weight, if that is little enough.

        What a pair leaves open only grows with the rows looked at, so most pairs are
        refuted by the rows that fewest columns cover, which come first.
        """
        allowed = self._total - self.target
        left = np.zeros((len(ones), len(others)))
        start, length = 0, _FIRST_ROWS
        while start < weights.size:
            part = slice(start, start + length)
            left += (ones[:, part] * weights[part]) @ others[:, part].T.astype(float)
            width = min(length, weights.size - start)
            self.budget.spend(left.size * (4.0 + width * _DENSE_UNIT))
            start, length = start + length, 4 * length
            alive = left <= allowed
            n_alive = int(np.count_nonzero(alive))
            if n_alive == 0:
                return 0, 0, None
            if n_alive * _FEW_PAIRS < left.size and start < weights.size:
                i, j = np.nonzero(alive)
                rest = slice(start, None)
                for k in range(0, i.size, _PAIR_BLOCK):
                    few = slice(k, k + _PAIR_BLOCK)
                    both = ones[i[few], rest] & others[j[few], rest]
                    left[i[few], j[few]] += both @ weights[rest]
                    self.budget.spend(2.0 * both.size)
                left[~alive] = np.inf
                break
        i, j = np.unravel_index(int(np.argmin(left)), left.shape)
        value = float(left[i, j])
        return int(i), int(j), value if value <= allowed else None
