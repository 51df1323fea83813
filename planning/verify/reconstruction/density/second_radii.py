"""Radii of a second sequence, from where the first one's rings lie and what they found.

The paper's future work: "sampling density determination given the density of previous
light sources". Between two rings a surface is interpolated by a chord, which errs along
the beam by at most kappa h^2 / 8, with an rms of kappa h^2 / sqrt(120). kappa, the
second derivative of the height, is that of the points measured on three rings in a row.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median
from scipy.spatial import KDTree

from planning.verify.reconstruction.arrays import Array, Indices
from planning.verify.reconstruction.patterns.ring_patterns import DrawnRings

Numbers = NDArray[np.integer]
_AZIMUTHS = 180
# Where fewer azimuths tell, a ring takes kappa from the next one.
_FEWEST = 3


@dataclass(frozen=True, eq=False)
class MeasuredRings:
    """Heights measured on the rings of one projector, by azimuth.

    Attributes:
        pattern: The rings, shape (n,).
        depth: Median z in the ring frame in [m], NaN where nothing is measured, shape
            (n, n_azimuths).
        noise_m: Standard deviation of a height along the beam [m].
    """

    pattern: DrawnRings
    depth: Array
    noise_m: float

    @classmethod
    def of(
        cls, pattern: DrawnRings, local: Array, ring: Numbers, noise_m: float
    ) -> "MeasuredRings":
        """Sort points of the ring frame (n, 3), each on a ring (n,), by azimuth."""
        turn = np.arctan2(local[:, 1], local[:, 0]) % (2.0 * np.pi)
        column = (turn * (_AZIMUTHS / (2.0 * np.pi))).astype(np.int64) % _AZIMUTHS
        cell = ring.astype(np.int64) * _AZIMUTHS + column
        depth = np.full(len(pattern.radii) * _AZIMUTHS, np.nan)
        known = np.unique(cell)
        if len(known):
            depth[known] = median(local[:, 2], cell, known)
        return cls(pattern, depth.reshape(-1, _AZIMUTHS), noise_m)

    def bends(self, max_incidence: float) -> tuple[Array, Array]:
        """Return the mean of kappa^2 in each gap, and how much of it is seen.

        In [m^2] per unit of the radii to the fourth, and in azimuths, shape (n,) each;
        gap k ends at ring k, the first begins at the centre, through which a profile
        runs on to the other side. A profile that rises faster against the beam than
        tan(max_incidence) crosses a step and doesn't count. What bends less than the
        noise over the widest gap isn't told from flat.
        """
        radii, light = self.pattern.radii, self.pattern.light
        across = np.roll(self.depth, _AZIMUTHS // 2, axis=1)
        depth = np.concatenate([across[:1], self.depth])
        rho = np.concatenate([-radii[:1], radii])
        s, t = light.slope_run(rho[:, None], depth)
        with np.errstate(invalid="ignore"):
            even = np.abs(np.diff(t, axis=0)) <= np.tan(max_incidence) * np.diff(
                s, axis=0
            )
        slope = np.diff(light.chart(depth), axis=0) / np.diff(rho)[:, None]
        span = 0.5 * (rho[2:] - rho[:-2])[:, None]
        kappa = np.diff(slope, axis=0) / span
        kappa *= light.chart_m(radii[:-1, None], self.depth[:-1])
        kappa[~(even[1:] & even[:-1])] = np.nan
        gaps = np.diff(radii, prepend=-radii[0])
        floor = (8.0 * self.noise_m / float(gaps.max()) ** 2) ** 2
        at_ring = np.append(_mean_squares(kappa), np.nan)
        ends = np.stack([np.concatenate([at_ring[:1], at_ring[:-1]]), at_ring])
        known = np.isfinite(ends)
        mean = np.where(known, ends, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
        seen = np.isfinite(self.depth).sum(axis=1).astype(np.float64)
        return np.maximum(mean, floor), seen


def _mean_squares(kappa: Array) -> Array:
    """Return the mean of kappa^2 of each row, NaN where hardly any is known, (n,)."""
    known = np.isfinite(kappa)
    count = known.sum(axis=1)
    total = np.where(known, kappa, 0.0) ** 2
    return np.where(count >= _FEWEST, total.sum(axis=1) / np.maximum(count, 1), np.nan)


@dataclass(frozen=True, eq=False)
class Gaps:
    """The gaps between the rings of a first sequence, the first about the centre.

    Attributes:
        radii: Outer end of each, rising, shape (n,).
        bend: Mean kappa^2 in each, shape (n,).
        seen: How much of the circumference is measured there, shape (n,).
        finest: Least distance of two rings of one sequence there, shape (n,).
    """

    radii: Array
    bend: Array
    seen: Array
    finest: Array

    def squared_error(self, more: Indices) -> Array:
        """Return the mean squared error times the area of each gap, (n,).

        With so many rings more in each: ``bend h^4 / 120``, on an area that goes with
        ``seen R h``. The gap about the centre is as long as a diameter, and every ring
        in it cuts it twice.
        """
        inner = np.concatenate([[0.0], self.radii[:-1]])
        length, parts = self.radii - inner, more + 1.0
        length[0], parts[0] = 2.0 * self.radii[0], 2.0 * more[0] + 1.0
        area = self.seen * 0.5 * (self.radii**2 - inner**2)
        return area * self.bend * (length / parts) ** 4 / 120.0

    def placed(self, more: Indices) -> tuple[Array, Indices]:
        """Return radii that part each gap evenly, so many in it, and their gaps."""
        begin = np.concatenate([[0.0], self.radii[:-1]])
        parts = [
            self.radii[0] * np.arange(1, 2 * n, 2) / (2 * n + 1)
            if k == 0
            else begin[k] + (self.radii[k] - begin[k]) * np.arange(1, n + 1) / (n + 1)
            for k, n in enumerate(more.tolist())
        ]
        return np.concatenate(parts), np.repeat(np.arange(len(more)), more)

    def kept_apart(self, more: Indices) -> bool:
        """Return whether no two of the new rings come nearer than is allowed."""
        radii, gap = self.placed(more)
        least = np.maximum(self.finest[gap[1:]], self.finest[gap[:-1]])
        return bool(np.all(np.diff(radii) >= least * (1.0 - 1e-9)))


def second_radii(gaps: Gaps) -> Array:
    """Return as many radii, which lower the rms of the interpolation error most.

    One ring after the other goes to the gap whose squared error it lowers most, since
    the error of a gap falls ever more slowly; a gap that would come too near is closed.
    If one ring in each gap, as a halving has, errs less, it is that.
    """
    n = len(gaps.radii)
    more, closed = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=bool)
    for _ in range(n):
        step = np.eye(n, dtype=np.int64)
        won = gaps.squared_error(more) - gaps.squared_error(more + 1)
        while not closed.all():
            best = int(np.argmax(np.where(closed, -np.inf, won)))
            if gaps.kept_apart(more + step[best]):
                more = more + step[best]
                break
            closed[best] = True
    even = np.ones(n, dtype=np.int64)
    worse = gaps.squared_error(more).sum() > gaps.squared_error(even).sum()
    return gaps.placed(even if worse or more.sum() < 2 else more)[0]


def nearest_rings(pixels: Array, ring: Numbers, n_rings: int, *, share: float) -> Array:
    """Return how far neighbouring rings lie apart in an image, a gap each, (n_rings,).

    Of points of ring k the distance to the nearest of ring k - 1, such that a share of
    them lies no farther; NaN where either is missing. Pixels (n, 2), ring (n,).
    """
    apart = np.full(n_rings, np.nan)
    on = [ring == k for k in range(n_rings)]
    for k in range(1, n_rings):
        if on[k].any() and on[k - 1].any():
            away, _ = KDTree(pixels[on[k - 1]]).query(pixels[on[k]])
            apart[k] = np.quantile(away, share)
    return apart
