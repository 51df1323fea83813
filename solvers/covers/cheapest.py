"""Cheapest sets, and fewest where rows have several needs or row sets.

Drop and repair from above, the linear program from below, then HiGHS' branch and bound.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from solvers.covers.bounds.mixed_integer import (
    branch_and_bound,
    fits,
    linear_multipliers,
)
from solvers.covers.bounds.reduced_cover import ReducedCover
from solvers.covers.bounds.relaxation import cost_bound
from solvers.covers.search.neighbourhood import better, cheapest, greedy
from solvers.status import SolveStatus, WorkBudget

from .answers import INTEGER_PROOF, NONE, Answer
from .counts import fewest_sets
from .heaviest import SETTLED, closed

_KICKS = 600


def cheapest_sets(
    cover: ReducedCover,
    budget: WorkBudget,
    *,
    seed: int,
    max_sets: int | None = None,
    heaviest: bool = True,
) -> Answer:
    """Find the cheapest sets that meet what can be met, with a lower bound.

    If more than ``max_sets`` are proved necessary, the selection is that of most
    weight, the bound that of any cover. More weight is looked for where all cost 1.
    """
    counting = bool(np.all(cover.costs == 1.0))
    start, limit = greedy(cover, NONE, budget), None
    if max_sets is not None and not counting:
        # Whether so few can do at all.
        limit, part = max_sets, budget.part(0.3 * budget.units)
        equal = replace(cover, costs=np.ones(cover.n_sets))
        search = fewest_sets if cover.simple else cheapest_sets
        few = search(equal, part, seed=seed, max_sets=max_sets, heaviest=False)
        if few.status is SolveStatus.INFEASIBLE:
            return replace(few, bound=_linear_bound(cover, budget, None)[0])
        if few.status is not SolveStatus.UNKNOWN:
            start = few.selected
    found = _searched(cover, start, budget, seed, limit)
    return closed(cover, found, budget, seed, max_sets, heaviest=heaviest)


def _searched(
    cover: ReducedCover,
    start: NDArray[np.int64],
    budget: WorkBudget,
    seed: int,
    max_sets: int | None,
) -> Answer:
    selected = cheapest(
        cover,
        start,
        budget.part(0.2 * budget.units),
        seed=seed,
        max_kicks=_KICKS,
        max_sets=max_sets,
    )
    lower, proof = _linear_bound(cover, budget, max_sets)
    if lower < cover.costs[selected].sum() * (1.0 - 1e-9) and fits(cover):
        answer = branch_and_bound(cover, selected, budget, max_sets=max_sets)
        if answer.selected is not None:
            selected = better(cover, selected, answer.selected, max_sets)
        bound = 0.0 if answer.bound is None else answer.bound
        # A bound above a cover that was counted here is none.
        if lower < bound <= cover.costs[selected].sum() * (1.0 + SETTLED):
            lower, proof = bound, INTEGER_PROOF
    if np.all(cover.costs == 1.0):
        lower = min(float(np.ceil(lower - 1e-5)), float(selected.size))
    return Answer(SolveStatus.FEASIBLE, selected, lower, proof)


def _linear_bound(
    cover: ReducedCover, budget: WorkBudget, max_sets: int | None
) -> tuple[float, str]:
    lower, proof = float(cover.costs.min()), "a positive weight needs a set"
    multipliers = linear_multipliers(cover, budget.part(0.5 * budget.remaining))
    if multipliers is not None:
        bound = cost_bound(cover, multipliers, max_sets=max_sets)
        if bound > lower:
            lower, proof = bound, "linear relaxation"
    return lower, proof
