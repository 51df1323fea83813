"""Branch and bound on groups of alike sets, for covers by pairs.

The tree of `exact.group_branching`, bounded by what each set is worth by itself. Its
selections are looked at with their pairs: a part is closed where its bound falls below
the target, or where it is down to one selection.
"""

import heapq
from dataclasses import dataclass
from itertools import count

import numpy as np
from numpy.typing import NDArray

from solvers.covers.exact.group_bounds import GroupPart
from solvers.covers.exact.group_parts import children, only_selection
from solvers.status import WorkBudget

from .pair_bounds import PairBounds
from .pair_rows import PairRows

_BATCH = 48
_MAX_OPEN = 600_000_000
# Steps for the whole, and for a part that starts from its parent's multipliers; fewer
# where splitting costs less than bounding well.
_FIRST_STEPS, _STEPS, _LEAST_STEPS = 200, 40, 10
_SMALL = 50_000.0


@dataclass(frozen=True, eq=False)
class PairTreeAnswer:
    """What a search for K sets found.

    Attributes:
        selected: The best selection that reaches the target, or None.
        weight: Integer-valued weight that it covers.
        upper_bound: No K sets cover more.
        complete: Whether nothing is left open.
    """

    selected: NDArray[np.int64] | None
    weight: float
    upper_bound: float
    complete: bool


class PairTree:
    """Search for K sets that cover a target, or the most.

    Args:
        cover: Rows and pairs.
        shares: What each set is worth to a row, from `worth`.
        n_sets: K, at least as many as are fixed.
        target: Integer-valued weight below which nothing is of interest.
        budget: Counted work.
        first: Whether any selection that reaches the target will do.
    """

    def __init__(
        self,
        cover: PairRows,
        shares: NDArray[np.float32],
        n_sets: int,
        *,
        target: float,
        budget: WorkBudget,
        first: bool,
    ) -> None:
        self.cover, self.n_sets, self.budget = cover, n_sets, budget
        self.target, self._first = target, first
        self.selected: NDArray[np.int64] | None = None
        self.weight = 0.0
        self.fixed = cover.problem.fixed
        self._bounds = PairBounds(cover, shares, n_sets, target, budget)
        self._names, self._alike = count(), None
        self._open: list[tuple[float, int, GroupPart]] = []

    def run(self, start: NDArray[np.float64] | None = None) -> PairTreeAnswer:
        """Search; `start` are multipliers over weights to begin with, (n_r,)."""
        if start is None:
            start = np.ones(len(self.cover.rows))
        self._take([self._bounds.without(self.fixed, start)], _FIRST_STEPS)
        most = _MAX_OPEN // (4 * len(self.cover.rows) + 5 * self.cover.n_sets)
        while self._promising:
            if (self._first and self.selected is not None) or len(self._open) > most:
                break
            if self.budget.exhausted:
                break
            split: list[GroupPart] = []
            while self._promising and len(split) < _BATCH:
                part = heapq.heappop(self._open)[2]
                split += children(part, self.n_sets, self._likeness())
            self._take(split, _STEPS)
        left = -self._open[0][0] if self._promising else self.target - 1.0
        bound = max(self.weight, min(left, self.cover.total))
        grain = self.cover.grain
        return PairTreeAnswer(
            self.selected,
            self.weight,
            float(bound // grain * grain),
            complete=not self._promising,
        )

    @property
    def _promising(self) -> bool:
        return bool(self._open) and -self._open[0][0] >= self.target

    def _take(self, parts: list[GroupPart], steps: int) -> None:
        """Bound parts, look at what they would take, and keep those still open."""
        steps = max(_LEAST_STEPS, int(steps * min(1.0, self.cover.size / _SMALL)))
        several: list[GroupPart] = []
        for part in parts:
            only = only_selection(part, self.n_sets)
            if only is None:
                several.append(part)
            else:
                self._offer(only)
        for part in self._bounds.lowered(several, steps):
            if part.costliest.size:
                self._offer(part.costliest)
            if part.bound >= self.target:
                heapq.heappush(self._open, (-part.bound, next(self._names), part))

    def _offer(self, chosen: NDArray[np.int64]) -> None:
        self.budget.spend(64.0 * self.cover.good.shape[2] * len(chosen) ** 2)
        weight = self.cover.weight_of(np.sort(chosen))
        if weight >= self.target:
            self.selected, self.weight = np.sort(chosen), weight
            self.target = weight + self.cover.grain

    def _likeness(self) -> NDArray[np.float32]:
        """Return the weighted Jaccard index of what sets see, shape (n_s, n_s)."""
        if self._alike is None:
            sees, weights = self.cover.sees.astype(np.float32), self.cover.weights
            scale = max(1.0, float(weights.sum()) / float(1 << 23))
            whole = np.maximum(np.floor(weights / scale), 1.0).astype(np.float32)
            both = (sees * whole) @ sees.T
            alone = both.diagonal()
            either = np.maximum(alone[:, None] + alone[None, :] - both, 1.0)
            # A set that sees nothing is alike to itself at least.
            alike = np.asarray(both / either, dtype=np.float32)
            np.fill_diagonal(alike, 1.0)
            self._alike = alike
            self.budget.spend(sees.size * len(sees) / 16.0)
        return self._alike
