"""Where pairs of devices contradict each other, by images and calibration alone.

A camera's pixel shows one point, and a projector's pixel lights one: what two pairs
measured through one pixel of a device that they share is one point, whatever the object
is. What a pair measured can't lie before what another camera saw through the same
pixel, or another projector lit; behind it, it may be hidden.

Residuals are in pixels: by how much the edges of both would have to be elsewhere ::

    |(X_1 - X_2) . w| / sqrt(|s_1|^2 + |s_2|^2)

with w along the pixel, and s the displacement of a point by one pixel of its edge.
"""

from collections.abc import Set
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
from scipy.spatial import KDTree

from planning.verify.reconstruction.arrays import Array
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.decode.decode import PairIndex
from planning.verify.reconstruction.scanner import Scanner

# Pairs agree up to this residual: half a pixel beside a spot is elsewhere on slanted
# surface. Well calibrated pairs reached 0.53 on ten objects and six plans.
AGREE_PX = 0.75
# Points are of one spot if they lie this near in an image [px].
_SAME_SPOT_PX = 0.5
_QUANTILE = 0.75
_FEWEST = 30
# Which index of a pair.
_PROJECTOR, _CAMERA = 0, 1


@dataclass(frozen=True, eq=False)
class Agreement:
    """Clouds of pairs, held against each other."""

    plan: Scanner
    clouds: dict[PairIndex, Cloud]

    @cached_property
    def residuals(self) -> dict[frozenset[PairIndex], float]:
        """Of each two pairs that measured many spots through one device [px]."""
        upper: dict[frozenset[PairIndex], float] = {}
        for one, other in combinations(sorted(self.clouds), 2):
            for which in (_PROJECTOR, _CAMERA):
                if one[which] == other[which]:
                    before = self._before(
                        self.clouds[one], self.clouds[other], other, which
                    )
                    if len(before) >= _FEWEST:
                        upper[frozenset((one, other))] = upper_px(np.abs(before))
        return upper

    def evidence(self, points: Cloud, of: PairIndex, others: Set[PairIndex]) -> Array:
        """Return residuals of points of one pair against others' [px], shape (n,).

        One for each point and each device that can't but have seen or lit it.
        """
        every = [np.zeros(0)]
        for other in sorted(others - {of}):
            theirs = self.clouds[other]
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
        self, points: Cloud, measured: Cloud, by: PairIndex, which: int
    ) -> Array:
        """Return how far points lie before what a device of a pair measured [px].

        Of those that show within `_SAME_SPOT_PX` of it, by the camera or projector.
        """
        projector, camera = self.plan.projectors[by[0]], self.plan.cameras[by[1]]
        if which == _CAMERA:
            spots, known = camera.project(points.points), measured.pixels
            depths = [_lengths(c.points - camera.centre) for c in (points, measured)]
        else:
            spots, known = self._on_panel(points, measured, by)
            depths = [projector.aim(c.points)[2] for c in (points, measured)]
        shown = np.flatnonzero(np.isfinite(spots).all(axis=1))
        beside, nearest = KDTree(known).query(
            spots[shown], distance_upper_bound=_SAME_SPOT_PX
        )
        near = np.isfinite(beside)
        i, k = shown[near], np.asarray(nearest)[near]
        shift = np.hypot(_lengths(points.shift[i]), _lengths(measured.shift[k]))
        return (depths[1][k] - depths[0][i]) / shift

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
    """Return the upper quartile, which a few spots on slanted surface don't move."""
    return float(np.quantile(residuals, _QUANTILE))


def _lengths(vectors: Array) -> Array:
    return np.linalg.norm(vectors, axis=1)
