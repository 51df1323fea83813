"""The plane of each pixel's window for which two images agree best, coarse to fine.

Planes are drawn at random and handed on: a neighbour's plane often suits a pixel, too.
So a few lucky draws spread over a surface, and are refined by smaller and smaller
changes (M. Bleyer, C. Rhemann, C. Rother, PatchMatch Stereo, BMVC 2011). All pixels
take each step at once, on images that are halved until the object is small.
"""

from dataclasses import dataclass

import numpy as np

from planning.verify.reconstruction.arrays import Array, Grey, Indices
from planning.verify.reconstruction.calibration import CameraCalibration

from .level_image import Grid, LevelImage
from .two_views import TwoViews, homogeneous

# Windows reach so many pixels of their image about their middle.
_REACH = 3
# Rounds on the coarsest image, and on each finer one.
_ROUNDS = (12, 4, 3, 1)
_WAYS = ((0, 1), (0, -1), (1, 0), (-1, 0))
# The steepest surface that is drawn, against the first camera's rays [rad].
_STEEPEST = np.deg2rad(75.0)
# Windows whose grey levels vary less say nothing.
_FLAT = 1.0
# Windows that are compared at once: they stay in the cache.
_CHUNK = 1 << 12


@dataclass(frozen=True, eq=False)
class Planes:
    """What was found for the places of a grid.

    Attributes:
        grid: The places.
        planes: d, d_u, d_v in [1/m] and [1/(m px)], shape (n, 3).
        scores: Correlation of both images' windows, -1 where unknown, shape (n,).
    """

    grid: Grid
    planes: Array
    scores: Array


class WindowSearch:
    """Finds the windows of a first image in a second one."""

    def __init__(
        self,
        cameras: tuple[CameraCalibration, CameraCalibration],
        images: tuple[list[LevelImage], list[LevelImage]],
        depths: tuple[float, float],
        seed: tuple[int, ...],
    ) -> None:
        self._cameras, self._images = cameras, images
        self._inverse = 1.0 / depths[1], 1.0 / depths[0]
        self._rng = np.random.default_rng(seed)

    def found(self, step: int, dark: float) -> Planes:
        """Return planes for every so many pixels of the finest image."""
        firsts, _ = self._images
        last = len(firsts) - 1
        known: Planes | None = None
        for level in range(last, -1, -1):
            every = max(1, round(step / firsts[level].fold))
            grid = Grid.over(firsts[level], every, dark)
            planes = self._drawn(grid) if known is None else _handed_on(known, grid)
            work = _LevelWork(self._cameras, self._images, level, grid)
            known = Planes(grid, planes, work.scores(np.arange(len(planes)), planes))
            for number in range(_ROUNDS[last - level]):
                # On finer images what is found is nearly right.
                size = 0.5 ** (number + 2.0 * (last - level))
                known = self._round(work, known, size)
        assert known is not None
        return known

    def _drawn(self, grid: Grid) -> Array:
        """Planes at random: depths, and directions that the first camera sees."""
        n, low_high = len(grid.pixels), self._inverse
        d = self._rng.uniform(*low_high, n)
        return np.column_stack([d, self._slopes(grid.pixels, d)])

    def _slopes(self, pixels: Array, d: Array) -> Array:
        """D_u, d_v of planes with normals at random: 1 / z = N.x / (N.X)."""
        first = self._cameras[0]
        x = homogeneous(first, pixels)
        tilt = np.tan(_STEEPEST) * np.sqrt(self._rng.random(len(d)))
        turn = self._rng.uniform(0.0, 2.0 * np.pi, len(d))
        # About the ray: the middle of the image is near enough to the axis.
        normals = np.column_stack([tilt * np.cos(turn), tilt * np.sin(turn)])
        along = normals @ np.eye(2) + x[:, :2]
        scale = d / (1.0 + np.einsum("ij,ij->i", along, x[:, :2]))
        focal = np.diag(first.matrix)[:2]
        return along * scale[:, None] / focal

    def _round(self, work: "_LevelWork", known: Planes, size: float) -> Planes:
        """Try the neighbours' planes, then changes of the own."""
        for way in _WAYS:
            here, there = known.grid.neighbours(*way)
            off = -known.grid.step * np.array(way[::-1], dtype=np.float64)
            planes = known.planes[there].copy()
            planes[:, 0] += planes[:, 1:] @ off
            known = work.better(known, here, planes)
        everywhere = np.arange(len(known.planes))
        n, (low, high) = len(everywhere), self._inverse
        for what in ("both", "slopes"):
            planes = known.planes.copy()
            if what == "both":
                planes[:, 0] += size * (high - low) * self._rng.uniform(-0.5, 0.5, n)
            steepest = np.tan(_STEEPEST) * planes[:, :1] / self._cameras[0].focal_px
            planes[:, 1:] += size * steepest * self._rng.uniform(-1.0, 1.0, (n, 2))
            planes[:, 0] = np.clip(planes[:, 0], low, high)
            known = work.better(known, everywhere, planes)
        return known


class _LevelWork:
    """Compares windows on one level of both images."""

    def __init__(
        self,
        cameras: tuple[CameraCalibration, CameraCalibration],
        images: tuple[list[LevelImage], list[LevelImage]],
        level: int,
        grid: Grid,
    ) -> None:
        first, self._second = images[0][level], images[1][level]
        reach = np.arange(-_REACH, _REACH + 1, dtype=np.float64) * first.fold
        self._offsets = np.stack(np.meshgrid(reach, reach), axis=-1).reshape(-1, 2)
        u, v = (grid.pixels[:, None, k] + self._offsets[:, k] for k in (0, 1))
        self._windows = _normalised(first.at(u, v))
        self._views = TwoViews.of(*cameras, grid.pixels)

    def scores(self, places: Indices, planes: Array) -> Array:
        """Return correlations with the windows that planes show, shape (n,)."""
        scores = np.empty(len(places))
        for start in range(0, len(places), _CHUNK):
            part = slice(start, start + _CHUNK)
            views = self._views.take(places[part])
            u, v, _, _ = views.seen_at(planes[part], self._offsets)
            other = _normalised(self._second.at(u, v))
            scores[part] = np.einsum("nm,nm->n", self._windows[places[part]], other)
        return scores

    def better(self, known: Planes, places: Indices, planes: Array) -> Planes:
        """Return what is known, with other planes of places where they agree better."""
        scores = self.scores(places, planes)
        won = scores > known.scores[places]
        after, best = known.planes.copy(), known.scores.copy()
        after[places[won]], best[places[won]] = planes[won], scores[won]
        return Planes(known.grid, after, best)


def _normalised(windows: Grey) -> Grey:
    """Return windows (n, m) less their mean and of length 1; 0 where they are flat."""
    centred = windows - windows.mean(axis=1, keepdims=True)
    length = np.sqrt(np.einsum("nm,nm->n", centred, centred))
    flat = length < _FLAT * np.sqrt(windows.shape[1])
    scale = np.where(flat, 0.0, 1.0 / np.where(flat, 1.0, length))
    return (centred * scale[:, None]).astype(np.float32)


def _handed_on(known: Planes, grid: Grid) -> Array:
    """Return the planes of a coarser grid at the places of a finer one."""
    columns, coarse = known.grid.pixels, known.grid
    first = _first_pixel(coarse)
    near = coarse.nearest(grid.pixels, first)
    # Of a bright pixel whose coarser one was dark the planes begin anywhere.
    lost = near < 0
    near[lost] = np.arange(int(lost.sum())) % max(len(columns), 1)
    planes = known.planes[near].copy()
    off = grid.pixels - columns[near]
    off[lost] = 0.0
    planes[:, 0] += np.einsum("ij,ij->i", planes[:, 1:], off)
    return planes


def _first_pixel(grid: Grid) -> Array:
    """Pixel (u, v) of the grid's first place, whether it is bright or not."""
    row, column = np.argwhere(grid.index >= 0)[0]
    return grid.pixels[0] - grid.step * np.array([column, row], dtype=np.float64)
