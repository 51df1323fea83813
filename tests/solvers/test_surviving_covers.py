"""Covers that must be met K times over and after a loss, against all selections."""

from itertools import combinations

import numpy as np
import pytest

from solvers.surviving.exchanges import Exchanges
from solvers.surviving.fewest_surviving import least_surviving, solve_surviving
from solvers.surviving.surviving_cover import SurvivingCover


def random_cover(seed):
    """Pairs with sets of a second kind, whose losses are cases; floors; fixed sets."""
    rng = np.random.default_rng(seed)
    n, m, others = 24, 8, int(rng.integers(1, 4))
    need, losable = int(rng.integers(1, 4)), bool(rng.integers(2))
    pairs = rng.random((n, m, others)) < 0.4
    counts = pairs.sum(axis=2)
    cases = [counts]
    if losable and others > 1:
        cases += [counts - pairs[:, :, p] for p in range(others)]
    row_sets = rng.integers(0, 3, n)
    reached = [case.sum(axis=1) >= need for case in cases]
    floors = [
        [0, *(int(0.5 * (mask & (row_sets == r)).sum()) for r in (1, 2))]
        for mask in reached
    ]
    return SurvivingCover.of(
        cases,
        [int(0.7 * mask.sum()) for mask in reached],
        need=need,
        losable=losable,
        row_sets=row_sets,
        floors=np.array(floors),
        n_fixed=int(rng.integers(0, 2)),
        kinds=np.arange(m) % 2,
        stock=np.array([m, int(rng.integers(1, 4))]),
    )


def left_of(cover, selected):
    """Elements covered in each case after each loss."""
    losses = [(0, [s for s in selected if s != out]) for out in selected]
    if not cover.losable or not losses:
        losses = [(0, list(selected))]
    losses += [(g, list(selected)) for g in range(1, len(cover.serves))]
    for case, left in losses:
        table = cover.serves[case]
        yield case, table[:, left].astype(int).sum(axis=1) >= cover.need


def is_met(cover, selected):
    for case, covered in left_of(cover, selected):
        counts = np.bincount(cover.row_sets, weights=covered, minlength=3)
        if sum(covered) < cover.required[case] or np.any(counts < cover.floors[case]):
            return False
    return True


def fewest(cover):
    """The least number of sets by looking at all selections; None: none is enough."""
    for count in range(cover.n_sets + 1):
        for selected in combinations(range(cover.n_sets), count):
            stocked = np.bincount(cover.kinds[list(selected)], minlength=2)
            if not set(cover.fixed.tolist()) <= set(selected):
                continue
            if np.all(stocked <= cover.stock) and is_met(cover, selected):
                return count
    return None


@pytest.mark.parametrize("seed", range(10))
def test_as_few_as_all_selections_allow(seed):
    cover = random_cover(seed)
    truth = fewest(cover)
    found = solve_surviving(
        cover, lower_bound=least_surviving(cover, budget=1e5), kicks=6
    )
    if truth is None:
        assert found.status == "infeasible"
        return
    assert found.status != "infeasible"
    assert is_met(cover, found.selected)
    assert len(found.selected) == truth >= found.lower_bound
    assert cover.in_stock(found.selected)
    assert np.isin(cover.fixed, found.selected).all()


def test_every_exchange_is_ranked_as_what_it_leaves():
    for seed in range(6):
        cover = random_cover(seed)
        exchanges, chosen = Exchanges(cover), np.array([0, 3, 5])
        rests = [np.delete(chosen, k) for k in range(3)]
        lacking, spare = exchanges.with_one_more(rests)
        for k, rest in enumerate(rests):
            for one in np.setdiff1d(np.arange(cover.n_sets), rest):
                rank = exchanges.rank(np.append(rest, one))
                assert rank == (lacking[k, one], spare[k, one])


def test_two_sets_that_halve_a_sphere_take_two_more():
    # Elements of each half, which a set sees from either end: copies of two sets.
    half = np.zeros((10, 6), dtype=np.uint8)
    half[:5, ::2] = half[5:, 1::2] = 1
    for share, truth in ((10, 4), (5, 2)):
        # Half of it asked: without one of two the other half is left.
        cover = SurvivingCover.of([half], [share])
        found = solve_surviving(cover, lower_bound=least_surviving(cover, budget=1e5))
        assert (len(found.selected), found.status) == (
            truth,
            "optimal" if truth == 2 else "feasible",
        )


def test_one_set_more_than_a_cover_is_proved_where_it_suffices():
    # Any two of three cover all, so that one of three may go.
    serves = ~np.eye(3, dtype=bool)
    cover = SurvivingCover.of([np.repeat(serves, 2, axis=0).astype(np.uint8)], [6])
    found = solve_surviving(cover, lower_bound=least_surviving(cover, budget=1e5))
    assert (len(found.selected), found.status, found.lower_bound) == (3, "optimal", 3)


def test_pairs_count_as_often_as_they_serve():
    # The first set serves all with two others, as two of the rest do together.
    serves = np.array([[2, 1, 1, 0], [2, 1, 1, 1], [2, 0, 1, 1]], dtype=np.uint8)
    cover = SurvivingCover.of([serves], [3], need=2, losable=False)
    found = solve_surviving(cover, lower_bound=least_surviving(cover, budget=1e5))
    assert (found.selected.tolist(), found.status) == ([0], "optimal")
    more = SurvivingCover.of([serves], [3], need=3, losable=False)
    assert (
        len(
            solve_surviving(
                more, lower_bound=least_surviving(more, budget=1e5)
            ).selected
        )
        == 2
    )


def test_what_is_allowed_lacks_least():
    half = np.zeros((10, 4), dtype=np.uint8)
    half[:5, :2] = half[5:, 2:] = 1
    found = solve_surviving(SurvivingCover.of([half], [10]), most=3)
    assert (found.status, len(found.selected)) == ("infeasible", 3)
    with pytest.raises(ValueError, match="need must be 1 or more"):
        SurvivingCover.of([half], [10], need=0)
    with pytest.raises(ValueError, match="required must be"):
        SurvivingCover.of([half, half], [10])
