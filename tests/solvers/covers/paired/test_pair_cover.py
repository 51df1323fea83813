"""Covers by pairs against every selection, on small random problems."""

from itertools import product

import numpy as np
import pytest

from solvers import CoverProblem, SolveStatus, solve_cover
from solvers.covers.paired.pair_cover import solve_most_pairs, solve_pair_cover
from solvers.covers.paired.pair_problem import PairCoverProblem, packed_pairs


def random_problem(seed):
    """A problem of up to 9 sets and 14 elements, with every feature now and then."""
    rng = np.random.default_rng(seed)
    n_e, n_s = int(rng.integers(1, 15)), int(rng.integers(1, 10))
    sees = rng.random((n_e, n_s)) < rng.uniform(0.3, 0.9)
    tables = np.triu(rng.random((n_e, n_s, n_s)) < rng.uniform(0.1, 0.9))
    each = np.arange(n_s)
    tables[:, each, each] &= rng.random((n_e, n_s)) < rng.choice([0.0, 0.2])
    tables |= tables.transpose(0, 2, 1)
    tables &= sees[:, :, None] & sees[:, None, :]
    good = packed_pairs(lambda i: tables[:, i].T, n_s, n_e)
    weights = [np.ones(n_e), rng.integers(0, 5, n_e).astype(float), rng.random(n_e)]
    views = rng.choice([1, 2, 3], p=[0.6, 0.25, 0.15])
    problem = PairCoverProblem(
        sees,
        good,
        weights=weights[rng.integers(3)],
        min_coverage=float(rng.choice([1.0, 0.8, 0.5])),
        views=rng.integers(1, 4, n_e) if rng.random() < 0.2 else views,
        fixed=rng.choice(n_s, rng.integers(0, 2), replace=False),
    )
    return problem, tables


def covered_by_hand(problem, tables, chosen):
    """Which elements selections cover that are rows of 0 and 1, (n, n_e)."""
    pairs = np.einsum("ki,eij,kj->ke", chosen, tables.astype(int), chosen)
    return (pairs > 0) & (chosen @ problem.sees.T.astype(int) >= problem.views)


def most_by_count(problem, tables):
    """The most weight of each number of sets, by looking at all selections."""
    every = np.array(list(product((0, 1), repeat=problem.n_sets)))
    every = every[np.all(every[:, problem.fixed] == 1, axis=1)]
    weights = covered_by_hand(problem, tables, every) @ problem.weights
    counts = every.sum(axis=1)
    return {k: float(weights[counts == k].max()) for k in np.unique(counts).tolist()}


@pytest.mark.parametrize("block", range(2))
def test_fewest_sets_are_those_of_all_selections(block):
    statuses = set()
    for seed in range(160 * block, 160 * block + 160):
        problem, tables = random_problem(seed)
        most = most_by_count(problem, tables)
        need = problem.required_weight * (1.0 - 1e-9)
        enough = [k for k in sorted(most) if most[k] >= need]
        solution = solve_pair_cover(problem, seed=seed)
        statuses.add(solution.status)
        assert set(problem.fixed) <= set(solution.selected)
        if not enough:
            assert solution.status is SolveStatus.INFEASIBLE, seed
            assert solution.covered_weight == pytest.approx(max(most.values()))
            assert solution.shortfall() > 0
            continue
        assert solution.status is SolveStatus.OPTIMAL, seed
        assert len(solution.selected) == enough[0] == solution.lower_bound, seed
        assert solution.shortfall() == 0.0
        chosen = np.isin(np.arange(problem.n_sets), solution.selected).astype(int)
        (hand,) = covered_by_hand(problem, tables, chosen[None])
        np.testing.assert_array_equal(problem.covered(solution.selected), hand)
    assert SolveStatus.OPTIMAL in statuses
    assert SolveStatus.INFEASIBLE in statuses


def test_most_weight_is_that_of_all_selections():
    for seed in range(30):
        problem, tables = random_problem(1000 + seed)
        for k, weight in most_by_count(problem, tables).items():
            solution = solve_most_pairs(problem, k)
            assert solution.status is SolveStatus.OPTIMAL
            assert len(solution.selected) <= k
            assert solution.covered_weight == pytest.approx(weight)
            assert solution.upper_bound == pytest.approx(weight)


def test_bounds_hold_with_no_work_to_spend():
    for seed in range(30):
        problem, tables = random_problem(2000 + seed)
        most = most_by_count(problem, tables)
        need = problem.required_weight * (1.0 - 1e-9)
        fewest = min((k for k in most if most[k] >= need), default=np.inf)
        solution = solve_pair_cover(problem, budget=0.0)
        assert solution.lower_bound <= fewest
        if fewest < np.inf:
            assert solution.covered_weight >= need
            assert len(solution.selected) >= fewest
        for k, weight in most.items():
            assert solve_most_pairs(problem, k, budget=0.0).upper_bound >= weight - 1e-9


def test_without_limits_of_pairs_two_sets_are_needed():
    """Where any two sets that see an element do, it is a cover with needs of 2."""
    for seed in range(8):
        rng = np.random.default_rng(seed)
        sees = rng.random((16, 8)) < 0.5
        both = sees[:, :, None] & sees[:, None, :]
        both[:, np.arange(8), np.arange(8)] = False
        good = packed_pairs(lambda i, table=both: table[:, i].T, 8, 16)
        share = float(rng.choice([0.7, 0.9]))
        required = np.floor(share * (sees.sum(axis=1) > 1).sum())
        pairs = solve_pair_cover(PairCoverProblem(sees, good, required_weight=required))
        needs = CoverProblem(sees, required_weight=np.array([required]), needs=2)
        assert pairs.status is SolveStatus.OPTIMAL
        assert pairs.lower_bound == solve_cover(needs).lower_bound


def test_sets_that_cover_alone_are_a_simple_cover():
    for seed in range(20):
        rng = np.random.default_rng(seed)
        sees = rng.random((30, 12)) < 0.3
        alone = sees[:, :, None] & np.eye(12, dtype=bool)
        good = packed_pairs(lambda i, table=alone: table[:, i].T, 12, 30)
        reached = float(sees.any(axis=1).sum())
        pairs = solve_pair_cover(PairCoverProblem(sees, good, required_weight=reached))
        simple = solve_cover(CoverProblem(sees, required_weight=np.array([reached])))
        assert pairs.status is SolveStatus.OPTIMAL
        assert len(pairs.selected) == len(simple.selected)


def test_too_few_sets_are_refused_with_proof():
    problem, tables = random_problem(7)
    fewest = len(solve_pair_cover(problem).selected)
    assert fewest > 2
    solution = solve_pair_cover(problem, max_sets=fewest - 1)
    assert solution.status is SolveStatus.INFEASIBLE
    assert len(solution.selected) <= fewest - 1
    assert solution.covered_weight == most_by_count(problem, tables)[fewest - 1]
    assert solve_pair_cover(problem, max_sets=fewest).status is SolveStatus.OPTIMAL


def test_the_same_seed_gives_the_same_answer():
    problem, _ = random_problem(3)
    first, again = (solve_pair_cover(problem, seed=5) for _ in range(2))
    np.testing.assert_array_equal(first.selected, again.selected)
    assert first.proof == again.proof
