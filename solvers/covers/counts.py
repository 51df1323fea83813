"""Fewest sets of a simple cover: the order in which the methods are tried.

From above: greedy, then swaps (`neighbourhood`). From below: Lagrangian bound, then
exact search, over pairs or over groups of alike sets, then HiGHS' branch and bound.
Covers of every row have searches of their own (``full``). Each method offers a smaller
cover or proves one set more, says how, and spends a share of one counted budget.
"""

import math

import numpy as np

from solvers.covers.bounds.lagrangian import tighten
from solvers.covers.bounds.mixed_integer import branch_and_bound, fits
from solvers.covers.bounds.reduced_cover import ReducedCover
from solvers.covers.bounds.relaxation import count_bound
from solvers.covers.full.full_cover import fewest_full
from solvers.covers.search.neighbourhood import (
    better,
    greedy,
    most_coverage,
    moves,
    prune,
)
from solvers.status import SolveStatus, WorkBudget

from .answers import INTEGER_PROOF, NONE, Answer
from .heaviest import closed, exact_search

# Work after which the first bounds are asked whether more search is worth it.
_FIRST_UNITS = 4e8


def fewest_sets(
    cover: ReducedCover,
    budget: WorkBudget,
    *,
    seed: int,
    max_sets: int | None = None,
    heaviest: bool = True,
) -> Answer:
    """Find the fewest sets of a simple cover of costs 1, with a lower bound.

    All sets together meet the requirement.
    """
    search = _CountSearch(cover, budget, max_sets)
    if cover.full:
        known = search.selected
        full = fewest_full(cover, budget, seed=seed, start=known, lower=search.lower)
        search.selected = full.selected
        search.prove(int(full.bound), full.proof)
        # All rows are covered.
        heaviest = False
    else:
        search.run(seed)
    lower = float(search.lower)
    found = Answer(SolveStatus.FEASIBLE, search.selected, lower, search.proof)
    return closed(cover, found, budget, seed, max_sets, heaviest=heaviest)


class _CountSearch:
    """Cover from above, bound from below and its proof."""

    def __init__(
        self, cover: ReducedCover, budget: WorkBudget, max_sets: int | None
    ) -> None:
        self.cover, self.budget = cover, budget
        self.selected = prune(cover, greedy(cover, NONE, budget))
        self.cap = cover.n_sets if max_sets is None else max_sets
        self.multipliers = cover.weights
        self.lower, self.proof = 1, "a positive weight needs a set"
        self.prove(count_bound(cover, self.multipliers), "sum of the largest sets")

    def run(self, seed: int) -> None:
        budget, whole = self.budget, self.budget.units
        self.improve(budget.part(min(0.02 * whole, _FIRST_UNITS)), seed)
        self.by_multipliers(budget.part(0.25 * whole))
        self.improve(budget.part(0.15 * whole), seed)
        self.by_tuples()
        if not self.settled and fits(self.cover):
            self.by_integers()
        while not self.settled and not budget.exhausted:
            seed += 1
            self.improve(budget, seed)

    @property
    def settled(self) -> bool:
        return self.lower >= min(self.selected.size, self.cap + 1)

    def prove(self, bound: int, proof: str) -> None:
        if bound > self.lower:
            self.lower, self.proof = bound, proof

    def improve(self, budget: WorkBudget, seed: int) -> None:
        """Take a set out and search from there, while that gives a cover."""
        cover = self.cover
        while self.selected.size > self.lower:
            without = [np.delete(self.selected, i) for i in range(self.selected.size)]
            start = max(without, key=cover.weight_of)
            n, need = moves(start.size), cover.required
            fewer = most_coverage(
                cover, start, budget, target=need, seed=seed, max_moves=n
            )
            if not cover.meets(fewer):
                break
            self.selected = prune(cover, fewer)

    def by_multipliers(self, budget: WorkBudget) -> None:
        """Refute counts by multipliers while a descent from the last ones does it."""
        cover, required = self.cover, self.cover.required
        while not self.settled:
            count, start = self.lower, self.multipliers
            self.multipliers = tighten(cover, count, required, start, budget)
            self.prove(count_bound(cover, self.multipliers), "Lagrangian bound")
            if self.lower == count:
                break

    def by_tuples(self) -> None:
        """Exhaust the tuples of as many sets as the bound, then of one more."""
        while not self.settled:
            search, proof = exact_search(self.lower)
            answer = search(
                self.cover,
                self.lower,
                target=self.cover.required,
                multipliers=self.multipliers,
                budget=self.budget.part(0.7 * self.budget.remaining),
                first=True,
            )
            if answer.selected is not None:
                self.selected = answer.selected
            elif answer.complete:
                self.prove(self.lower + 1, proof)
            else:
                break

    def by_integers(self) -> None:
        answer = branch_and_bound(self.cover, self.selected, self.budget)
        if answer.selected is not None:
            self.selected = better(self.cover, self.selected, answer.selected)
        if answer.bound is not None:
            proved = math.ceil(answer.bound - 1e-5)
            # A bound above a cover that was counted here is none.
            if proved <= self.selected.size:
                self.prove(proved, INTEGER_PROOF)
