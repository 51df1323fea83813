"""Pieces of cells against scipy's labels of the same images."""

import numpy as np
import pytest
from scipy import ndimage

from geometry.directions.cube_cells import pieces


@pytest.mark.parametrize("share", [0.0, 0.3, 0.6, 0.95, 1.0])
@pytest.mark.parametrize("n", [1, 2, 16])
def test_pieces_are_what_hangs_together_on_a_face(share, n):
    rng = np.random.default_rng(int(100 * share) + n)
    marks = rng.random((5, 6 * n * n)) < share
    in_plane = np.zeros((3, 3, 3), dtype=bool)
    in_plane[1] = [[0, 1, 0], [1, 1, 1], [0, 1, 0]]
    labels, count = ndimage.label(marks.reshape(-1, n, n), structure=in_plane)
    labels = labels.reshape(marks.shape)
    found = pieces(marks, n)
    firsts = [int(np.flatnonzero(labels.ravel() == k)[0]) for k in range(1, count + 1)]
    assert sorted(found.first.tolist()) == sorted(firsts)
    # Each piece by itself, every other one, all and none.
    number = labels.ravel()[found.first]
    for wanted in ([0], range(0, count, 2), range(count), []):
        chosen = np.zeros(count, dtype=bool)
        chosen[[k for k in wanted if k < count]] = True
        np.testing.assert_array_equal(
            found.cells(chosen), np.isin(labels, number[chosen])
        )


def test_a_snake_is_one_piece():
    """It turns at both ends of every row: runs join far from where they begin."""
    n = 9
    face = np.zeros((n, n), dtype=bool)
    face[::2] = True
    face[1::4, -1] = face[3::4, 0] = True
    marks = np.zeros((1, 6, n, n), dtype=bool)
    marks[0, 2] = face
    found = pieces(marks.reshape(1, -1), n)
    assert found.first.tolist() == [2 * n * n]
    assert (found.cells(np.array([True])).reshape(marks.shape) == marks).all()
