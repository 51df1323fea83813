"""Every kind of cover against trying all selections, whole and cut."""

import itertools
import os
from dataclasses import dataclass, replace

import numpy as np
import pytest

from solvers import CoverProblem, solve_cover
from solvers.covers.cover import solve_max_coverage
from solvers.status import SolveStatus

# The benchmark runs 10,000 of them.
_INSTANCES = int(os.environ.get("RINGRIG_SMALL_COVERS", "24"))
_PART = 12
# Relative; what differs by less is rounding of the sums.
SLACK = 1e-12


def small_cover(seed):
    """Return a cover of at most 12 rows and 7 sets; the seed decides of which kind.

    Full and partial, plain, weighted and weightless rows, equal and differing costs,
    rows needed once to three times, one to three row sets, none to two fixed sets.
    """
    rng = np.random.default_rng([seed, 7])
    n_e, n_s = int(rng.integers(1, 13)), int(rng.integers(1, 8))
    covers = rng.random((n_e, n_s)) < rng.choice([0.2, 0.4, 0.7])
    weights = [None, rng.uniform(0.1, 1.0, n_e), rng.integers(0, 4, n_e).astype(float)]
    costs = [None, rng.uniform(0.5, 1.5, n_s), rng.integers(1, 4, n_s).astype(float)]
    needs = [1, 2, rng.integers(1, 4, n_e)]
    n_g = int(rng.choice([1, 1, 2, 3]))
    row_sets = rng.integers(0, n_g, n_e)
    n_fixed = int(rng.choice([0, 0, 1, 2]))
    problem = CoverProblem(
        covers,
        weights[rng.choice(3, p=[0.3, 0.4, 0.3])],
        costs[rng.choice(3, p=[0.5, 0.3, 0.2])],
        min_coverage=float(rng.choice([0.5, 0.8, 0.9, 1.0])),
        needs=needs[rng.choice(3, p=[0.5, 0.25, 0.25])],
        row_sets=row_sets,
        fixed=rng.choice(n_s, size=min(n_fixed, n_s), replace=False),
    )
    if rng.random() < 0.8:
        # A share of what all sets cover: of everything, few could be covered at all.
        every = problem.covered_weights(np.arange(n_s))
        return replace(problem, required_weight=problem.min_coverage * every)
    return problem


@dataclass(frozen=True)
class Truth:
    """What trying all selections gives.

    Attributes:
        least_cost: Least cost of a cover with at most k sets, for k = 0 ... n_s; inf
            where there is none.
        most_weight: Most weight of at most k sets, the fixed ones included.
        heaviest: Most weight of a cover of the fewest sets.
    """

    least_cost: list[float]
    most_weight: list[float]
    heaviest: float


def by_hand(problem):
    """Return the truth about a small problem, counted from its own arrays."""
    covers = problem.covers.toarray()
    n_s, fixed = covers.shape[1], {int(s) for s in problem.fixed}
    groups = [problem.row_sets == g for g in range(problem.n_row_sets)]
    least, most, heaviest = [], [], -np.inf
    for k in range(n_s + 1):
        cost, weight = (least[-1], most[-1]) if k else (np.inf, -np.inf)
        smallest = not np.isfinite(cost)
        for chosen in itertools.combinations(range(n_s), k):
            if not fixed <= set(chosen):
                continue
            done = covers[:, chosen].sum(axis=1) >= problem.needs
            covered = float(problem.weights[done].sum())
            weight = max(weight, covered)
            slack = SLACK * max(problem.total_weight, problem.required_weight.max())
            if all(
                problem.weights[done & group].sum() >= required - slack
                for group, required in zip(groups, problem.required_weight, strict=True)
            ):
                cost = min(cost, float(problem.costs[list(chosen)].sum()))
                heaviest = max(heaviest, covered) if smallest else heaviest
        least.append(cost)
        most.append(weight)
    return Truth(least, most, heaviest)


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
        assert solution.covered_weight == pytest.approx(
            problem.covered_weight(range(problem.costs.size))
        )
        return
    assert solution.shortfall() == 0.0
    assert solution.lower_bound <= least * (1 + 1e-9)
    if not cut:
        assert solution.status is SolveStatus.OPTIMAL
    if solution.status is SolveStatus.OPTIMAL:
        assert solution.cost == pytest.approx(least)
        assert solution.lower_bound == pytest.approx(least)
    else:
        assert "within the work budget" in solution.proof


@pytest.mark.parametrize("first", range(0, _INSTANCES, _PART))
def test_equals_trying_all(first):
    for seed in range(first, first + _PART):
        try:
            check(seed)
        except Exception as error:
            error.add_note(f"instance {seed}")
            raise
