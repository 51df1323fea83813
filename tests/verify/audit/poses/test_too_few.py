"""How many caps of a sphere are too few, where the truth is known."""

from itertools import combinations_with_replacement

import numpy as np
import pytest

from geometry.arrays import Array, Ints, Mask
from planning.verify.audit.proofs.poses.sphere_cells import Cells, of_parallel
from planning.verify.audit.proofs.poses.too_few import (
    Outcome,
    Question,
    in_open_pairs,
    most_of_one,
)


class Caps:
    """Points of the unit sphere within an angle of a direction."""

    def __init__(self, points: Array, angle: float) -> None:
        self.points, self.angle = points, angle

    def serve(self, cells: Cells, may: Mask) -> Mask:
        seen = of_parallel(cells, (self.points,))
        off = np.arccos(np.clip(seen.along[0], -1.0, 1.0))
        return may & (off - seen.psi <= self.angle)


def _points(n: int) -> Array:
    """Even points of the sphere, a spiral from pole to pole."""
    z = 1.0 - (2.0 * np.arange(n) + 1.0) / n
    turn = np.arange(n) * np.pi * (3.0 - 5.0**0.5)
    across = np.sqrt(1.0 - z**2)
    return np.column_stack([across * np.cos(turn), across * np.sin(turn), z])


def _asked(points: Array, degrees: float) -> Question:
    caps = Caps(points, np.radians(degrees))
    roots = Cells.of_shell(1.0, 1.0)
    return Question(roots, caps, len(points), 0.0, lambda _: None)


def _by_multipliers(points: Array, degrees: float, n: int, lam: Ints) -> Outcome:
    most = most_of_one(n, len(points), lam)
    return _asked(points, degrees).by_multipliers(most, lam)


@pytest.mark.parametrize(("degrees", "enough"), [(80.0, 3), (58.0, 5), (47.0, 7)])
def test_area_alone_refutes_as_many_caps_as_it_must(degrees, enough) -> None:
    # A cap is (1 - cos a) / 2 of the sphere: no fewer than its inverse are enough.
    points = _points(2000)
    ones = np.ones(2000, dtype=np.int64)
    assert np.ceil(2.0 / (1.0 - np.cos(np.radians(degrees)))) == enough
    assert _by_multipliers(points, degrees, enough - 1, ones).too_few
    assert not _by_multipliers(points, degrees, enough, ones).too_few


def test_what_lies_apart_takes_a_cap_each() -> None:
    # Four corners of a tetrahedron: no cap of 54 degrees holds two of them.
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / 3**0.5
    points = np.concatenate([corners, _points(200)])
    lam = np.concatenate([[1, 1, 1, 1], np.zeros(200)]).astype(np.int64)
    assert _by_multipliers(points, 54.0, 3, lam).too_few
    # Of 55 degrees one holds two, in between them.
    assert not _by_multipliers(points, 55.0, 3, lam).too_few


@pytest.mark.long
def test_pairs_refute_what_two_caps_leave() -> None:
    points = _points(300)
    gap = Question.by_pairs
    # Two hemispheres, less a degree, leave a belt; over a right angle they don't.
    assert gap(_asked(points, 80.0), 300).too_few
    assert not gap(_asked(points, 100.0), 300).too_few
    # As many as two caps hold: (1 - cos a) of them all.
    share = 1.0 - np.cos(np.radians(50.0))
    assert gap(_asked(points, 50.0), int(1.25 * share * 300)).too_few
    assert not gap(_asked(points, 50.0), int(0.9 * share * 300)).too_few


@pytest.mark.parametrize("seed", range(5))
def test_open_pairs_are_those_that_a_loop_finds(seed) -> None:
    rng = np.random.default_rng(seed)
    served = rng.random((700, 40)) < rng.random((700, 1)) * 0.7
    least = 33
    found = set[int]()
    for a, b in combinations_with_replacement(range(700), 2):
        if (served[a] | served[b]).sum() >= least:
            found |= {a, b}
    assert in_open_pairs(served, least).tolist() == sorted(found)


def test_the_most_of_one_is_as_much_as_refutes() -> None:
    rng = np.random.default_rng(1)
    for _ in range(50):
        lam = rng.integers(0, 9, 20)
        least, n = int(rng.integers(1, 21)), int(rng.integers(1, 5))
        most = most_of_one(n, least, lam)
        cheapest = int(np.sort(lam)[:least].sum())
        assert n * most < cheapest <= n * (most + 1)
