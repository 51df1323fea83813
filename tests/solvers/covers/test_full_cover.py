"""Full covers of equal costs against brute force, planted covers and known optima."""

import gzip
import itertools
from pathlib import Path

import numpy as np
import pytest
from scipy import sparse

from solvers.covers.bounds.reductions import reduce_problem
from solvers.covers.cover_problem import CoverProblem
from solvers.covers.full.full_cover import fewest_full
from solvers.covers.full.node_program import linear_cover, needed_sets
from solvers.covers.full.row_branching import RowTree
from solvers.covers.full.row_dominance import essential, minimal, separate
from solvers.covers.full.row_weighting import RowWeighting
from solvers.status import SolveStatus, WorkBudget


def reduced_cover(covers, weights, costs, required):
    """The cover that the search would see."""
    return reduce_problem(
        CoverProblem(covers, weights, costs, required_weight=required)
    )


SETCOVER = Path(__file__).resolve().parents[4] / "shared" / "data" / "setcover"
PLENTY = 1e11


def random_rows(seed, *, most_rows=18, most_sets=9):
    rng = np.random.default_rng(seed)
    n_e = int(rng.integers(1, most_rows + 1))
    n_s = int(rng.integers(1, most_sets + 1))
    covers = rng.random((n_e, n_s)) < rng.choice([0.15, 0.3, 0.5])
    covers[np.arange(n_e), rng.integers(0, n_s, n_e)] = True
    return covers


def fewest_by_hand(covers):
    n_s = covers.shape[1]
    for k in range(n_s + 1):
        for chosen in itertools.combinations(range(n_s), k):
            if covers[:, chosen].any(axis=1).all():
                return k
    raise AssertionError("some row has no set")


def reduced(covers):
    n_e, n_s = covers.shape
    return reduced_cover(
        sparse.csr_array(covers), np.ones(n_e), np.ones(n_s), float(n_e)
    )


def solve(covers, budget=PLENTY, *, seed=0, lower=1, start=None):
    cover = reduced(covers)
    everything = np.arange(cover.n_sets) if start is None else start
    answer = fewest_full(
        cover, WorkBudget(budget), seed=seed, start=everything, lower=lower
    )
    assert covers[:, cover.kept[answer.selected]].any(axis=1).all()
    assert np.all(np.diff(answer.selected) > 0)
    return answer


def triples_of_affine_space(dimension):
    """Lines of the affine space over three elements: a Steiner triple system."""
    points = np.array(list(itertools.product(range(3), repeat=dimension)))
    lines = []
    for i, j in itertools.combinations(range(len(points)), 2):
        third = (-points[i] - points[j]) % 3
        k = int(np.flatnonzero((points == third).all(axis=1))[0])
        if j < k:
            row = np.zeros(len(points), dtype=bool)
            row[[i, j, k]] = True
            lines.append(row)
    return np.array(lines)


def planted(seed, *, n_e, n_s, n_parts):
    """Rows split among a few sets, hidden among smaller parts of unions of them."""
    rng = np.random.default_rng(seed)
    part = rng.permutation(np.arange(n_e) % n_parts)
    decoys = rng.random((n_e, n_s - n_parts)) < 0.5 / n_parts
    # One private row a part, which no decoy covers: no fewer sets can do.
    for p in range(n_parts):
        decoys[np.flatnonzero(part == p)[0]] = False
    covers = np.concatenate([part[:, None] == np.arange(n_parts), decoys], axis=1)
    return covers[:, rng.permutation(n_s)]


@pytest.mark.parametrize("first", range(0, 120, 60))
def test_equals_brute_force_and_bounds_hold_however_the_budget_cuts(first):
    for seed in range(first, first + 60):
        covers = random_rows(seed)
        best = fewest_by_hand(covers)
        for budget in (PLENTY, 3e6, 1e5, 0.0):
            answer = solve(covers, budget, seed=seed)
            assert answer.bound <= best <= answer.selected.size, seed
            if answer.status is SolveStatus.OPTIMAL or budget == PLENTY:
                assert answer.status is SolveStatus.OPTIMAL, seed
                assert answer.bound == answer.selected.size == best, seed
            else:
                assert answer.status is SolveStatus.FEASIBLE


@pytest.mark.parametrize(("dimension", "n_lines", "fewest"), [(2, 12, 5), (3, 117, 18)])
def test_steiner_triples_have_the_known_covers(dimension, n_lines, fewest):
    """A cover is what is left of a largest cap: 4 of 9 points, 9 of 27."""
    covers = triples_of_affine_space(dimension)
    assert covers.shape == (n_lines, 3**dimension)
    answer = solve(covers)
    assert answer.status is SolveStatus.OPTIMAL
    assert answer.selected.size == answer.bound == fewest
    assert "branch and bound" in answer.proof


def test_shared_stn27_is_proved():
    path = SETCOVER / "stn27.gz"
    if not path.exists():
        pytest.skip(f"{path.name} is not beside the repository")
    numbers = np.array(gzip.decompress(path.read_bytes()).split(), dtype=np.int64)
    triples = numbers[2:].reshape(-1, 3) - 1
    covers = np.zeros((len(triples), numbers[0]), dtype=bool)
    np.put_along_axis(covers, triples, values=True, axis=1)
    answer = solve(covers)
    assert (answer.selected.size, answer.bound) == (18, 18.0)


@pytest.mark.parametrize("seed", range(4))
def test_planted_covers_are_found_and_proved(seed):
    covers = planted(seed, n_e=300, n_s=80, n_parts=9)
    answer = solve(covers, seed=seed)
    assert answer.status is SolveStatus.OPTIMAL
    assert answer.selected.size == 9


def test_search_alone_finds_what_greedy_does_not():
    """Greedy takes the set of four; rows that stay open outweigh it."""
    covers = np.zeros((6, 3), dtype=bool)
    for s, members in enumerate([[0, 1, 3, 4], [0, 1, 2], [3, 4, 5]]):
        covers[members, s] = True
    search = RowWeighting(covers, np.array([0, 1]), seed=0)
    assert search.open_rows.tolist() == [5]
    assert search.search(100, WorkBudget(PLENTY))
    assert sorted(search.chosen.tolist()) == [1, 2]
    assert search.open_rows.size == 0


def test_search_keeps_its_book():
    for seed in range(20):
        covers = random_rows(seed, most_rows=40, most_sets=25)
        rng = np.random.default_rng(seed)
        size = int(rng.integers(1, covers.shape[1] + 1))
        chosen = np.sort(rng.permutation(covers.shape[1])[:size])
        search = RowWeighting(covers, chosen, seed=seed)
        for _ in range(12):
            found = search.search(1, WorkBudget(PLENTY))
            picked = covers[:, search.chosen]
            counts = picked.sum(axis=1)
            assert found == (counts > 0).all()
            assert search.open_rows.tolist() == np.flatnonzero(counts == 0).tolist()
            alone = (counts == 1) * search.weights
            assert search.losses().tolist() == (alone @ picked).tolist()
            assert np.unique(search.chosen).size == size
        if size > 1:
            worst = search.losses().min()
            total = search.weights[picked.any(axis=1)].sum()
            search.drop()
            left = search.weights[covers[:, search.chosen].any(axis=1)].sum()
            assert total - left == worst


def test_rows_taken_in_later_count_as_if_they_had_been_there():
    for seed in range(20):
        covers = random_rows(seed, most_rows=40, most_sets=25)
        rng = np.random.default_rng(seed)
        chosen = rng.permutation(covers.shape[1])[:3]
        weights = rng.integers(1, 9, len(covers)).astype(float)
        whole = RowWeighting(covers, chosen, seed=seed)
        grown = RowWeighting(covers[:0], chosen, seed=seed)
        for part in np.array_split(np.arange(len(covers)), 4):
            grown.add_rows(covers[part])
        whole.weights[:] = grown.weights[:] = weights
        for _ in range(30):
            assert grown.search(1, WorkBudget(PLENTY)) == whole.search(
                1, WorkBudget(PLENTY)
            )
            assert grown.chosen.tolist() == whole.chosen.tolist()
            assert grown.open_rows.tolist() == whole.open_rows.tolist()
            assert grown.losses().tolist() == whole.losses().tolist()


def test_ages_that_run_out_begin_again(monkeypatch):
    monkeypatch.setattr("solvers.covers.full.row_weighting._AGES", 300.0)
    covers = random_rows(3, most_rows=60, most_sets=30)
    fewest = fewest_by_hand(covers)
    for seed in range(5):
        search = RowWeighting(covers, np.arange(fewest), seed=seed)
        assert search.search(20_000, WorkBudget(PLENTY))
        assert np.unique(search.chosen).size == fewest
    too_few = RowWeighting(covers, np.arange(fewest - 1), seed=0)
    assert not too_few.search(2_000, WorkBudget(PLENTY))


def test_only_rows_that_stay_open_grow_heavier():
    """Five of ten disjoint rows can be covered: each step leaves five open."""
    search = RowWeighting(np.eye(10, dtype=bool), np.arange(5), seed=1)
    assert not search.search(200, WorkBudget(PLENTY))
    assert search.weights.sum() == 10 + 200 * 5
    assert search.weights.max() < 2 * search.weights.min()
    none = RowWeighting(np.eye(3, dtype=bool), np.arange(1), seed=0)
    assert not none.search(200, WorkBudget(0.0))
    assert none.weights.sum() == 3


def test_dominance_keeps_the_optimum():
    smaller = 0
    for seed in range(150):
        covers = random_rows(seed)
        rows, columns = essential(covers, WorkBudget(PLENTY))
        left = covers[np.ix_(rows, columns)]
        assert fewest_by_hand(left) == fewest_by_hand(covers), seed
        partly = essential(covers, WorkBudget(6e4))
        assert fewest_by_hand(covers[np.ix_(*partly)]) == fewest_by_hand(covers)
        smaller += left.size < covers.size
        # Whatever covers the rows left covers all.
        for chosen in itertools.combinations(columns, min(3, columns.size)):
            whole = covers[:, list(chosen)].any(axis=1).all()
            assert whole == covers[np.ix_(rows, chosen)].any(axis=1).all()
    assert smaller > 100


def test_minimal_sets_are_those_that_include_no_other():
    for seed in range(40):
        rng = np.random.default_rng(seed)
        sets = rng.random((30, int(rng.choice([3, 8, 130])))) < 0.4
        includes = ~np.any(sets[None, :, :] & ~sets[:, None, :], axis=2)
        equal = includes & includes.T
        earlier = np.tril(np.ones((30, 30), dtype=bool), -1)
        goes = (includes & ~equal) | (equal & earlier)
        kept = np.flatnonzero(~goes.any(axis=1))
        assert minimal(sets, WorkBudget(PLENTY)).tolist() == kept.tolist()


def test_separate_parts_are_solved_apart():
    """Rings of five, each of which needs three: together out of a tree's reach."""
    ring = np.eye(5, dtype=bool) | np.roll(np.eye(5, dtype=bool), 1, axis=1)
    rng = np.random.default_rng(4)
    covers = np.kron(np.eye(12, dtype=bool), ring)
    covers = covers[rng.permutation(60)][:, rng.permutation(60)]
    answer = solve(covers, 2e9)
    assert answer.status is SolveStatus.OPTIMAL
    assert answer.selected.size == answer.bound == 36
    assert answer.proof.startswith("separate parts: ")
    for budget in (0.0, 1e6, 3e7):
        cut = solve(covers, budget)
        assert cut.bound <= 36 <= cut.selected.size


def test_parts_share_neither_rows_nor_columns():
    for seed in range(30):
        covers = random_rows(seed, most_rows=30, most_sets=25)
        parts = separate(covers)
        rows, columns = (np.concatenate([p[i] for p in parts]) for i in (0, 1))
        assert sorted(rows) == list(range(len(covers)))
        used = np.flatnonzero(covers.any(axis=0))
        assert set(used) <= set(columns)
        assert np.unique(columns).size == columns.size
        for some, sets in parts:
            assert not covers[some][:, np.setdiff1d(used, sets)].any()
            apart = separate(covers[np.ix_(some, sets)])
            assert len(apart) == 1


def test_counts_by_any_multipliers_are_bounds():
    for seed in range(60):
        covers = random_rows(seed)
        best = fewest_by_hand(covers)
        rng = np.random.default_rng(seed)
        for scale in (0.1, 0.5, 1.0, 3.0):
            given = scale * np.abs(rng.normal(size=len(covers)))
            assert needed_sets(given, 1.0 - given @ covers) <= best
    assert needed_sets(np.ones(4), np.zeros(4)) == pytest.approx(4.0)


def test_linear_bound_by_rows_is_that_of_all_rows():
    """The lines of a plane of order three: each point shares 1/4 of each line."""
    n = 600
    around = np.arange(n)
    covers = (around[:, None] - around) % n < 7
    linear = linear_cover(covers, WorkBudget(PLENTY))
    assert linear.lower_bound == 86 == int(np.ceil(n / 7))
    assert linear.primal.sum() == pytest.approx(n / 7)
    assert np.all(covers @ linear.primal > 1 - 1e-5)


def test_branching_on_pairs_of_rows_refutes_or_finds_less():
    branched = 0
    for seed in range(60):
        covers = random_rows(seed, most_rows=40, most_sets=11)
        best = fewest_by_hand(covers)
        for first in (np.arange(len(covers)), np.array([0])):
            tree = RowTree(covers, first, best, WorkBudget(PLENTY))
            refuted = tree.run()
            assert refuted.selected is None
            assert refuted.lower_bound == best, seed
            branched += tree.made > 2
        found = RowTree(covers, first, best + 1, WorkBudget(PLENTY)).run()
        assert found.selected is not None
        assert found.selected.size == best
        assert covers[:, found.selected].any(axis=1).all()
        for budget in (0.0, 3e6, 1e7):
            cut = RowTree(covers, first, best, WorkBudget(budget)).run()
            assert cut.lower_bound <= best, seed
    assert branched > 10


def test_branching_finds_what_relaxations_hide():
    """Rows of three sets each: far from the linear bound, so dear sets are needed."""
    for seed in range(15):
        rng = np.random.default_rng(seed)
        covers = np.zeros((40, 13), dtype=bool)
        for row in covers:
            row[rng.choice(13, size=3, replace=False)] = True
        best = fewest_by_hand(covers)
        every = np.arange(40)
        refuted = RowTree(covers, every, best, WorkBudget(PLENTY)).run()
        assert (refuted.selected, refuted.lower_bound) == (None, best)
        found = RowTree(covers, every, best + 1, WorkBudget(PLENTY)).run()
        assert found.selected is not None, seed
        assert found.selected.size == best


def rows_of_three(seed):
    rng = np.random.default_rng(seed)
    covers = np.zeros((30, 11), dtype=bool)
    for row in covers:
        row[rng.choice(11, size=3, replace=False)] = True
    return covers


def test_children_share_out_every_smaller_cover():
    """Also those with a set that costs all of what the relaxation leaves."""
    ring = np.eye(5, dtype=bool) | np.roll(np.eye(5, dtype=bool), 1, axis=0)
    with_single_rows = np.concatenate([ring, np.eye(5, dtype=bool)], axis=1)
    shared_out = 0
    for covers in (with_single_rows, *map(rows_of_three, range(15))):
        n_e, n_s = covers.shape
        best = fewest_by_hand(covers)
        tree = RowTree(covers, np.arange(n_e), best + 1, WorkBudget(PLENTY))
        root = tree.linear.root()
        assert root is not None
        children = tree.branch(root)
        assert children is not None
        for chosen in map(list, itertools.combinations(range(n_s), best)):
            if covers[:, chosen].any(axis=1).all():
                shared_out += 1
                homes = [
                    child.part.allowed[chosen].all()
                    and all(row[chosen].any() for row in child.part.added)
                    for child in children
                ]
                assert sum(homes) == 1, chosen
    assert shared_out > 15


def test_branching_settles_an_odd_hole():
    """An odd ring of n rows, two a set: one more than half, where LP says half."""
    for n in (3, 5, 9, 15):
        ring = np.eye(n, dtype=bool) | np.eye(n, k=1, dtype=bool)
        ring[-1, 0] = True
        assert linear_cover(ring, WorkBudget(PLENTY)).primal.sum() == n / 2
        refuted = RowTree(ring, np.arange(n), n // 2 + 1, WorkBudget(PLENTY)).run()
        assert refuted.lower_bound == n // 2 + 1
        assert refuted.selected is None


def test_same_answer_twice_and_as_many_when_permuted():
    rng = np.random.default_rng(5)
    covers = rng.random((120, 40)) < 0.15
    covers[np.arange(120), rng.integers(0, 40, 120)] = True
    once, again = (solve(covers, 3e9, seed=3) for _ in range(2))
    assert once.selected.tolist() == again.selected.tolist()
    assert (once.bound, once.proof) == (again.bound, again.proof)
    assert once.status is SolveStatus.OPTIMAL
    for _ in range(2):
        rows, columns = rng.permutation(120), rng.permutation(40)
        moved = solve(covers[rows][:, columns], 3e9, seed=3)
        assert moved.status is SolveStatus.OPTIMAL
        assert moved.selected.size == once.selected.size


def test_what_is_known_is_kept():
    covers = np.eye(4, dtype=bool)
    answer = solve(covers, 0.0, lower=4)
    assert answer.status is SolveStatus.OPTIMAL
    assert answer.bound == 4.0
    cover = reduced(covers)
    with pytest.raises(ValueError, match="start of 3 sets must cover every row"):
        fewest_full(cover, WorkBudget(1e9), seed=0, start=np.arange(3), lower=1)


def test_clock_cuts():
    rng = np.random.default_rng(7)
    covers = rng.random((200, 80)) < 0.06
    covers[np.arange(200), rng.integers(0, 80, 200)] = True
    cover = reduced(covers)
    work = WorkBudget(PLENTY, time_limit=0.0)
    start = np.arange(cover.n_sets)
    answer = fewest_full(cover, work, seed=0, start=start, lower=1)
    assert answer.status is SolveStatus.FEASIBLE
    assert answer.bound <= solve(covers, 1e8).selected.size
