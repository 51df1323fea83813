"""Cheapest sets: heuristic, linear and Lagrangian bound, HiGHS' branch and bound."""

from dataclasses import replace

import numpy as np

from solvers.covers.bounds.lagrangian import ascend
from solvers.covers.bounds.mixed_integer import fits, linear_multipliers, solve_integer
from solvers.covers.bounds.reductions import ReducedCover
from solvers.covers.bounds.relaxation import cost_bound
from solvers.covers.search.neighbourhood import cheapest, greedy
from solvers.status import SolveStatus, WorkBudget

from .answers import INTEGER_PROOF, NONE, CountAnswer, better, cut_short
from .counts import fewest_sets

# Relative to the cost; HiGHS' own tolerance is below it.
_SETTLED = 1e-5


def cheapest_sets(
    cover: ReducedCover, budget: WorkBudget, *, seed: int, max_sets: int | None = None
) -> CountAnswer:
    """Find the cheapest sets that meet what is required, with a lower bound.

    Args:
        cover: A cover whose sets together meet the requirements.
        budget: Counted work.
        seed: Seed of the neighbourhood search.
        max_sets: Sets allowed. If more are proved necessary, the selection is that of
            most weight, the bound that of any cover.
    """
    start = greedy(cover, NONE, budget)
    few = None
    if max_sets is not None:
        # Whether so few can do at all.
        part = budget.part(0.3 * budget.units)
        few = fewest_sets(cover, part, seed=seed, max_sets=max_sets, heaviest=False)
    if few is not None and few.status is SolveStatus.INFEASIBLE:
        lower, _ = _linear_bound(cover, budget, np.inf, None)
        return replace(few, lower_bound=lower)
    if few is not None and few.status is not SolveStatus.UNKNOWN:
        start = few.selected
    selected = cheapest(
        cover,
        start,
        budget.part(0.2 * budget.units),
        seed=seed,
        max_kicks=300,
        max_sets=max_sets,
    )
    if few is not None and max_sets is not None and selected.size > max_sets:
        lower, proof = _linear_bound(cover, budget, np.inf, max_sets)
        proof = cut_short(proof, budget)
        return CountAnswer(SolveStatus.UNKNOWN, few.selected, lower, proof)
    cost = float(cover.costs[selected].sum())
    lower, proof = _linear_bound(cover, budget, cost, max_sets)
    if lower < cost * (1.0 - 1e-9) and fits(cover):
        answer = solve_integer(cover, selected, budget, max_sets=max_sets)
        other = better(cover, selected, answer.selected)
        if max_sets is None or other.size <= max_sets:
            selected = other
        cost = float(cover.costs[selected].sum())
        # A bound above a cover that was counted here is none.
        bound = 0.0 if answer.bound is None else answer.bound
        if lower < bound <= cost * (1.0 + _SETTLED):
            lower, proof = bound, INTEGER_PROOF
    settled = lower >= cost * (1.0 - _SETTLED)
    status = SolveStatus.OPTIMAL if settled else SolveStatus.FEASIBLE
    proof = proof if settled else cut_short(proof, budget)
    return CountAnswer(status, selected, cost if settled else lower, proof)


def _linear_bound(
    cover: ReducedCover, budget: WorkBudget, cost: float, max_sets: int | None
) -> tuple[float, str]:
    """Return the better of the bounds by linear program and by ascent, and its name."""
    lower, proof = float(cover.costs.min()), "a positive weight needs a set"
    multipliers = linear_multipliers(cover, budget.part(0.5 * budget.remaining))
    if multipliers is not None:
        bound = cost_bound(cover, multipliers, max_sets=max_sets)
        if bound > lower:
            lower, proof = bound, "linear relaxation"
    if lower < cost * (1.0 - 1e-9):
        start = np.zeros(cover.weights.size) if multipliers is None else multipliers
        part = budget.part(0.2 * budget.remaining)
        step = ascend(cover, start, part, target=min(cost, 1e300))
        bound = cost_bound(cover, step.multipliers, max_sets=max_sets)
        if bound > lower:
            lower, proof = bound, "Lagrangian bound"
    return lower, proof
