"""What is known of a count: a cover from above, a bound from below.

Both count searches (``counts``, ``multicover``) keep this book; every method either
offers a smaller cover or proves one set more, and says how.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solvers.covers.bounds.mixed_integer import fits, solve_integer
from solvers.covers.bounds.reductions import ReducedCover
from solvers.covers.bounds.relaxation import count_bound
from solvers.covers.search.neighbourhood import prune
from solvers.status import SolveStatus, WorkBudget

from .answers import INTEGER_PROOF, NONE, CountAnswer, better, cut_short

# K sets that meet the requirements or None; what exhausted all K-tuples, or None.
TupleSearch = Callable[[int, WorkBudget], tuple[NDArray[np.int64] | None, str | None]]
# K sets of much weight, from a cover of as many or from nothing.
HeaviestSearch = Callable[[int, NDArray[np.int64], WorkBudget], NDArray[np.int64]]
# Share of the budget that more weight at the same count may cost on top.
_HEAVIEST = 0.3


class CountLedger:
    """Cover, bound and proof of the fewest sets under search.

    Attributes:
        cover: The cover; costs don't count.
        selected: The smallest cover found, indices of the reduced cover.
        cap: Sets allowed.
        lower: Sets known to be necessary.
        proof: What proves it.
    """

    def __init__(
        self,
        cover: ReducedCover,
        selected: NDArray[np.int64],
        max_sets: int | None,
    ) -> None:
        self.cover = cover
        self.selected = selected
        self.cap = cover.n_sets if max_sets is None else max_sets
        self.lower, self.proof = 1, "a positive weight needs a set"
        self.prove(
            count_bound(cover, cover.weights / cover.needs), "sum of the largest sets"
        )

    @property
    def settled(self) -> bool:
        """Whether no smaller cover is left, or none that is allowed."""
        return self.lower >= min(self.selected.size, self.cap + 1)

    def prove(self, bound: int, proof: str) -> None:
        """Raise the bound."""
        if bound > self.lower:
            self.lower, self.proof = bound, proof

    def by_multipliers(
        self,
        ascend: Callable[[int, NDArray[np.float64]], NDArray[np.float64]],
    ) -> NDArray[np.float64]:
        """Refute counts by multipliers while an ascent from the last ones does it."""
        multipliers = self.cover.weights / self.cover.needs
        while not self.settled:
            before = self.lower
            multipliers = ascend(before, multipliers)
            self.prove(count_bound(self.cover, multipliers), "Lagrangian bound")
            if self.lower == before:
                break
        return multipliers

    def improve(
        self,
        worth: Callable[[NDArray[np.int64]], Any],
        search: Callable[[NDArray[np.int64]], NDArray[np.int64]],
    ) -> None:
        """Take a set out and search from there, while that gives a cover."""
        while self.selected.size > self.lower:
            without = [np.delete(self.selected, i) for i in range(self.selected.size)]
            fewer = search(max(without, key=worth))
            if not self.cover.meets(fewer):
                break
            self.selected = prune(self.cover, fewer)

    def by_exact_search(self, exhaust: TupleSearch, budget: WorkBudget) -> None:
        """Exhaust few sets, then leave a small program to HiGHS."""
        self._by_tuples(exhaust, budget)
        if not self.settled:
            self._by_integers(budget)

    def _by_tuples(self, tuples: TupleSearch, budget: WorkBudget) -> None:
        """Exhaust the tuples of as many sets as the bound, then of one more."""
        while not self.settled:
            part = budget.part(0.7 * budget.remaining)
            found, proof = tuples(self.lower, part)
            if found is not None:
                self.selected = found
            elif proof is not None:
                self.prove(self.lower + 1, proof)
            else:
                break

    def _by_integers(self, budget: WorkBudget) -> None:
        """Leave a small program to HiGHS."""
        if not fits(self.cover):
            return
        answer = solve_integer(self.cover, self.selected, budget)
        self.selected = better(self.cover, self.selected, answer.selected)
        if answer.bound is not None:
            proved = math.ceil(answer.bound - 1e-5)
            # A bound above a cover that was counted here is none.
            if proved <= self.selected.size:
                self.prove(proved, INTEGER_PROOF)

    def closed(
        self, search: HeaviestSearch, budget: WorkBudget, *, heaviest: bool
    ) -> CountAnswer:
        """Return the answer, of most weight where that is asked for.

        Args:
            search: For more weight.
            budget: The whole, to say what cut it.
            heaviest: Whether to look for more weight at the same count.
        """
        selected, settled = self.selected, self.lower >= self.selected.size
        status = SolveStatus.OPTIMAL if settled else SolveStatus.FEASIBLE
        # Its own allowance, so that a hard proof doesn't cost the larger area.
        spare = budget.part(np.inf)
        spare.units = _HEAVIEST * budget.units
        if selected.size > self.cap:
            settled = self.lower > self.cap
            status = SolveStatus.INFEASIBLE if settled else SolveStatus.UNKNOWN
            selected = search(self.cap, NONE, spare)
        elif heaviest and selected.size:
            selected = search(selected.size, selected, spare)
        proof = self.proof if settled else cut_short(self.proof, budget)
        return CountAnswer(status, selected, float(self.lower), proof)
