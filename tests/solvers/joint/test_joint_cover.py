"""Projectors and cameras together, against all subsets of both."""

from itertools import combinations

import numpy as np
import pytest
from scipy import sparse
from scipy.optimize import Bounds, LinearConstraint, milp

from solvers.covers.paired.pair_cover import solve_pair_cover
from solvers.covers.paired.pair_problem import PairCoverProblem, packed_pairs
from solvers.joint.camera_costs import cost_steps
from solvers.joint.joint_cover import solve_joint
from solvers.joint.joint_problem import JointProblem, Requirement
from solvers.status import SolveStatus

# Enough for programs of a handful of sets.
_BUDGET = 1e7


def subsets(n):
    return [c for k in range(n + 1) for c in combinations(range(n), k)]


def least_cost(problem):
    """The cheapest of all subsets of both kinds, written from the statement."""
    n_e, n_c, n_p = problem.pairs.shape
    best = np.inf
    for lights in subsets(n_p):
        lit = [any(problem.lit[e, p] for p in lights) for e in range(n_e)]
        if not reaches(problem.required_lit, lit, problem.row_sets):
            continue
        sees = problem.pairs[:, :, list(lights)].any(axis=2)
        for views in subsets(n_c):
            cost = sum(problem.projector_costs[p] for p in lights)
            cost += sum(problem.camera_costs[c] for c in views)
            counts = zip((len(lights), len(views)), problem.most, strict=True)
            if cost >= best or any(most is not None and n > most for n, most in counts):
                continue
            done = sees[:, list(views)].any(axis=1)
            if done.sum() < problem.required_measured.total:
                continue
            if reaches(problem.required_measured, done, problem.row_sets):
                best = cost
    return best


def reaches(required, covered, row_sets):
    covered = np.asarray(covered)
    per = [int(covered[row_sets == g].sum()) for g in range(len(required.floors))]
    return covered.sum() >= required.total and all(
        n >= floor for n, floor in zip(per, required.floors, strict=True)
    )


def random_problem(seed):
    """Few devices; costs, floors of row sets and numbers allowed now and then."""
    rng = np.random.default_rng(seed)
    n, n_p, n_c = int(rng.integers(6, 13)), 4, 4
    lit = rng.random((n, n_p)) < rng.uniform(0.4, 0.8)
    pairs = lit[:, None] & (rng.random((n, n_c, n_p)) < rng.uniform(0.3, 0.7))
    row_sets = rng.integers(0, 3, n)
    there = np.bincount(row_sets, minlength=3)
    floored = seed % 3 == 0

    def required(reached):
        floors = np.minimum(rng.integers(0, 2, 3), there) if floored else ()
        return Requirement(int(0.8 * reached.any(axis=1).sum()), floors)

    costs = {}
    if seed % 2:
        costs = {
            "projector_costs": rng.integers(1, 4, n_p) / 2.0,
            "camera_costs": rng.integers(1, 3, n_c) / 2.0,
        }
    return JointProblem(
        lit,
        pairs,
        required(lit),
        required(pairs.reshape(n, -1)),
        row_sets=row_sets,
        most=(2, 3) if seed % 5 == 4 else (None, None),
        **costs,
    )


@pytest.mark.parametrize("seed", range(24))
def test_it_costs_what_the_cheapest_of_all_subsets_costs(seed):
    problem = random_problem(seed)
    truth = least_cost(problem)

    found = solve_joint(problem, budget=_BUDGET)

    if np.isinf(truth):
        assert found.status is SolveStatus.INFEASIBLE
        assert found.lower_bound == found.cost == np.inf
        return
    assert found.status is SolveStatus.OPTIMAL
    assert problem.enough(found.projectors, found.cameras)
    assert found.cost == pytest.approx(truth)
    assert found.lower_bound == pytest.approx(truth)


@pytest.mark.parametrize("n_covers", [2, 3, 4, 8])
def test_a_cut_bound_is_below_every_answer(n_covers):
    for seed in range(40, 46):
        problem = random_problem(seed)
        truth = least_cost(problem)
        found = solve_joint(problem, n_covers=n_covers, budget=_BUDGET)
        assert found.lower_bound <= truth * (1 + 1e-9)
        assert found.cost >= truth * (1 - 1e-9)
        if found.status is SolveStatus.OPTIMAL:
            assert found.cost == pytest.approx(truth)


def by_mixed_integer_program(problem):
    """The least count, from a program with a variable for each pair of a sample."""
    n_e, n_c, n_p = problem.pairs.shape
    e, c, p = np.nonzero(problem.pairs)
    k = len(e)
    # x (n_p), z (n_c), l and m (n_e each), y (k).
    n = n_p + n_c + 2 * n_e + k
    lit, done, pair = n_p + n_c, n_p + n_c + n_e, n_p + n_c + 2 * n_e
    rows = sparse.lil_array((2 * n_e + 2 * k + 2, n))
    for row in range(n_e):
        rows[row, lit + row] = -1.0
        rows[row, np.flatnonzero(problem.lit[row])] = 1.0
        rows[n_e + row, done + row] = -1.0
        rows[n_e + row, pair + np.flatnonzero(e == row)] = 1.0
    for row in range(k):
        rows[2 * n_e + row, pair + row] = rows[2 * n_e + k + row, pair + row] = -1.0
        rows[2 * n_e + row, p[row]] = rows[2 * n_e + k + row, n_p + c[row]] = 1.0
    rows[-2, lit:done] = rows[-1, done:pair] = 1.0
    least = np.zeros(len(rows.toarray()))
    least[-2:] = problem.required_lit.total, problem.required_measured.total
    costs = np.zeros(n)
    costs[: n_p + n_c] = np.concatenate([problem.projector_costs, problem.camera_costs])
    found = milp(
        costs,
        constraints=LinearConstraint(rows.tocsr(), least, np.inf),
        bounds=Bounds(0, 1),
        integrality=np.arange(n) < n_p + n_c,
    )
    assert found.success
    return found.fun


@pytest.mark.parametrize("dear", [2.0])
def test_it_costs_what_a_mixed_integer_program_says(dear):
    """Of more devices than all subsets of can be looked at, of either path."""
    rng = np.random.default_rng(int(dear))
    n, n_p, n_c = 24, 9, 10
    lit = rng.random((n, n_p)) < 0.45
    pairs = lit[:, None] & (rng.random((n, n_c, n_p)) < 0.35)
    problem = JointProblem(
        lit,
        pairs,
        Requirement(22),
        Requirement(20),
        projector_costs=np.full(n_p, dear),
    )

    found = solve_joint(problem, budget=3e7)

    assert found.status is SolveStatus.OPTIMAL
    assert problem.enough(found.projectors, found.cameras)
    assert found.cost == pytest.approx(by_mixed_integer_program(problem))


def one_light_or_two():
    """One projector lights all, and each camera measures a quarter with it.

    Two others light half each; with both, the last camera measures all.
    """
    n = 8
    lit = np.zeros((n, 3), dtype=bool)
    lit[:, 0] = lit[:4, 1] = lit[4:, 2] = True
    pairs = np.zeros((n, 5, 3), dtype=bool)
    for c in range(4):
        pairs[2 * c : 2 * c + 2, c, 0] = True
    pairs[:4, 4, 1] = pairs[4:, 4, 2] = True
    return lit, pairs


def test_fewest_projectors_first_may_take_more_devices():
    lit, pairs = one_light_or_two()
    all_of_it = Requirement(8)
    problem = JointProblem(lit, pairs, all_of_it, all_of_it)
    assert problem.enough([0], [0, 1, 2, 3])

    found = solve_joint(problem, known=([0], [0, 1, 2, 3]), budget=_BUDGET)

    assert found.status is SolveStatus.OPTIMAL
    assert (found.projectors.tolist(), found.cameras.tolist()) == ([1, 2], [4])
    assert found.lower_bound == found.cost == 3.0


def test_costs_decide_which_kind_is_saved():
    lit, pairs = one_light_or_two()
    all_of_it = Requirement(8)
    problem = JointProblem(
        lit, pairs, all_of_it, all_of_it, projector_costs=np.full(3, 10.0)
    )

    found = solve_joint(problem, budget=_BUDGET)

    assert found.projectors.tolist() == [0]
    assert found.cost == found.lower_bound == 14.0


def test_numbers_that_are_allowed_bind():
    lit, pairs = one_light_or_two()
    all_of_it = Requirement(8)

    found = solve_joint(
        JointProblem(lit, pairs, all_of_it, all_of_it, most=(1, None)), budget=_BUDGET
    )
    neither = solve_joint(
        JointProblem(lit, pairs, all_of_it, all_of_it, most=(1, 3)), budget=_BUDGET
    )

    assert found.cost == 5.0
    assert neither.status is SolveStatus.INFEASIBLE


def test_known_devices_are_never_left_for_dearer_ones():
    problem = random_problem(1)
    best = solve_joint(problem, budget=_BUDGET)

    found = solve_joint(
        problem, known=(best.projectors, best.cameras), n_covers=2, budget=_BUDGET
    )

    assert found.cost == best.cost


def test_known_devices_must_be_enough():
    lit, pairs = one_light_or_two()
    problem = JointProblem(lit, pairs, Requirement(8), Requirement(8))
    with pytest.raises(ValueError, match="don't light and measure enough"):
        solve_joint(problem, known=([0], [0]))


def test_without_light_to_give_it_is_a_cover_by_pairs():
    """Of equal costs and no light to give: `covers.paired` has the same answer."""
    rng = np.random.default_rng(5)
    n, n_p, n_c = 30, 5, 6
    lit = rng.random((n, n_p)) < 0.6
    pairs = lit[:, None] & (rng.random((n, n_c, n_p)) < 0.5)
    problem = JointProblem(lit, pairs, Requirement(0), Requirement(24))
    n_s = n_p + n_c
    both = np.zeros((n_s, n_s, n), dtype=bool)
    both[:n_p, n_p:] = pairs.T
    both |= both.transpose(1, 0, 2)
    alike = PairCoverProblem(
        both.any(axis=1).T,
        packed_pairs(lambda s: both[s], n_s, n),
        required_weight=24.0,
    )

    found, other = solve_joint(problem, budget=_BUDGET), solve_pair_cover(alike)

    assert other.status is found.status is SolveStatus.OPTIMAL
    assert found.cost == len(other.selected)


def test_cameras_cost_sums_of_what_there_is():
    steps = cost_steps(np.array([2.0, 2.0, 5.0]), 2.0, 9.5)
    assert [(step.low, step.high) for step in steps] == [
        (cost, cost) for cost in (2.0, 4.0, 5.0, 7.0, 9.0)
    ]


def test_very_many_sums_are_taken_together_and_none_is_lost():
    costs = np.array([1.0, 1.1, 1.23, 1.347, 1.4591] * 3)
    steps = cost_steps(costs, 0.0, 9.0)
    assert len(steps) <= 64
    for sums in combinations(costs.tolist(), 4):
        inside = [s for s in steps if s.low - 1e-6 <= sum(sums) <= s.high + 1e-6]
        assert len(inside) == 1


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"lit": np.zeros((8, 3))}, "masks"),
        ({"lit": np.zeros((8, 2), dtype=bool)}, "must be"),
        ({"lit": np.zeros((8, 3), dtype=bool)}, "doesn't light"),
        ({"required_lit": Requirement(9)}, "there are 8"),
        ({"required_measured": Requirement(0, [0, 1])}, "there are 8"),
        ({"camera_costs": np.zeros(5)}, "positive"),
        ({"projector_costs": np.ones(2)}, "projector_costs must be"),
        ({"row_sets": np.zeros(3)}, "row_sets must be"),
        ({"most": (0, None)}, "at least one"),
    ],
)
def test_what_is_no_problem_is_refused(change, words):
    lit, pairs = one_light_or_two()
    sound = {
        "lit": lit,
        "pairs": pairs,
        "required_lit": Requirement(8),
        "required_measured": Requirement(8),
    }
    with pytest.raises(ValueError, match=words):
        JointProblem(**(sound | change))


def test_devices_of_one_kind_alone_measure_nothing():
    problem = random_problem(1)
    for some in (((), (0, 1)), ((0, 1), ()), ((), ())):
        assert not problem.measured_by(*some).any()


def test_a_requirement_is_at_least_nothing():
    with pytest.raises(ValueError, match="at least 0"):
        Requirement(-1)
