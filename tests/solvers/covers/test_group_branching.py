"""Branching on groups of alike sets, against all selections of small covers."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse
from scipy.optimize import Bounds, LinearConstraint, milp

from solvers.covers.bounds.reductions import reduce_problem
from solvers.covers.bounds.relaxation import sets_worth_taking
from solvers.covers.cover import solve_cover, solve_max_coverage
from solvers.covers.cover_problem import CoverProblem
from solvers.covers.exact.group_bounds import PartBounds
from solvers.covers.exact.group_branching import _Tree, best_by_groups
from solvers.covers.exact.group_parts import children, only_selection
from solvers.covers.search.prices import Prices
from solvers.status import SolveStatus, WorkBudget


def alike_covers(seed, *, n_places=5, n_each=3, n_rows=40):
    """A few places, each offered several times over with few rows exchanged."""
    rng = np.random.default_rng(seed)
    places = rng.random((n_rows, n_places)) < 0.35
    offered = np.repeat(places, n_each, axis=1)
    offered ^= rng.random(offered.shape) < 0.06
    weights = rng.integers(1, 9, n_rows).astype(float) if seed % 2 else None
    return reduce_problem(
        CoverProblem(sparse.csr_array(offered), weights, min_coverage=0.8)
    )


def plenty():
    return WorkBudget(1e10)


def every_selection(cover, k):
    return [
        np.array(chosen) for chosen in itertools.combinations(range(cover.n_sets), k)
    ]


def weight_of(cover, chosen):
    serves = cover.by_set.toarray()[chosen] > 0
    return float(cover.weights[serves.any(axis=0)].sum())


@pytest.mark.parametrize("seed", range(6))
def test_the_most_weight_is_that_of_all_selections(seed):
    cover = alike_covers(seed)
    for k in (1, 2, 3):
        most = max(weight_of(cover, chosen) for chosen in every_selection(cover, k))
        for start in (0.0 * cover.weights, cover.weights)[: 4 - k]:
            found = best_by_groups(
                cover, k, target=1.0, multipliers=start, budget=plenty()
            )
            assert found.complete
            assert found.weight == most == found.upper_bound
            assert weight_of(cover, found.selected) == most
        beyond = best_by_groups(
            cover,
            k,
            target=most + cover.grain,
            multipliers=cover.weights,
            budget=plenty(),
        )
        assert beyond.complete
        assert beyond.selected is None
        assert beyond.upper_bound == most


@pytest.mark.parametrize("seed", range(6))
def test_no_selection_of_a_part_exceeds_its_bound(seed):
    cover = alike_covers(seed)
    rng = np.random.default_rng(seed)
    names = rng.permutation(cover.n_sets)
    closed = np.zeros(cover.n_sets, dtype=bool)
    closed[names[:3]] = True
    groups = (np.sort(names[3:7]), np.sort(names[7:9]))
    budget = plenty()
    bounds = PartBounds(cover, 3, 0.0, budget)
    whole = bounds.whole(rng.random(cover.weights.size))
    part = type(whole)(
        closed, groups, whole.shares, whole.primal, whole.costliest, np.inf
    )
    own = [
        weight_of(cover, chosen)
        for chosen in every_selection(cover, 3)
        if not closed[chosen].any()
        and all(np.isin(chosen, group).any() for group in groups)
    ]
    before = np.inf
    for steps in (10, 40, 200):
        (part,) = bounds.lowered([part], steps)
        assert max(own) <= part.bound <= before
        before = part.bound
    assert part.bound < 1.1 * max(own)
    assert not closed[part.costliest].any()
    assert all(np.isin(part.costliest, group).any() for group in groups)


def test_sets_left_out_are_in_no_selection_that_reaches_the_target():
    n_left_out, n_worth_none = 0, 0
    for seed in range(4):
        cover = alike_covers(seed)
        selections = every_selection(cover, 3)
        weights = np.array([weight_of(cover, chosen) for chosen in selections])
        group = np.sort(np.random.default_rng(seed).permutation(cover.n_sets)[:4])
        for target in np.quantile(weights, [0.9, 1.0]):
            enough = np.array(selections)[weights >= target]
            bounds = PartBounds(cover, 3, target, plenty(), leaves_out=True)
            whole = bounds.whole(np.full(cover.weights.size, 0.5))
            for groups in ((), (group,)):
                (part,) = bounds.lowered([replace(whole, groups=groups)], 200)
                of_part = enough[
                    [all(np.isin(c, g).any() for g in groups) for c in enough]
                ]
                assert not part.closed[of_part].any()
                assert not part.closed[group].any() or not groups
                multipliers = part.shares * cover.weights
                kept = sets_worth_taking(cover, 3, multipliers, target)
                assert np.isin(enough, kept).all()
                n_left_out += int(part.closed.sum())
                n_worth_none += cover.n_sets - kept.size
    assert n_left_out > 0
    assert n_worth_none > 0


@pytest.mark.parametrize("seed", range(4))
def test_children_share_out_the_selections_of_a_part(seed):
    cover = alike_covers(seed)
    # No weight is too little to be of interest, so no part leaves a set out.
    tree = _Tree(Prices.even(cover), 3, 0.0, plenty(), first=False)
    selections = every_selection(cover, 3)

    def held(part):
        assert not any(part.closed[group].any() for group in part.groups)
        return np.array(
            [
                not part.closed[chosen].any()
                and all(np.isin(chosen, group).any() for group in part.groups)
                for chosen in selections
            ]
        )

    parts = [tree.bounds.whole(np.ones(cover.weights.size))]
    assert np.all(held(parts[0]))
    for _ in range(4):
        split = [part for part in parts if only_selection(part, tree.n_sets) is None]
        parts = []
        for part in tree.bounds.lowered(split, 10):
            split = children(part, tree.n_sets, tree._alike)
            assert np.array_equal(sum(held(child) * 1 for child in split), held(part))
            parts += split
        parts = parts[:6]


def test_a_cut_search_says_what_is_left_open():
    cover = alike_covers(3, n_places=12, n_each=6, n_rows=200)
    most = solve_max_coverage(cover.problem, 5)
    assert most.status is SolveStatus.OPTIMAL
    found = best_by_groups(
        cover, 5, target=1.0, multipliers=cover.weights, budget=WorkBudget(1e6)
    )
    assert not found.complete
    assert found.weight <= most.covered_weight / cover.unit <= found.upper_bound


@pytest.mark.parametrize("seed", range(6))
def test_the_first_selection_that_will_do_bounds_no_other(seed):
    cover = alike_covers(seed)
    most = max(weight_of(cover, chosen) for chosen in every_selection(cover, 3))
    found = best_by_groups(
        cover,
        3,
        target=0.8 * most,
        multipliers=cover.weights,
        budget=plenty(),
        first=True,
    )
    assert 0.8 * most <= weight_of(cover, found.selected) == found.weight
    assert found.upper_bound >= most
    assert not found.complete or found.weight == most


def test_a_search_cut_before_its_first_bound_claims_nothing():
    cover = alike_covers(3, n_places=12, n_each=6, n_rows=200)

    class Late(WorkBudget):
        """The clock has run out, though work is left."""

        @property
        def exhausted(self):
            return True

    found = best_by_groups(
        cover, 5, target=1.0, multipliers=cover.weights, budget=Late(1e10)
    )
    assert not found.complete
    assert found.upper_bound == cover.total


@pytest.mark.parametrize("seed", range(40))
def test_weights_of_all_sizes_leave_single_selections(seed):
    """Rows of 1e-9 to 1e9: multipliers of the light ones never become exact."""
    rng = np.random.default_rng(seed)
    n_rows, n_sets = int(rng.integers(15, 60)), int(rng.integers(8, 13))
    covers = rng.random((n_rows, n_sets)) < 0.2
    weights = 10.0 ** rng.uniform(-9, 9, n_rows)
    problem = CoverProblem(sparse.csr_array(covers), weights)
    found = solve_max_coverage(problem, 5)
    most = max(
        problem.covered_weight(np.array(chosen))
        for chosen in itertools.combinations(range(n_sets), 5)
    )
    assert found.status is SolveStatus.OPTIMAL
    assert found.covered_weight == pytest.approx(most, rel=1e-10)


@pytest.mark.long
def test_caps_of_a_ball_are_proved_where_the_relaxation_is_short():
    """Caps of 55 degrees: six are needed for 0.95 of 200 points, HiGHS agrees."""
    points, centres = lattice(200), lattice(60)
    covers = points @ centres.T >= np.cos(np.radians(55.0))
    problem = CoverProblem(sparse.csr_array(covers), min_coverage=0.95)
    solution = solve_cover(problem)
    assert solution.status is SolveStatus.OPTIMAL
    assert solution.proof == "sets of 5 by branching on groups of alike sets"
    n, m = covers.shape
    served = sparse.hstack(
        [sparse.csr_array(covers, dtype=float), -sparse.eye_array(n)]
    )
    every = np.concatenate([np.zeros(m), np.ones(n)])
    answer = milp(
        np.concatenate([np.ones(m), np.zeros(n)]),
        integrality=np.concatenate([np.ones(m), np.zeros(n)]),
        bounds=Bounds(0.0, 1.0),
        constraints=[
            LinearConstraint(served, 0.0, np.inf),
            LinearConstraint(every, problem.required_weight[0], np.inf),
        ],
    )
    assert answer.success
    assert len(solution.selected) == round(answer.fun) == 6


def lattice(n):
    """Points spread over the unit ball."""
    z = 1.0 - (2.0 * np.arange(n) + 1.0) / n
    turn = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(n)
    r = np.sqrt(1.0 - z * z)
    return np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=1)
