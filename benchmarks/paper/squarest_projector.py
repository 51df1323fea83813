"""How clouds were merged before: one projector a tile, one camera a cell.

Where several projectors light a piece of surface, the one that meets it more squarely
stayed, then among cameras the one with the smaller standard deviation along the normal.
Kept for the comparison in `benchmarks.paper.redundancy`.
"""

from dataclasses import dataclass

import numpy as np

from planning.verify.reconstruction.arrays import Array, Indices, Mask
from planning.verify.reconstruction.cloud import Cloud

# Edges are compared within tiles of the image about one ring pitch wide.
_MIN_TILE_PX, _MAX_TILE_PX = 6, 64
_MIN_POINTS = 12
# A plane is one if the points spread in two directions, at most this unevenly.
_MIN_SPREAD = 0.02
# A projector may stand for another in a tile if it measured this share as many points.
_MIN_SUPPORT = 0.4
# Directions that a surface may face, and one for surface whose direction isn't known.
_SIDES = 7


def squarest_projectors(cloud: Cloud, *, gap_m: float, pitch_px: float) -> Cloud:
    """Return the points that stay, of rings so far apart on the object, in images."""
    side = int(np.clip(np.ceil(pitch_px), _MIN_TILE_PX, _MAX_TILE_PX))
    normals = np.full((len(cloud), 3), np.nan)
    square = np.zeros(len(cloud), dtype=bool)
    for camera in np.unique(cloud.camera):
        seen = np.flatnonzero(cloud.camera == camera)
        by_camera = cloud.take(seen)
        tiles = _Tiles.of(by_camera.pixels, side)
        normals[seen] = _plane_normals(by_camera, tiles)
        square[seen] = _squarest_projector(by_camera, tiles, normals[seen])
    squarest, normals = cloud.take(square), normals[square]
    sigma = squarest.sigma(normals)
    best = _sharpest_camera(squarest, sigma, _side(normals), 0.5 * gap_m)
    return squarest.take(best)


@dataclass(frozen=True, eq=False)
class _Tiles:
    """Squares of an image, and which of them each point is in."""

    of_point: Indices
    shape: tuple[int, int]

    @classmethod
    def of(cls, pixels: Array, side: int) -> "_Tiles":
        """Lay tiles over the points, with one row and column of empty ones around."""
        place = np.floor((pixels - pixels.min(axis=0)) / side).astype(np.int64) + 1
        columns, rows = (place.max(axis=0) + 2).tolist()
        return cls(place[:, 1] * columns + place[:, 0], (rows, columns))

    def occupied(self, chosen: Mask) -> Mask:
        """Return whether each tile holds one of the chosen points, (n_tiles,)."""
        rows, columns = self.shape
        return np.bincount(self.of_point[chosen], minlength=rows * columns) > 0

    def sum_around(self, values: Array | None = None) -> Array:
        """Return sums over each tile and its eight neighbours, (n_tiles,)."""
        rows, columns = self.shape
        summed = np.bincount(self.of_point, values, rows * columns)
        grid = summed.astype(np.float64).reshape(self.shape)
        padded = np.pad(grid, 1)
        wide = padded[:-2] + padded[1:-1] + padded[2:]
        return (wide[:, :-2] + wide[:, 1:-1] + wide[:, 2:]).ravel()


def _plane_normals(cloud: Cloud, tiles: _Tiles) -> Array:
    """Normals of the planes through the points around each point's tile, (n, 3)."""
    points = cloud.points - cloud.points.mean(axis=0)
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
    away = np.einsum("ij,ij->i", normals, cloud.rays) > 0.0
    return np.where(away[:, None], -normals, normals)


def _squarest_projector(cloud: Cloud, tiles: _Tiles, normals: Array) -> Mask:
    """Points of the projector that meets each tile most squarely, shape (n,)."""
    projectors = np.unique(cloud.projector)
    if len(projectors) < 2:
        return np.ones(len(cloud), dtype=bool)
    cosine = -np.einsum("ij,ij->i", cloud.beams, normals)
    known = np.isfinite(cosine)
    score, support = [], []
    for projector in projectors:
        lit = cloud.projector == projector
        count = tiles.sum_around(lit.astype(np.float64))
        count[~tiles.occupied(lit)] = 0.0
        weighed = tiles.sum_around((lit & known).astype(np.float64))
        total = tiles.sum_around(np.where(lit & known, cosine, 0.0))
        score.append(total / np.maximum(weighed, 1.0))
        support.append(count)
    scores, counts = np.array(score), np.array(support)
    able = counts >= _MIN_SUPPORT * counts.max(axis=0)
    winner = projectors[np.argmax(np.where(able, scores, -np.inf), axis=0)]
    return ~known | (cloud.projector == winner[tiles.of_point])


def _side(normals: Array) -> Indices:
    """Which of the six directions of the axes each normal is nearest to; 6 for none."""
    known = np.isfinite(normals[:, 0])
    steepest = np.argmax(np.abs(np.where(known[:, None], normals, 0.0)), axis=1)
    sign = np.take_along_axis(normals, steepest[:, None], axis=1)[:, 0] > 0.0
    return np.where(known, 2 * steepest + sign, _SIDES - 1)


def _sharpest_camera(cloud: Cloud, sigma: Array, side: Indices, cell_m: float) -> Mask:
    """Points of the camera with the least mean sigma in each cell of space, (n,)."""
    if len(cloud) == 0:
        return np.zeros(0, dtype=bool)
    place = np.floor((cloud.points - cloud.points.min(axis=0)) / cell_m).astype(
        np.int64
    )
    rows, columns = place[:, 1].max() + 1, place[:, 2].max() + 1
    key = (place[:, 0] * rows + place[:, 1]) * columns + place[:, 2]
    # Surface that faces another way is the other side of something thin.
    key = key * _SIDES + side
    _, cell = np.unique(key, return_inverse=True)
    cameras = int(cloud.camera.max()) + 1
    slot = cell * cameras + cloud.camera
    n_slots = (int(cell.max()) + 1) * cameras
    # Without a normal a point gives way to any other.
    known = np.where(np.isfinite(sigma), sigma, 1.0)
    count = np.bincount(slot, minlength=n_slots)
    mean = np.bincount(slot, known, n_slots) / np.maximum(count, 1)
    mean = np.where(count > 0, mean, np.inf).reshape(-1, cameras)
    return cloud.camera == np.argmin(mean, axis=1)[cell]
