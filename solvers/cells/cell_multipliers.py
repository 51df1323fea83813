"""Multipliers that refute a number of poses, with cells split where they are used.

The frontier is the set of cells that aren't split; it holds every pose. One round
solves the program over the cells in hand and takes in hand what of the frontier is
costlier than the program knew. Where nothing is, cells that the fractional cover uses,
and with them the costliest others, are split: a child's cost is at most its parent's,
so the bound can only rise.
"""

from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from solvers.bit_rows import unpack_rows
from solvers.status import WorkBudget

from .cell_problem import WholeRows
from .cell_program import MultiplierProgram
from .cell_store import CellStore

_TAKEN = 40
_POLISH = 8
_SPLIT = 100
# Splitting goes on while it leaves at most this share of what was too costly: errors
# halve with the size of cells, so that less would never close the gap.
_WORTH = 0.6
_TOLERANCE = 1e-6
# Rounds of splits after which a descent that hardly moves is given up, and its pace.
_LOOK_BACK = 4
_PATIENCE = 4.0


class MultiplierSearch:
    """Raises the bound; holds the best multipliers so far.

    Attributes:
        multipliers: The best, integers, shape (n_rows,).
        largest_cost: Largest lambda(S) of the frontier then, hence of all poses.
        ratio: need(lambda) / M by these; at least so many poses, not rounded.
        bound: The same, rounded up; inf if no number of poses is enough.
    """

    def __init__(self, whole: WholeRows, store: CellStore, budget: WorkBudget) -> None:
        self._whole, self._store, self._budget = whole, store, budget
        self._program = MultiplierProgram(whole, budget)
        self.multipliers, self.largest_cost = np.zeros_like(whole.weights), 0
        self.ratio, self.bound, self._need = Fraction(0), 0.0, Fraction(0)
        self._drilled = self.multipliers
        start = whole.weights / np.maximum(whole.needs, 1)
        self._record(start, store.frontier)

    def refute(self, n_poses: int) -> bool:
        """Look for multipliers by which so many poses aren't enough."""
        self._program.set_count(n_poses)
        ratios: list[float] = []
        while self.bound <= n_poses and not self._budget.exhausted:
            self._drill(n_poses)
            if self.bound > n_poses:
                break
            moved = self._descend(n_poses)
            ratios.append(float(self.ratio))
            if not moved or _stalls(ratios, n_poses):
                break
        return self.bound > n_poses

    def _drill(self, n_poses: int) -> None:
        if self.multipliers is self._drilled:
            return
        allowed = float(self._need) / n_poses
        gap = self.largest_cost - allowed
        while self.bound <= n_poses and not self._budget.exhausted:
            frontier = self._store.frontier
            costs = self._store.costs(frontier, self.multipliers)
            split = self._split(frontier[costs >= allowed + 0.5 * gap])
            frontier = self._store.frontier
            costs = self._store.costs(frontier, self.multipliers)
            self._measure(int(costs.max(initial=0)))
            before, gap = gap, self.largest_cost - allowed
            if not split or gap >= _WORTH * before:
                self._drilled = self.multipliers
                break

    def _descend(self, n_poses: int) -> bool:
        """Solve the program over the frontier, then split what it uses.

        Cells in hand bound the program from below. As soon as they alone reach the
        requirement, the frontier refutes nothing; where none of those used can be
        split, no multipliers do, and a few more rounds only improve ``most``.
        """
        polish = _POLISH
        while polish and not self._budget.exhausted:
            proposal = self._program.solve()
            if proposal is None:
                return False
            frontier = self._store.frontier
            costs = self._record(proposal.multipliers, frontier)
            if self.bound > n_poses:
                return True
            reached = proposal.value > _TOLERANCE * self._whole.weights.size
            final = reached and not np.any(self._store.may_split(proposal.used))
            polish -= final
            if final or not reached:
                if self._take(frontier, costs):
                    continue
                if final:
                    return False
            costly = frontier[np.argsort(-costs, kind="stable")[:_SPLIT]]
            return self._split(np.union1d(proposal.used, costly))
        return False

    def _record(
        self, proposed: NDArray[np.float64], frontier: NDArray[np.int64]
    ) -> NDArray[np.int64]:
        """Keep multipliers if they are the best; return the costs."""
        multipliers = self._whole.multipliers(proposed)
        costs = self._store.costs(frontier, multipliers)
        need = self._whole.least_cost(multipliers)
        largest_cost = int(costs.max(initial=0))
        self._budget.spend(2e3 * multipliers.size)
        if need / max(1, largest_cost) > self.ratio:
            self.multipliers, self._need = multipliers, need
            self._measure(largest_cost)
        return costs

    def _measure(self, largest_cost: int) -> None:
        self.largest_cost = largest_cost
        self.ratio = self._need / max(1, largest_cost)
        self.bound = self._whole.count_bound(self.multipliers, largest_cost)

    def _take(self, frontier: NDArray[np.int64], costs: NDArray[np.int64]) -> bool:
        """Take in hand the costliest cells that break the program, if any does."""
        in_hand = np.isin(frontier, self._program.cells)
        known = int(costs[in_hand].max(initial=0))
        order = np.argsort(-np.where(in_hand, -1, costs), kind="stable")[:_TAKEN]
        cells = frontier[order[costs[order] > known * (1.0 + _TOLERANCE)]]
        cells = cells[~np.isin(cells, self._program.cells)]
        if cells.size == 0:
            return False
        rows = unpack_rows(self._store.rows[cells], self._whole.weights.size)
        self._program.add(cells, rows)
        return True

    def _split(self, cells: NDArray[np.int64]) -> bool:
        """Split cells, in hand or not; say if any could."""
        before = self._store.size
        self._store.split(cells)
        self._program.drop(cells[self._store.is_split(cells)])
        return self._store.size > before


def _stalls(ratios: list[float], n_poses: int) -> bool:
    """Whether the rounds so far move too slowly to refute so many poses."""
    if len(ratios) <= _LOOK_BACK:
        return False
    return n_poses - ratios[-1] > _PATIENCE * (ratios[-1] - ratios[-1 - _LOOK_BACK])
