"""The parts of the cover engine one by one, where the whole would hide a fault."""

import itertools

import numpy as np
import pytest
from scipy import sparse

from solvers.covers.bounds.lagrangian import tighten
from solvers.covers.bounds.mixed_integer import branch_and_bound, linear_multipliers
from solvers.covers.bounds.reductions import reduce_problem
from solvers.covers.bounds.relaxation import cost_bound, coverage_bounds
from solvers.covers.cover_problem import CoverProblem
from solvers.covers.exact.group_branching import best_by_groups
from solvers.covers.exact.pairs import best_pair
from solvers.covers.search.neighbourhood import cheapest, greedy, most_coverage, prune
from solvers.covers.search.swaps import Swaps
from solvers.status import WorkBudget


def reduced_cover(covers, weights, costs, required):
    """The cover that the search would see."""
    return reduce_problem(
        CoverProblem(covers, weights, costs, required_weight=required)
    )


NONE = np.empty(0, dtype=np.int64)


def random_cover(seed, *, n_e=36, n_s=12, density=0.3, share=0.9, costs=None):
    rng = np.random.default_rng(seed)
    covers = rng.random((n_e, n_s)) < density
    weights = rng.integers(1, 9, n_e).astype(float) if seed % 2 else rng.random(n_e)
    reachable = weights[covers.any(axis=1)].sum()
    c = np.ones(n_s) if costs is None else costs
    return reduced_cover(sparse.csr_array(covers), weights, c, share * reachable)


def plenty():
    return WorkBudget(5e9)


def best_tuple(cover, n_sets, **ask):
    """The engine's exact search for so many sets."""
    return (best_pair if n_sets < 3 else best_by_groups)(cover, n_sets, **ask)


def most_by_hand(cover, k):
    tuples = itertools.combinations(range(cover.n_sets), min(k, cover.n_sets))
    serves = cover.by_set.toarray() > 0
    return float(np.max(serves[np.array(list(tuples))].any(axis=1) @ cover.weights))


def multipliers_of(cover, seed):
    """Rows' own weights, random ones and good ones: the answer may not depend on it."""
    rng = np.random.default_rng(seed)
    return [
        cover.weights,
        cover.weights * rng.random(cover.weights.size),
        tighten(cover, 3, 0.0, cover.weights, plenty()),
    ][seed % 3]


@pytest.mark.long
@pytest.mark.parametrize("k", [1, 2, 3, 4, 5])
def test_tuples_equal_brute_force(k):
    for seed in range(40):
        cover = random_cover(seed)
        best = most_by_hand(cover, k)
        search = best_tuple(
            cover,
            k,
            target=1.0,
            multipliers=multipliers_of(cover, seed),
            budget=plenty(),
        )
        assert search.complete
        assert search.weight == best, seed
        assert cover.weight_of(search.selected) == best
        assert best <= search.upper_bound <= best * (1 + 1e-10)


@pytest.mark.long
@pytest.mark.parametrize("k", [2, 3, 4])
def test_tuples_decide_to_the_last_unit_of_weight(k):
    """The most weight is reached, one unit more isn't: also when all rows count."""
    for seed in range(40):
        cover = random_cover(seed, density=0.2 + 0.02 * (seed % 20))
        best = most_by_hand(cover, k)
        for target, reached in ((best, True), (best + 1.0, False)):
            search = best_tuple(
                cover,
                k,
                target=target,
                multipliers=multipliers_of(cover, seed),
                budget=plenty(),
                first=True,
            )
            assert (search.selected is not None) is reached, seed
            if reached:
                assert cover.weight_of(search.selected) >= target
                assert search.selected.size <= k
            else:
                assert search.complete


def test_sums_of_equal_weights_come_in_whole_grains():
    """A target between two sums asks for the upper one, and refutes it if it's none."""
    for seed in range(12):
        covers = np.random.default_rng(seed).random((50, 12)) < 0.3
        cover = reduced_cover(
            sparse.csr_array(covers), np.full(50, 0.3), np.ones(12), 1.0
        )
        assert np.all(cover.weights % cover.grain == 0.0)
        counts = cover.weights / cover.grain
        assert np.gcd.reduce(counts.astype(int)) == 1
        best = most_by_hand(cover, 3)
        search = best_tuple(
            cover,
            3,
            target=best + 1.0,
            multipliers=cover.weights,
            budget=plenty(),
        )
        assert search.selected is None
        assert search.upper_bound == best


def test_planted_full_covers_are_found_among_decoys():
    """A planted exact cover of five among decoys that miss a row each."""
    rng = np.random.default_rng(2)
    part = rng.integers(0, 5, 120)
    covers = np.column_stack([part == i for i in range(5)])
    for i in range(5):
        for _ in range(4):
            decoy = covers[:, i].copy()
            decoy[rng.choice(np.flatnonzero(decoy))] = False
            decoy |= rng.random(120) < 0.02
            covers = np.column_stack([covers, decoy])
    cover = reduced_cover(sparse.csr_array(covers), np.ones(120), np.ones(25), 120.0)
    ask = {"multipliers": cover.weights, "budget": plenty(), "first": True}
    five = best_tuple(cover, 5, target=cover.total, **ask)
    assert cover.weight_of(five.selected) == cover.total
    four = best_tuple(cover, 4, target=cover.total, **ask)
    assert four.selected is None
    assert four.complete


def test_cut_search_returns_a_bound_that_holds():
    for seed in range(20):
        cover = random_cover(seed, n_e=80, n_s=30)
        best = most_by_hand(cover, 3)
        for units in (0.0, 3e5, 2e6):
            search = best_tuple(
                cover,
                3,
                target=1.0,
                multipliers=cover.weights,
                budget=WorkBudget(units),
            )
            assert search.upper_bound >= best
            assert search.weight <= best
            if search.complete:
                assert search.weight == best


def arcs(rng):
    """Points on a circle against arcs: few pairs stand nearly opposite."""
    points, centres = (rng.uniform(0.0, 2 * np.pi, n) for n in (900, 420))
    gap = np.abs((points[:, None] - centres + np.pi) % (2 * np.pi) - np.pi)
    return gap <= 0.46 * np.pi


@pytest.mark.parametrize("kind", ["even", "uneven", "arcs"])
def test_many_pairs_agree_with_a_dense_product(kind, monkeypatch):
    """More columns than a block, more rows than the first look."""
    if kind == "arcs":  # Else the few that are left are too many to go one by one.
        monkeypatch.setattr("solvers.covers.exact.pairs._FEW_PAIRS", 8)
    rng = np.random.default_rng(4)
    covers = {
        "even": rng.random((900, 420)) < 0.32,
        "uneven": rng.random((900, 420)) < rng.uniform(0.2, 0.45, 420),
        "arcs": arcs(rng),
    }[kind]
    weights = rng.uniform(0.5, 1.5, 900)
    cover = reduced_cover(sparse.csr_array(covers), weights, np.ones(420), 1.0)
    a = cover.by_row.toarray()
    gains = cover.weights @ a
    pairs = gains[:, None] + gains - (a * cover.weights[:, None]).T @ a
    best = float(pairs.max())
    search = best_tuple(
        cover, 2, target=1.0, multipliers=cover.weights, budget=plenty()
    )
    assert search.weight == best
    known = best_tuple(
        cover, 2, target=best, multipliers=cover.weights, budget=plenty()
    )
    assert known.weight == best
    cuts = 0
    for units in np.linspace(1e6, 3e7, 30):
        cut = best_tuple(
            cover,
            2,
            target=1.0,
            multipliers=cover.weights,
            budget=WorkBudget(float(units)),
        )
        assert cut.upper_bound >= best
        cuts += not cut.complete and cut.selected is not None
    assert cuts > 0 or kind != "even"
    beyond = best_tuple(
        cover, 2, target=best + 1.0, multipliers=cover.weights, budget=plenty()
    )
    assert beyond.selected is None
    assert beyond.complete


def test_descent_approaches_the_linear_program():
    """No bound is below what is covered, and the descent gets near the LP's."""
    from scipy.optimize import linprog

    for seed in range(6):
        cover = random_cover(seed, n_e=60, n_s=25, density=0.2)
        n_s, n_e = cover.by_set.shape
        link = sparse.hstack([-cover.by_row, sparse.eye_array(n_e)])
        count = sparse.csr_array(np.concatenate([np.ones(n_s), np.zeros(n_e)])[None])
        lp = linprog(
            np.concatenate([np.zeros(n_s), -cover.weights / cover.total]),
            A_ub=sparse.vstack([link, count]),
            b_ub=np.append(np.zeros(n_e), 4.0),
            bounds=(0, 1),
        )
        goal = -lp.fun * 0.999 * cover.total
        multipliers = tighten(cover, 4, goal, cover.weights, plenty())
        bound = coverage_bounds(cover, multipliers)[4]
        assert -lp.fun * (1 - 1e-9) <= bound / cover.total <= -lp.fun * 1.02


def test_moves_never_lose_the_best():
    for seed in range(30):
        cover = random_cover(seed, n_e=60, n_s=20)
        start, reached = np.array([0, 1, 2]), 0.0
        for moves in (0, 1, 2, 3, 5, 9, 40):
            best = most_coverage(
                cover, start, plenty(), target=np.inf, seed=0, max_moves=moves
            )
            assert best.size == 3
            assert cover.weight_of(best) >= max(reached, cover.weight_of(start))
            reached = cover.weight_of(best)
        for out in best:
            for into in range(cover.n_sets):
                swapped = np.append(best[best != out], into)
                assert cover.weight_of(swapped) <= reached


def test_barred_moves_count_only_beyond_the_best():
    cover = random_cover(3, n_e=60, n_s=12, density=0.4)
    kept = Swaps(cover, [3, 0], plenty())
    change, out, into = kept.best_swap()
    barred = np.zeros(12, dtype=bool)
    barred[into] = True
    free = np.zeros(2, dtype=bool)
    assert kept.best_swap(stay=free, barred=barred)[2] != into
    stay = np.arange(2) == out
    assert kept.best_swap(stay=stay, barred=barred & False)[1] != out
    low = kept.best_swap(stay=stay, barred=barred, beyond=change * (1 - 1e-9))
    assert low == (change, out, into)
    assert kept.best_swap(stay=stay, barred=barred, beyond=change) != low
    nothing = kept.best_swap(stay=free | True, barred=barred | True)
    assert nothing[0] == -np.inf


def assert_worths_are_true(cover, kept):
    """Gains, regains and the best swap against weights counted anew, to the bit."""

    serves = cover.by_row.toarray() > 0

    def weight(chosen):
        return float(cover.weights[serves[:, chosen].any(axis=1)].sum())

    assert kept.covered == weight(kept.chosen)
    gain = [weight([*kept.chosen, j]) - kept.covered for j in range(cover.n_sets)]
    assert kept.gain.tolist() == gain
    changes = []
    for i, s in enumerate(kept.chosen):
        rest = kept.chosen[:i] + kept.chosen[i + 1 :]
        with_j = [weight([*rest, j]) - weight(rest) for j in range(cover.n_sets)]
        assert kept.regain[i].tolist() == (np.array(with_j) - gain).tolist()
        changes.append(np.array(with_j) - with_j[s])
    change, out, into = kept.best_swap()
    assert change == np.max(changes)
    assert (out, into) == divmod(int(np.argmax(changes)), cover.n_sets)


@pytest.mark.parametrize("block", [2**18, 40])
def test_worth_of_swaps_is_kept_to_the_bit_as_sets_come_and_go(block, monkeypatch):
    monkeypatch.setattr("solvers.covers.search.swaps._BLOCK", block)
    for seed in range(4):
        cover = random_cover(seed, n_e=60, n_s=12, density=0.4)
        rng = np.random.default_rng(seed)
        kept = Swaps(cover, [3, 0], plenty())
        assert_worths_are_true(cover, kept)
        for _ in range(12):
            free = np.setdiff1d(np.arange(cover.n_sets), kept.chosen)
            if len(kept.chosen) < 2 or (rng.random() < 0.6 and free.size):
                kept.add(int(rng.choice(free)))
            else:
                kept.drop(int(rng.integers(len(kept.chosen))))
            assert_worths_are_true(cover, kept)


def test_weights_that_single_precision_would_round_are_summed_exactly():
    """Odd numbers of 23 bits: each is exact in single precision, no sum of them is."""
    rng = np.random.default_rng(5)
    covers = rng.random((60, 12)) < 0.4
    weights = 2.0 * rng.integers(2**21, 2**22, 60) + 1.0
    total = weights[covers.any(axis=1)].sum()
    cover = reduced_cover(
        sparse.csr_array(covers), weights, np.ones(12), float(np.floor(0.9 * total))
    )
    kept = Swaps(cover, [3, 0, 7], plenty())
    kept.drop(1)
    kept.add(5)
    assert_worths_are_true(cover, kept)


def test_moves_leave_local_optima():
    """Over many instances, moves that lose weight find what a descent misses."""
    first = last = 0.0
    for seed in range(12):
        cover = random_cover(seed, n_e=80, n_s=30)
        start = greedy(cover, NONE, plenty(), n_sets=4)
        few, many = (
            most_coverage(
                cover, start, plenty(), target=np.inf, seed=0, max_moves=moves
            )
            for moves in (5, 120)
        )
        first += cover.weight_of(few) / cover.total
        last += cover.weight_of(many) / cover.total
        assert cover.weight_of(many) == most_by_hand(cover, 4)
    assert last > first


def test_prune_drops_what_isn_t_needed():
    for seed in range(20):
        cover = random_cover(seed)
        pruned = prune(cover, np.arange(cover.n_sets))
        assert cover.weight_of(pruned) >= cover.required
        for s in pruned:
            assert cover.weight_of(pruned[pruned != s]) < cover.required


def least_cost_by_hand(cover):
    return min(
        cover.costs[list(chosen)].sum()
        for k in range(1, cover.n_sets + 1)
        for chosen in itertools.combinations(range(cover.n_sets), k)
        if cover.weight_of(np.array(chosen)) >= cover.required
    )


@pytest.mark.parametrize("share", [0.8, 0.97, 1.0])
def test_costs_by_search_linear_bound_and_integers(share):
    for seed in range(4):
        costs = np.random.default_rng(seed).uniform(0.5, 2.0, 9)
        cover = random_cover(seed, n_e=24, n_s=9, share=share, costs=costs)
        least = least_cost_by_hand(cover)
        start = greedy(cover, NONE, plenty())
        found = cheapest(cover, start, plenty(), seed=0, max_kicks=100)
        cost = cover.costs[found].sum()
        assert least - 1e-9 <= cost <= cover.costs[start].sum() + 1e-9
        bound = cost_bound(cover, linear_multipliers(cover, plenty()))
        assert 0.5 * least < bound <= least + 1e-9
        answer = branch_and_bound(cover, start, plenty())
        assert cover.weight_of(answer.selected) >= cover.required
        assert cover.costs[answer.selected].sum() == pytest.approx(least)
        assert answer.bound == pytest.approx(least, rel=1e-5)
        assert answer.bound <= least


def test_loss_of_a_light_row_isn_t_taken_for_a_full_cover():
    """Two light rows may be lost, a heavy one may not: one set suffices."""
    covers = np.array([[1, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=bool)
    weights = np.array([10.0, 12.0, 1.0, 1.0])
    cover = reduced_cover(sparse.csr_array(covers), weights, np.ones(3), 22.0)
    answer = branch_and_bound(cover, np.arange(3), plenty())
    assert answer.selected.tolist() == [0]
    assert answer.bound == pytest.approx(1.0, abs=1e-5)
