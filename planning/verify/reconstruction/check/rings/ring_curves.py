"""What several cameras measured of one ring: one curve, since light lands once.

Each ray of light meets the object in one point. On the surface of light behind a ring,
with s the length along the ring and t that along the light, all cameras measure the
same curve t(s), and another depth at the same s contradicts.
"""

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import lengths
from planning.verify.reconstruction.arrays import Array, Indices, Mask
from planning.verify.reconstruction.check.overlaps import pixel_sizes
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.scanner import Scanner

from .ring_fit import Lines, RingFit, in_cloud

_T = TypeVar("_T", bound=np.generic)

# Points this far along a ring are of one place, and lines are fitted through those
# within either reach [px].
_REACHES_PX = (0.75, 1.5)
# Better points of other cameras this near on both sides make one redundant [px].
_BESIDE_PX = 0.6
# Neighbours that are looked at on either side, for each camera of a rig.
_LOOKED_AT = 3
# Slope of t over s that neighbours on one surface have at most, and surely keep below.
_STEEPEST, _SURE_SLOPE = 2.0, 0.5
# Deviations within which neighbours are of one surface, and surely are.
_SIGMAS, _SURE_SIGMAS = 4.0, 3.0
# Estimates within different reaches agree within this many of their deviations.
_AGREE = 2.0
# An edge below this share of another's blur doesn't contradict it.
_STEP = 0.65
# Share of a point's slide that counts whatever the curve's slope is.
_ASTRAY = 0.1


@dataclass(frozen=True, eq=False)
class RingCurves:
    """Points along their rings, and which of them are neighbours there.

    Attributes:
        order: Index of each in the cloud, shape (n,).
        camera: Of each, shape (n,).
        slide: Changes of s and t by the standard deviation of its edge [m], (n, 2).
        one: Places of points in `order`, shape (n_links,).
        other: Of a neighbour of each.
        apart: How much larger its s is [m].
        depth: t of each point [m], shape (n,).
        apart_px: `apart` in pixels of the camera that measured the first point.
    """

    order: Indices
    camera: Indices
    slide: Array
    one: Indices
    other: Indices
    apart: Array
    depth: Array
    apart_px: Array

    @classmethod
    def of(cls, cloud: Cloud, plan: Scanner) -> "RingCurves":
        """Lay a cloud along its rings."""
        angle, radius, depth = np.empty((3, len(cloud)))
        slide = np.empty((len(cloud), 2))
        noise = np.hypot(cloud.noise_px, cloud.bias_px)
        for p, projector in enumerate(plan.projectors):
            chosen = np.flatnonzero(cloud.projector == p)
            points, beams = cloud.points[chosen], cloud.beams[chosen]
            x, y, _ = projector.to_ring(points).T
            angle[chosen], radius[chosen] = np.arctan2(y, x), np.hypot(x, y)
            turn = np.column_stack([-y, x]) / np.maximum(radius[chosen], 1e-12)[:, None]
            tangent = turn @ projector.world_from_ring[:3, :2].T
            depth[chosen] = np.einsum("ij,ij->i", points - projector.centre, beams)
            for k, along in enumerate((tangent, beams)):
                moved = np.einsum("ij,ij->i", cloud.shift[chosen], along)
                slide[chosen, k] = noise[chosen] * moved
        n_rings = int(cloud.ring.max(initial=0)) + 1
        ring = cloud.projector.astype(np.int64) * n_rings + cloud.ring
        order = np.lexsort((angle, ring))
        ring, angle, depth = ring[order], angle[order], depth[order]
        metres, pixel = radius[order], pixel_sizes(cloud, plan)[order]
        most = _LOOKED_AT * (int(cloud.camera.max(initial=0)) + 1)
        ends: list[Indices] = [order[:0]]
        further: list[Indices] = [order[:0]]
        for k in range(1, min(len(cloud), most + 1)):
            apart = (angle[k:] - angle[:-k]) * metres[:-k]
            near = (ring[k:] == ring[:-k]) & (apart <= _REACHES_PX[-1] * pixel[:-k])
            ends.append(np.flatnonzero(near))
            further.append(ends[-1] + k)
        one, other = np.concatenate(ends), np.concatenate(further)
        apart = (angle[other] - angle[one]) * metres[one]
        camera = cloud.camera[order].astype(np.int64)
        return cls(
            order, camera, slide[order], one, other, apart, depth, apart / pixel[one]
        )

    @property
    def rise(self) -> Array:
        """How much larger the t of neighbours is [m], (n_links,)."""
        return self.depth[self.other] - self.depth[self.one]

    def only(self, points: Mask) -> "RingCurves":
        """Return the same with neighbours among some of the cloud's points, (n,)."""
        kept = points[self.order]
        return self._linked(kept[self.one] & kept[self.other])

    def evidence(self, sharpness: Array) -> tuple[Mask, Mask]:
        """Return which points another camera confirms, and which one contradicts.

        A much sharper edge may be the step itself and doesn't contradict. Sharpness is
        blur as a share of what is usual, shape (n,).
        """
        two = self._linked(self._of_two_cameras())
        spread = lengths(self.slide)
        together, sharp = two._together(spread), sharpness[self.order]
        agree, apart = two._linked(together), two._linked(~together)
        noise = np.hypot(spread[agree.one], spread[agree.other])
        limit = _SURE_SIGMAS * noise + _SURE_SLOPE * agree.apart
        surely = agree._linked(np.abs(agree.rise) <= limit)
        ends = (apart.one, apart.other), (apart.other, apart.one)
        against = [at[~(sharp[by] < _STEP * sharp[at])] for at, by in ends]
        may_be, confirmed, contradicted = np.zeros((3, len(self.order)), dtype=bool)
        for met, at in (
            (may_be, [agree.one, agree.other]),
            (confirmed, [surely.one, surely.other]),
            (contradicted, against),
        ):
            met[np.concatenate(at)] = True
        return self._in_cloud(confirmed), self._in_cloud(contradicted & ~may_be)

    def fitted(self, noise: Array) -> "RingFit":
        """Fit a line through the points near each, of whatever cameras, within reach.

        Noise is this share of points' deviations, shape (n,): what a calibration leaves
        counts in weights, too. With these, ``1 / sigma^2``; of the widest reach at
        which the estimates of all narrower ones still lie within `_AGREE` deviations
        (intersecting intervals: Goldenshluger & Nemirovski 1997), so that creases stay.
        """
        slide = lengths(self.slide)
        lines = self._on_one_surface(slide)._lines(slide)
        slope, _ = lines.through(self.depth)
        # Places that are noise, too, turn lines towards the way that points slide.
        seeming = 1.0 - lines.astray(self.slide[:, 0] * noise[self.order])
        across = self.slide[:, 1] - slope * self.slide[:, 0]
        first = np.hypot(across, _ASTRAY * slide)
        curves = self._on_one_surface(first)
        shift, sigma = np.zeros(len(first)), first.copy()
        low, high = -_AGREE * sigma, _AGREE * sigma
        used: list[tuple[Mask, Lines]] = []
        for reach in _REACHES_PX:
            lines = curves._linked(curves.apart_px <= reach)._lines(first)
            _, offset = lines.through(self.depth)
            spread = lines.spread
            low = np.maximum(low, offset - _AGREE * spread)
            high = np.minimum(high, offset + _AGREE * spread)
            better = (low <= high) & (spread < sigma)
            used.append((better, lines))
            shift = np.where(better, offset, shift)
            sigma = np.where(better, spread, sigma)
        return RingFit(
            self.order,
            self._in_cloud(shift),
            self._in_cloud(sigma / first),
            self._in_cloud(sigma * noise[self.order] / seeming),
            self._in_cloud(curves._redundant(first)),
            tuple(used),
        )

    def _redundant(self, sigma: Array) -> Mask:
        near = self._linked((self.apart_px <= _BESIDE_PX) & self._of_two_cameras())
        before, after = np.zeros((2, len(sigma)), dtype=bool)
        first = sigma[near.one] < sigma[near.other]
        before[near.other[first]] = True
        after[near.one[~first]] = True
        return before & after

    def _lines(self, sigma: Array) -> Lines:
        return Lines.of(self.one, self.other, self.apart, sigma)

    def _of_two_cameras(self) -> Mask:
        return self.camera[self.one] != self.camera[self.other]

    def _on_one_surface(self, sigma: Array) -> "RingCurves":
        return self._linked(self._together(sigma))

    def _together(self, sigma: Array) -> Mask:
        noise = np.hypot(sigma[self.one], sigma[self.other])
        return np.abs(self.rise) <= _SIGMAS * noise + _STEEPEST * self.apart

    def _linked(self, chosen: Mask) -> "RingCurves":
        names = "one", "other", "apart", "apart_px"
        return replace(self, **{name: getattr(self, name)[chosen] for name in names})

    def _in_cloud(self, values: NDArray[_T]) -> NDArray[_T]:
        return in_cloud(self.order, values)
