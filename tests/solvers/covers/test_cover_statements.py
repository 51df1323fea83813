"""The stated programs against highspy, our bounds, and duality itself."""

import dataclasses

import highspy
import numpy as np
import pytest
from support.cover_statements import (
    solve_statement,
    state_cover_relaxation,
    state_max_coverage,
)

from solvers import CoverProblem
from solvers.covers.bounds.mixed_integer import linear_multipliers
from solvers.covers.bounds.reductions import reduce_problem
from solvers.covers.bounds.relaxation import cost_bound, coverage_bounds
from solvers.status import SolveStatus, WorkBudget

TIGHT = 1e-6


@dataclasses.dataclass(frozen=True, eq=False)
class Data:
    covers: np.ndarray
    weights: np.ndarray
    costs: np.ndarray
    needs: np.ndarray
    row_sets: np.ndarray
    required: np.ndarray
    fixed: np.ndarray


def random_data(seed, *, plain=False):
    """A cover that all sets together reach; areas in m², so far from 1."""
    rng = np.random.default_rng(seed)
    n_e, n_s, n_g = (int(rng.integers(a, b)) for a, b in ((6, 40), (4, 15), (1, 4)))
    covers = rng.random((n_e, n_s)) < rng.choice([0.2, 0.4])
    covers[np.arange(n_e), rng.integers(n_s, size=n_e)] = True
    weights = 1e-6 * rng.uniform(0.2, 2.0, n_e)
    needs = np.minimum(rng.integers(1, 4, n_e), covers.sum(axis=1))
    row_sets = rng.integers(n_g, size=n_e)
    fixed = rng.permutation(n_s)[: int(rng.integers(0, 3))]
    if plain:
        needs, row_sets, n_g, fixed = (
            np.ones(n_e, int),
            np.zeros(n_e, int),
            1,
            fixed[:0],
        )
    shares = rng.choice([0.6, 0.9, 1.0], n_g)
    required = shares * np.bincount(row_sets, weights, minlength=n_g)
    costs = 1e3 * rng.uniform(0.5, 2.0, n_s)
    return Data(covers, weights, costs, needs, row_sets, required, fixed)


def stated_cover(data):
    return state_cover_relaxation(
        data.covers,
        data.required,
        weights=data.weights,
        costs=data.costs,
        needs=data.needs,
        row_sets=data.row_sets,
        fixed=data.fixed,
    )


def as_problem(data):
    return CoverProblem(
        data.covers,
        data.weights,
        data.costs,
        required_weight=data.required,
        needs=data.needs,
        row_sets=data.row_sets,
        fixed=data.fixed,
    )


def highs(costs, rows, low, lower, upper):
    """Minimise over rows @ z >= low within bounds; value, z and row multipliers."""
    solver = highspy.Highs()
    solver.setOptionValue("output_flag", False)
    solver.setOptionValue("threads", 1)
    for cost, least, most in zip(costs, lower, upper, strict=True):
        solver.addCol(cost, least, most, 0, np.empty(0, np.int32), np.empty(0))
    for row, least in zip(rows, low, strict=True):
        index = np.flatnonzero(row).astype(np.int32)
        solver.addRow(least, highspy.kHighsInf, index.size, index, row[index])
    solver.run()
    assert solver.getModelStatus() == highspy.HighsModelStatus.kOptimal
    answer = solver.getSolution()
    value = solver.getInfo().objective_function_value
    return value, np.array(answer.col_value), np.array(answer.row_dual)


def cover_by_highs(data):
    """The same program in costs and weights of mean 1, in the caller's units again."""
    n_e, n_s = data.covers.shape
    groups = np.arange(data.required.size)[:, None] == data.row_sets
    rows = np.block(
        [
            [data.covers.astype(float), -np.diag(data.needs.astype(float))],
            [np.zeros((len(groups), n_s)), 1e6 * groups * data.weights],
        ]
    )
    low = np.concatenate([np.zeros(n_e), 1e6 * data.required])
    costs = np.concatenate([1e-3 * data.costs, np.zeros(n_e)])
    least = np.zeros(n_s + n_e)
    least[data.fixed] = 1.0
    value, z, dual = highs(costs, rows, low, least, np.ones(n_s + n_e))
    return 1e3 * value, z[:n_s], z[n_s:], 1e3 * dual[:n_e], 1e9 * dual[n_e:]


def coverage_by_highs(data, n_sets):
    n_e, n_s = data.covers.shape
    rows = np.block(
        [
            [data.covers.astype(float), -np.diag(data.needs.astype(float))],
            [-np.ones((1, n_s)), np.zeros((1, n_e))],
        ]
    )
    low = np.append(np.zeros(n_e), -float(n_sets))
    gains = np.concatenate([np.zeros(n_s), -1e6 * data.weights])
    box = np.zeros(n_s + n_e), np.ones(n_s + n_e)
    value, z, dual = highs(gains, rows, low, *box)
    return -1e-6 * value, z[:n_s], z[n_s:], 1e-6 * dual[:n_e], 1e-6 * dual[n_e:]


def cover_dual(data, lam, nu):
    """Value of the dual in the docstring, from multipliers and data alone."""
    value = float(nu @ data.required)
    for e in range(data.weights.size):
        value += min(
            0.0, lam[e] * data.needs[e] - nu[data.row_sets[e]] * data.weights[e]
        )
    for s in range(data.costs.size):
        left = data.costs[s] - sum(lam[data.covers[:, s]])
        value += left if s in data.fixed else min(0.0, left)
    return value


def coverage_dual(data, n_sets, lam, mu):
    value = float(mu[0] * n_sets)
    for e in range(data.weights.size):
        value += max(0.0, data.weights[e] - lam[e] * data.needs[e])
    for s in range(data.costs.size):
        value += max(0.0, sum(lam[data.covers[:, s]]) - mu[0])
    return value


def assert_slack_where_priced(products, scale):
    assert np.max(np.abs(products), initial=0.0) <= TIGHT * scale


@pytest.mark.parametrize("seed", range(40))
def test_cover_relaxation_equals_highspy_and_its_dual(seed):
    data = random_data(seed)
    found = solve_statement(stated_cover(data))
    value, x, y, lam, nu = cover_by_highs(data)
    assert found.status is SolveStatus.OPTIMAL
    assert found.value == pytest.approx(value, rel=TIGHT)
    assert found.value == pytest.approx(data.costs @ found.x, rel=TIGHT)
    assert found.limit_multipliers.shape == data.required.shape
    assert found.multipliers.min() >= 0.0
    assert found.limit_multipliers.min() >= 0.0
    # Duals needn't be unique, but every one fits every primal optimum.
    for x_, y_ in ((found.x, found.y), (x, y)):
        assert np.all(data.covers @ x_ >= data.needs * y_ - TIGHT)
        reached = np.bincount(data.row_sets, data.weights * y_, data.required.size)
        for lam_, nu_ in ((found.multipliers, found.limit_multipliers), (lam, nu)):
            assert cover_dual(data, lam_, nu_) == pytest.approx(value, rel=TIGHT)
            slack = data.covers @ x_ - data.needs * y_
            assert_slack_where_priced(lam_ * slack, value)
            assert_slack_where_priced(nu_ * (reached - data.required), value)
            left = data.costs - data.covers.T @ lam_
            free = np.delete(np.arange(x_.size), data.fixed)
            assert_slack_where_priced(np.maximum(left, 0.0)[free] * x_[free], value)
            assert_slack_where_priced(np.minimum(left, 0.0) * (1.0 - x_), value)


@pytest.mark.parametrize("seed", range(40))
def test_coverage_program_equals_highspy_and_its_dual(seed):
    data, n_sets = random_data(seed), seed % 4
    found = solve_statement(
        state_max_coverage(data.covers, n_sets, weights=data.weights, needs=data.needs)
    )
    value, x, y, lam, mu = coverage_by_highs(data, n_sets)
    total = data.weights.sum()
    assert found.status is SolveStatus.OPTIMAL
    assert found.value == pytest.approx(value, rel=TIGHT, abs=TIGHT * total)
    assert found.value == pytest.approx(data.weights @ found.y, abs=TIGHT * total)
    assert found.multipliers.min() >= 0.0
    assert found.limit_multipliers.min() >= 0.0
    for x_, y_ in ((found.x, found.y), (x, y)):
        for lam_, mu_ in ((found.multipliers, found.limit_multipliers), (lam, mu)):
            dual = coverage_dual(data, n_sets, lam_, mu_)
            assert dual == pytest.approx(value, rel=TIGHT, abs=TIGHT * total)
            slack = data.covers @ x_ - data.needs * y_
            assert_slack_where_priced(lam_ * slack, total)
            assert_slack_where_priced(mu_ * (n_sets - x_.sum()), total)


@pytest.mark.parametrize("plain", [True, False])
@pytest.mark.parametrize("seed", range(15))
def test_safe_bounds_meet_the_program_at_its_duals(seed, plain):
    """Our bounds never exceed the linear program's, and meet it at its own duals."""
    data = random_data(seed, plain=plain)
    cover = reduce_problem(as_problem(data))
    stated = state_cover_relaxation(
        cover.by_row,
        cover.quotas,
        weights=cover.weights,
        costs=cover.costs,
        needs=cover.needs,
        row_sets=cover.row_sets,
    )
    found = solve_statement(stated)
    whole = found.value + data.costs[data.fixed].sum()
    # Fixed sets taken out, and columns by their needs, make the program tighter.
    given = solve_statement(stated_cover(data)).value
    assert given <= whole * (1.0 + TIGHT)
    if plain:
        assert given == pytest.approx(whole, rel=TIGHT)
    proposed = linear_multipliers(cover, WorkBudget(1e9))
    assert proposed is not None
    for multipliers in (found.multipliers, proposed):
        bound = cost_bound(cover, multipliers)
        assert bound <= found.value * (1.0 + 1e-12)
        assert bound == pytest.approx(found.value, rel=TIGHT)
    assert cost_bound(cover, 0.5 * found.multipliers + 1.0) <= found.value
    for n_sets in range(1, min(4, cover.n_sets)):
        most = solve_statement(
            state_max_coverage(
                cover.by_row, n_sets, weights=cover.weights, needs=cover.needs
            )
        )
        # Theirs are multipliers of y, ours of the r y sets that y asks for.
        bounds = coverage_bounds(cover, most.multipliers * cover.needs)
        assert bounds[n_sets] == pytest.approx(most.value, rel=TIGHT)
        rough = coverage_bounds(cover, 0.5 * cover.weights)[n_sets]
        assert rough >= most.value * (1.0 - TIGHT)


@pytest.mark.parametrize("seed", range(8))
def test_whole_sets_never_beat_the_program(seed):
    data = random_data(seed)
    n_s = data.costs.size
    chosen = (np.arange(2**n_s)[:, None] >> np.arange(n_s) & 1).astype(bool)
    covered = chosen.astype(int) @ data.covers.T >= data.needs
    reached = np.stack(
        [
            (covered * data.weights)[:, data.row_sets == g].sum(axis=1)
            for g in range(data.required.size)
        ]
    )
    meets = np.all(reached.T >= data.required * (1.0 - 1e-12), axis=1)
    meets &= chosen[:, data.fixed].all(axis=1)
    least = (chosen @ data.costs)[meets].min()
    assert 0.0 < solve_statement(stated_cover(data)).value <= least * (1.0 + TIGHT)
    weights = covered @ data.weights
    for n_sets in (1, 2, 3):
        most = solve_statement(
            state_max_coverage(
                data.covers, n_sets, weights=data.weights, needs=data.needs
            )
        )
        best = weights[chosen.sum(axis=1) <= n_sets].max()
        assert best * (1.0 - TIGHT) <= most.value <= data.weights.sum() * (1.0 + TIGHT)


@pytest.mark.parametrize("n", [3, 5, 9])
def test_odd_cycles_take_half_of_everything(n):
    """Set s holds points s and s + 1: n / 2 relaxed, (n + 1) / 2 in whole sets."""
    cycle = np.eye(n) + np.roll(np.eye(n), 1, axis=0)
    found = solve_statement(state_cover_relaxation(cycle, n))
    assert found.value == pytest.approx(n / 2)
    assert found.x == pytest.approx(np.full(n, 0.5))
    assert found.multipliers == pytest.approx(np.full(n, 0.5))
    few = (n - 1) // 2
    most = solve_statement(state_max_coverage(cycle, few))
    assert most.value == pytest.approx(2 * few)
    assert most.limit_multipliers == pytest.approx([2.0])


def test_partition_is_worth_what_its_parts_weigh():
    """Parts of 1, 2 and 3 points that weigh 5, 8 and 9 and cost 1, 2 and 4."""
    part = np.repeat([0, 1, 2], [1, 2, 3])
    covers = part[:, None] == np.arange(3)
    weights = np.array([5.0, 4.0, 4.0, 3.0, 3.0, 3.0])
    costs = np.array([1.0, 2.0, 4.0])
    one = state_cover_relaxation(covers, 17.5, weights=weights, costs=costs)
    found = solve_statement(one)
    assert found.x == pytest.approx([1.0, 1.0, 0.5])
    assert found.value == pytest.approx(5.0)
    assert found.limit_multipliers == pytest.approx([4 / 9])
    assert np.bincount(part, found.multipliers)[2] == pytest.approx(4.0)
    most = solve_statement(state_max_coverage(covers, 2, weights=weights))
    assert most.value == pytest.approx(17.0)
    assert most.x == pytest.approx([0.0, 1.0, 1.0])
    assert 5.0 <= most.limit_multipliers[0] <= 8.0 + TIGHT


def test_needs_row_sets_and_fixed_sets_each_count():
    covers = np.array([[1, 1, 1, 0], [0, 0, 0, 1]])
    plain = solve_statement(state_cover_relaxation(covers, 2.0))
    twice = solve_statement(state_cover_relaxation(covers, 2.0, needs=[2, 1]))
    assert (plain.value, twice.value) == pytest.approx((2.0, 3.0))
    second = state_cover_relaxation(covers, [0.0, 1.0], row_sets=[0, 1])
    assert solve_statement(second).x == pytest.approx([0.0, 0.0, 0.0, 1.0])
    held = state_cover_relaxation(covers, [0.0, 1.0], row_sets=[0, 1], fixed=[2])
    assert solve_statement(held).x == pytest.approx([0.0, 0.0, 1.0, 1.0])
    most = state_max_coverage(covers, 2, weights=[9.0, 1.0], needs=[3, 1])
    assert solve_statement(most).value == pytest.approx(6.0)


@pytest.mark.parametrize("required", [[2.5], [1e30], [1.0, 1.0]])
def test_what_cannot_be_covered_is_infeasible(required):
    covers = np.array([[1, 0], [0, 1], [0, 0]])
    row_sets = np.minimum([0, 0, 1], len(required) - 1)
    stated = state_cover_relaxation(covers, required, row_sets=row_sets)
    found = solve_statement(stated)
    assert found.status is SolveStatus.INFEASIBLE
    assert found.value == np.inf
    assert found.x is found.y is found.multipliers is found.limit_multipliers is None


def test_weightless_elements_and_free_sets_are_answered():
    found = solve_statement(
        state_cover_relaxation(np.eye(2), 0.0, weights=np.zeros(2), costs=np.zeros(2))
    )
    assert (found.status, found.value) == (SolveStatus.OPTIMAL, 0.0)
    none = solve_statement(state_max_coverage(np.eye(2), 1, weights=np.zeros(2)))
    assert (none.status, none.value) == (SolveStatus.OPTIMAL, 0.0)


def test_highspy_still_runs_with_one_thread_afterwards():
    """HiGHS' scheduler belongs to the process and keeps its first number of threads."""
    solve_statement(state_cover_relaxation(np.eye(3), 3.0))
    solver = highspy.Highs()
    solver.setOptionValue("output_flag", False)
    solver.setOptionValue("threads", 1)
    solver.addVar(1.0, 2.0)
    assert solver.run() == highspy.HighsStatus.kOk
