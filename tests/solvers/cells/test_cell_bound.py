"""Bounds over cells: against brute force, known optima, and random poses."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.optimize import linprog
from support.array_trees import ArrayTree
from support.leaf_trees import (
    leaves_of,
    multiplier_bound,
    rederived,
    tree_of_leaves,
)

from solvers.bit_rows import pack_rows, unpack_rows
from solvers.cells import cell_bound
from solvers.cells.cell_bound import CellStatus, bound_count
from solvers.cells.cell_multipliers import MultiplierSearch
from solvers.cells.cell_problem import CellProblem, whole_rows
from solvers.cells.cell_store import CellStore
from solvers.cells.cell_subtrees import Subtrees
from solvers.cells.cell_tuples import _split, refute_tuples
from solvers.cells.known_poses import proved_over
from solvers.status import WorkBudget

DEG = np.pi / 180.0
PLENTY = 1e12


def serves_enough(problem, rows):
    """Return whether poses with these rows, shape (K, n_rows), serve enough."""
    served = rows.sum(axis=0) >= problem.needs
    each = np.bincount(
        problem.row_sets,
        problem.weights * served,
        minlength=problem.required_weight.size,
    )
    total = (problem.required_total or 0.0) * (1 - 1e-11)
    each_met = np.all(each >= problem.required_weight * (1 - 1e-11))
    return bool(each_met and each.sum() >= total)


def fewest(problem, leaves, most):
    """Return the fewest cells, with repetition, that serve enough; inf if > most."""
    for k in range(most + 1):
        for cells in itertools.combinations_with_replacement(range(len(leaves)), k):
            if serves_enough(problem, leaves[list(cells)]):
                return k
    return math.inf


def random_tree(rng, n_rows, *, density=None):
    """Return a tree of 2 to 4 levels and some ten leaves, in places loose."""
    depth, parents, levels = int(rng.integers(2, 5)), [-1], [0]
    for _ in range(int(rng.integers(6, 18))):
        above = int(rng.choice([c for c, level in enumerate(levels) if level < depth]))
        parents.append(above)
        levels.append(levels[above] + 1)
    parents = np.array(parents)
    n_leaves = parents.size - np.unique(parents[parents >= 0]).size
    density = rng.uniform(0.15, 0.6) if density is None else density
    leaves = rng.random((n_leaves, n_rows)) < density
    tree = tree_of_leaves(parents, pack_rows(leaves), n_rows)
    if rng.random() < 0.3:
        loose = unpack_rows(tree.rows, n_rows)
        loose[0] = True
        tree = ArrayTree(parents, pack_rows(loose), n_rows)
    return tree, leaves


def random_problem(rng, leaves, *, plain=False):
    """Return a problem of random kind that is rarely out of reach."""
    n = leaves.shape[1]
    weights = [
        np.ones(n),
        rng.integers(0, 6, n).astype(float),
        rng.random(n),
        rng.random(n) ** 8,
    ][int(rng.integers(4))]
    redundancy = np.ones(n, dtype=int)
    row_sets = np.zeros(n, dtype=int)
    if not plain and rng.random() < 0.5:
        redundancy = rng.integers(0, 3, n)
    if not plain and rng.random() < 0.4:
        row_sets = rng.integers(0, 2, n)
    n_sets = int(row_sets.max()) + 1
    reach = leaves.any(axis=0) | (redundancy == 0)
    weight = np.bincount(row_sets, weights * reach, minlength=n_sets)
    share = rng.choice([1.0, 0.9, 0.7, 0.4], n_sets)
    return CellProblem(weights, share * weight, redundancy, row_sets)


def with_floors(rng, problem):
    """The same weights in two or three row sets, with floors and a total."""
    n, n_sets = problem.weights.size, int(rng.integers(2, 4))
    row_sets = rng.integers(0, n_sets, n)
    weight = np.bincount(row_sets, problem.weights, minlength=n_sets)
    share = rng.choice([0.0, 0.3, 0.5, 0.8], n_sets)
    total = rng.choice([0.3, 0.5, 0.7]) * problem.required_weight.sum()
    return CellProblem(
        problem.weights, share * weight, problem.needs, row_sets, float(total)
    )


def random_case(seed, **kinds):
    rng = np.random.default_rng(seed)
    tree, leaves = random_tree(rng, int(rng.integers(3, 12)))
    return tree, leaves, random_problem(rng, leaves, **kinds)


@pytest.mark.parametrize("block", range(8))
def test_what_is_complete_equals_brute_force(block):
    statuses = set()
    for seed in range(25 * block, 25 * block + 25):
        tree, leaves, problem = random_case(seed)
        if seed % 3 == 0:
            problem = with_floors(np.random.default_rng(seed), problem)
        count = 1 + seed % 4
        truth = fewest(problem, leaves, count)
        answer = bound_count(problem, tree, count, budget=PLENTY)
        statuses.add(answer.status)
        if answer.status is CellStatus.INFEASIBLE:
            assert fewest(problem, np.repeat(leaves, 2, axis=0), 5) == math.inf
            continue
        assert answer.lower_bound == min(truth, count), seed
        assert (answer.status is CellStatus.PROVED) == (truth >= count)
        if answer.survivor is not None:
            cells = unpack_rows(tree.rows[answer.survivor], tree.n_rows)
            assert len(cells) == truth < count
            assert serves_enough(problem, cells)
            assert np.all(np.isin(answer.survivor, leaves_of(tree.parents)))
    assert {CellStatus.PROVED, CellStatus.SURVIVED} <= statuses


@pytest.mark.parametrize("n_poses", [2, 3])
@pytest.mark.parametrize("multipliers", ["none", "weights", "random", "one"])
def test_the_tuple_search_equals_brute_force(n_poses, multipliers):
    outcomes = []
    for seed in range(60):
        tree, leaves, problem = random_case(10_000 + seed)
        whole = whole_rows(problem)
        rng = np.random.default_rng(seed)
        prices = {
            "none": np.zeros(tree.n_rows),
            "weights": problem.weights,
            "random": rng.random(tree.n_rows),
            "one": np.eye(tree.n_rows)[0],
        }[multipliers]
        budget = WorkBudget(PLENTY)
        store = CellStore(tree, budget)
        if seed % 3 == 0:
            store.split(np.array([0]))
            store.split(store.frontier[:1])
        found = refute_tuples(whole, store, n_poses, whole.multipliers(prices), budget)
        enough = any(
            serves_enough(problem, leaves[list(cells)])
            for cells in itertools.combinations_with_replacement(
                range(len(leaves)), n_poses
            )
        )
        assert found.refuted == (not enough), seed
        outcomes.append(enough)
        if enough:
            names = store.names[found.survivor]
            assert names.size == n_poses
            assert np.all(np.isin(names, leaves_of(tree.parents)))
            assert serves_enough(problem, unpack_rows(tree.rows[names], tree.n_rows))
    assert 8 < sum(outcomes) < 56


def test_known_poses_and_what_was_proved_before_change_no_bound():
    statuses = set()
    for seed in range(40):
        tree, leaves, problem = random_case(40_000 + seed)
        plain = bound_count(problem, tree, 3, budget=PLENTY)
        rng = np.random.default_rng(seed)
        # Guides may be poses, all or few of them, and even such as there are none.
        for known in (leaves, leaves[:1], rng.random(leaves.shape) < 0.9):
            led = bound_count(problem, tree, 3, known=known, budget=PLENTY)
            assert (led.status, led.lower_bound) == (plain.status, plain.lower_bound)
        if plain.status is CellStatus.INFEASIBLE:
            continue
        least = int(plain.lower_bound)
        led = bound_count(problem, tree, 3, least=least, budget=PLENTY)
        assert (led.status, led.lower_bound) == (plain.status, plain.lower_bound)
        statuses.add(plain.status)
    assert {CellStatus.PROVED, CellStatus.SURVIVED} <= statuses


def test_two_poses_in_one_cell_are_two_poses():
    # One root, two halves: each half serves one of two rows, so that both poses stand
    # in the root, one in each half.
    parents = np.array([-1, 0, 0])
    halves = tree_of_leaves(parents, pack_rows(np.eye(2, dtype=bool)), 2)
    answer = bound_count(CellProblem(np.ones(2), 2.0), halves, 3)
    assert answer.lower_bound == 2
    assert answer.survivor.tolist() == [1, 2]
    assert bound_count(CellProblem(np.ones(2), 1.0), halves, 3).lower_bound == 1


def test_two_poses_in_one_leaf_serve_what_needs_two():
    only = ArrayTree(np.array([-1]), pack_rows(np.ones((1, 3), dtype=bool)), 3)
    problem = CellProblem(np.ones(3), 3.0, np.array([1, 2, 3]))
    answer = bound_count(problem, only, 5)
    assert answer.lower_bound == 3
    assert answer.survivor.tolist() == [0, 0, 0]
    assert bound_count(problem, only, 3).status is CellStatus.PROVED
    two = CellProblem(np.ones(3), 2.0, np.array([1, 2, 3]))
    assert bound_count(two, only, 5).survivor.tolist() == [0, 0]


@pytest.mark.parametrize("n_poses", [1, 2, 3, 4])
def test_every_multiset_of_leaves_is_met_once(n_poses):
    for seed in range(3):
        tree, leaves, problem = random_case(seed)
        store = CellStore(tree, WorkBudget(PLENTY))
        subtrees = Subtrees(
            whole_rows(problem), store, n_poses, np.zeros(tree.n_rows, dtype=np.int64)
        )
        stack, ends = [np.full((1, n_poses), subtrees.root)], []
        while stack:
            node = stack.pop()
            parts, ended = _split(node, subtrees)
            if ended is None:
                stack += [part[None] for part in parts if np.all(part >= 0)]
            else:
                ends.append(tuple(sorted(subtrees.cell(int(t)) for t in ended)))
        names = np.sort(store.names[np.unique(ends)])
        np.testing.assert_array_equal(names, leaves_of(tree.parents))
        assert len(set(ends)) == len(ends)
        assert len(ends) == math.comb(len(leaves) + n_poses - 1, n_poses)


def test_a_cut_bound_is_true_and_says_so():
    cut = 0
    for seed in range(120):
        tree, leaves, problem = random_case(20_000 + seed)
        count = 1 + seed % 4
        truth = fewest(problem, leaves, count)
        budget = 10.0 ** np.random.default_rng(seed).uniform(4.5, 7.5)
        answer = bound_count(problem, tree, count, budget=budget)
        if answer.status is CellStatus.INFEASIBLE:
            continue
        assert answer.lower_bound <= truth
        if answer.status is CellStatus.CUT:
            cut += 1
            assert answer.lower_bound < count
            assert answer.proof.endswith("search cut by the work budget")
    assert cut > 12
    tree, leaves, problem = random_case(3)
    answer = bound_count(problem, tree, 9, time_limit=0.0)
    assert answer.proof.endswith("search cut by the time limit")
    assert answer.lower_bound <= fewest(problem, leaves, 8)


def test_multisets_of_too_many_cells_are_left_and_said_to_be(monkeypatch):
    """Where three poses are needed and multipliers prove two of them."""
    left = 0
    for seed in range(60):
        tree, leaves, problem = random_case(20_000 + seed)
        truth = fewest(problem, leaves, 4)
        whole = bound_count(problem, tree, 4)
        with monkeypatch.context() as patch:
            patch.setattr(cell_bound, "_BRIEFLY", 1e-9)
            answer = bound_count(problem, tree, 4, most_cells=1)
        assert answer.lower_bound <= whole.lower_bound == min(truth, 4)
        if answer.status is CellStatus.CUT:
            left += 1
            n = int(answer.lower_bound)
            said = f"multisets of {n} cells are too many to search for long"
            assert answer.proof.endswith(said)
            assert n >= 2
        else:
            assert answer.lower_bound == whole.lower_bound
    assert left >= 5


NUMBERS = st.one_of(
    st.floats(allow_nan=True, allow_infinity=True),
    st.sampled_from([0.0, -1.0, np.nan, np.inf, -np.inf, 1e308, 5e-324]),
    st.floats(0.0, 10.0),
)
CASES = [random_case(seed) for seed in range(30_000, 30_040)]
TRUTHS = [fewest(problem, leaves, 4) for _, leaves, problem in CASES]


def most_of(problem, leaves, k):
    return max(
        float(problem.weights @ (leaves[list(cells)].sum(axis=0) >= problem.needs))
        for cells in itertools.combinations_with_replacement(range(len(leaves)), k)
    )


@settings(max_examples=150, deadline=None)
@given(
    st.integers(0, len(CASES) - 1), arrays(np.float64, 12, elements=NUMBERS), st.data()
)
def test_the_bound_holds_for_any_multipliers(case, numbers, data):
    tree, leaves, problem = CASES[case]
    multipliers = numbers[: tree.n_rows]
    k = data.draw(st.integers(0, 2))
    largest_cost = data.draw(st.sampled_from([0, 2**40, 2**48, 2**50]))
    bound, most = multiplier_bound(
        problem, tree, multipliers, n_poses=k, largest_cost=largest_cost
    )
    if TRUTHS[case] < math.inf:
        assert bound <= TRUTHS[case]
    assert most >= most_of(problem, leaves, k) * (1 - 1e-15)


def fractional_fewest(problem, leaves):
    """Return the optimum of the linear program over all leaves."""
    n, rows = leaves.shape
    n_sets = problem.required_weight.size
    member = (problem.row_sets == np.arange(n_sets)[:, None]) * problem.weights
    served = np.hstack([-leaves.T.astype(float), np.diag(problem.needs.astype(float))])
    enough = np.hstack([np.zeros((n_sets, n)), -member])
    upper = np.concatenate([np.zeros(rows), -problem.required_weight * (1 - 1e-12)])
    bounds = [(0, None)] * n + [(0, 1)] * rows
    costs = np.concatenate([np.ones(n), np.zeros(rows)])
    return linprog(costs, np.vstack([served, enough]), upper, bounds=bounds).fun


def test_multipliers_reach_the_linear_program_over_leaves():
    reached, worth = 0, set()
    for seed in range(60):
        tree, leaves, problem = random_case(40_000 + seed)
        optimum = fractional_fewest(problem, leaves)
        if optimum is None or abs(optimum - round(optimum)) < 1e-4:
            continue
        whole, budget = whole_rows(problem), WorkBudget(PLENTY)
        search = MultiplierSearch(whole, CellStore(tree, budget), budget)
        k = 1
        while search.refute(k):
            k += 1
        assert search.bound == math.ceil(optimum), seed
        reached += 1
        worth.add(search.bound)
    assert reached > 10
    assert {2.0, 3.0} <= worth


def test_the_answer_derives_its_own_bound_again():
    beyond = 0
    for seed in range(60):
        tree, leaves, problem = random_case(seed)
        answer = bound_count(problem, tree, 3, budget=PLENTY)
        if answer.status is CellStatus.INFEASIBLE:
            continue
        bound, most = rederived(answer)
        assert (bound, most) == (answer.by_multipliers, answer.most_weight)
        assert most >= most_of(problem, leaves, 2) * (1 - 1e-15)
        assert min(bound, 3) <= answer.lower_bound
        beyond += answer.lower_bound > bound
    assert beyond >= 3


def test_a_spoiled_answer_is_caught():
    caught = 0
    for seed in range(60):
        tree, _, problem = random_case(seed)
        good = bound_count(problem, tree, 3, budget=PLENTY)
        if good.by_multipliers < 2 or good.status is CellStatus.INFEASIBLE:
            continue
        rows = good.multipliers.copy()
        rows[int(np.argmax(rows))] = 0
        for spoiled in (
            dataclasses.replace(good, multipliers=rows),
            dataclasses.replace(good, largest_cost=good.largest_cost // 2),
            dataclasses.replace(good, by_multipliers=good.by_multipliers + 1),
        ):
            bound, most = rederived(spoiled)
            # Asked for less than cells cost, the walk goes on to finer ones.
            if spoiled.largest_cost == good.largest_cost:
                assert bound <= good.by_multipliers
            caught += (bound, most) != (spoiled.by_multipliers, spoiled.most_weight)
    assert caught > 30


def test_order_of_rows_and_cells_changes_nothing():
    for seed in range(20):
        tree, _, problem = random_case(seed)
        rng = np.random.default_rng(seed)
        rows = rng.permutation(tree.n_rows)
        turned = CellProblem(
            problem.weights[rows],
            problem.required_weight,
            problem.needs[rows],
            problem.row_sets[rows],
        )
        # Another order of cells in which parents still come first.
        depth = np.zeros(tree.parents.size)
        for cell in range(1, depth.size):
            depth[cell] = depth[tree.parents[cell]] + 1
        order = np.lexsort((rng.random(depth.size), depth))
        place = np.argsort(order)
        dense = unpack_rows(tree.rows, tree.n_rows)[order][:, rows]
        above = tree.parents[order]
        parents = np.where(above >= 0, place[above], -1)
        other = ArrayTree(parents, pack_rows(dense), tree.n_rows)
        one = bound_count(problem, tree, 4, budget=PLENTY)
        two = bound_count(turned, other, 4, budget=PLENTY)
        assert (one.lower_bound, one.status) == (two.lower_bound, two.status)


def test_no_requirement_needs_no_pose_and_none_reaches_too_much():
    tree, leaves, _ = random_case(1)
    weights = np.ones(tree.n_rows)
    nothing = bound_count(CellProblem(weights, 0.0), tree, 2)
    assert nothing.lower_bound == 0
    assert nothing.survivor.size == 0
    zero = bound_count(CellProblem(0 * weights, 0.0), tree, 2)
    assert zero.lower_bound == 0
    reach = float(leaves.any(axis=0).sum())
    beyond = bound_count(CellProblem(weights, reach + 0.5), tree, 2)
    assert beyond.status is CellStatus.INFEASIBLE
    assert beyond.lower_bound == math.inf
    fixed = CellProblem(weights, reach, np.zeros(tree.n_rows, dtype=int))
    assert bound_count(fixed, tree, 2).lower_bound == 0


# Synthetic workspaces whose optimum is known.


def on_circle(cap_trees, n, reach, depth):
    """Return arcs that serve exactly ``reach`` of n even points, wherever they lie."""
    spacing = 2 * np.pi / n
    points = cap_trees.circle(spacing * (np.arange(n) + 0.3))
    return cap_trees.CircleTree(points, (reach - 0.5) / 2 * spacing, depth)


@pytest.mark.parametrize(
    ("n", "reach", "share"),
    [(60, 20, 1.0), (60, 21, 1.0), (61, 20, 1.0), (97, 14, 1.0), (96, 16, 0.9)],
)
def test_the_circle_needs_as_many_arcs_as_divide_it(cap_trees, n, reach, share):
    # An arc of (reach - 1/2) spacings holds reach - 1 or reach points; cells of under
    # 1/8 spacing each side add none.
    tree = on_circle(cap_trees, n, reach, 3 + int(np.ceil(np.log2(n))))
    needed = math.ceil(share * n)
    truth = math.ceil(needed / reach)
    answer = bound_count(CellProblem(np.ones(n), needed), tree, truth)
    assert answer.status is CellStatus.PROVED
    assert answer.lower_bound == truth
    assert answer.most_weight < needed or answer.by_multipliers < truth
    # One more claimed: the true number survives, and its cells are such a cover.
    more = bound_count(CellProblem(np.ones(n), needed), tree, truth + 1)
    assert more.status is CellStatus.SURVIVED
    assert more.lower_bound == truth == more.survivor.size
    rows = tree.serves(more.survivor)
    assert rows.any(axis=0).sum() >= needed


def test_what_no_search_refutes_is_soon_seen(cap_trees):
    """Two caps are enough: only one has to be refuted, and no cells beside are made."""
    tree = cap_trees.SphereTree(cap_trees.spread(120), 66 * DEG, 6)
    problem = CellProblem(np.ones(120), 76.0)
    answer = bound_count(problem, tree, 3)
    assert (answer.lower_bound, answer.status) == (2, CellStatus.SURVIVED)
    assert tree.serves(answer.survivor).any(axis=0).sum() >= 76
    vainly = CellStore(tree, WorkBudget(PLENTY))
    search = MultiplierSearch(whole_rows(problem), vainly, WorkBudget(PLENTY))
    assert not search.refute(2)
    assert 3 * answer.cells_used < vainly.size


@pytest.mark.parametrize("redundancy", [2, 3])
def test_the_circle_twice_needs_twice_as_many(cap_trees, redundancy):
    tree = on_circle(cap_trees, 48, 16, 9)
    problem = CellProblem(np.ones(48), 48.0, np.full(48, redundancy))
    answer = bound_count(problem, tree, 3 * redundancy)
    assert answer.status is CellStatus.PROVED
    assert answer.lower_bound == 3 * redundancy


def test_two_row_sets_need_their_own_shares(cap_trees):
    # Half the circle is one mesh, half the other; arcs reach a quarter.
    tree = on_circle(cap_trees, 64, 16, 9)
    row_sets = (np.arange(64) >= 32).astype(int)
    both = CellProblem(np.ones(64), [32.0, 16.0], None, row_sets)
    assert bound_count(both, tree, 3).status is CellStatus.PROVED
    either = CellProblem(np.ones(64), 48.0)
    assert bound_count(either, tree, 3).status is CellStatus.PROVED
    one = CellProblem(np.ones(64), [32.0, 0.0], None, row_sets)
    more = bound_count(one, tree, 3)
    assert (more.lower_bound, more.status) == (2, CellStatus.SURVIVED)


# Covering radii of the sphere by equal caps: 3 caps 90, 4 caps 70.5288 (tetrahedron),
# 5 caps 63.4349, 6 caps 54.7356 (octahedron) degrees. K caps of angle a that serve all
# of a point set cover the sphere with caps of a + delta, delta the largest hole of the
# set; so with a + delta below the covering radius of K, K caps aren't enough.
def hole(points):
    far = np.random.default_rng(0).normal(size=(20_000, 3))
    far /= np.linalg.norm(far, axis=1, keepdims=True)
    return float(np.arccos(np.clip((far @ points.T).max(axis=1), -1, 1)).max())


@pytest.mark.parametrize(
    ("degrees", "too_few", "truth"), [(71.0, 90.0, 4), (80.0, 90.0, 4)]
)
def test_the_sphere_needs_a_tetrahedron(cap_trees, degrees, too_few, truth):
    points = cap_trees.spread(300)
    assert degrees * DEG + hole(points) < too_few * DEG
    tree = cap_trees.SphereTree(points, degrees * DEG, 5)
    answer = bound_count(CellProblem(np.ones(300), 300.0), tree, truth)
    assert answer.status is CellStatus.PROVED
    assert answer.lower_bound == truth
    assert "multisets of 3 cells" in answer.proof


def test_what_multisets_of_three_refute_multipliers_get_work_for_again(
    cap_trees, monkeypatch
):
    """Who follows the proof has multipliers alone."""
    problem = CellProblem(np.ones(300), 285.0)
    tree = cap_trees.SphereTree(cap_trees.spread(300), 60 * DEG, 5)
    monkeypatch.setattr(cell_bound, "_MULTIPLIERS_SHARE", 1e-5)
    monkeypatch.setattr(cell_bound, "_AGAIN", 0.0)
    by_multisets = bound_count(problem, tree, 4, budget=1e9)
    assert by_multisets.proof == "multisets of 3 cells by exhaustion"
    assert by_multisets.by_multipliers < 4
    monkeypatch.undo()
    monkeypatch.setattr(cell_bound, "_MULTIPLIERS_SHARE", 1e-5)
    again = bound_count(problem, tree, 4, budget=1e9)
    assert again.lower_bound == by_multisets.lower_bound == again.by_multipliers == 4
    assert again.proof == "multipliers of the rows"


@pytest.mark.long
def test_just_below_the_tetrahedron_four_caps_fail(cap_trees):
    points = cap_trees.spread(600)
    assert 63.4349 < 63.5 < 63.5 + hole(points) / DEG < 70.5288
    tree = cap_trees.SphereTree(points, 63.5 * DEG, 6)
    answer = bound_count(CellProblem(np.ones(600), 600.0), tree, 6)
    assert answer.lower_bound == 5
    assert "multisets of 4 cells" in answer.proof


SOLIDS = {
    4: (70.5288, [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]),
    6: (54.7356, np.concatenate([np.eye(3), -np.eye(3)])),
    12: (
        37.3774,
        [
            np.roll([0, s, t * (1 + 5**0.5) / 2], k)
            for k in range(3)
            for s in (1, -1)
            for t in (1, -1)
        ],
    ),
}


@pytest.mark.long
@pytest.mark.parametrize("count", [4, 6, 12])
def test_no_bound_beats_a_platonic_cover(cap_trees, count):
    radius, axes = SOLIDS[count]
    axes = np.array(axes, dtype=float)
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    points = cap_trees.spread(500)
    wide = (radius + 1e-3) * DEG
    assert np.all((axes @ points.T).max(axis=0) >= np.cos(wide))
    tree = cap_trees.SphereTree(points, wide, 4)
    answer = bound_count(CellProblem(np.ones(500), 500.0), tree, count + 1, budget=1e9)
    assert answer.lower_bound <= count
    assert answer.status in (CellStatus.SURVIVED, CellStatus.CUT)
    # The areas of caps prove 3, 5 and 10; coarse cells lose up to two of them.
    assert answer.lower_bound >= math.ceil(2 / (1 - math.cos(wide))) - 2


@pytest.mark.parametrize("kind", ["circle", "sphere"])
def test_rows_of_cells_hold_what_their_poses_serve(cap_trees, kind):
    rng = np.random.default_rng(5)
    if kind == "circle":
        tree = cap_trees.CircleTree(cap_trees.circle(rng.uniform(0, 7, 200)), 0.5, 10)
        cells = rng.integers(0, 2**11 - 1, 250)
    else:
        tree = cap_trees.SphereTree(cap_trees.spread(200), 0.5, 6)
        cells = rng.integers(0, 2 * (4**7 - 1), 100)
    held = {}
    for cell in cells:
        poses = tree.inside(cell, rng, 400)
        served = np.any(poses @ tree.points.T >= np.cos(tree.radius), axis=0)
        above = [int(cell)]
        while tree.level(np.array(above[-1:]))[0] > 0:
            above.append(int(tree.parent(np.array(above[-1:]))[0]))
        new = [c for c in above if c not in held]
        if new:
            held |= dict(zip(new, tree.serves(np.array(new)), strict=True))
        assert not any(np.any(served & ~held[c]) for c in above)


def test_a_root_that_cannot_be_split_is_weighed_too():
    """Two poses are needed in the one cell there is; one is refuted by weighing it."""
    tree = ArrayTree(np.array([-1]), pack_rows(np.ones((1, 3), dtype=bool)), 3)
    problem = CellProblem(np.ones(3), 1.0, np.full(3, 2))
    answer = bound_count(problem, tree, 2)
    assert answer.status is CellStatus.PROVED
    assert answer.lower_bound == 2


@pytest.mark.parametrize(
    ("weights", "required"), [(np.zeros(3), 1.0), (np.ones(3), 1e300)]
)
def test_what_nothing_can_serve_is_infeasible(weights, required):
    tree = ArrayTree(np.array([-1]), pack_rows(np.ones((1, 3), dtype=bool)), 3)
    answer = bound_count(CellProblem(weights, required), tree, 2)
    assert answer.status is CellStatus.INFEASIBLE


def test_no_cover_by_free_projectors_beats_the_bound(cap_trees):
    rng = np.random.default_rng(11)
    for _ in range(2):
        points = rng.normal(size=(150, 3)) * rng.uniform(0.3, 1.0, 3)
        points /= np.linalg.norm(points, axis=1, keepdims=True)
        weights, radius = rng.random(150), rng.uniform(25, 45) * DEG
        needed = rng.choice([0.8, 0.9, 0.95]) * weights.sum()
        poses = np.concatenate([points, rng.normal(size=(6_000, 3))])
        poses /= np.linalg.norm(poses, axis=1, keepdims=True)
        serves = poses @ points.T >= np.cos(radius)
        found = greedy(serves, weights, needed)
        tree = cap_trees.SphereTree(points, radius, 5)
        answer = bound_count(CellProblem(weights, needed), tree, found + 1, budget=1e9)
        assert 2 <= answer.lower_bound <= found
        top = np.argsort(-(serves @ weights))[:3000]
        for _ in range(200):
            few = rng.choice(top, found, replace=False)
            assert weights[serves[few].any(axis=0)].sum() <= answer.most_weight


def greedy(serves, weights, needed):
    left, found = weights.copy(), 0
    while weights.sum() - left.sum() < needed:
        left[serves[int(np.argmax(serves @ left))]] = 0.0
        found += 1
    return found


def test_cells_made_when_asked_for_prove_the_same(cap_trees):
    lazy = cap_trees.SphereTree(cap_trees.spread(120), 66 * DEG, 4)
    whole, names = cap_trees.flatten(lazy)
    problem = CellProblem(np.random.default_rng(0).random(120), 50.0)
    lazy.made.clear()
    one, two = bound_count(problem, lazy, 4), bound_count(problem, whole, 4)
    assert (one.lower_bound, one.status) == (two.lower_bound, two.status)
    np.testing.assert_array_equal(one.multipliers, two.multipliers)
    np.testing.assert_array_equal(one.survivor, names[two.survivor])
    assert one.cells_used == len(lazy.made) + 6 < names.size


def test_threads_change_nothing(cap_trees, by_threads):
    tree = cap_trees.SphereTree(cap_trees.spread(200), 50 * DEG, 4)
    problem = CellProblem(np.random.default_rng(0).random(200), 80.0)
    one, two = by_threads(lambda: bound_count.__wrapped__(problem, tree, 6, budget=1e9))
    np.testing.assert_array_equal(one.multipliers, two.multipliers)
    for name in ("lower_bound", "status", "cells_used", "proof"):
        assert getattr(one, name) == getattr(two, name)


@pytest.mark.parametrize(
    ("poses", "n", "proved"), [(2, 1, 1.2), (1, 1, 1.0), (2, 2, 2.0)]
)
def test_what_multipliers_prove_over_some_poses(poses, n, proved):
    """Six of ten are wanted, five of which a pose serves: 6/5, where one is asked."""
    halves = np.repeat(np.eye(2, dtype=bool), 5, axis=1)
    known = halves if poses == 2 else np.ones((1, 10), dtype=bool)
    problem = CellProblem(np.ones(10), np.array([6.0]))
    assert proved_over(problem, known, n, PLENTY) == pytest.approx(proved)


def test_without_work_nothing_is_known_of_poses():
    problem = CellProblem(np.ones(2), np.array([1.0]))
    assert proved_over(problem, np.ones((1, 2), dtype=bool), 1, 0.0) == np.inf
