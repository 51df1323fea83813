"""Clouds of coded pixels to one: in each cell the surest point, and what others add.

Points of several pairs that fall into one cell of space and look the same way measure
one place, as overlaps do in eqs. (5)-(7). The surest stays, moved along its normal to
the mean of all that are about as sure, weighted by ``1 / sigma^2``; what is left of
noise is ``1 / sqrt(sum 1 / sigma^2)``, of what is alike in all images nothing less.
"""

from dataclasses import dataclass, replace

import numpy as np

from planning.verify.reconstruction.arrays import Array, Indices, Mask
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.scanner import Scanner

from .tiles import Tiles, plane_normals

# Points whose sigma is so many times that of the surest in their cell add nothing; in
# cells so many times as large they go.
_MUCH_WORSE, _PLACE = 3.0, 4.0
# A point this many deviations off the surest one's plane is of another surface, or
# false [sigma of both].
_APART = 5.0
# Points along a side of a tile, for normals.
_POINTS_A_TILE = 3.0


@dataclass(frozen=True, eq=False)
class DenseMerged:
    """Points that stay, shape (n,) each.

    Attributes:
        cloud: They, moved.
        stays: Which of all points they are, shape (n_all,).
        shared: Which lie where several pairs measured, shape (n_all,).
        normals: By the points around, towards the camera, NaN: too few, (n, 3).
        sigma: Standard deviation along the normal [m].
    """

    cloud: Cloud
    stays: Mask
    shared: Mask
    normals: Array
    sigma: Array


def merge_dense(cloud: Cloud, plan: Scanner, *, cell_m: float) -> DenseMerged:
    """Average what several pairs measured of one place, and leave one point of it.

    Args:
        cloud: Points of coded pixels of all pairs.
        plan: Whose devices measured them.
        cell_m: Side of the cells.
    """
    normals = dense_normals(cloud, plan)
    known = np.isfinite(normals[:, :1])
    facing = np.where(known, normals, -cloud.rays)
    sigma = cloud.sigma(facing)
    # Unsure points scatter over cells beside those of sure ones, and would stay there;
    # along normals of such points, which scatter too, some would seem sure.
    about = cells_of(cloud.points, np.zeros(len(cloud), np.int64), _PLACE * cell_m)
    spread = np.linalg.norm(cloud.shift, axis=1) * np.hypot(
        cloud.noise_px, cloud.bias_px
    )
    worth = np.flatnonzero(spread <= _MUCH_WORSE * _least(about, spread))
    found = _merged(cloud.take(worth), facing[worth], sigma[worth], plan, cell_m)
    order = worth[found.order]
    stays, shared = (np.zeros(len(cloud), dtype=bool) for _ in range(2))
    stays[order] = True
    shared[worth] = found.shared
    kept = cloud.take(order)
    kept = replace(
        kept,
        points=kept.points + found.away_m[:, None] * facing[order],
        noise_px=kept.noise_px * np.minimum(found.remaining, 1.0),
    )
    return DenseMerged(kept, stays, shared, normals[order], kept.sigma(facing[order]))


@dataclass(frozen=True, eq=False)
class _Merged:
    """Which points stay, how far these move along their normals, and their noise left.

    `order` and what follows have shape (k,), the noise as a share; `shared` tells of
    all n points whether several pairs measured there.
    """

    order: Indices
    away_m: Array
    remaining: Array
    shared: Mask


def _merged(
    cloud: Cloud, facing: Array, sigma: Array, plan: Scanner, cell_m: float
) -> _Merged:
    octant = ((facing > 0.0) @ np.array([1, 2, 4])).astype(np.int64)
    _, cell = np.unique(cells_of(cloud.points, octant, cell_m), return_inverse=True)
    best = _surest(cell, sigma)
    own = best[cell]
    # Along the surest one's normal: aside of it points lie on the same surface.
    away = np.einsum("ij,ij->i", facing[own], cloud.points - cloud.points[own])
    alike = sigma <= _MUCH_WORSE * sigma[own]
    alike &= np.abs(away) <= _APART * np.hypot(sigma, sigma[own]) + _relief(cell_m)
    pair = cloud.projector.astype(np.int64) * len(plan.cameras) + cloud.camera
    # Two cameras' points are off by the noise of codes that theirs with the projector
    # are off by, too, and add nothing to them.
    by_two = cloud.ring < -1
    alone = by_two | by_two[own]
    alike &= ~alone | ((cloud.ring == cloud.ring[own]) & (pair == pair[own]))
    weight = np.where(alike, sigma**-2.0, 0.0)
    every = np.bincount(cell, weight)
    mean = np.bincount(cell, weight * away) / every
    shared = (np.bincount(cell, pair != pair[own]) > 0.0)[cell]
    order = np.sort(best)
    rank = cell[order]
    remaining = 1.0 / (np.sqrt(every[rank]) * sigma[order])
    return _Merged(order, mean[rank], remaining, shared)


def _least(place: Array, sigma: Array) -> Array:
    """Least sigma of the points in each one's place, shape (n,)."""
    _, among = np.unique(place, return_inverse=True)
    least = np.full(int(among.max(initial=-1)) + 1, np.inf)
    np.minimum.at(least, among, sigma)
    return least[among]


def dense_normals(cloud: Cloud, plan: Scanner) -> Array:
    """Return normals by points around in each pair's image; NaN: too few, (n, 3)."""
    normals = np.full((len(cloud), 3), np.nan)
    pair = cloud.projector.astype(np.int64) * len(plan.cameras) + cloud.camera
    for one in np.unique(pair):
        rows = np.flatnonzero(pair == one)
        spacing = _grid_px(cloud.pixels[rows])
        tiles = Tiles.of(cloud.pixels[rows], _POINTS_A_TILE * spacing)
        about = plane_normals(cloud.points[rows], cloud.rays[rows], tiles)[0]
        normals[rows] = about
    return normals


def _grid_px(pixels: Array) -> float:
    """Every how many pixels there is a point: the least step along a row."""
    columns = np.unique(pixels[:, 0])
    return float(np.diff(columns).min()) if len(columns) > 1 else 1.0


def _surest(cell: Indices, sigma: Array) -> Indices:
    """Index of the point of the least sigma in each cell, shape (n_cells,)."""
    order = np.lexsort((sigma, cell))
    first = np.flatnonzero(np.diff(cell[order], prepend=-1))
    return order[first]


def _relief(cell_m: float) -> float:
    """What points of one cell may lie off a plane through one of them [m]."""
    return 0.25 * cell_m


def cells_of(points: Array, kind: Indices, side_m: float) -> Array:
    """Return a number of each point's cube in space and kind, (n,)."""
    x, y, z = np.floor((points - points.min(axis=0)) / side_m).T
    cube = (x * (y.max() + 1.0) + y) * (z.max() + 1.0) + z
    return cube * (kind.max() + 1.0) + kind
