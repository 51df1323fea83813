"""The shortest way between stations, against all orders."""

from itertools import permutations

import numpy as np
import pytest

from planning.cameras.stations.heads import tour
from planning.cameras.stations.heads.tour import shortest_way


def _length(places, order):
    return float(np.linalg.norm(np.diff(places[list(order)], axis=0), axis=1).sum())


@pytest.mark.parametrize("n", [1, 2, 3, 5, 7])
def test_the_way_is_the_shortest_of_all_orders(n):
    rng = np.random.default_rng(n)
    for _ in range(5):
        places = rng.normal(size=(n, 3))
        order, way = shortest_way(places)
        assert sorted(order) == list(range(n))
        assert way == pytest.approx(_length(places, order))
        best = min(_length(places, one) for one in permutations(range(n)))
        assert way == pytest.approx(best)


def test_more_stations_than_are_solved_exactly_lie_in_a_row_all_the_same(monkeypatch):
    monkeypatch.setattr(tour, "_EXACT", 3)
    places = np.zeros((9, 3))
    places[:, 0] = np.random.default_rng(1).permutation(9)
    order, way = shortest_way(places)
    assert way == pytest.approx(8.0)
    assert sorted(places[order, 0]) in (
        places[order, 0].tolist(),
        places[order, 0].tolist()[::-1],
    )
