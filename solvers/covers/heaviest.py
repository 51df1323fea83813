"""Most weight of K sets: the order in which the methods are tried.

From below: greedy, then swaps (`neighbourhood`) or, where rows have several needs or
row sets, exchanges. From above: Lagrangian bound, then exact search, over pairs or over
groups of alike sets, or else HiGHS' branch and bound. Each spends a share of one
counted budget.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from solvers.covers.bounds.lagrangian import tighten
from solvers.covers.bounds.mixed_integer import TOLERANCE, fits, heaviest_integer
from solvers.covers.bounds.reductions import ReducedCover
from solvers.covers.bounds.relaxation import coverage_bounds, rounding
from solvers.covers.exact.group_branching import best_by_groups
from solvers.covers.exact.pairs import best_pair, pair_proof
from solvers.covers.search.exchanges import exchange
from solvers.covers.search.neighbourhood import (
    FIRST_MOVES,
    greedy,
    most_coverage,
    moves,
)
from solvers.status import SolveStatus, WorkBudget

from .answers import INTEGER_PROOF, NONE, ExactSearch, WeightAnswer, cut_short

# Pairs are exhausted by a matrix product; groups are for more sets.
_LEAST_GROUPED = 3


def most_weight(
    cover: ReducedCover,
    n_sets: int,
    budget: WorkBudget,
    *,
    seed: int,
    start: NDArray[np.int64] = NONE,
) -> WeightAnswer:
    """Find the most weight that K sets cover, whatever is required, and a bound."""
    n_sets = min(n_sets, cover.n_sets)
    if n_sets == 0:
        return WeightAnswer(SolveStatus.OPTIMAL, NONE, 0.0, "no set is allowed")
    best = NONE
    for first in (start, NONE) if start.size else (NONE,):
        filled = greedy(cover, first, budget, n_sets=n_sets)
        best = max(best, filled, key=cover.weight_of)
    search = _of_simple if cover.simple else _of_any
    return search(cover, n_sets, best, budget, seed)


def exact_search(n_sets: int) -> tuple[Callable[..., ExactSearch], str]:
    """Return the search that exhausts K sets of a simple cover, and what it proves."""
    if n_sets < _LEAST_GROUPED:
        return best_pair, pair_proof(n_sets)
    return best_by_groups, f"sets of {n_sets} by branching on groups of alike sets"


def _of_simple(
    cover: ReducedCover,
    n_sets: int,
    best: NDArray[np.int64],
    budget: WorkBudget,
    seed: int,
) -> WeightAnswer:
    kicks = budget.part(0.4 * budget.units)
    best = most_coverage(
        cover, best, kicks, target=cover.total, seed=seed, max_moves=FIRST_MOVES
    )
    weight = cover.weight_of(best)
    if weight >= cover.total:
        proof = "all that any set covers is covered"
        return WeightAnswer(SolveStatus.OPTIMAL, best, weight, proof)
    least = max(cover.grain, np.floor(cover.total * 1e-11))
    part = budget.part(0.2 * budget.units)
    step = tighten(cover, n_sets, weight + least, cover.weights, part)
    upper = float(coverage_bounds(cover, step.multipliers)[n_sets])
    if upper >= weight + least:
        # No more is to be had than the last whole grain below the bound.
        best = most_coverage(
            cover,
            best,
            kicks,
            target=upper - upper % cover.grain,
            seed=seed + 1,
            max_moves=moves(n_sets),
        )
        weight = cover.weight_of(best)
    if upper < weight + least:
        return WeightAnswer(SolveStatus.OPTIMAL, best, weight, "Lagrangian bound")
    search, proof = exact_search(n_sets)
    answer = search(
        cover,
        n_sets,
        target=weight + least,
        multipliers=step.multipliers,
        budget=budget.part(budget.remaining),
    )
    if answer.selected is not None:
        best, weight = answer.selected, answer.weight
    upper = max(weight, min(upper, answer.upper_bound))
    if answer.complete:
        return WeightAnswer(SolveStatus.OPTIMAL, best, weight, proof)
    proof = cut_short("Lagrangian bound", budget)
    return WeightAnswer(SolveStatus.FEASIBLE, best, upper, proof)


def _of_any(
    cover: ReducedCover,
    n_sets: int,
    best: NDArray[np.int64],
    budget: WorkBudget,
    seed: int,
) -> WeightAnswer:
    free = replace(cover, quotas=np.zeros(cover.quotas.size))
    if best.size:
        part = budget.part(0.4 * budget.units)
        best = exchange(free, best, part, seed=seed, heaviest=True)
    part = budget.part(0.2 * budget.units)
    step = tighten(cover, n_sets, 0.0, cover.weights, part)
    upper = float(coverage_bounds(cover, step.multipliers)[n_sets])
    proof = "Lagrangian bound"
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


def heavier(
    cover: ReducedCover, selected: NDArray[np.int64], budget: WorkBudget, seed: int
) -> NDArray[np.int64]:
    """Return as many sets of more weight that meet the requirements too."""
    n_sets = selected.size
    if cover.simple:
        return most_weight(cover, n_sets, budget, seed=seed, start=selected).selected
    other = exchange(cover, selected, budget, seed=seed, heaviest=True)
    if fits(cover):
        answer = heaviest_integer(cover, other, budget, n_sets=n_sets)
        if answer.selected is not None and answer.selected.size <= n_sets:
            proposals = [other, answer.selected]
            other = max(filter(cover.meets, proposals), key=cover.weight_of)
    return other
