"""Most weight of K sets: the order in which the methods are tried.

From below: greedy, then swaps (`neighbourhood`). From above: Lagrangian bound, then
exact search, over pairs or over groups of alike sets; where floors of row sets aren't
met by that, the same at prices of the row sets; where rows have several needs or row
sets, HiGHS' branch and bound. Each spends a share of one counted budget. Where a stock
binds, exact searches leave it out: what they find counts where it is in stock, what
they refute is refuted all the same.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from solvers.covers.bounds.lagrangian import tighten
from solvers.covers.bounds.mixed_integer import TOLERANCE, branch_and_bound, fits
from solvers.covers.bounds.reduced_cover import ReducedCover
from solvers.covers.bounds.relaxation import (
    coverage_bounds,
    rounding,
    sets_worth_taking,
)
from solvers.covers.exact.floored_pairs import least_lacking
from solvers.covers.exact.group_branching import best_by_groups
from solvers.covers.exact.pairs import best_pair
from solvers.covers.search.neighbourhood import (
    FIRST_MOVES,
    greedy,
    most_coverage,
    moves,
)
from solvers.covers.search.prices import lack, least_shortage, tightest
from solvers.status import SolveStatus, WorkBudget

from .answers import (
    FLOORS_COUNTED,
    IN_STOCK,
    INTEGER_PROOF,
    NONE,
    Answer,
    ExactSearch,
    cut_short,
)

# Relative to the cost; HiGHS' own tolerance is below it.
SETTLED = 1e-5
# Share of the budget that more weight at the same count may cost on top.
_HEAVIEST = 0.3
# Pairs are exhausted by a matrix product; groups are for more sets.
_LEAST_GROUPED = 3


def most_weight(
    cover: ReducedCover,
    n_sets: int,
    budget: WorkBudget,
    *,
    seed: int,
    start: NDArray[np.int64] = NONE,
) -> Answer:
    """Find the most weight that K sets cover, whatever is required, and a bound.

    With floors, of those that lack least of them.
    """
    n_sets = min(n_sets, cover.n_sets)
    if n_sets == 0:
        return Answer(SolveStatus.OPTIMAL, NONE, 0.0, "no set is allowed")
    if cover.limited:
        return _of_stock(cover, n_sets, budget, seed, start)
    if cover.floored and cover.without_floors.simple:
        return _of_floored(cover, n_sets, budget, seed, start)
    best = NONE
    for first in (start, NONE) if start.size else (NONE,):
        filled = greedy(cover, first, budget, n_sets=n_sets)
        best = max(best, filled, key=cover.weight_of)
    if cover.simple:
        return _of_simple(cover, n_sets, best, budget, seed)
    return _of_any(cover, n_sets, best, budget)


def exact_search(n_sets: int) -> tuple[Callable[..., ExactSearch], str]:
    """Return the search that exhausts K sets of a simple cover, and its proof."""
    if n_sets >= _LEAST_GROUPED:
        return best_by_groups, group_proof(n_sets)
    sets = "single sets" if n_sets == 1 else "pairs"
    return best_pair, f"{sets} by exhaustion"


def group_proof(n_sets: int) -> str:
    """Return what proves that no K sets do, by groups."""
    return f"sets of {n_sets} by branching on groups of alike sets"


def _of_simple(
    cover: ReducedCover,
    n_sets: int,
    best: NDArray[np.int64],
    budget: WorkBudget,
    seed: int,
) -> Answer:
    kicks = budget.part(0.4 * budget.units)
    best = most_coverage(
        cover, best, kicks, target=cover.total, seed=seed, max_moves=FIRST_MOVES
    )
    weight = cover.weight_of(best)
    if weight >= cover.total:
        proof = "all that any set covers is covered"
        return Answer(SolveStatus.OPTIMAL, best, weight, proof)
    least = max(cover.grain, np.floor(cover.total * 1e-11))
    part = budget.part(0.2 * budget.units)
    multipliers = tighten(cover, n_sets, weight + least, cover.weights, part)
    upper = float(coverage_bounds(cover, multipliers)[n_sets])
    if upper < weight + least:
        return Answer(SolveStatus.OPTIMAL, best, weight, "Lagrangian bound")
    worth = sets_worth_taking(cover, n_sets, multipliers, weight + least)
    some = np.union1d(best, worth)
    few = cover.of_sets(some)
    # No more is to be had than the last whole grain below the bound.
    best = most_coverage(
        few,
        np.searchsorted(some, best),
        kicks,
        target=upper - upper % cover.grain,
        seed=seed + 1,
        max_moves=moves(n_sets),
    )
    best = some[best]
    weight = cover.weight_of(best)
    if upper < weight + least:
        return Answer(SolveStatus.OPTIMAL, best, weight, "Lagrangian bound")
    search, proof = exact_search(n_sets)
    answer = search(
        few,
        n_sets,
        target=weight + least,
        multipliers=multipliers,
        budget=budget.part(budget.remaining),
    )
    if answer.selected is not None:
        best, weight = some[answer.selected], answer.weight
    upper = max(weight, min(upper, answer.upper_bound))
    if answer.complete:
        return Answer(SolveStatus.OPTIMAL, best, weight, proof)
    proof = cut_short("Lagrangian bound", budget)
    return Answer(SolveStatus.FEASIBLE, best, upper, proof)


def _of_floored(
    cover: ReducedCover,
    n_sets: int,
    budget: WorkBudget,
    seed: int,
    start: NDArray[np.int64],
) -> Answer:
    alone = cover.without_floors
    part = budget.part(0.5 * budget.units)
    free = most_weight(alone, n_sets, part, seed=seed, start=start)
    best = free.selected
    if np.all(cover.covered_by(best) >= cover.quotas):
        return free
    if (few := least_lacking(cover, n_sets, budget)) is not None:
        if not cover.meets(few):
            return Answer(SolveStatus.FEASIBLE, few, free.bound, free.proof, free.bound)
        proof = f"{exact_search(n_sets)[1]}, {FLOORS_COUNTED}"
        weight = cover.weight_of(few)
        return Answer(SolveStatus.OPTIMAL, few, weight, proof, free.bound)
    part = budget.part(0.4 * budget.remaining)
    for first in (best, greedy(cover, start, budget, n_sets=n_sets)):
        lacks_less, prices = least_shortage(cover, first, part, seed)
        best = min(best, lacks_less, key=lambda s: lack(cover, s))
    met, target, weight = cover.meets(best), cover.required, cover.weight_of(best)
    if met:
        target = weight + max(cover.grain, np.floor(cover.total * 1e-11))
    part = budget.part(0.3 * budget.remaining)
    tight, multipliers = tightest(prices, n_sets, target, part)
    answer = best_by_groups(
        cover,
        n_sets,
        target=target,
        multipliers=multipliers,
        budget=budget.part(budget.remaining),
        prices=tight,
    )
    if answer.selected is not None:
        best, weight, met = answer.selected, answer.weight, True
    if met and answer.complete:
        proof = f"{group_proof(n_sets)}, {FLOORS_COUNTED}"
        return Answer(SolveStatus.OPTIMAL, best, weight, proof, free.bound)
    upper = max(weight, min(free.bound, answer.upper_bound)) if met else free.bound
    proof = cut_short(free.proof, budget)
    return Answer(SolveStatus.FEASIBLE, best, upper, proof, free.bound)


def _of_stock(
    cover: ReducedCover,
    n_sets: int,
    budget: WorkBudget,
    seed: int,
    start: NDArray[np.int64],
) -> Answer:
    """Most weight of sets in stock, under the bounds of any and of those in stock."""
    part = budget.part(0.5 * budget.units)
    free = most_weight(cover.without_stock, n_sets, part, seed=seed, start=start)
    if np.all(cover.left(free.selected) >= 0):
        return free
    kicks, best = budget.part(0.5 * budget.remaining), NONE
    firsts = (cover.in_stock(free.selected), cover.in_stock(start), ())
    for first in dict.fromkeys(firsts):
        known = np.array(first, dtype=np.int64)
        filled = greedy(cover, known, budget, n_sets=n_sets)
        swapped = most_coverage(
            cover,
            filled,
            kicks,
            target=cover.total,
            seed=seed,
            max_moves=moves(n_sets),
        )
        if cover.floored:
            swapped = min(
                swapped,
                least_shortage(cover, swapped, kicks, seed)[0],
                key=lambda s: lack(cover, s),
            )
        best = min(best, swapped, key=lambda s: lack(cover, s))
    alone = cover.without_floors if cover.floored else cover
    weight, upper, proof = cover.weight_of(best), free.bound, free.proof
    least = max(cover.grain, np.floor(cover.total * 1e-11))
    part = budget.part(budget.remaining)
    multipliers = tighten(alone, n_sets, weight + least, alone.weights, part)
    bound = float(coverage_bounds(alone, multipliers)[: n_sets + 1][-1])
    if bound < upper:
        upper, proof = bound, IN_STOCK
    met = cover.meets(best) or not cover.floored
    if met and upper < weight + least:
        return Answer(SolveStatus.OPTIMAL, best, weight, proof, free.total_bound)
    proof = cut_short(proof, budget)
    return Answer(SolveStatus.FEASIBLE, best, upper, proof, free.total_bound)


def _of_any(
    cover: ReducedCover, n_sets: int, best: NDArray[np.int64], budget: WorkBudget
) -> Answer:
    part = budget.part(0.2 * budget.units)
    multipliers = tighten(cover, n_sets, 0.0, cover.weights, part)
    upper = float(coverage_bounds(cover, multipliers)[n_sets])
    proof = "Lagrangian bound"
    # Less than this is rounding, not weight.
    least = max(cover.grain, 2.0 * rounding(cover.weights.size) * cover.total)
    if upper >= cover.weight_of(best) + least and fits(cover):
        free = replace(cover, quotas=np.zeros(cover.quotas.size))
        answer = branch_and_bound(free, best, budget, max_sets=n_sets, heaviest=True)
        if answer.selected is not None and answer.selected.size <= n_sets:
            best = max(best, answer.selected, key=cover.weight_of)
        if answer.bound is not None and answer.bound < upper:
            upper, proof = answer.bound, INTEGER_PROOF
            least = max(least, 2.0 * TOLERANCE * cover.total)
    weight = cover.weight_of(best)
    if upper < weight + least:
        return Answer(SolveStatus.OPTIMAL, best, weight, proof)
    return Answer(SolveStatus.FEASIBLE, best, upper, cut_short(proof, budget))


def heavier(
    cover: ReducedCover, selected: NDArray[np.int64], budget: WorkBudget, seed: int
) -> NDArray[np.int64]:
    """Return as many sets of more weight that meet the requirements too."""
    n_sets = selected.size
    if cover.simple:
        return most_weight(cover, n_sets, budget, seed=seed, start=selected).selected
    if not fits(cover):
        return selected
    other = branch_and_bound(
        cover, selected, budget, max_sets=n_sets, heaviest=True
    ).selected
    if other is None or other.size > n_sets or not cover.meets(other):
        return selected
    return max(selected, other, key=cover.weight_of)


def closed(
    cover: ReducedCover,
    found: Answer,
    budget: WorkBudget,
    seed: int,
    max_sets: int | None,
    *,
    heaviest: bool,
) -> Answer:
    """Return the answer about a cover found, of most weight where that is asked for."""
    selected, lower, proof = found.selected, found.bound, found.proof
    counting = bool(np.all(cover.costs == 1.0))
    cost = float(cover.costs[selected].sum())
    settled = lower >= cost * (1.0 - SETTLED)
    status = SolveStatus.OPTIMAL if settled else SolveStatus.FEASIBLE
    # Its own allowance, so that a hard proof doesn't cost the larger area.
    spare = budget.part(np.inf)
    spare.units = _HEAVIEST * budget.units
    if max_sets is not None and selected.size > max_sets:
        settled = counting and lower > max_sets
        status = SolveStatus.INFEASIBLE if settled else SolveStatus.UNKNOWN
        selected = most_weight(cover, max_sets, spare, seed=seed).selected
    else:
        lower = cost if settled else lower
        if counting and heaviest and selected.size:
            selected = heavier(cover, selected, spare, seed)
    proof = proof if settled else cut_short(proof, budget)
    return Answer(status, selected, lower, proof)
