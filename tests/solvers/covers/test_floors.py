"""Floors of row sets beside what is required of all: brute force and known answers."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog

from solvers import CoverProblem, SolveStatus, solve_cover
from solvers.covers import floored_counts
from solvers.covers.bounds.mixed_integer import branch_and_bound
from solvers.covers.bounds.reductions import reduce_problem
from solvers.covers.bounds.relaxation import cost_bound, count_bound, least_service
from solvers.covers.cover import solve_max_coverage
from solvers.covers.exact.floored_pairs import least_lacking
from solvers.covers.search.prices import Prices, lack
from solvers.status import WorkBudget


def floored(seed, *, n_e=30, n_s=8):
    """A cover of random kind with floors, that all sets together meet."""
    rng = np.random.default_rng(seed)
    covers = rng.random((n_e, n_s)) < rng.choice([0.15, 0.25, 0.35])
    weights = [np.ones(n_e), rng.integers(1, 9, n_e) * 1.0, rng.random(n_e)][seed % 3]
    row_sets = rng.integers(0, 2 + seed % 3, n_e)
    reach = np.where(covers.any(axis=1), weights, 0.0)
    floors = rng.choice([0.0, 0.5, 0.7, 0.9], row_sets.max() + 1)
    return CoverProblem(
        covers,
        weights,
        required_weight=floors * np.bincount(row_sets, reach),
        required_total=rng.choice([0.6, 0.75, 0.85]) * reach.sum(),
        row_sets=row_sets,
        fixed=[0] if seed % 4 == 0 else [],
    )


def meets(problem, chosen):
    covered = problem.covered_weights(list(chosen)) * (1.0 + 1e-12)
    return bool(
        np.all(covered >= problem.required_weight)
        and covered.sum() >= problem.required_total
    )


def fewest_and_most(problem):
    """Return the fewest sets, and the most weight that as many cover within floors."""
    sets = (
        np.arange(2**problem.costs.size)[:, None] >> np.arange(problem.costs.size)
    ) & 1
    sets = sets[np.all(sets[:, problem.fixed] == 1, axis=1)]
    covered = (sets @ problem.covers.T.toarray() > 0) * problem.weights
    groups = problem.row_sets == np.arange(problem.n_row_sets)[:, None]
    each = covered @ groups.T * (1.0 + 1e-12)
    within = np.all(each >= problem.required_weight, axis=1)
    enough = within & (each.sum(axis=1) >= problem.required_total)
    needed = int(sets.sum(axis=1)[enough].min())
    return needed, covered.sum(axis=1)[within & (sets.sum(axis=1) <= needed)].max()


@pytest.mark.parametrize("seed", range(6))
def test_counts_and_weights_equal_brute_force(seed):
    problem = floored(seed)
    needed, most = fewest_and_most(problem)
    solution = solve_cover(problem, seed=1)
    assert solution.status is SolveStatus.OPTIMAL
    assert solution.cost == solution.lower_bound == needed
    assert meets(problem, solution.selected)
    assert solution.shortfall() == 0.0
    # As the bound of the total alone, which is what F = 0 asks.
    alone = solve_cover(replace(problem, required_weight=0 * problem.required_weight))
    assert solution.total_bound == alone.lower_bound <= needed
    best, floors = solve_max_coverage(problem, needed), problem.required_weight
    assert best.status is SolveStatus.OPTIMAL
    assert np.all(problem.covered_weights(best.selected) >= 0.999 * floors)
    assert best.covered_weight == pytest.approx(most, rel=1e-9)
    cover = reduce_problem(problem)
    for lam in np.random.default_rng(seed).random((5, cover.weights.size)):
        assert count_bound(cover, lam) <= needed - problem.fixed.size
        assert cost_bound(cover, lam) <= needed - problem.fixed.size + 1e-9
    exact = branch_and_bound(cover, np.arange(cover.n_sets), WorkBudget(1e12))
    assert exact.bound == pytest.approx(needed - problem.fixed.size, abs=1e-4)


@pytest.mark.parametrize("seed", range(9))
def test_pairs_that_lack_least_are_those_of_brute_force(seed):
    cover = reduce_problem(floored(seed, n_e=40, n_s=12))
    for n_sets in (1, 2):
        found = least_lacking(cover, n_sets, WorkBudget(1e9))
        tuples = itertools.combinations_with_replacement(range(cover.n_sets), n_sets)
        least = min(lack(cover, np.unique(sets)) for sets in tuples)
        assert lack(cover, found) == least
    assert least_lacking(cover, 3, WorkBudget(1e9)) is None


@pytest.mark.parametrize("seed", range(6))
def test_least_service_is_that_of_a_linear_program(seed):
    cover = reduce_problem(floored(seed))
    lam = np.random.default_rng(seed).random(cover.weights.size)
    groups = cover.row_sets == np.arange(cover.quotas.size)[:, None]
    asked = np.vstack([groups * cover.weights, cover.weights])
    needed = np.append(cover.quotas, cover.quota)
    unit = cover.weights.max()
    cheapest = linprog(lam, -asked / unit, -needed / unit, bounds=(0, 1))
    assert least_service(cover, lam) == pytest.approx(cheapest.fun, rel=1e-7)


def test_prices_ask_of_what_meets_the_floors_no_more_than_it_has():
    # Rows 0 to 3 and 4 to 7; floors of two rows each.
    covers = np.eye(8, dtype=bool)
    sets = np.repeat([0, 1], 4)
    problem = CoverProblem(
        covers, required_weight=[2, 2], required_total=5, row_sets=sets
    )
    cover = reduce_problem(problem)
    prices = replace(Prices.even(cover), of_sets=np.array([16.0, 80.0]))
    for chosen in ([0, 1, 4, 5], [0, 1, 2, 4, 5], [0, 1, 4, 5, 6, 7], [4, 5, 6, 7]):
        chosen = np.array(chosen)
        weight, priced = cover.weight_of(chosen), prices.priced.weight_of(chosen)
        beyond = float((cover.covered_by(chosen) - cover.quotas)[1])
        # What a floor is exceeded by counts, at what it costs more than one.
        assert priced == prices.demand(weight) + 64.0 * beyond
        assert prices.weight(priced) == weight + 4.0 * beyond >= weight


def test_a_floor_costs_a_set_that_the_total_does_not():
    # Two sets hold 18 of 20 rows; the last two rows are a set of their own.
    covers = np.zeros((20, 3), dtype=bool)
    covers[:9, 0] = covers[9:18, 1] = covers[18:, 2] = True
    region = np.repeat([0, 1], [18, 2])
    alone = CoverProblem(
        covers, required_total=18, required_weight=[0, 0], row_sets=region
    )
    asked = replace(alone, required_weight=np.array([0.0, 1.0]))
    assert solve_cover(alone).lower_bound == 2
    solution = solve_cover(asked)
    assert (solution.cost, solution.lower_bound, solution.total_bound) == (3, 3, 2)
    assert solution.proof.endswith("floors counted")
    # Two sets can't do both: what lacks least is told, and no floor is claimed.
    two = solve_max_coverage(asked, 2)
    assert two.status is SolveStatus.FEASIBLE
    assert two.covered_weight == 18 == two.upper_bound
    none_allowed = solve_cover(asked, max_sets=2)
    assert none_allowed.status is SolveStatus.INFEASIBLE
    assert none_allowed.shortfall() == 0.5
    # What stands already is enough for the total, which then takes none.
    standing = solve_cover(replace(asked, fixed=[0, 1]))
    assert (standing.lower_bound, standing.total_bound) == (3, 2)


@pytest.mark.parametrize("seed", [1, 10, 11])
def test_from_below_alone_the_count_is_found(seed, monkeypatch):
    def all_sets(cover, *_):
        return np.arange(cover.n_sets), [Prices.even(cover)]

    monkeypatch.setattr(floored_counts, "_from_above", all_sets)
    problem = floored(seed)
    needed, _ = fewest_and_most(problem)
    solution = solve_cover(problem, seed=1)
    assert solution.cost == solution.lower_bound == needed > solution.total_bound
    assert meets(problem, solution.selected)


def test_a_floor_that_costs_weight_but_no_set_is_met():
    # Sets 0 and 1 hold most; with set 2 the small row set is covered as well.
    covers = np.zeros((21, 3), dtype=bool)
    covers[:10, 0] = covers[10:20, 1] = covers[11:21, 2] = True
    covers[10, 0] = True
    region = np.repeat([0, 1], [20, 1])
    problem = CoverProblem(
        covers[:, [0, 1, 2]], required_total=19, required_weight=[0, 1], row_sets=region
    )
    solution = solve_cover(problem)
    assert solution.selected.tolist() == [0, 2]
    assert solution.lower_bound == solution.total_bound == 2


@pytest.mark.parametrize("total", [-1.0, np.nan, np.inf])
def test_a_total_must_be_a_weight(total):
    with pytest.raises(ValueError, match="required_total must be finite"):
        CoverProblem(np.ones((2, 2), dtype=bool), required_total=total)


@pytest.mark.parametrize("seed", range(3))
def test_the_floor_that_takes_most_sets_leads_and_bounds(seed):
    """Small rows take many sets, large ones few: what that floor needs, all need."""
    rng = np.random.default_rng(seed)
    covers = np.zeros((460, 120), dtype=bool)
    covers[:60] = rng.random((60, 120)) < 0.05
    covers[60:] = rng.random((400, 120)) < 0.4
    row_sets = np.repeat([0, 1], [60, 400])
    needed = np.floor(0.9 * np.bincount(row_sets, covers.any(axis=1)))
    alone = solve_cover(CoverProblem(covers[:60], required_weight=needed[0]))
    assert alone.status is SolveStatus.OPTIMAL
    problem = CoverProblem(
        covers, required_weight=needed, required_total=needed.sum(), row_sets=row_sets
    )
    solution = solve_cover(problem, budget=3e8)
    assert meets(problem, solution.selected)
    assert alone.lower_bound <= solution.lower_bound <= solution.cost
    assert solution.cost <= alone.cost + 1
