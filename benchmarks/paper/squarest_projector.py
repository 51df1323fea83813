"""How clouds were merged before: one projector a tile, one camera a cell.

Where several projectors light a piece of surface, the one that meets it more squarely
stayed, then among cameras the one with the smaller standard deviation along the normal.
Kept for the comparison in `benchmarks.paper.redundancy`.
"""

import numpy as np

from planning.verify.reconstruction.arrays import Array, Indices, Mask
from planning.verify.reconstruction.check.tiles import Tiles, plane_normals
from planning.verify.reconstruction.cloud import Cloud

# A projector may stand for another in a tile if it measured this share as many points.
_MIN_SUPPORT = 0.4
# Directions that a surface may face, and one for surface whose direction isn't known.
_SIDES = 7


def squarest_projectors(cloud: Cloud, *, gap_m: float, pitch_px: float) -> Cloud:
    """Return the points that stay, of rings so far apart on the object, in images."""
    normals = np.full((len(cloud), 3), np.nan)
    square = np.zeros(len(cloud), dtype=bool)
    for camera in np.unique(cloud.camera):
        seen = np.flatnonzero(cloud.camera == camera)
        by_camera = cloud.take(seen)
        tiles = Tiles.of(by_camera.pixels, pitch_px)
        normals[seen] = plane_normals(by_camera.points, by_camera.rays, tiles)[0]
        square[seen] = _squarest_projector(by_camera, tiles, normals[seen])
    squarest, normals = cloud.take(square), normals[square]
    sigma = squarest.sigma(normals)
    best = _sharpest_camera(squarest, sigma, _side(normals), 0.5 * gap_m)
    return squarest.take(best)


def _squarest_projector(cloud: Cloud, tiles: Tiles, normals: Array) -> Mask:
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
        # Of tiles that hold none of its points.
        count[np.bincount(tiles.of_point[lit], minlength=len(count)) == 0] = 0.0
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
