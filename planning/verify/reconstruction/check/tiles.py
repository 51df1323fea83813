"""Tiles of an image about one ring pitch wide, and the planes of what they show."""

from dataclasses import dataclass

import numpy as np

from planning.verify.reconstruction.arrays import Array, Indices

_MIN_TILE_PX, _MAX_TILE_PX = 6, 64
_MIN_POINTS = 12
# A plane is one if the points spread in two directions, at most this unevenly.
_MIN_SPREAD = 0.02
# Times that means are taken of means; deviations that no neighbour answers for.
_SMOOTHED, _DEVIATIONS = 3, 3.0
# Deviation of what a point is a mean over: the lens, pixels, three of them on a line.
_BLURRED_PX = np.sqrt(0.7**2 + 1.0 / 12.0 + 3.0**2 / 12.0)


@dataclass(frozen=True, eq=False)
class Tiles:
    """Squares of an image, and which of them each point is in."""

    of_point: Indices
    shape: tuple[int, int]
    side_px: int

    @classmethod
    def of(cls, pixels: Array, pitch_px: float) -> "Tiles":
        """Lay tiles over the points, with one row and column of empty ones around."""
        side = int(np.clip(np.ceil(pitch_px), _MIN_TILE_PX, _MAX_TILE_PX))
        place = np.floor((pixels - pixels.min(axis=0)) / side).astype(np.int64) + 1
        columns, rows = (place.max(axis=0) + 2).tolist()
        return cls(place[:, 1] * columns + place[:, 0], (rows, columns), side)

    def sum_around(self, values: Array | None = None, times: int = 1) -> Array:
        """Return sums over each tile and its eight neighbours, so many times over."""
        rows, columns = self.shape
        summed = np.bincount(self.of_point, values, rows * columns)
        grid = summed.astype(np.float64).reshape(self.shape)
        for _ in range(times):
            padded = np.pad(grid, 1)
            wide = padded[:-2] + padded[1:-1] + padded[2:]
            grid = wide[:, :-2] + wide[:, 1:-1] + wide[:, 2:]
        return grid.ravel()

    def excess_around(self, square: Array, usual: Array) -> Array:
        """Return how much more squares are than usual about each point, at least 0.

        Means over nine tiles, of nine, of nine: of fewer points they would vary more
        than what they tell. Weighted by ``1 / sqrt(usual)``: between the plain mean,
        which the noisiest few decide, and the surest, which leaves out what is rare. A
        point that lies off by more than three deviations speaks for itself.

        Args:
            square: Of random numbers, shape (n,).
            usual: Their expectation; 0 or NaN: not looked at, shape (n,).
        """
        known = np.isfinite(square) & (usual > 0.0)
        weight = np.where(known, usual, np.inf) ** -0.5
        every = self.sum_around(weight, _SMOOTHED)
        rest = self.sum_around(weight * np.where(known, square - usual, 0.0), _SMOOTHED)
        mean = rest / np.maximum(every, np.finfo(float).tiny)
        around = np.maximum(mean, 0.0)[self.of_point]
        alone = known & (square > _DEVIATIONS**2 * (usual + around))
        return np.where(alone, square, around)


def plane_normals(points: Array, rays: Array, tiles: Tiles) -> tuple[Array, Array]:
    """Return normals of the planes through the points around each point's tile.

    Args:
        points: In [m], shape (n, 3).
        rays: Unit directions from the camera to them, shape (n, 3).
        tiles: Where they lie in the image.

    Returns:
        Unit normals towards the camera, shape (n, 3), NaN where points are too few, or
        on a line; and how far a bent surface lies off the mean of what a point is one
        of [m], shape (n,). Bent by k over a width w, it lies r = k w^2 / sqrt(720) off
        the plane of nine tiles, rms, and a mean over b (rms) k b^2 / 2 off itself. The
        mean square of what planes nearby tell: one alone is of few points.
    """
    points = points - points.mean(axis=0)
    count = tiles.sum_around()
    safe = np.maximum(count, 1.0)
    mean = np.stack([tiles.sum_around(points[:, a]) for a in range(3)], axis=1)
    mean /= safe[:, None]
    spread = np.empty((len(count), 3, 3))
    for a in range(3):
        for b in range(a, 3):
            moment = tiles.sum_around(points[:, a] * points[:, b]) / safe
            spread[:, a, b] = spread[:, b, a] = moment - mean[:, a] * mean[:, b]
    values, vectors = np.linalg.eigh(spread)
    flat = (count >= _MIN_POINTS) & (values[:, 1] > _MIN_SPREAD * values[:, 2])
    normals = np.where(flat[:, None], vectors[:, :, 0], np.nan)[tiles.of_point]
    away = np.einsum("ij,ij->i", normals, rays) > 0.0
    bends = np.maximum(values[:, 0], 0.0)[tiles.of_point]
    near = tiles.sum_around(bends, 2) / np.maximum(tiles.sum_around(times=2), 1.0)
    relief = np.sqrt(180.0 * near) * (_BLURRED_PX / (3.0 * tiles.side_px)) ** 2
    return np.where(away[:, None], -normals, normals), relief[tiles.of_point]
