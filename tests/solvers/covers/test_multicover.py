"""Rows needed more than once, several row sets, sets that are fixed: laws and parts."""

import itertools
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from solvers import CoverProblem, SolveStatus, solve_cover
from solvers.covers.bounds.mixed_integer import branch_and_bound
from solvers.covers.bounds.reductions import reduce_problem
from solvers.covers.bounds.relaxation import cost_bound, count_bound, coverage_bounds
from solvers.covers.cover import solve_max_coverage
from solvers.covers.search.neighbourhood import cheapest, greedy
from solvers.status import WorkBudget

NONE = np.empty(0, dtype=np.int64)


def plenty():
    return WorkBudget(5e9)


def random_cover(seed, *, n_e=40, n_s=12, share=0.7, density=0.35, costs=None):
    """A cover that all sets together meet, of several needs and row sets."""
    rng = np.random.default_rng(seed)
    covers = rng.random((n_e, n_s)) < density
    weights = rng.integers(1, 9, n_e).astype(float) if seed % 2 else rng.random(n_e)
    needs = rng.integers(1, 4, n_e)
    row_sets = rng.integers(0, 1 + seed % 3, n_e)
    row_sets[: 1 + seed % 3] = np.arange(1 + seed % 3)
    can = np.where(covers.sum(axis=1) >= needs, weights, 0.0)
    required = share * np.bincount(row_sets, weights=can)
    return CoverProblem(
        covers,
        weights,
        costs,
        required_weight=required,
        needs=needs,
        row_sets=row_sets,
    )


def met_by(problem):
    """For each number of sets, those selections that meet what is required."""
    covers = problem.covers.toarray()
    groups = np.arange(problem.n_row_sets)[:, None] == problem.row_sets
    found = {}
    for k in range(problem.costs.size + 1):
        found[k] = []
        for chosen in itertools.combinations(range(problem.costs.size), k):
            done = covers[:, chosen].sum(axis=1) >= problem.needs
            held = (groups * problem.weights) @ done
            if np.all(held >= problem.required_weight * (1 - 1e-12)):
                found[k].append(chosen)
    return found


def test_a_row_needed_twice_takes_two_sets_even_like_ones():
    """Two like columns: neither may be dropped as superfluous."""
    covers = np.ones((3, 4), dtype=bool)
    for r in (1, 2, 3):
        solution = solve_cover(CoverProblem(covers, needs=r))
        assert solution.status is SolveStatus.OPTIMAL
        assert solution.lower_bound == solution.cost == r
    beyond = solve_cover(CoverProblem(covers, needs=5))
    assert beyond.status is SolveStatus.INFEASIBLE
    assert beyond.covered_weight == 0.0


def test_redundant_arcs_on_a_circle():
    """Arcs of a quarter cover the circle r times with 4 r of them, no fewer."""
    at = np.arange(48)
    covers = (at[:, None] - np.arange(48)[None]) % 48 < 12
    for r in (1, 2):
        solution = solve_cover(CoverProblem(covers, needs=r))
        assert solution.status is SolveStatus.OPTIMAL
        assert solution.cost == 4 * r


def test_any_one_of_a_redundant_selection_may_fail():
    for seed in range(2):
        rng = np.random.default_rng(seed)
        covers = rng.random((40, 10)) < 0.5
        twice = CoverProblem(covers, min_coverage=0.9, needs=2)
        solution = solve_cover(twice)
        assert solution.status is SolveStatus.OPTIMAL
        once = CoverProblem(covers, min_coverage=0.9)
        for lost in solution.selected:
            left = np.setdiff1d(solution.selected, [lost])
            assert once.covered_weight(left) >= once.required_weight[0] * (1 - 1e-12)


def test_row_sets_can_t_help_each_other_out():
    """One set covers most of both together, but too little of the second."""
    covers = np.zeros((20, 2), dtype=bool)
    covers[:12, 0] = True
    covers[10:, 1] = True
    together = CoverProblem(covers, min_coverage=0.6)
    assert solve_cover(together).cost == 1
    apart = CoverProblem(covers, min_coverage=0.6, row_sets=np.repeat([0, 1], 10))
    solution = solve_cover(apart)
    assert solution.selected.tolist() == [0, 1]
    assert solution.lower_bound == 2
    assert apart.covered_weights(solution.selected).tolist() == [10.0, 10.0]
    short = apart.covered_weights([0])
    assert short.tolist() == [10.0, 2.0]


def test_each_row_set_has_a_requirement_of_its_own():
    covers = np.kron(np.eye(4, dtype=bool), np.ones((5, 1), dtype=bool))
    row_sets = np.repeat([0, 1], 10)
    for required, count in (([5, 0], 1), ([5, 5], 2), ([6, 5], 3), ([10, 6], 4)):
        problem = CoverProblem(
            covers, required_weight=np.array(required, dtype=float), row_sets=row_sets
        )
        assert solve_cover(problem).cost == count
    shares = CoverProblem(covers, min_coverage=np.array([1.0, 0.5]), row_sets=row_sets)
    assert solve_cover(shares).cost == 3


def test_fixed_sets_are_in_and_save_what_they_serve():
    covers = np.kron(np.eye(3, dtype=bool), np.ones((4, 1), dtype=bool))
    covers = np.column_stack([covers, covers[:, 0]])
    free = solve_cover(CoverProblem(covers))
    assert free.cost == 3
    # The fourth does what the first does, so the first isn't needed beside it.
    held = solve_cover(CoverProblem(covers, fixed=[3]))
    assert held.selected.tolist() == [1, 2, 3]
    assert held.lower_bound == held.cost == 3
    useless = np.column_stack([covers, np.zeros(12, dtype=bool)])
    forced = solve_cover(CoverProblem(useless, fixed=[4]))
    assert forced.selected.size == forced.lower_bound == 4
    both = solve_cover(CoverProblem(covers, needs=2, fixed=[0, 3], min_coverage=1 / 3))
    assert both.selected.tolist() == [0, 3]
    assert both.lower_bound == 2
    assert "fixed" in both.proof
    most = solve_max_coverage(CoverProblem(covers, fixed=[0]), 2)
    assert most.covered_weight == most.upper_bound == 8
    assert 0 in most.selected
    with pytest.raises(ValueError, match="max_sets is 1, but 2 sets are fixed"):
        solve_cover(CoverProblem(covers, fixed=[0, 3]), max_sets=1)
    with pytest.raises(ValueError, match="n_sets is 1, but 2 sets are fixed"):
        solve_max_coverage(CoverProblem(covers, fixed=[0, 3]), 1)


def test_a_warm_start_leaves_fixed_sets_in():
    covers = np.zeros((6, 3), dtype=bool)
    covers[0, 0] = covers[1:4, 1] = covers[4:, 2] = True
    problem = CoverProblem(covers, fixed=[0])
    answer = solve_max_coverage(problem, 2, warm_start=[1, 2])
    assert answer.selected.tolist() == [0, 1]
    assert answer.covered_weight == answer.upper_bound == 4.0


def test_no_more_sets_than_allowed_where_nothing_reaches_the_requirement():
    covers = np.eye(4, dtype=bool)[:, :3]
    for needs in (1, [1, 1, 1, 2]):
        few = solve_cover(CoverProblem(covers, needs=needs), max_sets=1)
        assert few.status is SolveStatus.INFEASIBLE
        assert few.selected.size == few.covered_weight == 1


def test_rows_too_light_for_highs_still_count():
    """5,000 rows below its 1e-9 of the mean: without them 61 would be the least."""
    n, k = 5000, 13
    covers = np.zeros((n + 2, 4 + 2 * k), dtype=bool)
    covers[0, 0] = covers[1, 1] = True
    for p in (0, 1):
        rows = 2 + p * 2500 + np.arange(2500)
        covers[rows, 2 + p] = True
        # Only to make the rows differ.
        bits = (np.arange(1, 2501)[:, None] >> np.arange(k)) & 1
        covers[rows, 4 + p * k : 4 + (p + 1) * k] = bits
    weights = np.concatenate([[1.0, 1e-5], np.full(n, 1.8e-13)])
    costs = np.concatenate([[1.0, 60.0, 1.0, 1.0], np.full(2 * k, 2.0)])
    problem = CoverProblem(covers, weights, costs, required_weight=1 + 8.9e-10)
    assert problem.covered_weight([0, 2, 3]) >= problem.required_weight[0]
    assert solve_cover(problem).lower_bound <= 3.0


def test_costs_under_a_limit_on_the_number():
    """Three cheap sets or one dear one: the number allowed decides."""
    covers = np.column_stack([np.ones(3), np.eye(3)]).astype(bool)
    problem = CoverProblem(covers, costs=np.array([10.0, 1.0, 1.0, 1.0]))
    for allowed, cost in ((None, 3.0), (3, 3.0), (2, 10.0), (1, 10.0)):
        solution = solve_cover(problem, max_sets=allowed)
        assert solution.status is SolveStatus.OPTIMAL
        assert solution.cost == pytest.approx(cost)
        assert solution.lower_bound == pytest.approx(cost)
    none = solve_cover(
        CoverProblem(covers[:, 1:], costs=np.array([1.0, 1.0, 2.0])), max_sets=2
    )
    assert none.status is SolveStatus.INFEASIBLE
    assert none.selected.size == 2
    assert none.lower_bound <= 4.0


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 2**16),
    scale=st.sampled_from(
        [0.0, 5e-324, 1e-309, 1e-30, 0.3, 1.0, 50.0, 1e250, np.inf, np.nan]
    ),
)
def test_bounds_hold_for_any_multipliers(seed, scale):
    rng = np.random.default_rng(seed)
    problem = random_cover(seed, n_e=16, n_s=7, costs=rng.uniform(0.5, 2.0, 7))
    cover = reduce_problem(problem)
    with np.errstate(over="ignore"):
        multipliers = scale * rng.normal(size=cover.weights.size)
    if seed % 2:
        multipliers = np.abs(multipliers) / cover.needs
    weighty = coverage_bounds(cover, multipliers * cover.weights)
    found = met_by(problem)
    fewest = min((k for k, ones in found.items() if ones), default=8)
    assert count_bound(cover, multipliers) <= fewest
    assert count_bound(cover, multipliers * cover.weights) <= fewest
    for allowed in (None, *range(1, 8)):
        costs = [
            problem.costs[list(chosen)].sum()
            for k, ones in found.items()
            if allowed is None or k <= allowed
            for chosen in ones
        ]
        bound = cost_bound(cover, multipliers, max_sets=allowed)
        assert bound <= min(costs, default=np.inf) + 1e-9
    for k in range(8):
        for chosen in itertools.combinations(range(7), k):
            weight = problem.covered_weight(chosen)
            bound = weighty[min(k, cover.n_sets)] * cover.unit
            assert weight <= bound * (1 + 1e-9)


def test_drop_and_repair_finds_small_covers():
    for seed in range(6):
        problem = random_cover(seed, n_s=10)
        cover = reduce_problem(problem)
        fewest = min(k for k, ones in met_by(problem).items() if ones)
        start = greedy(cover, NONE, plenty())
        few = cheapest(cover, start, plenty(), seed=0, max_kicks=100)
        assert cover.meets(few)
        assert few.size == fewest
        best = branch_and_bound(cover, few, plenty(), max_sets=fewest, heaviest=True)
        assert cover.meets(best.selected)
        assert cover.weight_of(few) <= cover.weight_of(best.selected) <= best.bound


def test_max_coverage_counts_rows_only_when_served_often_enough():
    covers = np.ones((6, 3), dtype=bool)
    covers[3:, 2] = False
    problem = CoverProblem(covers, needs=[1, 2, 3, 1, 2, 3])
    for k, weight in ((0, 0.0), (1, 2.0), (2, 4.0), (3, 5.0)):
        answer = solve_max_coverage(problem, k)
        assert answer.status is SolveStatus.OPTIMAL
        assert answer.covered_weight == answer.upper_bound == weight


@pytest.mark.long
def test_permuted_rows_and_columns_need_as_many():
    rng = np.random.default_rng(0)
    problem = random_cover(5, n_e=60, n_s=24, share=0.8)
    best = solve_cover(problem, heaviest=False)
    assert best.status is SolveStatus.OPTIMAL
    for _ in range(2):
        rows, columns = rng.permutation(60), rng.permutation(24)
        moved = CoverProblem(
            problem.covers.toarray()[rows][:, columns],
            problem.weights[rows],
            required_weight=problem.required_weight,
            needs=problem.needs[rows],
            row_sets=problem.row_sets[rows],
        )
        solution = solve_cover(moved, heaviest=False)
        assert solution.status is SolveStatus.OPTIMAL
        assert solution.cost == best.cost


def test_same_answer_with_one_and_two_threads(by_threads):
    """Also without the limit to one thread that solvers run under."""

    def answers():
        found = []
        for seed in (1,):
            problem = random_cover(seed, n_e=100, n_s=30, share=0.8)
            s = solve_cover.__wrapped__(problem, budget=1e8)
            found.append((s.selected.tolist(), s.lower_bound, s.proof))
        return found

    one, two = by_threads(answers)
    assert one == two


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"needs": 0}, "needs must be from 1 to 1000"),
        ({"needs": 1001}, "needs must be from 1 to 1000"),
        ({"needs": 1.5}, "needs must be whole numbers"),
        ({"needs": [1, 2]}, r"needs must be one number or \(3,\), got \(2,\)"),
        ({"needs": [1, np.nan, 1]}, "needs must be whole numbers"),
        ({"needs": [1, np.inf, 1]}, "needs must be whole numbers"),
        ({"row_sets": [0, 1]}, r"row_sets must be \(3,\), got \(2,\)"),
        ({"row_sets": [0, -1, 0]}, "row_sets must be from 0 to 9999"),
        ({"row_sets": [0, 10_000, 0]}, "row_sets must be from 0 to 9999"),
        ({"fixed": [True, False]}, "by number, not by a mask"),
        ({"weights": ["a", "b", "c"]}, "weights must be real numbers"),
        ({"weights": [1j, 1, 1]}, "weights must be real numbers"),
        ({"weights": [10**400, 1, 1]}, "weights must be real numbers"),
        ({"costs": [None, 1]}, "costs must be real numbers"),
        ({"needs": {}}, "needs must be real numbers"),
        ({"fixed": [2]}, "fixed must name sets from 0 to 1"),
        ({"fixed": [-1]}, "fixed must name sets from 0 to 1"),
        ({"required_weight": [1.0, 1.0]}, r"required_weight must be \(1,\)"),
        (
            {"required_weight": 1.0, "row_sets": [0, 1, 1]},
            r"required_weight must be \(2,\), one for each row set, got \(1,\)",
        ),
        (
            {"min_coverage": [0.5, 0.5, 0.5], "row_sets": [0, 1, 1]},
            r"min_coverage must be one number or \(2,\)",
        ),
        ({"costs": [1.0, 1e101]}, "costs must be finite and positive"),
        ({"costs": [1.0, 1e-101]}, "costs must be finite and positive"),
    ],
)
def test_bad_numbers_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        CoverProblem(np.ones((3, 2), dtype=bool), **arguments)


def test_an_unknown_set_is_refused():
    problem = CoverProblem(np.ones((3, 2), dtype=bool))
    for unknown in ([2], [-1]):
        with pytest.raises(ValueError, match="selected must name sets from 0 to 1"):
            problem.covered_weight(unknown)
    for mask in ([True, False], np.array([False, True])):
        with pytest.raises(ValueError, match="by number, not by a mask"):
            problem.covered_weight(mask)
    with pytest.raises(ValueError, match="selected must be whole numbers"):
        problem.covered_weight([0.7])
    assert problem.covered_weight([1, 1]) == 3.0
    twice = CoverProblem(np.ones((3, 2), dtype=bool), needs=2)
    assert twice.covered_weight([1, 1]) == 0.0


def test_another_highs_with_more_threads_costs_no_bound():
    """Its scheduler belongs to the process and refuses another number of threads."""
    code = (
        "import highspy\n"
        "other = highspy.Highs()\n"
        "other.setOptionValue('output_flag', False)\n"
        "other.setOptionValue('threads', 2)\n"
        "other.setOptionValue('parallel', 'on')\n"
        "other.minimize(other.addBinary())\n"
        "from tests.solvers.covers.test_multicover import random_cover\n"
        "import numpy as np\n"
        "from solvers import solve_cover\n"
        "costs = np.random.default_rng(0).uniform(1, 2, 12)\n"
        "print(solve_cover(random_cover(2, costs=costs)).proof)\n"
    )
    answer = subprocess.run(
        [sys.executable, "-c", code],
        cwd=Path(__file__).resolve().parents[3],
        capture_output=True,
        text=True,
        check=True,
    )
    assert answer.stdout == "branch and bound (HiGHS)\n"
