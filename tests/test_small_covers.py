"""Every kind of cover against trying all selections, whole and cut."""

import os

import numpy as np
import pytest
from tests.small_covers import by_hand, small_cover

from solvers import solve_cover
from solvers.cover import solve_max_coverage
from solvers.status import SolveStatus

# The benchmark runs 10,000 of them.
_INSTANCES = int(os.environ.get("RINGRIG_SMALL_COVERS", "1000"))
_PART = 100


def check(seed):
    """Hold one instance against the truth; return its kind, for the statistics."""
    problem = small_cover(seed)
    truth = by_hand(problem)
    least, n_s = truth.least_cost[-1], problem.costs.size
    whole = solve_cover(problem)
    _check_cover(whole, least, cut=False)
    if problem.unit_costs and np.isfinite(least):
        assert whole.covered_weight == pytest.approx(truth.heaviest, rel=1e-9)
    budget = float(10.0 ** np.random.default_rng(seed).uniform(3, 8))
    _check_cover(solve_cover(problem, budget=budget), least, cut=True)

    k = max(1, problem.fixed.size, seed % (n_s + 1))
    few = solve_cover(problem, max_sets=k)
    if np.isfinite(truth.least_cost[k]):
        _check_cover(few, truth.least_cost[k], cut=False)
        assert few.selected.size <= k
    else:
        assert few.status is SolveStatus.INFEASIBLE
        assert few.lower_bound <= least * (1 + 1e-9)
        if np.isfinite(least):
            assert few.covered_weight == pytest.approx(truth.most_weight[k])
    most = solve_max_coverage(problem, k)
    assert set(problem.fixed) <= set(most.selected)
    assert most.selected.size <= k
    assert most.status is SolveStatus.OPTIMAL
    assert most.covered_weight == pytest.approx(truth.most_weight[k])
    rough = solve_max_coverage(problem, k, budget=budget)
    assert rough.covered_weight <= truth.most_weight[k] * (1 + 1e-9)
    assert rough.upper_bound >= truth.most_weight[k] * (1 - 1e-9)


def _check_cover(solution, least, *, cut):
    problem = solution.problem
    assert set(problem.fixed) <= set(solution.selected)
    if not np.isfinite(least):
        assert solution.status is SolveStatus.INFEASIBLE
        assert solution.lower_bound == np.inf
        assert solution.covered_weight == pytest.approx(problem.best_weight)
        return
    assert solution.shortfall() == 0.0
    assert solution.lower_bound <= least * (1 + 1e-9)
    if not cut:
        assert solution.status is SolveStatus.OPTIMAL
    if solution.status is SolveStatus.OPTIMAL:
        assert solution.cost == pytest.approx(least)
        assert solution.lower_bound == pytest.approx(least)
    else:
        assert "cut by" in solution.proof


@pytest.mark.parametrize("first", range(0, _INSTANCES, _PART))
def test_equals_trying_all(first):
    for seed in range(first, first + _PART):
        try:
            check(seed)
        except Exception as error:
            error.add_note(f"instance {seed}")
            raise
