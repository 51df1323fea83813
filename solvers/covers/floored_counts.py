"""Fewest sets that cover what is required of all, and floors of row sets beside it.

What is required of all comes first: its searches are fast, and its bound holds for the
stricter cover, as does that of the floor which takes most sets by itself. Where what
they choose misses a floor, sets that miss none are looked for at prices of the row
sets, halving the gap between those bounds and the sets known; from below, counts are
refuted by the exact search at those prices, at last by HiGHS' branch and bound.
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from solvers.covers.bounds.mixed_integer import branch_and_bound, fits
from solvers.covers.bounds.reduced_cover import ReducedCover
from solvers.covers.exact.group_branching import best_by_groups
from solvers.covers.search.neighbourhood import better, greedy, prune
from solvers.covers.search.prices import Prices, lack, least_shortage, tightest
from solvers.status import SolveStatus, WorkBudget

from .answers import FLOORS_COUNTED, HARDEST, INTEGER_PROOF, NONE, Answer
from .counts import fewest_sets
from .heaviest import closed, group_proof

# Share of the work on the total by itself; where a floor takes more sets than it.
_TOTAL_ALONE = (0.5, 0.1)


def fewest_with_floors(
    cover: ReducedCover,
    budget: WorkBudget,
    *,
    seed: int,
    max_sets: int | None = None,
    heaviest: bool = True,
) -> Answer:
    """Find the fewest sets of a cover with floors of costs 1, with a lower bound.

    But for floors it is simple. All sets together meet the requirement.
    """
    alone = cover.without_floors
    floor, count = _hardest(cover, budget)
    # What floors ask for alone, the total's proof needn't know.
    share = _TOTAL_ALONE[count > greedy(alone, NONE, budget).size]
    part = budget.part(share * budget.units)
    found = fewest_sets(alone, part, seed=seed, heaviest=False)
    # Of nothing that is lacking the search takes one set all the same.
    total_bound = found.bound if alone.required > 0 else 0.0
    if not cover.meets(found.selected):
        part = budget.part(0.2 * budget.remaining)
        hardest = fewest_sets(floor, part, seed=seed, heaviest=False)
        if hardest.bound > found.bound:
            proof = f"{hardest.proof}, {HARDEST}"
            found = replace(found, bound=hardest.bound, proof=proof)
        starts = found.selected, hardest.selected
        selected, prices = _from_above(cover, starts, budget, seed)
        found = replace(found, status=SolveStatus.FEASIBLE, selected=selected)
        found = _from_below(cover, found, prices, budget)
    found = closed(cover, found, budget, seed, max_sets, heaviest=heaviest)
    return replace(found, total_bound=total_bound)


def _hardest(cover: ReducedCover, budget: WorkBudget) -> tuple[ReducedCover, int]:
    """Return the row set whose floor by itself takes most sets, greedily, and them."""
    alone = (cover.of_row_set(g) for g in np.flatnonzero(cover.quotas).tolist())
    counted = ((one, greedy(one, NONE, budget).size) for one in alone)
    return max(counted, key=lambda each: each[1], default=(cover.without_floors, 0))


def _from_above(
    cover: ReducedCover,
    starts: tuple[NDArray[np.int64], NDArray[np.int64]],
    budget: WorkBudget,
    seed: int,
) -> tuple[NDArray[np.int64], list[Prices]]:
    """Return few sets that meet all, and prices at which fewer were looked for.

    From sets that meet the total, and such that meet the hardest floor.
    """
    free, hard = starts
    begun = (prune(cover, greedy(cover, first, budget)) for first in (NONE, hard))
    few, least = min(begun, key=len), max(free.size, hard.size)
    prices = [Prices.even(cover)]
    # Halving the gap: what fails costs all its work, and most counts between do fail
    # where floors ask for many more sets than the total does.
    while least < few.size:
        count = (least + few.size) // 2
        part = budget.part(0.3 * budget.remaining)
        shorter = few
        while shorter.size > count:
            without = [np.delete(shorter, i) for i in range(shorter.size)]
            shorter = min(without, key=lambda s: lack(cover, s))
        filled = greedy(cover, free, budget, n_sets=count)
        start = min(shorter, filled, key=lambda s: lack(cover, s))
        selected, prices = least_shortage(cover, start, part, seed, enough=True)
        if cover.meets(selected):
            few = prune(cover, selected)
        else:
            least = count + 1
    return few, prices


def _from_below(
    cover: ReducedCover, found: Answer, prices: list[Prices], budget: WorkBudget
) -> Answer:
    """Refute counts, or find fewer sets on the way."""
    selected, lower, proof = found.selected, int(found.bound), found.proof
    while lower < selected.size and not budget.exhausted:
        part = budget.part(0.2 * budget.remaining)
        tight, multipliers = tightest(prices, lower, cover.required, part)
        answer = best_by_groups(
            cover,
            lower,
            target=cover.required,
            multipliers=multipliers,
            budget=budget.part(0.7 * budget.remaining),
            first=True,
            prices=tight,
        )
        if answer.selected is not None:
            selected = answer.selected
        elif not answer.complete:
            break
        else:
            proof = f"{group_proof(lower)}, {FLOORS_COUNTED}"
            lower += 1
    if lower < selected.size and fits(cover):
        integers = branch_and_bound(cover, selected, budget)
        if integers.selected is not None:
            selected = better(cover, selected, integers.selected)
        bound = math.ceil((integers.bound or 0.0) - 1e-5)
        if bound > lower:
            lower, proof = bound, f"{INTEGER_PROOF}, {FLOORS_COUNTED}"
    return replace(found, selected=selected, bound=float(lower), proof=proof)
