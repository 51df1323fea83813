"""Trees of cells, what is asked of them, and what is said of bad ones."""

import dataclasses
import itertools
from fractions import Fraction

import numpy as np
import pytest
from scipy.optimize import linprog
from support.array_trees import ArrayTree
from support.leaf_trees import leaves_of, tree_of_leaves

from solvers import bit_rows
from solvers.bit_rows import BitSum, BitSums, pack_rows, unpack_rows
from solvers.cells import cell_store
from solvers.cells import cell_tree as cells
from solvers.cells.cell_bound import CellStatus, bound_count
from solvers.cells.cell_multipliers import MultiplierSearch
from solvers.cells.cell_problem import CellProblem, whole_rows
from solvers.cells.cell_store import CellStore
from solvers.cells.cell_tree import CellBatch
from solvers.cells.cell_tuples import refute_tuples
from solvers.status import WorkBudget

PARENTS = np.array([-1, -1, 0, 0, 1, 1, 2, 2])


def small_tree(seed=0, n_rows=70):
    rng = np.random.default_rng(seed)
    leaves = rng.random((5, n_rows)) < 0.4
    return tree_of_leaves(PARENTS, pack_rows(leaves), n_rows)


@pytest.mark.parametrize("n", [1, 8, 63, 64, 65, 200])
def test_bit_rows_keep_what_they_hold(n):
    serves = np.random.default_rng(n).random((7, n)) < 0.5
    packed = pack_rows(serves)
    assert packed.shape == (7, -(-n // 64))
    np.testing.assert_array_equal(unpack_rows(packed, n), serves)


@pytest.mark.parametrize("n_values", [1, 3, 8, 9, 500])
def test_bits_weigh_exactly_what_their_rows_weigh(n_values):
    rng = np.random.default_rng(n_values)
    serves = rng.random((300, 777)) < 0.5
    values = rng.integers(0, 2**41, n_values)[rng.integers(0, n_values, 777)]
    exact = [sum(int(v) for v in values[row]) for row in serves]
    assert BitSum(values)(pack_rows(serves)).tolist() == exact
    # Several sums at once are what each is alone.
    several = np.stack([values, np.where(np.arange(777) % 2, values, 0)])
    alone = [BitSum(each)(pack_rows(serves)) for each in several]
    sums = BitSums(several)
    np.testing.assert_array_equal(sums(pack_rows(serves)), np.stack(alone, axis=1))
    assert sums.units == sum(BitSum(each).units for each in several)


def test_parents_of_leaves_hold_exactly_the_union():
    tree = small_tree()
    dense = unpack_rows(tree.rows, tree.n_rows)
    for cell in (0, 1, 2):
        below = np.flatnonzero(tree.parents == cell)
        np.testing.assert_array_equal(dense[cell], dense[below].any(axis=0))
    assert leaves_of(tree.parents).tolist() == [3, 4, 5, 6, 7]
    assert tree.roots().cells.tolist() == [0, 1]
    batch = tree.children(np.array([2, 3, 0]))
    assert batch.cells.tolist() == [6, 7, 2, 3]
    assert batch.parents.tolist() == [0, 0, 2, 2]
    np.testing.assert_array_equal(batch.rows, tree.rows[[6, 7, 2, 3]])


def test_a_parent_may_hold_more_but_not_one_row_less():
    tree = small_tree()
    more = tree.rows.copy()
    more[2] = pack_rows(np.ones((1, tree.n_rows), dtype=bool))
    more[0] = more[2]
    ArrayTree(PARENTS, more, tree.n_rows)
    for parent, child in ((2, 7), (0, 3), (1, 5)):
        row = int(np.flatnonzero(unpack_rows(tree.rows[[child]], tree.n_rows)[0])[-1])
        dense = unpack_rows(tree.rows, tree.n_rows)
        dense[parent, row] = False
        # Not of the ancestors' own making.
        first = next(
            c
            for c in range(len(PARENTS))
            if PARENTS[c] >= 0 and np.any(dense[c] & ~dense[PARENTS[c]])
        )
        with pytest.raises(ValueError, match=rf"cell {first} serves rows that its p"):
            ArrayTree(PARENTS, pack_rows(dense), tree.n_rows)


class Lying:
    """A lazy tree that leaves a row out of the parent it handed out."""

    units = 0.0

    def __init__(self, tree, parent):
        self.tree, self.parent, self.n_rows = tree, parent, tree.n_rows

    def hide(self, batch):
        rows = batch.rows.copy()
        child = self.tree.children(np.array([self.parent])).rows[0]
        first = unpack_rows(child[None], self.n_rows)[0]
        missing = np.zeros((1, self.n_rows), dtype=bool)
        missing[0, int(np.argmax(first))] = True
        rows[batch.cells == self.parent] &= ~pack_rows(missing)
        return dataclasses.replace(batch, rows=rows)

    def roots(self):
        return self.hide(self.tree.roots())

    def children(self, asked, /):
        return self.tree.children(asked)


def test_a_lazy_tree_is_caught_when_a_parent_misses_a_row():
    tree = small_tree()
    store = CellStore(Lying(tree, 1), WorkBudget(1e9))
    with pytest.raises(ValueError, match="cell 4 serves rows that its parent 1 misses"):
        store.split(np.array([1]))


def test_the_store_asks_once_and_knows_its_frontier():
    tree = small_tree()
    store = CellStore(tree, WorkBudget(1e9))
    assert store.frontier.tolist() == [0, 1]
    new = store.split(np.array([1]))
    assert store.names[new].tolist() == [4, 5]
    assert store.split(np.array([1])).size == 0
    store.split(store.frontier)
    assert sorted(store.names[store.frontier]) == [2, 3, 4, 5]
    assert store.levels.tolist() == [0, 0, 1, 1, 1, 1]
    assert not np.any(store.may_split(np.flatnonzero(np.isin(store.names, [4, 5]))))
    np.testing.assert_array_equal(store.rows, tree.rows[store.names])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"parents": np.array([0, -1])}, "parents must come before"),
        ({"parents": np.array([-1, -2])}, "parents must come before"),
        ({"parents": np.array([-1.0, 0.0])}, "vector of integers"),
        ({"rows": np.zeros((2, 1), dtype=np.int64)}, "must be uint64"),
        ({"rows": np.zeros((3, 1), dtype=np.uint64)}, "must be uint64 of shape"),
        ({"rows": np.full((2, 1), 2**64 - 1, dtype=np.uint64)}, "past its 10 rows"),
        ({"n_rows": 10**12}, "more than the limit of 2.0 GB: use fewer samples"),
    ],
)
def test_a_bad_tree_is_refused(change, words):
    good = {
        "parents": np.array([-1, 0]),
        "rows": np.zeros((2, 1), dtype=np.uint64),
        "n_rows": 10,
    }
    ArrayTree(**good)
    with pytest.raises(ValueError, match=words):
        ArrayTree(**good | change)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"weights": [1.0, np.nan]}, "weights must be finite"),
        ({"weights": [1.0, -1.0]}, "weights must be finite"),
        ({"weights": [1e308, 1e308]}, "have a finite sum"),
        ({"weights": np.ones((2, 2))}, "vector of 1 to"),
        ({"weights": []}, "vector of 1 to"),
        ({"weights": [1j, 1.0]}, "weights must be real numbers"),
        ({"weights": [10**400, 1]}, "weights must be real numbers"),
        ({"required_weight": "much"}, "required_weight must be real numbers"),
        ({"required_weight": np.nan}, "required_weight must be finite"),
        ({"required_weight": -1.0}, "required_weight must be finite"),
        ({"needs": [1, -1]}, "needs must be at least 0"),
        ({"needs": [1.0, 2.0]}, "needs must be integers"),
        ({"needs": [1]}, "needs must be integers of shape"),
        ({"row_sets": [0, 1]}, "names set 1, but required_weight has 1 entries"),
    ],
)
def test_a_bad_problem_is_refused(change, words):
    with pytest.raises(ValueError, match=words):
        CellProblem(**{"weights": [1.0, 2.0], "required_weight": 1.0} | change)


def test_bad_questions_are_refused():
    problem, tree = CellProblem(np.ones(70), 30.0), small_tree()
    with pytest.raises(ValueError, match="count must be at least 1, got 0"):
        bound_count(problem, tree, 0)
    with pytest.raises(ValueError, match=r"count must be a whole number, got 2\.5"):
        bound_count(problem, tree, 2.5)
    with pytest.raises(ValueError, match="cells have 70 rows, the problem has 3"):
        bound_count(CellProblem(np.ones(3), 1.0), tree, 2)
    with pytest.raises(ValueError, match=r"multipliers must be \(70,\)"):
        whole_rows(problem).multipliers(np.ones(3))
    for given in (np.full(70, 1j), [10**400] * 70, [[1], [1, 2]]):
        with pytest.raises(ValueError, match="multipliers must be real numbers"):
            whole_rows(problem).multipliers(given)


class Unordered(Lying):
    def roots(self):
        return self.tree.roots()

    def children(self, asked, /):
        batch = self.tree.children(asked)
        turned = (x[::-1] for x in (batch.cells, batch.parents, batch.rows))
        return CellBatch(*turned)


def test_children_out_of_order_are_refused():
    store = CellStore(Unordered(small_tree(), 0), WorkBudget(1e9))
    with pytest.raises(ValueError, match="in the order of the cells asked for"):
        store.split(np.array([0, 1]))


def test_the_memory_limit_is_named_and_the_bound_stays_true(monkeypatch, cap_trees):
    tree = cap_trees.CircleTree(
        cap_trees.circle(np.arange(97) * 2 * np.pi / 97), 0.5, 9
    )
    problem = CellProblem(np.ones(97), 97.0)
    whole = bound_count(problem, tree, 7)
    monkeypatch.setattr(cell_store, "MAX_BYTES", 20 * 16)
    cut = bound_count(problem, tree, 7)
    assert cut.status is CellStatus.CUT
    assert "memory limit" in cut.proof
    assert cut.cells_used <= 20
    assert 1 <= cut.lower_bound <= whole.lower_bound == 7
    monkeypatch.setattr(cells, "MAX_BYTES", 15)
    with pytest.raises(ValueError, match="1 cells x 97 rows take"):
        bound_count(problem, tree, 7)


def random_rows(seed, n=9):
    rng = np.random.default_rng(seed)
    n_sets = int(rng.integers(1, 3))
    sets = rng.integers(0, n_sets, n)
    weights = rng.integers(0, 5, n) * rng.choice([1.0, 0.1, 1e-9, 1e9])
    per_set = np.bincount(sets, weights, minlength=n_sets)
    total = rng.random() * weights.sum() if seed % 2 else None
    return CellProblem(
        weights, rng.random() * per_set, rng.integers(0, 3, n), sets, total
    ), rng.integers(0, 2**20, n)


@pytest.mark.parametrize("seed", range(40))
def test_the_knapsacks_are_those_of_a_linear_program(seed):
    problem, multipliers = random_rows(seed)
    whole = whole_rows(problem)
    given = whole.multipliers(multipliers)
    costs = (given * whole.needs).astype(float)
    weights, n_sets = whole.weights.astype(float), len(whole.needed)
    member = (whole.row_sets == np.arange(n_sets)[:, None]) * weights
    member = np.vstack([member, weights])
    needed = np.append(whole.needed, whole.needed_total)
    unit = max(1.0, weights.max())
    cheapest = linprog(costs, -member / unit, -needed / unit, bounds=(0, 1))
    assert float(whole.least_cost(given)) == pytest.approx(
        cheapest.fun, rel=1e-9, abs=1e-6
    )
    paid = int(0.6 * costs.sum())
    dearest = linprog(-weights / unit, costs[None], [paid], bounds=(0, 1))
    most = float(whole.most(given, paid))
    assert most == pytest.approx(-dearest.fun * unit, rel=1e-9, abs=1.0)


@pytest.mark.parametrize("seed", range(40))
def test_the_knapsacks_err_on_the_safe_side_exactly(seed):
    problem, multipliers = random_rows(seed, n=8)
    whole = whole_rows(problem)
    given = whole.multipliers(multipliers)
    costs = [int(c) for c in given * whole.needs]
    weights = [int(w) for w in whole.weights]
    paid = sum(costs) // 2
    for taken in itertools.product((0, 1), repeat=8):
        each = [
            sum(
                w * t
                for w, t, s in zip(weights, taken, whole.row_sets, strict=True)
                if s == g
            )
            for g in range(len(whole.needed))
        ]
        cost = sum(c * t for c, t in zip(costs, taken, strict=True))
        met = all(w >= n for w, n in zip(each, whole.needed, strict=True))
        if met and sum(each) >= whole.needed_total:
            assert whole.least_cost(given) <= cost
        if cost <= paid:
            assert whole.most(given, paid) >= sum(each)


def test_whole_numbers_favour_serving():
    rng = np.random.default_rng(3)
    for _ in range(200):
        weights = rng.random(int(rng.integers(1, 30))) * 10.0 ** rng.integers(-8, 8)
        chosen = rng.random(weights.size) < 0.5
        exact = sum((Fraction(float(w)) for w in weights[chosen]), Fraction(0))
        whole = whole_rows(CellProblem(weights, float(weights[chosen].sum())))
        assert int(whole.weights[chosen].sum()) >= whole.needed[0]
        assert Fraction(whole.in_unit(int(whole.weights[chosen].sum()))) >= exact
        assert whole.needed[0] * whole.unit == pytest.approx(float(exact), rel=1e-11)


def test_multipliers_survive_being_stored():
    whole = whole_rows(CellProblem(np.random.default_rng(0).random(50), 10.0))
    once = whole.multipliers(np.random.default_rng(1).random(50))
    assert once.sum() > 2**50
    np.testing.assert_array_equal(whole.multipliers(once), once)


def test_chunks_cover_everything():
    found = [i for p in bit_rows.parts(10_001) for i in range(p.start, p.stop)]
    assert found == list(range(10_001))


def test_a_full_store_makes_no_leaves(monkeypatch, cap_trees):
    # What there is no room to split isn't handed back as if it couldn't be split.
    tree = cap_trees.SphereTree(cap_trees.spread(300), np.deg2rad(80.0), 6)
    whole = whole_rows(CellProblem(np.ones(300), 300.0))
    monkeypatch.setattr(cell_store, "MAX_BYTES", 100 * 40)
    store, none = CellStore(tree, WorkBudget(1e9)), np.zeros(300, dtype=np.int64)
    found = refute_tuples(whole, store, 3, none, WorkBudget(1e12))
    assert store.full
    assert (found.refuted, found.survivor) == (False, None)


def test_a_ratio_that_is_whole_is_its_own_bound_and_ends_the_search():
    # Two leaves, two rows each, all four needed, without any slack for rounding.
    rows = np.kron(np.eye(2, dtype=bool), np.ones((1, 2), dtype=bool))
    tree = ArrayTree(np.array([-1, -1]), pack_rows(rows), 4)
    problem = CellProblem(np.ones(4), 4.0)
    whole = whole_rows(problem)
    exact, budget = dataclasses.replace(whole, needed=(whole.total,)), WorkBudget(1e8)
    search = MultiplierSearch(exact, CellStore(tree, budget), budget)
    assert search.ratio == 2
    assert not search.refute(2)
    assert search.bound == 2
    assert not budget.exhausted
    answer = bound_count(problem, tree, 3)
    assert (answer.lower_bound, answer.survivor.tolist()) == (2, [0, 1])
