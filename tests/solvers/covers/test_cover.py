"""Covers against brute force, known optima, and checkers that can say no."""

import dataclasses
import itertools
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse

from solvers import CoverProblem, solve_cover
from solvers.covers.bounds import reductions
from solvers.covers.bounds.reductions import reduce_problem
from solvers.covers.bounds.relaxation import cost_bound, count_bound, coverage_bounds
from solvers.covers.cover import reduced_problem, solve_max_coverage
from solvers.covers.cover_problem import MAX_ENTRIES
from solvers.status import SolveStatus


def reduced_cover(covers, weights, costs, required):
    """The cover that the search would see."""
    return reduce_problem(
        CoverProblem(covers, weights, costs, required_weight=required)
    )


def from_sets(sets, n_elements, **arguments):
    covers = np.zeros((n_elements, len(sets)), dtype=bool)
    for s, members in enumerate(sets):
        covers[list(members), s] = True
    return CoverProblem(covers, **arguments)


def random_problem(seed):
    rng = np.random.default_rng(seed)
    n_e, n_s = int(rng.integers(1, 16)), int(rng.integers(1, 9))
    covers = rng.random((n_e, n_s)) < rng.choice([0.15, 0.35, 0.6])
    weights = [
        None,
        rng.uniform(0.1, 1.0, n_e),
        rng.integers(0, 4, n_e).astype(float),
    ][seed % 3]
    costs = [
        None,
        None,
        rng.uniform(0.5, 1.5, n_s),
        rng.integers(1, 4, n_s).astype(float),
    ][seed % 4]
    share = float(rng.choice([0.5, 0.8, 0.9, 1.0]))
    return CoverProblem(covers, weights, costs, share)


def brute_force(problem):
    """Least cost of a cover (inf if none), and the most weight of at most k sets."""
    covers = problem.covers.toarray()
    best, most = np.inf, [0.0]
    for k in range(problem.costs.size + 1):
        most.append(most[-1])
        for chosen in itertools.combinations(range(problem.costs.size), k):
            weight = problem.weights[covers[:, chosen].any(axis=1)].sum()
            most[-1] = max(most[-1], weight)
            if weight >= problem.required_weight * (1 - 1e-12):
                best = min(best, problem.costs[list(chosen)].sum())
    return best, most[1:]


def visibility(n_e, n_s, *, seed=0, incidence=60.0):
    """Points on a bumpy sphere against directions, as projectors see them."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(n_e, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    normals = points.copy()
    for _ in range(6):
        wave = np.sin(rng.uniform(3, 8) * (points @ rng.normal(size=3)))
        normals += 0.2 * wave[:, None] * rng.normal(size=3)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    directions = rng.normal(size=(n_s, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    lit = normals @ directions.T > np.cos(np.deg2rad(incidence))
    return lit & (points @ directions.T > -0.3), rng.uniform(0.5, 1.5, n_e)


@pytest.mark.long
@pytest.mark.parametrize("first", range(0, 120, 60))
def test_equals_brute_force_whatever_the_budget(first):
    for seed in range(first, first + 60):
        problem = random_problem(seed)
        best, most = brute_force(problem)
        for budget in (1e9, 1e4, 0.0):
            solution = solve_cover(problem, budget=budget)
            if np.isinf(best):
                assert solution.status is SolveStatus.INFEASIBLE
                assert solution.lower_bound == np.inf
                assert solution.covered_weight == pytest.approx(
                    problem.covered_weight(range(problem.costs.size))
                )
                continue
            assert solution.shortfall() == 0.0, seed
            assert solution.lower_bound <= best + 1e-9, seed
            if solution.status is SolveStatus.OPTIMAL or budget == 1e9:
                assert solution.status is SolveStatus.OPTIMAL, seed
                assert solution.cost == pytest.approx(best), seed
        k = 1 + seed % 3
        if k < len(most):
            answer = solve_max_coverage(problem, k)
            assert answer.covered_weight == pytest.approx(most[k]), seed
            assert answer.upper_bound == pytest.approx(most[k]), seed
            rough = solve_max_coverage(problem, k, budget=0.0)
            assert rough.covered_weight <= most[k] + 1e-9
            assert rough.upper_bound >= most[k] - 1e-9


def test_beats_greedy_on_the_greedy_trap():
    """Greedy takes the set of four first and needs three; two suffice."""
    trap = from_sets([{0, 1, 3, 4}, {0, 1, 2}, {3, 4, 5}], 6)
    solution = solve_cover(trap)
    assert solution.status is SolveStatus.OPTIMAL
    assert solution.selected.tolist() == [1, 2]
    assert solution.lower_bound == 2.0


def test_partial_cover_needs_fewer_and_ignores_no_row():
    sets = [set(range(9)), {9}]
    assert solve_cover(from_sets(sets, 10)).selected.tolist() == [0, 1]
    most = solve_cover(from_sets(sets, 10, min_coverage=0.9))
    assert most.selected.tolist() == [0]


def test_required_weight_is_absolute():
    problem = from_sets([{0, 1}, {2}], 3, required_weight=2.0, min_coverage=1.0)
    assert solve_cover(problem).selected.tolist() == [0]


def test_among_the_fewest_the_most_weight():
    sets = [{0, 1, 2}, {0, 1, 2, 3}, {0, 4, 5, 6, 7}, {4, 5}]
    solution = solve_cover(from_sets(sets, 8, required_weight=5.0))
    assert solution.selected.tolist() == [2]
    pair = solve_cover(from_sets(sets, 8, required_weight=6.0))
    assert pair.selected.tolist() == [1, 2]


def test_the_most_weight_is_left_out_on_request_and_nothing_else():
    lighter = 0
    for seed in range(4):
        covers, weights = visibility(200, 60, seed=seed)
        problem = CoverProblem(covers, weights, min_coverage=0.85)
        best = solve_cover(problem)
        any_one = solve_cover(problem, heaviest=False)
        assert (any_one.status, any_one.lower_bound) == (best.status, best.lower_bound)
        assert (any_one.cost, any_one.proof) == (best.cost, best.proof)
        assert any_one.shortfall() == 0.0
        assert any_one.covered_weight <= best.covered_weight
        lighter += any_one.covered_weight < best.covered_weight
        few = [solve_cover(problem, max_sets=2, heaviest=h) for h in (True, False)]
        assert few[0].selected.tolist() == few[1].selected.tolist()
    assert lighter > 0


@pytest.mark.parametrize("cost", [1.0, 2.5])
def test_one_reduction_answers_every_question_as_its_own_would(cost):
    covers, weights = visibility(200, 60, seed=2)
    problem = CoverProblem(covers, weights, np.full(60, cost), 0.9)
    once = reduced_problem(problem)
    answers = [solve_cover(problem), solve_cover(problem, reduced=once)]
    assert answers[0].selected.tolist() == answers[1].selected.tolist()
    assert answers[0].lower_bound == answers[1].lower_bound
    for k in (1, 2, 4):
        best = [solve_max_coverage(problem, k, reduced=r) for r in (None, once)]
        assert best[0].selected.tolist() == best[1].selected.tolist()
        assert best[0].upper_bound == best[1].upper_bound


def test_a_reduction_is_refused_where_it_does_not_belong():
    problem = from_sets([{0, 1}, {2}], 3)
    other = reduced_problem(from_sets([{0}, {1}, {2}], 3))
    with pytest.raises(ValueError, match="reduced must be made from this problem"):
        solve_cover(problem, reduced=other)
    with pytest.raises(ValueError, match="reduced must be made from this problem"):
        solve_max_coverage(problem, 1, reduced=other)
    less = dataclasses.replace(problem, required_weight=np.array([1.0]))
    with pytest.raises(ValueError, match="reduced must be made from this problem"):
        solve_cover(problem, reduced=reduced_problem(less))
    with pytest.raises(ValueError, match="costs differ"):
        reduced_problem(from_sets([{0}, {1}], 2, costs=np.array([1.0, 2.0])))


def test_costs_decide_over_counts():
    sets = [{0, 1, 2}, {0}, {1}, {2}]
    dear = from_sets(sets, 3, costs=np.array([10.0, 1.0, 1.0, 1.0]))
    assert solve_cover(dear).selected.tolist() == [1, 2, 3]
    assert solve_cover(from_sets(sets, 3)).selected.tolist() == [0]


@pytest.mark.parametrize("cost", [1.0, 2.5])
def test_equal_costs_scale_the_bound(cost):
    problem = from_sets([{0}, {1}], 2, costs=np.full(2, cost))
    solution = solve_cover(problem)
    assert solution.lower_bound == solution.cost == 2 * cost


def test_unreachable_weight_is_an_answer():
    solution = solve_cover(from_sets([{0}, {1}], 3, weights=np.array([1.0, 2.0, 5.0])))
    assert solution.status is SolveStatus.INFEASIBLE
    assert solution.covered_weight == 3.0
    assert solution.shortfall() == pytest.approx(5 / 8)


def test_too_few_sets_allowed():
    problem = from_sets([{0, 1}, {2}, {3}], 4)
    solution = solve_cover(problem, max_sets=2)
    assert solution.status is SolveStatus.INFEASIBLE
    assert solution.lower_bound == 3.0
    assert solution.covered_weight == 3.0
    assert solution.selected.size == 2


def test_nothing_required_needs_nothing():
    solution = solve_cover(from_sets([{0}], 1, required_weight=0.0))
    assert solution.status is SolveStatus.OPTIMAL
    assert solution.selected.size == 0
    weightless = solve_cover(from_sets([{0}], 1, weights=np.zeros(1)))
    assert weightless.selected.size == 0


@pytest.mark.parametrize("shape", [(0, 3), (3, 0), (0, 0)])
def test_empty_matrices_are_answered(shape):
    problem = CoverProblem(np.zeros(shape, dtype=bool))
    expected = SolveStatus.INFEASIBLE if shape[0] else SolveStatus.OPTIMAL
    solution = solve_cover(problem)
    assert solution.status is expected
    assert solution.selected.size == 0
    assert solve_max_coverage(problem, 0).selected.size == 0


def test_sets_without_members_are_an_answer_beside_floors_of_row_sets():
    floors = {"required_weight": [0.0, 1.0], "row_sets": [0, 1, 1]}
    problem = CoverProblem(np.zeros((3, 2), dtype=bool), required_total=2.0, **floors)
    solution = solve_cover(problem)
    assert solution.status is SolveStatus.INFEASIBLE
    assert solution.selected.size == 0


def test_duplicate_columns_choose_the_cheap_one():
    problem = from_sets([{0, 1}, {0, 1}], 2, costs=np.array([2.0, 1.0]))
    assert solve_cover(problem).selected.tolist() == [1]


def test_what_the_search_forgives_is_no_shortfall():
    """Many weights that no unit divides: each may be rounded by half of one."""
    rng = np.random.default_rng(0)
    weights = rng.random(100_000)
    covers = np.ones((weights.size, 2), dtype=bool)
    covers[0] = [False, True]
    covers[1] = [True, False]
    weights[:2] = 0.0
    total = float(weights.sum())
    for missing, served in ((1e-11, True), (1e-9, False)):
        asked = total * (1.0 + missing)
        problem = CoverProblem(covers, weights, required_weight=asked)
        solution = solve_cover(problem)
        assert (solution.shortfall() == 0.0) is served
        assert (solution.status is SolveStatus.OPTIMAL) is served


@pytest.mark.parametrize("scale", [1e-6, 1e-3, 1.0, 1e6])
def test_costs_of_any_size_are_settled(scale):
    ring = np.eye(5, dtype=bool) | np.roll(np.eye(5, dtype=bool), 1, axis=1)
    costs = scale * np.array([2.0, 2.1, 2.2, 2.3, 2.4])
    solution = solve_cover(CoverProblem(ring, costs=costs))
    assert solution.status is SolveStatus.OPTIMAL
    assert solution.cost == pytest.approx(6.4 * scale)
    assert solution.lower_bound == pytest.approx(6.4 * scale)


def test_a_bound_is_not_above_the_cost_by_rounding():
    """Six times 0.1 is more than six tenths added up."""
    solution = solve_cover(CoverProblem(np.eye(6, dtype=bool), costs=np.full(6, 0.1)))
    assert solution.status is SolveStatus.OPTIMAL
    assert solution.lower_bound == solution.cost


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"seed": 1.5}, r"seed must be a whole number, got 1\.5"),
        ({"seed": -1}, "seed must be at least 0, got -1"),
        ({"budget": "much"}, "budget must be a number, got 'much'"),
        ({"time_limit": None}, "time limit must be a number, got None"),
    ],
)
def test_options_that_are_no_numbers_are_refused(options, words):
    problem = CoverProblem(np.eye(2, dtype=bool))
    with pytest.raises(ValueError, match=words):
        solve_cover(problem, **options)
    with pytest.raises(ValueError, match=words):
        solve_max_coverage(problem, 1, **options)


def test_many_columns_are_not_all_compared(monkeypatch):
    monkeypatch.setattr(reductions, "_MOST_COMPARED", 50)
    covers = np.eye(40, dtype=bool)[:, np.repeat(np.arange(40), 3)]
    solution = solve_cover(CoverProblem(covers))
    assert solution.status is SolveStatus.OPTIMAL
    assert solution.cost == 40


def test_shortfall_catches_a_dropped_set():
    good = solve_cover(from_sets([{0, 1}, {2}], 3))
    spoiled = dataclasses.replace(good, selected=good.selected[:1])
    assert good.shortfall() == 0.0
    assert spoiled.shortfall() == pytest.approx(1 / 3)


@pytest.mark.parametrize("share", [0.9, 0.95])
def test_pairs_are_proved_by_exhaustion(share):
    """Where the relaxation says two, that two don't do is found by looking."""
    rng = np.random.default_rng(3)
    around = np.linspace(0.0, 2 * np.pi, 720, endpoint=False)
    centres = rng.uniform(0.0, 2 * np.pi, 200)
    gap = np.abs((around[:, None] - centres + np.pi) % (2 * np.pi) - np.pi)
    # Arcs of 0.92 of a half circle: two reach 0.92, three everything.
    problem = CoverProblem(gap <= 0.46 * np.pi, min_coverage=share)
    solution = solve_cover(problem)
    assert solution.status is SolveStatus.OPTIMAL
    assert solution.lower_bound == (2 if share == 0.9 else 3)


def test_permuted_rows_and_columns_need_as_many():
    covers, weights = visibility(300, 100, seed=4)
    rng = np.random.default_rng(0)
    reference = solve_cover(CoverProblem(covers, weights, min_coverage=0.95))
    assert reference.status is SolveStatus.OPTIMAL
    for _ in range(2):
        rows, columns = rng.permutation(300), rng.permutation(100)
        moved = CoverProblem(covers[rows][:, columns], weights[rows], min_coverage=0.95)
        solution = solve_cover(moved)
        assert solution.status is SolveStatus.OPTIMAL
        assert solution.selected.size == reference.selected.size


def test_budget_zero_still_gives_a_cover_and_a_true_bound():
    covers, weights = visibility(600, 200, seed=5)
    problem = CoverProblem(covers, weights, min_coverage=0.95)
    best = solve_cover(problem)
    rough = solve_cover(problem, budget=0.0)
    assert best.status is SolveStatus.OPTIMAL
    assert rough.shortfall() == 0.0
    assert rough.lower_bound <= best.cost <= rough.cost
    if rough.status is SolveStatus.FEASIBLE:
        assert "work budget" in rough.proof


def test_time_limit_cuts_and_says_so():
    covers, weights = visibility(600, 200, seed=6)
    problem = CoverProblem(covers, weights, min_coverage=1.0)
    best = solve_cover(problem)
    cut = solve_cover(problem, time_limit=0.0)
    assert cut.shortfall() == 0.0
    assert cut.lower_bound <= best.cost
    assert cut.status is SolveStatus.FEASIBLE
    assert "time limit" in cut.proof


def test_warm_start_is_never_lost():
    covers, weights = visibility(300, 120, seed=7)
    problem = CoverProblem(covers, weights)
    best = solve_max_coverage(problem, 4)
    warm = solve_max_coverage(problem, 4, warm_start=best.selected, budget=0.0)
    assert warm.covered_weight >= best.covered_weight * (1 - 1e-12)
    assert warm.upper_bound >= warm.covered_weight


def test_same_answer_twice():
    covers, weights = visibility(500, 200, seed=8)
    problem = CoverProblem(covers, weights, min_coverage=0.97)
    once, again = (solve_cover(problem, seed=3, budget=2e8) for _ in range(2))
    assert once.selected.tolist() == again.selected.tolist()
    assert (once.lower_bound, once.proof) == (again.lower_bound, again.proof)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), scale=st.sampled_from([0.0, 0.3, 1.0, 50.0]))
def test_bounds_hold_for_any_multipliers(seed, scale):
    rng = np.random.default_rng(seed)
    n_e, n_s = 14, 6
    covers = rng.random((n_e, n_s)) < 0.35
    weights, costs = rng.uniform(0.1, 1.0, n_e), rng.uniform(0.5, 2.0, n_s)
    required = 0.7 * weights[covers.any(axis=1)].sum()
    cover = reduced_cover(sparse.csr_array(covers), weights, costs, required)
    given_ones = scale * rng.normal(size=cover.weights.size)
    weighty = coverage_bounds(cover, given_ones * cover.weights)
    fewest, least = n_s + 1, np.inf
    for k in range(n_s + 1):
        for chosen in itertools.combinations(range(n_s), k):
            weight = weights[covers[:, chosen].any(axis=1)].sum()
            assert weight <= weighty[min(k, cover.n_sets)] * cover.unit * (1 + 1e-9)
            if weight >= required:
                fewest = min(fewest, k)
                least = min(least, costs[list(chosen)].sum())
    assert count_bound(cover, given_ones * cover.weights) <= fewest
    assert cost_bound(cover, given_ones) <= least + 1e-9
    assert cost_bound(cover, np.full(cover.weights.size, np.nan)) <= least


def test_reduction_keeps_the_weights_exact():
    covers, weights = visibility(500, 60, seed=9)
    doubled = np.vstack([covers, covers])
    cover = reduced_cover(
        sparse.csr_array(doubled), np.tile(weights, 2), np.ones(60), 1.0
    )
    assert cover.weights.size <= 500
    assert np.all(cover.weights == np.rint(cover.weights))
    everything = 2 * weights[covers.any(axis=1)].sum()
    assert cover.total * cover.unit == pytest.approx(everything, rel=1e-12)
    for s in range(60):
        mine = doubled[:, s]
        stand_in = doubled[:, cover.kept[cover.stand_in[s]]]
        assert not np.any(mine & ~stand_in)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"weights": np.ones(2)}, r"weights must be \(3,\), got \(2,\)"),
        ({"costs": np.ones(3)}, r"costs must be \(2,\), got \(3,\)"),
        ({"weights": np.array([1.0, np.nan, 1.0])}, "weights must be finite"),
        ({"weights": np.array([1.0, -1.0, 1.0])}, "weights must be finite"),
        ({"weights": np.array([1.0, np.inf, 1.0])}, "weights must be finite"),
        ({"weights": np.full(3, 1e308)}, "finite sum"),
        ({"costs": np.array([1.0, 0.0])}, "costs must be finite and positive"),
        ({"costs": np.array([1.0, np.nan])}, "costs must be finite and positive"),
        ({"min_coverage": 0.0}, r"min_coverage must be in \(0, 1\]"),
        ({"min_coverage": np.nan}, r"min_coverage must be in \(0, 1\]"),
        ({"min_coverage": 1.1}, r"min_coverage must be in \(0, 1\]"),
        ({"required_weight": np.nan}, "required_weight must be finite and at least 0"),
        ({"required_weight": -1.0}, "required_weight must be finite and at least 0"),
    ],
)
def test_bad_numbers_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        CoverProblem(np.ones((3, 2), dtype=bool), **arguments)


@pytest.mark.parametrize(
    ("covers", "message"),
    [
        (np.array([[1.0, np.nan]]), "boolean or hold only 0 and 1"),
        (np.array([[2]]), "boolean or hold only 0 and 1"),
        (np.ones(3, dtype=bool), "must be a matrix"),
        (sparse.csr_array((MAX_ENTRIES, 2), dtype=bool), "2000000 samples"),
        (sparse.csr_array((2, 100_001), dtype=bool), "100000 candidates"),
        (sparse.csr_array((2_000_000, 101), dtype=bool), "the limit of 200000000"),
    ],
)
def test_bad_matrices_are_refused(covers, message):
    with pytest.raises(ValueError, match=message):
        CoverProblem(covers)


def test_too_many_ones_are_refused_before_they_are_worked_on(monkeypatch):
    monkeypatch.setattr("solvers.covers.cover_problem.MAX_ONES", 3)
    CoverProblem(np.eye(3, dtype=bool))
    for covers in (np.eye(4, dtype=bool), sparse.csr_array(np.eye(4, dtype=bool))):
        with pytest.raises(ValueError, match="4 nonzero entries, more than the limit"):
            CoverProblem(covers)


@pytest.mark.parametrize(
    ("arguments", "status", "cost"),
    [
        ({"required_weight": 1e308}, SolveStatus.INFEASIBLE, 2.0),
        ({"required_weight": 1e-320}, SolveStatus.OPTIMAL, 0.0),
        ({"weights": [1e249, 1.0, 1e-300]}, SolveStatus.OPTIMAL, 1.0),
        ({"weights": [1e-249, 1e-249, 1e-249]}, SolveStatus.OPTIMAL, 2.0),
        ({"weights": [0, 0, 0], "required_weight": 0.3}, SolveStatus.INFEASIBLE, 0.0),
        ({"weights": [0, 0, 0]}, SolveStatus.OPTIMAL, 0.0),
        ({"costs": [1e100, 1e-100, 1e-100]}, SolveStatus.OPTIMAL, 2e-100),
        ({"needs": 1000}, SolveStatus.INFEASIBLE, 0.0),
        ({"row_sets": [0, 5, 9]}, SolveStatus.OPTIMAL, 2.0),
        ({"fixed": [0, 1, 2, 2]}, SolveStatus.OPTIMAL, 3.0),
    ],
)
def test_absurd_numbers_are_answered(arguments, status, cost):
    covers = np.array([[1, 1, 0], [1, 1, 0], [0, 0, 1]], dtype=bool)
    problem = CoverProblem(covers, **arguments)
    solution = solve_cover(problem)
    assert solution.status is status
    assert solution.cost == pytest.approx(cost)
    most = solve_max_coverage(problem, 3)
    assert most.covered_weight <= most.upper_bound


def test_bad_limits_are_refused():
    problem = from_sets([{0}], 1)
    with pytest.raises(ValueError, match="max_sets must be at least 1"):
        solve_cover(problem, max_sets=0)
    with pytest.raises(ValueError, match="n_sets must be at least 0"):
        solve_max_coverage(problem, -1)
    with pytest.raises(ValueError, match="warm_start must name sets from 0 to 0"):
        solve_max_coverage(problem, 1, warm_start=[3])
    with pytest.raises(ValueError, match="warm_start must name at most 0"):
        solve_max_coverage(problem, 0, warm_start=[0])
    for number in (1.5, "1", np.inf):
        with pytest.raises(ValueError, match="max_sets must be a whole number"):
            solve_cover(problem, max_sets=number)
        with pytest.raises(ValueError, match="n_sets must be a whole number"):
            solve_max_coverage(problem, number)
    assert solve_cover(problem, budget=np.inf).cost == 1.0
    with pytest.raises(ValueError, match="time limit is nan"):
        solve_cover(problem, time_limit=float("nan"))


def test_values_are_frozen():
    solution = solve_cover(from_sets([{0}], 1))
    with pytest.raises(dataclasses.FrozenInstanceError):
        solution.status = SolveStatus.UNKNOWN
    with pytest.raises(ValueError, match="read-only"):
        solution.problem.weights[0] = 2.0


def test_the_example_of_the_page_runs(capsys):
    page = Path(__file__).resolve().parents[3] / "docs" / "method" / "covers.md"
    (code,) = re.findall(r"```python\n(.*?)```", page.read_text("utf-8"), re.S)
    exec(compile(code, page, "exec"), {})
    assert capsys.readouterr().out.startswith("[0 2] 2.0 proven optimal ")


def published(set_cover_files, name):
    instance = set_cover_files.BY_NAME[name]
    if not instance.path.exists():
        pytest.skip("the shared set cover instances aren't here")
    return instance, *instance.read()


@pytest.mark.parametrize("name", ["map1", "map2", "stn27", "scpe1"])
def test_published_covers_are_proved(name, set_cover_files):
    instance, covers, _ = published(set_cover_files, name)
    solution = solve_cover(CoverProblem(covers), budget=2e10)
    assert solution.status is SolveStatus.OPTIMAL
    assert solution.shortfall() == 0.0
    assert solution.lower_bound == solution.cost == instance.fewest


@pytest.mark.parametrize("name", ["scp41", "scp61", "scpcyc06"])
def test_published_covers_are_nearly_reached_by_little_work(name, set_cover_files):
    instance, covers, _ = published(set_cover_files, name)
    solution = solve_cover(CoverProblem(covers), budget=2e9)
    assert solution.shortfall() == 0.0
    assert solution.lower_bound <= instance.fewest <= solution.cost
    assert solution.cost <= instance.fewest + 1


@pytest.mark.parametrize("name", ["scp41", "scp61"])
def test_published_costs_are_proved(name, set_cover_files):
    instance, covers, costs = published(set_cover_files, name)
    solution = solve_cover(CoverProblem(covers, costs=costs), budget=2e10)
    assert solution.status is SolveStatus.OPTIMAL
    assert solution.lower_bound == solution.cost == instance.cheapest


def test_same_answer_with_one_and_two_threads(by_threads):
    """Also without the limit to one thread that solvers run under."""

    def answers():
        found = []
        for seed in range(2):
            covers, weights = visibility(500, 200, seed=seed)
            problem = CoverProblem(covers, weights, min_coverage=0.95)
            s = solve_cover.__wrapped__(problem, budget=3e8)
            found.append((s.selected.tolist(), s.lower_bound, s.proof))
        return found

    one, two = by_threads(answers)
    assert one == two
