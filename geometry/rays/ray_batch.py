"""Rays of several devices, prepared in place and given to embree in one call.

Preparing rays costs a tenth of tracing them if buffers are reused (fresh ones cost page
faults, in which threads wait for each other), a point is one item of 16 bytes (gathered
in one piece), and many rays go to embree at a time, since rays and tree drive each
other out of the cache at every change.
"""

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Ints, Mask, Single

from .rays import RayCaster

# A ray gives up at most the slack over this of its length, however flatly it meets.
_LEAST_RISE = 1e-4


@dataclass(frozen=True, eq=False)
class Source:
    """Where the light or view comes from, in the caster's own frame.

    Attributes:
        origin: Optical centre, or where a parallel beam's plane meets `along`, (3,).
        along: Unit direction of parallel light, shape (3,); None for a centre.
        distance: Of the origin from the middle of the mesh.
    """

    origin: Single
    along: Single | None
    distance: float


@dataclass(frozen=True, eq=False)
class SampleSet:
    """Samples made ready for many queries: checked, sorted in space, in float32.

    Attributes:
        order: Place of each sample in the caller's order, shape (n,).
        points: Positions in the caster's own frame and a zero, shape (n, 4).
        normals: Unit normals, shape (3, n).
        heights: N . P, shape (n,).
        back: Diameter of a ball about the middle that holds the mesh and all samples.
    """

    order: Ints
    points: Single
    normals: Single
    heights: Single
    back: float

    def __len__(self) -> int:
        return len(self.points)


class RayBatch:
    """Buffers of one thread, filled with rays, traced, and filled again.

    `capacity` rays fit, `block` samples may be offered at a time, and a ray ends
    `slack` above its sample's face, in the caster's own frame.
    """

    def __init__(
        self, caster: RayCaster, slack: float, capacity: int, block: int
    ) -> None:
        self._caster = caster
        self._slack = np.float32(slack)
        self._start = np.empty((capacity, 4), np.float32)
        self._along = np.empty((capacity, 4), np.float32)
        self._reach = np.empty(capacity, np.float32)
        self._climb = np.empty(block, np.float32)
        self._term = np.empty(block, np.float32)
        self._worth = np.empty(block, np.bool_)
        self.filled = 0

    @property
    def room(self) -> int:
        """Rays that still fit."""
        return len(self._start) - self.filled

    def add(
        self,
        samples: SampleSet,
        part: slice,
        source: Source,
        wanted: Mask | None = None,
        *,
        facing: bool = True,
    ) -> Ints:
        """Add rays to some samples, and return the index in the part of each.

        The part has at most a block, and as many as there is room for. Samples that
        aren't wanted (default: all are) get none, nor do those that face away, if they
        must face.
        """
        climb = self._climbs(samples, part, source)
        worth = np.less(climb, 0, out=self._worth[: len(climb)])
        if not facing:
            np.negative(np.abs(climb, out=climb), out=climb)
            worth[:] = True
        if wanted is not None:
            worth &= wanted
        rays = np.flatnonzero(worth)
        fresh = slice(self.filled, self.filled + len(rays))
        # With mode "raise", numpy would fill a copy first.
        start = samples.points[part].take(
            rays, axis=0, out=self._start[fresh], mode="clip"
        )
        rise = climb.take(rays, out=self._reach[fresh], mode="clip")
        self._aim(start, rise, fresh, source, samples.back)
        return rays

    def clear(self) -> Mask:
        """Trace all rays, forget them, and return which are free, shape (filled,)."""
        rays = slice(0, self.filled)
        self.filled = 0
        return ~self._caster.blocked_local(
            self._start[rays, :3], self._along[rays, :3], self._reach[rays]
        )

    def _climbs(self, samples: SampleSet, part: slice, source: Source) -> Single:
        """Return N . (P - O), or N . L if parallel: negative where a sample faces."""
        normals = samples.normals[:, part]
        n = normals.shape[1]
        climb, term = self._climb[:n], self._term[:n]
        along = source.origin if source.along is None else source.along
        np.multiply(normals[0], along[0], out=climb)
        for axis in (1, 2):
            np.multiply(normals[axis], along[axis], out=term)
            climb += term
        if source.along is None:
            np.subtract(samples.heights[part], climb, out=climb)
        return climb

    def _aim(
        self, start: Single, rise: Single, fresh: slice, source: Source, back: float
    ) -> None:
        """Make rays of points and what they climb (at most 0), elementwise in place."""
        ray = self._along[fresh]
        if source.along is None:
            # All rays shrink towards their samples by one factor. Starts then lie in a
            # ball about the shrunk origin, which the ball of the mesh can't reach.
            longest = source.distance + 0.5 * back
            kept = np.float32(min(1.0, back / longest))
            ray[:] = np.append(source.origin, np.float32(0.0))
            np.subtract(start, ray, out=ray)
            ray *= kept
            slack = self._slack / kept
        else:
            depth = (start[:, 0] - source.origin[0]) * source.along[0]
            depth += (start[:, 1] - source.origin[1]) * source.along[1]
            depth += (start[:, 2] - source.origin[2]) * source.along[2]
            np.minimum(depth, np.float32(back), out=depth)
            ray[:] = np.append(source.along, np.float32(0.0))
            ray *= depth[:, None]
            rise *= np.abs(depth)
            longest, slack = back, self._slack
        # `rise` is -cos t times the length, so this is the slack's share of the ray.
        np.minimum(rise, np.float32(-_LEAST_RISE * longest), out=rise)
        np.divide(slack, rise, out=rise)
        rise += np.float32(1.0)
        start -= ray
        self.filled = fresh.stop
