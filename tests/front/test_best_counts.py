"""The best of each number of candidates, held against looking at all."""

from itertools import combinations

import numpy as np
import pytest

from planning.proofs.device_stock import DeviceStock
from planning.proofs.selection import CandidateCover
from planning.steps.front.best_counts import best_counts, with_more


def covers(seed, n=40, m=9, share=0.25):
    return np.random.default_rng(seed).random((n, m)) < share


def most_of_all(matrix, count, fixed=()):
    chosen = (c for c in combinations(range(matrix.shape[1]), count))
    return max(
        int(matrix[:, list(c)].any(axis=1).sum()) for c in chosen if {*fixed} <= {*c}
    )


@pytest.mark.parametrize("seed", range(4))
def test_each_number_covers_most_and_no_less_than_its_bound(seed):
    matrix = covers(seed)
    found = best_counts(CandidateCover(matrix, 0.9), 5, 1e8)
    assert [*found] == [1, 2, 3, 4, 5]
    for count, best in found.items():
        assert len(best.chosen) == count
        assert best.covered == int(matrix[:, best.chosen].any(axis=1).sum())
        assert best.covered == most_of_all(matrix, count) == best.bound


def test_bounds_hold_where_no_work_is_left_to_find_the_best():
    matrix = covers(5, n=120, m=14)
    found = best_counts(CandidateCover(matrix, 0.9), 4, 1.0)
    for count, best in found.items():
        assert best.covered <= most_of_all(matrix, count) <= best.bound
    bounds = [best.bound for best in found.values()]
    assert bounds == sorted(bounds)


def test_existing_devices_are_in_all_and_count():
    matrix = covers(6)
    matrix[:, 0] = False
    matrix[0, 0] = True
    found = best_counts(CandidateCover(matrix, 0.9, n_existing=1), 3, 1e8)
    assert all(0 in best.chosen for best in found.values())
    assert found[3].covered == most_of_all(matrix, 3, fixed=(0,))


def test_without_a_number_it_ends_where_all_that_can_be_is_covered():
    matrix = np.zeros((10, 6), dtype=bool)
    matrix[:4, 1] = matrix[4:7, 3] = matrix[7:9, 5] = True
    found = best_counts(CandidateCover(matrix, 0.9), None, 1e8)
    assert [best.covered for best in found.values()] == [4, 7, 9]
    # A number that is given is looked at, though it covers no more.
    assert max(best_counts(CandidateCover(matrix, 0.9), 5, 1e8)) == 5


def test_another_covers_what_none_does_then_what_one_does():
    matrix = np.array([[1, 1, 0, 0], [1, 0, 0, 1], [0, 0, 1, 0]], dtype=bool)
    cover = CandidateCover(matrix, 1.0)
    assert with_more(cover, np.array([0]), 2).tolist() == [0, 2]
    assert with_more(cover, np.array([0, 2]), 3).tolist() == [0, 1, 2]
    assert with_more(cover, np.array([0]), 9).tolist() == [0, 1, 2, 3]


def test_no_more_of_a_model_than_there_are():
    matrix = np.eye(4, dtype=bool)
    stock = DeviceStock(np.array([0, 0, 1, 1]), np.array([1, 2]))
    cover = CandidateCover(matrix, 1.0, stock=stock)
    assert with_more(cover, np.array([1]), 4).tolist() == [1, 2, 3]
    assert max(best_counts(cover, 4, 1e8)) == 3
