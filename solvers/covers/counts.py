"""Fewest sets, and most weight of K sets: the order in which the methods are tried.

From above: greedy, swaps, large-neighbourhood search. From below: Lagrangian bound,
then exact search, over pairs or over groups of alike sets. Each spends a share of one
counted budget.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from solvers.covers.bounds.reductions import ReducedCover
from solvers.covers.bounds.relaxation import coverage_bounds, tighten
from solvers.covers.exact.group_branching import best_by_groups
from solvers.covers.exact.incumbent import ExactSearch
from solvers.covers.exact.pairs import best_pair, pair_proof
from solvers.covers.full.full_cover import fewest_full
from solvers.covers.search.neighbourhood import greedy, most_coverage, prune
from solvers.status import SolveStatus, WorkBudget

from .answers import NONE, CountAnswer, WeightAnswer, cut_short
from .count_ledger import CountLedger

# Moves before a bound is asked whether more are worth it; after that, for each set.
_FIRST_MOVES = 60
_MOVES_A_SET = 50
# Pairs are exhausted by a matrix product; groups are for more sets.
_LEAST_GROUPED = 3
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
    cover = replace(cover, costs=np.ones(cover.n_sets))
    ledger = CountLedger(cover, prune(cover, greedy(cover, NONE, budget)), max_sets)

    def heavier(
        n_sets: int, start: NDArray[np.int64], part: WorkBudget
    ) -> NDArray[np.int64]:
        return most_weight(cover, n_sets, part, seed=seed, start=start).selected

    if cover.full:
        full = fewest_full(
            cover, budget, seed=seed, start=ledger.selected, lower=ledger.lower
        )
        ledger.selected = full.selected
        ledger.prove(int(full.lower_bound), full.proof)
        return ledger.closed(heavier, budget, heaviest=False)
    _improve(ledger, budget.part(min(0.02 * budget.units, _FIRST_UNITS)), seed)
    ascending = budget.part(0.25 * budget.units)
    multipliers = ledger.by_multipliers(
        lambda n_sets, start: (
            tighten(
                cover.by_set, cover.weights, n_sets, cover.required, start, ascending
            ).multipliers
        )
    )
    _improve(ledger, budget.part(0.15 * budget.units), seed)

    def exhaust(
        n_sets: int, part: WorkBudget
    ) -> tuple[NDArray[np.int64] | None, str | None]:
        search, proof = _exact(n_sets)
        found = search(
            cover,
            n_sets,
            target=cover.required,
            multipliers=multipliers,
            budget=part,
            first=True,
        )
        return found.selected, proof if found.complete else None

    ledger.by_exact_search(exhaust, budget)
    again = seed
    while not ledger.settled and not budget.exhausted:
        again += 1
        _improve(ledger, budget, again)
    return ledger.closed(heavier, budget, heaviest=heaviest)


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
    search, proof = _exact(n_sets)
    found = search(
        cover,
        n_sets,
        target=weight + least,
        multipliers=step.multipliers,
        budget=budget.part(budget.remaining),
    )
    if found.selected is not None:
        best, weight = found.selected, found.weight
    upper = max(weight, min(upper, found.upper_bound))
    if found.complete:
        return WeightAnswer(SolveStatus.OPTIMAL, best, weight, proof)
    proof = cut_short("Lagrangian bound", budget)
    return WeightAnswer(SolveStatus.FEASIBLE, best, upper, proof)


def _improve(ledger: CountLedger, budget: WorkBudget, seed: int) -> None:
    """Look for fewer sets by tabu search."""
    cover = ledger.cover

    def search(start: NDArray[np.int64]) -> NDArray[np.int64]:
        return most_coverage(
            cover,
            start,
            budget,
            target=cover.required,
            seed=seed,
            max_moves=_FIRST_MOVES + _MOVES_A_SET * start.size,
        )

    ledger.improve(cover.weight_of, search)


def _exact(n_sets: int) -> tuple[Callable[..., ExactSearch], str]:
    """Return the search that exhausts K sets, and what it proves."""
    if n_sets < _LEAST_GROUPED:
        return best_pair, pair_proof(n_sets)
    return best_by_groups, f"sets of {n_sets} by branching on groups of alike sets"
