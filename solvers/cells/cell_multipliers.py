"""Multipliers that refute a number of poses, with cells split where they cost too much.

The program's rows are poses: those that are known, and cells that can't be split, which
stand for poses. They are few and lie where they matter, so its multipliers are nearly
those of all poses. By them, cells of the frontier that cost too much are split, the
costliest first; the frontier is the set of cells that aren't split, and holds every
pose. Either none of it costs too much any more, and the number is refuted, or cells do
that can't be split, and become rows of the program. Multipliers between the best so far
and those proposed are tried first (Ben-Ameur and Neto, "Acceleration of cutting-plane
and column generation algorithms", Networks 49(1), 2007).
"""

from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from solvers.status import WorkBudget

from .cell_problem import WholeRows
from .cell_store import CellStore
from .known_poses import TOLERANCE, KnownPoses, Proposed

# Cells that can't be split that cost too much, after which others aren't looked at, and
# cells split at a time.
_ENOUGH = 40
_SPLIT = 400
# Where no poses are known: cells below each of which one that can't be split is taken.
_SPREAD = 100
# How far from the best multipliers towards those proposed cells are first looked at:
# proposals leap from one corner of the program to another, and each leap splits others.
_STEP = 0.5


class MultiplierSearch:
    """Raises the bound; holds the best multipliers so far.

    Args:
        whole: What must be served.
        store: Cells that hold every pose.
        budget: Of the search.
        known: Bit rows of some poses, shape (k, n_words). They guide the search, and
            nothing that is proved rests on them. None: none are known.

    Attributes:
        multipliers: The best, integers, shape (n_rows,).
        largest_cost: Largest lambda(S) of the frontier then, hence of all poses.
        ratio: need(lambda) / M by these; at least so many poses, not rounded.
        bound: The same, rounded up; inf if no number of poses is enough.
        out_of_work: Whether the last search ended with the work, not with its cells.
    """

    def __init__(
        self,
        whole: WholeRows,
        store: CellStore,
        budget: WorkBudget,
        known: NDArray[np.uint64] | None = None,
    ) -> None:
        self._whole, self._store, self._budget = whole, store, budget
        rows = store.rows[:0] if known is None else known
        self._poses = KnownPoses(whole, rows, budget)
        self._spread = known is None
        self._taken = np.empty(0, dtype=np.int64)
        self.multipliers, self.largest_cost = np.zeros_like(whole.weights), 0
        self.ratio, self.bound = Fraction(0), 0.0
        self.out_of_work = False
        start = whole.multipliers(whole.weights / np.maximum(whole.needs, 1))
        self._record(start, store.costs(store.frontier, start))

    @property
    def over_known(self) -> float:
        """The most that multipliers prove over the known poses; inf if none are."""
        return self._poses.most_proved

    def refute_most(self, n_poses: int) -> None:
        """Refute at once so many poses, or as many as poses in hand leave room for."""
        while self.bound <= n_poses and self.may_be_enough(n_poses):
            n_poses -= 1
        self.refute(n_poses)

    def may_be_enough(self, n_poses: int) -> bool:
        """Return whether so many poses in hand are, as far as multipliers know."""
        self._prepare(n_poses)
        proposal = self._poses.proposed(n_poses)
        return proposal is not None and proposal.reached

    def refute(self, n_poses: int) -> bool:
        """Look for multipliers by which so many poses aren't enough."""
        self._prepare(n_poses)
        while self.bound <= n_poses and not self._budget.exhausted:
            proposal = self._poses.proposed(n_poses)
            if proposal is None:
                break
            leaves = np.empty(0, dtype=np.int64)
            if self.ratio and not proposal.reached:
                leaves = self._drilled(n_poses, self._between(proposal))
                # Only what costs more than all poses known cuts the proposal off.
                costs = self._store.costs(leaves, proposal.multipliers)
                leaves = leaves[costs > proposal.largest_cost * (1.0 + TOLERANCE)]
            if not leaves.size and self.bound <= n_poses:
                leaves = self._drilled(n_poses, proposal.multipliers)
            # What is in hand already would change nothing.
            leaves = np.setdiff1d(leaves, self._taken)
            if proposal.reached or not leaves.size:
                break
            self._take(leaves)
        self.out_of_work = self._budget.exhausted
        return self.bound > n_poses

    def _between(self, proposal: Proposed) -> NDArray[np.int64]:
        """Return multipliers on the way from the best ones to those proposed."""
        best = self.multipliers / max(1, self.largest_cost)
        proposed = proposal.multipliers / proposal.largest_cost
        return self._whole.multipliers(best + _STEP * (proposed - best))

    def _prepare(self, n_poses: int) -> None:
        if self._spread and self.bound <= n_poses:
            self._take(self._leaves_about())
            self._spread = False

    def _take(self, leaves: NDArray[np.int64]) -> None:
        self._taken = np.concatenate([self._taken, leaves])
        self._poses.append(self._store.rows[leaves])

    def _drilled(
        self, n_poses: int, multipliers: NDArray[np.int64]
    ) -> NDArray[np.int64]:
        """Split what costs too much; return cells that do and can't be split."""
        store = self._store
        # Poses that cost less than this each aren't enough together.
        least = -(-self._whole.least_cost(multipliers) // n_poses)
        cells = store.frontier
        costs = store.costs(cells, multipliers)
        while True:
            over = costs >= least
            splits = over & store.may_split(cells)
            leaves = cells[over & ~splits]
            ended = self._budget.exhausted or store.full
            if ended or leaves.size >= _ENOUGH or not splits.any():
                break
            places = np.flatnonzero(splits)
            places = places[np.argsort(-costs[places], kind="stable")[:_SPLIT]]
            new = store.split(cells[places])
            kept = np.ones(cells.size, dtype=bool)
            kept[places] = ~store.is_split(cells[places])
            cells = np.concatenate([cells[kept], new])
            costs = np.concatenate([costs[kept], store.costs(new, multipliers)])
        self._record(multipliers, costs)
        return leaves

    def _leaves_about(self) -> NDArray[np.int64]:
        """Return cells that can't be split, spread over the tree."""
        store = self._store
        while not store.full:
            spread = store.frontier
            splits = spread[store.may_split(spread)]
            if spread.size >= _SPREAD or not store.split(splits).size:
                break
        cells = store.frontier[:: max(1, store.frontier.size // _SPREAD)]
        while store.split(cells).size:
            split = store.is_split(cells)
            below = [store.children(cell)[:1] for cell in cells[split]]
            cells = np.concatenate([cells[~split], *below])
        return cells[~store.may_split(cells)]

    def _record(self, multipliers: NDArray[np.int64], costs: NDArray[np.int64]) -> None:
        """Keep multipliers, by which the frontier costs so much, if they are better."""
        largest = int(costs.max(initial=0))
        need = self._whole.least_cost(multipliers)
        self._budget.spend(2e3 * multipliers.size)
        if need / max(1, largest) > self.ratio:
            self.multipliers, self.largest_cost = multipliers, largest
            self.ratio = need / max(1, largest)
            self.bound = self._whole.count_bound(multipliers, largest)
