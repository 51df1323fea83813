"""Fewest sets, most weight of K sets: several needs of a row, several row sets.

From above: greedy and exchanges. From below: Lagrangian bound, all pairs,
HiGHS' branch and bound. Each spends a share of one counted budget.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from solvers.covers.answers import (
    INTEGER_PROOF,
    NONE,
    CountAnswer,
    WeightAnswer,
    cut_short,
)
from solvers.covers.bounds.lagrangian import ascend
from solvers.covers.bounds.mixed_integer import TOLERANCE, fits, heaviest_integer
from solvers.covers.bounds.reductions import ReducedCover
from solvers.covers.bounds.relaxation import coverage_bounds, rounding, tighten
from solvers.covers.count_ledger import CountLedger
from solvers.covers.exact.pairs import any_pair, pair_proof
from solvers.covers.search.neighbourhood import greedy, prune
from solvers.status import SolveStatus, WorkBudget

from .multicover_swaps import exchange, worth_of

# Sets of which all selections are looked at.
_MOST_EXHAUSTED = 2


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
    ledger = CountLedger(cover, prune(cover, greedy(cover, NONE, budget)), max_sets)
    _improve(ledger, budget.part(0.2 * budget.units), seed)
    ascending = budget.part(0.25 * budget.units)
    ledger.by_multipliers(
        lambda n_sets, start: (
            ascend(cover, start, ascending, target=0.0, n_sets=n_sets).multipliers
        )
    )

    def exhaust(
        n_sets: int, part: WorkBudget
    ) -> tuple[NDArray[np.int64] | None, str | None]:
        if n_sets > _MOST_EXHAUSTED:
            return None, None
        search = any_pair(cover, n_sets, part)
        return search.selected, pair_proof(n_sets) if search.complete else None

    def heavier(
        n_sets: int, start: NDArray[np.int64], part: WorkBudget
    ) -> NDArray[np.int64]:
        if start.size:
            return _heavier(cover, start, part, seed)
        return heaviest_of(cover, n_sets, part, seed=seed).selected

    ledger.by_exact_search(exhaust, budget)
    return ledger.closed(heavier, budget, heaviest=heaviest)


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


def _improve(ledger: CountLedger, budget: WorkBudget, seed: int) -> None:
    """Look for fewer sets by exchanges."""
    cover = ledger.cover

    def search(start: NDArray[np.int64]) -> NDArray[np.int64]:
        kicks = 20 + 10 * start.size
        return exchange(
            cover, start, budget, seed=seed, max_kicks=kicks, heaviest=False
        )

    ledger.improve(lambda some: worth_of(cover, some), search)


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
