"""Symmetries of covers, and branching on their orbits, against trying all."""

import itertools

import numpy as np
import pytest

from solvers import CoverProblem, SolveStatus, solve_cover
from solvers.covers.full import symmetry
from solvers.covers.full.orbital_branching import OrbitalTree
from solvers.covers.full.row_branching import RowTree
from solvers.covers.full.symmetry import column_colours, column_orbits, may_be_symmetric
from solvers.status import WorkBudget

PLENTY = 1e11
# Nine points in three by three: the lines through three of them.
_POINTS = np.array(list(itertools.product(range(3), repeat=2)))
AFFINE_PLANE = np.array(
    [
        np.isin(np.arange(9), line)
        for line in itertools.combinations(range(9), 3)
        if not (_POINTS[list(line)].sum(axis=0) % 3).any()
    ]
)


def cycle(n):
    """Edges of a ring over its corners."""
    return np.eye(n, dtype=bool) | np.roll(np.eye(n, dtype=bool), 1, axis=1)


def beside(*covers):
    """Covers that share neither rows nor columns."""
    shape = tuple(sum(c.shape[i] for c in covers) for i in (0, 1))
    both = np.zeros(shape, dtype=bool)
    row = column = 0
    for part in covers:
        both[row : row + part.shape[0], column : column + part.shape[1]] = part
        row, column = row + part.shape[0], column + part.shape[1]
    return both


def circulant(seed):
    """Rows that are the turns of a few, over a ring of columns."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(5, 12))
    first = rng.random((2, n)) < rng.choice([0.25, 0.4])
    first[:, 0] = True
    turns = [np.roll(row, k) for row in first for k in range(n)]
    return np.array(turns)[:, rng.permutation(n)]


def split_colourings(n, k):
    """Colourings of n points by two colours over the k-subsets of one colour."""
    subsets = list(itertools.combinations(range(n), k))
    rows = []
    for colours in itertools.product([False, True], repeat=n - 1):
        of = np.array([False, *colours])
        rows.append([of[list(s)].all() or not of[list(s)].any() for s in subsets])
    return np.array(rows)


def symmetries(covers):
    """All permutations of the columns that keep the rows, by trying all."""
    rows = sorted(row.tobytes() for row in covers)
    for moved in itertools.permutations(range(covers.shape[1])):
        if sorted(row.tobytes() for row in covers[:, moved]) == rows:
            yield moved


def orbits_by_hand(covers):
    first = np.arange(covers.shape[1])
    for moved in symmetries(covers):
        first = np.minimum(first, np.array(moved))
    return first


def covers_of(covers, size):
    return [
        list(chosen)
        for chosen in itertools.combinations(range(covers.shape[1]), size)
        if covers[:, chosen].any(axis=1).all()
    ]


def fewest_by_hand(covers):
    return next(k for k in range(covers.shape[1] + 1) if covers_of(covers, k))


def small_covers():
    yield from (cycle(n) for n in (3, 4, 7))
    yield beside(cycle(3), cycle(3))
    yield beside(cycle(3), cycle(4))
    yield np.eye(5, 6, dtype=bool) | np.eye(5, 6, k=1, dtype=bool)
    for seed in range(12):
        rng = np.random.default_rng(seed)
        yield rng.random((8, 6)) < 0.4
        half = rng.random((5, 3)) < 0.5
        yield beside(half, half)[:, rng.permutation(6)]


def test_orbits_are_those_of_all_symmetries():
    several = 0
    for covers in small_covers():
        orbits = column_orbits(covers, WorkBudget(PLENTY))
        assert orbits.tolist() == orbits_by_hand(covers).tolist()
        several += np.unique(orbits).size < orbits.size
    assert several > 12


def test_columns_of_one_colour_need_not_be_exchanged():
    """A ring of six and two of three: every corner has two edges of two corners."""
    covers = beside(cycle(6), cycle(3), cycle(3))
    assert np.unique(column_colours(covers, WorkBudget(PLENTY))).size == 1
    assert column_orbits(covers, WorkBudget(PLENTY)).tolist() == [0] * 6 + [6] * 6


def test_no_collision_of_colours_makes_an_orbit(monkeypatch):
    """Numbers that hardly tell anything apart: permutations are still checked."""
    monkeypatch.setattr(symmetry, "_mixed", lambda values: values & np.uint64(3))
    for covers in small_covers():
        whole = orbits_by_hand(covers)
        for column, first in enumerate(column_orbits(covers, WorkBudget(PLENTY))):
            assert whole[column] == whole[first]


def test_no_orbit_is_claimed_without_work():
    assert column_orbits(cycle(9), WorkBudget(0.0)).tolist() == list(range(9))


def test_orbits_come_in_parts_where_the_search_is_cut(monkeypatch):
    monkeypatch.setattr(symmetry, "_MAX_REFINEMENTS", 4)
    covers = cycle(9)
    orbits = column_orbits(covers, WorkBudget(PLENTY))
    assert 1 < np.unique(orbits).size <= 9
    tree = OrbitalTree(covers, np.arange(9), 5, WorkBudget(PLENTY)).run()
    assert (tree.selected, tree.lower_bound) == (None, 5)


@pytest.mark.parametrize("first", [0, 10, 20])
def test_branching_on_orbits_refutes_or_finds_less(first):
    branched = 0
    for seed in range(first, first + 10):
        covers = circulant(seed)
        best = fewest_by_hand(covers)
        for rows in (np.arange(len(covers)), np.array([0])):
            tree = OrbitalTree(covers, rows, best, WorkBudget(PLENTY))
            refuted = tree.run()
            assert (refuted.selected, refuted.lower_bound) == (None, best), seed
            branched += tree.made > 1
            found = OrbitalTree(covers, rows, best + 1, WorkBudget(PLENTY)).run()
            assert found.selected is not None
            assert found.selected.size == best
            assert covers[:, found.selected].any(axis=1).all()
        for budget in (0.0, 1e6, 5e6):
            cut = OrbitalTree(covers, rows, best, WorkBudget(budget)).run()
            assert cut.lower_bound <= best, seed
    assert branched >= 4


def test_some_smaller_cover_of_a_node_is_in_a_child():
    """Whatever is dropped, one cover as small as any is left somewhere."""
    split = 0
    chance = np.random.default_rng(3)
    more = [chance.random((25, 9)) < 0.3 for _ in range(10)]
    for covers in (split_colourings(5, 3), cycle(9), *map(circulant, range(30)), *more):
        covers[~covers.any(axis=1), 0] = True
        n_e, n_s = covers.shape
        best = fewest_by_hand(covers)
        smallest = covers_of(covers, best)
        tree = OrbitalTree(covers, np.arange(n_e), best + 1, WorkBudget(PLENTY))
        nodes = [tree.linear.root()]
        while nodes:
            node = nodes.pop()
            assert node is not None
            held = [
                chosen
                for chosen in smallest
                if node.part.allowed[chosen].all()
                and set(np.flatnonzero(node.part.taken)) <= set(chosen)
            ]
            if not held or np.count_nonzero(node.part.taken) == best:
                continue
            children = tree.branch(node)
            assert children is not None
            split += len(children) == 2
            assert any(
                child.part.allowed[chosen].all()
                and set(np.flatnonzero(child.part.taken)) <= set(chosen)
                for child in children
                for chosen in smallest
            )
            nodes.extend(children)
        assert n_s <= 11
    assert split > 30


def test_symmetric_covers_need_far_fewer_nodes():
    """Lines of the affine plane: any point is like any other, and so are the rest."""
    rows = np.arange(len(AFFINE_PLANE))
    orbital = OrbitalTree(AFFINE_PLANE, rows, 5, WorkBudget(PLENTY))
    assert orbital.run().lower_bound == 5
    by_rows = RowTree(AFFINE_PLANE, rows, 5, WorkBudget(PLENTY))
    assert by_rows.run().lower_bound == 5
    assert 2 * orbital.made < by_rows.made


def test_the_engine_proves_a_symmetric_cover_by_orbits():
    solution = solve_cover(CoverProblem(AFFINE_PLANE))
    assert solution.status is SolveStatus.OPTIMAL
    assert (solution.selected.size, solution.lower_bound) == (5, 5)
    assert solution.proof == "branch and bound on orbits of sets"


def colours_of(covers):
    return column_colours(covers, WorkBudget(PLENTY))


def test_colours_tell_apart_what_no_symmetry_exchanges():
    lines = AFFINE_PLANE
    assert np.unique(colours_of(lines)).size == 1
    assert may_be_symmetric(lines, WorkBudget(PLENTY))
    # A path of four: ends and middles.
    path = np.array([[1, 1, 0, 0], [0, 1, 1, 0], [0, 0, 1, 1]], dtype=bool)
    colours = colours_of(path)
    assert colours[0] == colours[3] != colours[1] == colours[2]
    longer = np.eye(5, 6, dtype=bool) | np.eye(5, 6, k=1, dtype=bool)
    assert np.unique(colours_of(longer)).size == 3
    rng = np.random.default_rng(0)
    chance = rng.random((60, 30)) < 0.3
    assert np.unique(colours_of(chance)).size == 30
    assert not may_be_symmetric(chance, WorkBudget(PLENTY))
    order = rng.permutation(9)
    marked = np.concatenate([lines, np.eye(9, dtype=bool)[:1]])
    shape = np.unique(colours_of(marked), return_counts=True)[1]
    assert sorted(shape) == [1, 8]
    moved = np.unique(colours_of(marked[:, order]), return_counts=True)[1]
    assert sorted(moved) == sorted(shape)
