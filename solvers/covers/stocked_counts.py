"""Fewest sets of a cover whose kinds have a stock.

The stock is left out first: those searches are fast and exact, and their bound holds
for any stock. Where what they choose isn't in stock, as many sets that are in stock are
looked for, then one more, and so on; from below, counts are refuted by multipliers that
count the stock, at last by HiGHS' branch and bound.
"""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from solvers.covers.bounds.lagrangian import tighten
from solvers.covers.bounds.mixed_integer import branch_and_bound, fits
from solvers.covers.bounds.reduced_cover import ReducedCover
from solvers.covers.bounds.relaxation import coverage_bounds
from solvers.covers.search.neighbourhood import better, prune
from solvers.status import SolveStatus, WorkBudget

from .answers import IN_STOCK, INTEGER_PROOF, NONE, Answer
from .heaviest import closed, most_weight


def fewest_in_stock(
    cover: ReducedCover,
    budget: WorkBudget,
    search: Callable[..., Answer],
    *,
    seed: int,
    max_sets: int | None = None,
    heaviest: bool = True,
) -> Answer:
    """Find the fewest sets in stock that meet the requirement, with a lower bound.

    `search` finds them without a stock. Where none in stock were found to meet it, the
    status is ``UNKNOWN``, or ``INFEASIBLE`` if none can, and the selection has most
    weight.
    """
    free, part = cover.without_stock, budget.part(0.4 * budget.units)
    found = search(free, part, seed=seed, heaviest=False)
    if np.any(cover.left(found.selected) < 0):
        found = _from_above(cover, found, budget, seed)
        found = _from_below(cover, found, budget)
        if not cover.meets(found.selected):
            return found
    total_bound = found.total_bound
    found = closed(cover, found, budget, seed, max_sets, heaviest=heaviest)
    return replace(found, total_bound=total_bound)


def _from_above(
    cover: ReducedCover, free: Answer, budget: WorkBudget, seed: int
) -> Answer:
    """Return the fewest in stock that were found to meet all, or most weight."""
    best, status = NONE, SolveStatus.UNKNOWN
    last = min(int(cover.stock.sum()), cover.n_sets)
    for count in range(min(free.selected.size, last), last + 1):
        part = budget.part(0.2 * budget.remaining)
        best = most_weight(cover, count, part, seed=seed, start=best).selected
        if cover.meets(best):
            best, status = prune(cover, best), SolveStatus.FEASIBLE
            break
        if best.size < count:
            break
    return replace(free, status=status, selected=best)


def _from_below(cover: ReducedCover, found: Answer, budget: WorkBudget) -> Answer:
    """Refute counts by what is in stock, or find fewer on the way."""
    selected, lower, proof = found.selected, int(found.bound), found.proof
    met = cover.meets(selected)
    last = selected.size if met else int(cover.stock.sum()) + 1
    alone = cover.without_floors if cover.floored else cover
    multipliers, required = alone.weights, alone.required
    while lower < last and not budget.exhausted:
        part = budget.part(0.2 * budget.remaining)
        multipliers = tighten(alone, lower, required, multipliers, part)
        if coverage_bounds(alone, multipliers)[: lower + 1][-1] >= required:
            break
        lower, proof = lower + 1, IN_STOCK
    if lower < last and fits(cover):
        start = selected if met else NONE
        integers = branch_and_bound(cover, start, budget)
        other = NONE if integers.selected is None else integers.selected
        if np.all(cover.left(other) >= 0) and cover.meets(other):
            selected = better(cover, selected, other) if met else prune(cover, other)
            met, last = True, selected.size
        bound = math.ceil((integers.bound or 0.0) - 1e-5)
        if lower < bound <= last:
            lower, proof = bound, f"{INTEGER_PROOF}, stock counted"
    status = SolveStatus.FEASIBLE if met else found.status
    if not met and lower == last:
        status, lower = SolveStatus.INFEASIBLE, np.inf
    return replace(
        found, status=status, selected=selected, bound=float(lower), proof=proof
    )
