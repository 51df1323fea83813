"""What tiles tell of chance alone, where the answer is a formula."""

import numpy as np
import pytest

from planning.verify.reconstruction.check.tiles import Tiles, plane_normals

SIDE, A_TILE = 6, 10
# Of a mean of means of means over nine: sum of squared weights along one axis.
_ONE_AXIS = np.convolve(np.convolve([1, 1, 1], [1, 1, 1]), [1, 1, 1]) / 27.0
N_TOLD = A_TILE / np.sum(_ONE_AXIS**2) ** 2


@pytest.fixture(scope="module")
def tiles():
    """A hundred by a hundred tiles of ten points each, and which lie inside."""
    rng = np.random.default_rng(5)
    corners = np.stack(np.meshgrid(np.arange(100), np.arange(100)), axis=-1)
    corners = np.repeat(SIDE * corners.reshape(-1, 2), A_TILE, axis=0)
    pixels = corners + rng.uniform(0.0, SIDE, corners.shape)
    inside = np.all((pixels > 3 * SIDE) & (pixels < 97 * SIDE), axis=1)
    found = Tiles.of(np.vstack([pixels, [[0.0, 0.0]]]), float(SIDE))
    return Tiles(found.of_point[:-1], found.shape, found.side_px), pixels, inside


def test_chance_is_hardly_taken_for_shape(tiles):
    """The mean of a normal number's positive part is 0.4 of its deviation."""
    tiles, _, inside = tiles
    square = np.random.default_rng(6).standard_normal(len(inside)) ** 2
    # What a point says for itself is no mean.
    square = np.minimum(square, 8.9)
    usual = np.full(len(square), np.mean(square))
    found = tiles.excess_around(square, usual)[inside]
    deviation = np.std(square) / np.sqrt(N_TOLD)
    assert found.mean() == pytest.approx(deviation / np.sqrt(2.0 * np.pi), rel=0.15)
    real = tiles.excess_around(square + 0.5, usual)[inside]
    assert real.mean() == pytest.approx(0.5, abs=0.05)


def test_a_point_far_off_speaks_for_itself(tiles):
    tiles, _, inside = tiles
    square = np.ones(len(inside))
    far = np.flatnonzero(inside)[::5001]
    square[far] = 16.0
    found = tiles.excess_around(square, np.ones(len(square)))
    np.testing.assert_array_equal(found[far], 16.0)
    assert np.delete(found, far).max() < 1.0


def test_how_a_plane_bends_is_told_by_the_planes_around(tiles):
    """Of plane noise alone: a variance of n points has the deviation sqrt(2 / n)."""
    tiles, pixels, inside = tiles
    noise = 1e-5 * np.random.default_rng(7).standard_normal(len(inside))
    points = np.column_stack([1e-4 * pixels, noise])
    rays = np.tile([0.0, 0.0, 1.0], (len(inside), 1))
    normals, relief = plane_normals(points, rays, tiles)
    np.testing.assert_allclose(normals[inside, 2], -1.0, atol=1e-3)
    square = relief[inside] ** 2
    spread = np.std(square) / np.mean(square)
    assert spread == pytest.approx(np.sqrt(2.0 / N_TOLD), rel=0.15)
    blurred = (0.7**2 + 1.0 / 12.0 + 3.0**2 / 12.0) / (3 * SIDE) ** 2
    # Three of about ninety degrees of freedom are the plane's.
    expected = np.sqrt(180.0) * 1e-5 * blurred * np.sqrt(87.0 / 90.0)
    assert np.sqrt(np.mean(square)) == pytest.approx(expected, rel=0.02)
