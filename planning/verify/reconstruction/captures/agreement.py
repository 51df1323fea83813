"""Where pairs of devices contradict each other, by images and calibration alone.

A camera's pixel shows one point, and a projector's pixel lights one: what two pairs
measured through one pixel of a device that they share is one point, whatever the object
is. What a pair measured can't lie before what another camera saw through the same
pixel, or another projector lit; behind it, it may be hidden.

Rings of both hardly ever cross in one place, so that a point is held against the plane
through the other pair's points about it: half a pixel aside, slanted surface is
elsewhere. Residuals are in pixels, by how much the edges of both would have to be
elsewhere, beyond three deviations of their noise ::

    n . (X_1 - X_2) / sqrt(e_1^2 + e_2^2)

with n the normal of the plane, and e how far a point moves along it when its edge moves
by a pixel.
"""

from collections.abc import Set
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
from scipy.spatial import KDTree

from planning.verify.reconstruction.arrays import Array, Mask
from planning.verify.reconstruction.check.overlaps import ring_pitch_px
from planning.verify.reconstruction.check.tiles import Tiles, plane_normals
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.decode.decode import PairIndex
from planning.verify.reconstruction.scanner import Scanner

# Pairs agree up to this residual; well calibrated ones reached 0.1.
AGREE_PX = 0.5
# What so many deviations of the noise explain is no residual.
SIGMAS = 3.0
# Points are of one spot if they lie this near in an image [px].
_SAME_SPOT_PX = 0.5
_QUANTILE = 0.75
_FEWEST = 30
# Which index of a pair.
_PROJECTOR, _CAMERA = 0, 1
# Points, and unit normals of the planes about them, NaN where there is none, (n, 3).
Surface = tuple[Cloud, Array]


@dataclass(frozen=True, eq=False)
class Agreement:
    """Clouds of pairs, held against each other."""

    plan: Scanner
    clouds: dict[PairIndex, Cloud]

    @cached_property
    def _surfaces(self) -> dict[PairIndex, Surface]:
        return {key: self._surface(cloud) for key, cloud in self.clouds.items()}

    def _surface(self, cloud: Cloud) -> Surface:
        tiles = Tiles.of(cloud.pixels, ring_pitch_px(cloud, self.plan))
        return cloud, plane_normals(cloud.points, cloud.rays, tiles)[0]

    @cached_property
    def residuals(self) -> dict[frozenset[PairIndex], float]:
        """Of each two pairs that measured many spots through one device [px]."""
        upper: dict[frozenset[PairIndex], float] = {}
        for one, other in combinations(sorted(self.clouds), 2):
            for which in (_PROJECTOR, _CAMERA):
                if one[which] == other[which]:
                    two = self._surfaces[one], self._surfaces[other]
                    before = self._before(*two, other, which)
                    if len(before) >= _FEWEST:
                        upper[frozenset((one, other))] = upper_px(np.abs(before))
        return upper

    def evidence(self, some: Mask, of: PairIndex, others: Set[PairIndex]) -> Array:
        """Return residuals of some points of a pair against others' [px], shape (n,).

        One for each point and each device that can't but have seen or lit it.
        """
        every = [np.zeros(0)]
        cloud, normals = self._surfaces[of]
        points = cloud.take(some), normals[some]
        for other in sorted(others - {of}):
            theirs = self._surfaces[other]
            for which in (_PROJECTOR, _CAMERA):
                before = self._before(points, theirs, other, which)
                if of[which] == other[which]:
                    every.append(np.abs(before))
                    continue
                behind = self._before(theirs, points, of, which)
                every += [
                    np.maximum(px[px > -AGREE_PX], 0.0) for px in (before, behind)
                ]
        return np.concatenate(every)

    def _before(
        self, points: Surface, measured: Surface, by: PairIndex, which: int
    ) -> Array:
        """Return how far points lie before what a device of a pair measured [px].

        Of those that show within `_SAME_SPOT_PX` of it, by the camera or projector.
        """
        one, other = points[0], measured[0]
        if which == _CAMERA:
            camera = self.plan.cameras[by[1]]
            spots, known = camera.project(one.points), other.pixels
        else:
            spots, known = self._on_panel(one, other, by)
        shown = np.flatnonzero(np.isfinite(spots).all(axis=1))
        beside, nearest = KDTree(known).query(
            spots[shown], distance_upper_bound=_SAME_SPOT_PX
        )
        near = np.isfinite(beside)
        i, k = shown[near], np.asarray(nearest)[near]
        one, other = one.take(i), other.take(k)
        looks = other.rays if which == _CAMERA else other.beams
        normals = _first_known(measured[1][k], points[1][i], looks)
        normals *= -np.sign(np.einsum("ij,ij->i", normals, looks))[:, None]
        before = np.einsum("ij,ij->i", normals, one.points - other.points)
        shift = np.stack([cloud.per_pixel(normals) for cloud in (one, other)], axis=1)
        noise = _lengths(shift * np.stack([one.noise_px, other.noise_px], axis=1))
        beyond = np.maximum(np.abs(before) - SIGMAS * noise, 0.0)
        return np.sign(before) * beyond / _lengths(shift)

    def _on_panel(
        self, points: Cloud, measured: Cloud, by: PairIndex
    ) -> tuple[Array, Array]:
        """Return where light passes to both, in pixels of the camera that measured.

        Rings are several pixels apart: of one projector those near are of one ring.
        """
        projector, camera = self.plan.projectors[by[0]], self.plan.cameras[by[1]]
        reach = _lengths(measured.points - camera.centre)
        local = [projector.to_ring(cloud.points) for cloud in (points, measured)]
        shrink = projector.light.shrink(local[1][:, 2])
        per_pixel = camera.focal_px / float(np.median(reach * shrink))
        spots = projector.light.plane(local[0]) * per_pixel
        known = projector.light.plane(local[1]) * per_pixel
        spots[~projector.light.reaches(local[0][:, 2])] = np.nan
        return np.asarray(spots, np.float64), np.asarray(known, np.float64)


def upper_px(residuals: Array) -> float:
    """Return the upper quartile, which a few spots on steps don't move."""
    return float(np.quantile(residuals, _QUANTILE))


def _first_known(*columns: Array) -> Array:
    """Return of each row, (n, 3), the first that isn't NaN."""
    known = columns[0]
    for more in columns[1:]:
        known = np.where(np.isfinite(known), known, more)
    return known


def _lengths(vectors: Array) -> Array:
    return np.linalg.norm(vectors, axis=1)
