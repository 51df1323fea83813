"""Fewest sets, most weight of K sets: several needs of a row, several row sets.

From above: greedy and exchanges. From below: Lagrangian bound, exact search over
K-tuples, HiGHS' branch and bound. Each spends a share of one counted budget.
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from .answers import INTEGER_PROOF, NONE, CountAnswer, WeightAnswer, better, cut_short
from .exact_multicover import any_tuple
from .lagrangian import ascend
from .mixed_integer import TOLERANCE, fits, heaviest_integer, solve_integer
from .multicover_swaps import exchange, worth_of
from .neighbourhood import greedy, prune
from .reductions import ReducedCover
from .relaxation import count_bound, coverage_bounds, rounding, tighten
from .status import SolveStatus, WorkBudget

_LARGE_COUNT = 8


def fewest_multicover(
    cover: ReducedCover,
    budget: WorkBudget,
    *,
    seed: int,
    max_sets: int | None = None,
    heaviest: bool = True,
) -> CountAnswer:
    """Find the fewest sets that meet all requirements, with a lower bound.

    Args:
        cover: A cover whose sets together meet the requirements; costs don't count.
        budget: Counted work.
        seed: Seed of the exchanges.
        max_sets: Sets allowed.
        heaviest: Whether to look for more weight at the same count.
    """
    cover = replace(cover, costs=np.ones(cover.n_sets))
    selected = prune(cover, greedy(cover, NONE, budget))
    cap = cover.n_sets if max_sets is None else max_sets
    multipliers = cover.weights / cover.needs
    lower, proof = 1, "a positive weight needs a set"
    sized = count_bound(cover, multipliers)
    if sized > lower:
        lower, proof = sized, "sum of the largest sets"
    selected = _improve(cover, selected, lower, budget.part(0.2 * budget.units), seed)

    ascending = budget.part(0.25 * budget.units)
    while lower < min(selected.size, cap + 1):
        step = ascend(cover, multipliers, ascending, target=0.0, n_sets=lower)
        multipliers = step.multipliers
        proved = count_bound(cover, multipliers)
        if proved <= lower:
            break
        lower, proof = proved, "Lagrangian bound"

    methods = [_by_tuples, _by_integers]
    for method in methods if lower < _LARGE_COUNT else methods[::-1]:
        if lower < min(selected.size, cap + 1):
            selected, proved, how = method(
                cover, selected, lower, cap, multipliers, budget
            )
            lower, proof = (proved, how) if proved > lower else (lower, proof)
    return _closed(
        cover, selected, lower, proof, budget, seed=seed, cap=cap, heaviest=heaviest
    )


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
    spare = budget.part(np.inf)
    spare.units = 0.3 * budget.units
    if selected.size > cap:
        settled = lower > cap
        status = SolveStatus.INFEASIBLE if settled else SolveStatus.UNKNOWN
        selected = heaviest_of(cover, cap, spare, seed=seed).selected
    else:
        settled = lower >= selected.size
        status = SolveStatus.OPTIMAL if settled else SolveStatus.FEASIBLE
        if heaviest and selected.size:
            selected = _heavier(cover, selected, spare, seed)
    proof = proof if settled else cut_short(proof, budget)
    return CountAnswer(status, selected, float(lower), proof)


def heaviest_of(
    cover: ReducedCover,
    n_sets: int,
    budget: WorkBudget,
    *,
    seed: int,
    start: NDArray[np.int64] = NONE,
) -> WeightAnswer:
    """Find the most weight that K sets cover, whatever is required."""
    free = replace(cover, quotas=np.zeros(cover.quotas.size))
    n_sets = min(n_sets, cover.n_sets)
    if n_sets == 0:
        return WeightAnswer(SolveStatus.OPTIMAL, NONE, 0.0, "no set is allowed")
    best = NONE
    for first in (start, NONE) if start.size else (NONE,):
        filled = greedy(free, first, budget, n_sets=n_sets)
        best = max(best, filled, key=cover.weight_of)
    part = budget.part(0.4 * budget.units)
    if best.size:
        best = exchange(
            free, best, part, seed=seed, max_kicks=20 + 10 * n_sets, heaviest=True
        )
    upper, proof = _weight_bound(cover, n_sets, budget), "Lagrangian bound"
    # Less than this is rounding, not weight.
    least = max(cover.grain, 2.0 * rounding(cover.weights.size) * cover.total)
    if upper >= cover.weight_of(best) + least and fits(cover):
        answer = heaviest_integer(free, best, budget, n_sets=n_sets)
        if answer.selected is not None and answer.selected.size <= n_sets:
            best = max(best, answer.selected, key=cover.weight_of)
        if answer.bound is not None and answer.bound < upper:
            upper, proof = answer.bound, INTEGER_PROOF
            least = max(least, 2.0 * TOLERANCE * cover.total)
    weight = cover.weight_of(best)
    if upper < weight + least:
        return WeightAnswer(SolveStatus.OPTIMAL, best, weight, proof)
    return WeightAnswer(SolveStatus.FEASIBLE, best, upper, cut_short(proof, budget))


def _weight_bound(cover: ReducedCover, n_sets: int, budget: WorkBudget) -> float:
    """Return a weight that no K sets exceed, by multipliers."""
    service = sparse.csr_array(cover.by_set.multiply(1.0 / cover.needs[None]))
    step = tighten(
        service,
        cover.weights,
        n_sets,
        0.0,
        cover.weights,
        budget.part(0.2 * budget.units),
    )
    return float(coverage_bounds(cover, step.multipliers)[n_sets])


def _improve(
    cover: ReducedCover,
    selected: NDArray[np.int64],
    lower: int,
    budget: WorkBudget,
    seed: int,
) -> NDArray[np.int64]:
    """Return a cover of fewer sets while exchanges find one."""
    while selected.size > max(lower, 1):
        without = [np.delete(selected, i) for i in range(selected.size)]
        start = max(without, key=lambda some: worth_of(cover, some))
        fewer = exchange(
            cover,
            start,
            budget,
            seed=seed,
            max_kicks=20 + 10 * start.size,
            heaviest=False,
        )
        if not cover.meets(fewer):
            break
        selected = prune(cover, fewer)
    return selected


def _heavier(
    cover: ReducedCover, selected: NDArray[np.int64], budget: WorkBudget, seed: int
) -> NDArray[np.int64]:
    """Return as many sets of more weight that meet the requirements too."""
    other = exchange(
        cover,
        selected,
        budget,
        seed=seed,
        max_kicks=20 + 10 * selected.size,
        heaviest=True,
    )
    if fits(cover):
        answer = heaviest_integer(cover, other, budget, n_sets=selected.size)
        if answer.selected is not None and answer.selected.size <= selected.size:
            proposals = [other, answer.selected]
            other = max(filter(cover.meets, proposals), key=cover.weight_of)
    return other


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
        search = any_tuple(
            cover, lower, multipliers, budget.part(0.7 * budget.remaining)
        )
        if search.selected is not None:
            selected = search.selected
        elif search.complete:
            lower, proof = lower + 1, f"sets of {lower} by branch and bound"
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
    proved = lower if answer.bound is None else math.ceil(answer.bound - 1e-5)
    # A bound above a cover that was counted here is none.
    return selected, proved if proved <= selected.size else lower, INTEGER_PROOF
