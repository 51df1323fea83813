"""Fewest sets, and most weight of K sets: the order in which the methods are tried.

From above: greedy, swaps, large-neighbourhood search. From below: Lagrangian bound,
then exact search over K-tuples. Each spends a share of one counted budget.
"""

import math

import numpy as np
from numpy.typing import NDArray

from .answers import INTEGER_PROOF, NONE, CountAnswer, WeightAnswer, better, cut_short
from .exact_cover import TupleSearch, best_tuple
from .full_cover import fewest_full
from .mixed_integer import fits, solve_integer
from .neighbourhood import greedy, most_coverage, prune
from .reductions import ReducedCover
from .relaxation import count_bound, coverage_bounds, tighten
from .status import SolveStatus, WorkBudget

_LARGE_COUNT = 8
# Moves before a bound is asked whether more are worth it; after that, for each set.
_FIRST_MOVES = 60
_MOVES_A_SET = 50
# Work after which the first bounds are asked whether more search is worth it.
_FIRST_UNITS = 4e8


def fewest_sets(
    cover: ReducedCover,
    budget: WorkBudget,
    *,
    seed: int,
    max_sets: int | None = None,
    heaviest: bool = True,
) -> CountAnswer:
    """Find the fewest sets that reach the required weight, with a lower bound.

    Args:
        cover: A cover whose sets together reach the required weight.
        budget: Counted work.
        seed: Seed of the neighbourhood search.
        max_sets: Sets allowed.
        heaviest: Whether to look for more weight at the same count.
    """
    selected = prune(cover, greedy(cover, NONE, budget))
    cap = cover.n_sets if max_sets is None else max_sets
    lower, proof = 1, "a positive weight needs a set"
    multipliers = cover.weights
    sized = count_bound(cover, multipliers)
    if sized > lower:
        lower, proof = sized, "sum of the largest sets"

    def closed(selected: NDArray[np.int64], lower: int, proof: str) -> CountAnswer:
        heavier = heaviest and not cover.full
        return _closed(
            cover, selected, lower, proof, budget, seed=seed, cap=cap, heaviest=heavier
        )

    if cover.full:
        full = fewest_full(cover, budget, seed=seed, start=selected, lower=lower)
        if full.lower_bound > lower:
            lower, proof = int(full.lower_bound), full.proof
        return closed(full.selected, lower, proof)
    first = min(0.02 * budget.units, _FIRST_UNITS)
    selected = _improve(cover, selected, lower, budget.part(first), seed)

    lagrangian = budget.part(0.25 * budget.units)
    while lower < min(selected.size, cap + 1):
        step = tighten(
            cover.by_set, cover.weights, lower, cover.required, multipliers, lagrangian
        )
        multipliers = step.multipliers
        proved = count_bound(cover, multipliers)
        if proved <= lower:
            break
        lower, proof = proved, "Lagrangian bound"
    selected = _improve(cover, selected, lower, budget.part(0.15 * budget.units), seed)

    # Tuples are for small counts, branch and bound on rows and cuts for large ones.
    methods = [_by_tuples, _by_integers]
    for method in methods if lower < _LARGE_COUNT else methods[::-1]:
        if lower < min(selected.size, cap + 1):
            part = budget.part(0.8 * budget.remaining)
            selected, proved, how = method(
                cover, selected, lower, cap, multipliers, part
            )
            lower, proof = (proved, how) if proved > lower else (lower, proof)
    again = seed
    while lower < min(selected.size, cap + 1) and not budget.exhausted:
        again += 1
        selected = _improve(cover, selected, lower, budget, again)
    return closed(selected, lower, proof)


def _closed(
    cover: ReducedCover,
    selected: NDArray[np.int64],
    lower: int,
    proof: str,
    budget: WorkBudget,
    *,
    seed: int,
    cap: int,
    heaviest: bool,
) -> CountAnswer:
    """Return the answer, of most weight where that is asked for."""
    if selected.size > cap:
        status = SolveStatus.INFEASIBLE if lower > cap else SolveStatus.UNKNOWN
        settled, start = lower > cap, NONE
    else:
        settled, start = lower >= selected.size, selected
        status = SolveStatus.OPTIMAL if settled else SolveStatus.FEASIBLE
    if selected.size > cap or heaviest:
        # Its own allowance, so that a hard proof doesn't cost the larger area.
        spare = budget.part(np.inf)
        spare.units = 0.3 * budget.units
        size = min(selected.size, cap)
        selected = most_weight(cover, size, spare, seed=seed, start=start).selected
    proof = proof if settled else cut_short(proof, budget)
    return CountAnswer(status, selected, float(lower), proof)


def most_weight(
    cover: ReducedCover,
    n_sets: int,
    budget: WorkBudget,
    *,
    seed: int,
    start: NDArray[np.int64] = NONE,
) -> WeightAnswer:
    """Find the most weight that K sets cover, with an upper bound."""
    n_sets = min(n_sets, cover.n_sets)
    if n_sets == 0:
        return WeightAnswer(SolveStatus.OPTIMAL, NONE, 0.0, "no set is allowed")
    best = NONE
    for first in (start, NONE) if start.size else (NONE,):
        filled = greedy(cover, first, budget, n_sets=n_sets)
        best = max(best, filled, key=cover.weight_of)
    kicks = budget.part(0.4 * budget.units)
    best = most_coverage(
        cover, best, kicks, target=cover.total, seed=seed, max_moves=_FIRST_MOVES
    )
    weight = cover.weight_of(best)
    if weight >= cover.total:
        proof = "all that any set covers is covered"
        return WeightAnswer(SolveStatus.OPTIMAL, best, weight, proof)
    least = max(cover.grain, np.floor(cover.total * 1e-11))
    part = budget.part(0.2 * budget.units)
    step = tighten(
        cover.by_set, cover.weights, n_sets, weight + least, cover.weights, part
    )
    upper = float(coverage_bounds(cover, step.multipliers)[n_sets])
    if upper >= weight + least:
        # No more is to be had than the last whole grain below the bound.
        best = most_coverage(
            cover,
            best,
            kicks,
            target=upper - upper % cover.grain,
            seed=seed + 1,
            max_moves=_FIRST_MOVES + _MOVES_A_SET * n_sets,
        )
        weight = cover.weight_of(best)
    if upper < weight + least:
        return WeightAnswer(SolveStatus.OPTIMAL, best, weight, "Lagrangian bound")
    search = best_tuple(
        cover,
        n_sets,
        target=weight + least,
        multipliers=step.multipliers,
        budget=budget.part(budget.remaining),
    )
    if search.selected is not None:
        best, weight = search.selected, search.weight
    if search.complete:
        return WeightAnswer(
            SolveStatus.OPTIMAL, best, weight, _tuple_proof(n_sets, search)
        )
    upper = max(weight, min(upper, search.upper_bound))
    proof = cut_short("Lagrangian bound", budget)
    return WeightAnswer(SolveStatus.FEASIBLE, best, upper, proof)


def _by_tuples(
    cover: ReducedCover,
    selected: NDArray[np.int64],
    lower: int,
    cap: int,
    multipliers: NDArray[np.float64],
    budget: WorkBudget,
) -> tuple[NDArray[np.int64], int, str]:
    """Exhaust the tuples of as many sets as the bound, then of one more."""
    proof = ""
    while lower < min(selected.size, cap + 1):
        search = best_tuple(
            cover,
            lower,
            target=cover.required,
            multipliers=multipliers,
            budget=budget.part(0.7 * budget.remaining),
            first=True,
        )
        if search.selected is not None:
            selected = search.selected
        elif search.complete:
            lower, proof = lower + 1, _tuple_proof(lower, search)
        else:
            break
    return selected, lower, proof


def _by_integers(
    cover: ReducedCover,
    selected: NDArray[np.int64],
    lower: int,
    cap: int,
    multipliers: NDArray[np.float64],
    budget: WorkBudget,
) -> tuple[NDArray[np.int64], int, str]:
    """Leave a small program to HiGHS."""
    if not fits(cover):
        return selected, lower, ""
    answer = solve_integer(cover, selected, budget)
    selected = better(cover, selected, answer.selected)
    if answer.bound is None:
        return selected, lower, ""
    proved = math.ceil(answer.bound / float(cover.costs[0]) - 1e-5)
    # A bound above a cover that was counted here is none.
    return selected, proved if proved <= selected.size else lower, INTEGER_PROOF


def _improve(
    cover: ReducedCover,
    selected: NDArray[np.int64],
    lower: int,
    budget: WorkBudget,
    seed: int,
) -> NDArray[np.int64]:
    """Return a cover of fewer sets while the neighbourhood search finds one."""
    while selected.size > lower:
        without = [np.delete(selected, i) for i in range(selected.size)]
        start = max(without, key=cover.weight_of)
        fewer = most_coverage(
            cover,
            start,
            budget,
            target=cover.required,
            seed=seed,
            max_moves=_FIRST_MOVES + _MOVES_A_SET * start.size,
        )
        if cover.weight_of(fewer) < cover.required:
            break
        selected = prune(cover, fewer)
    return selected


def _tuple_proof(n_sets: int, search: TupleSearch) -> str:
    if n_sets == 1:
        return "single sets by exhaustion"
    if search.pairs_only and n_sets == 2:
        return "pairs by exhaustion"
    return f"sets of {n_sets} by branch and bound"
