"""The planner's visibility: whether the segment from a device to a sample is free.

Policy: rays run *from the device to the sample* and stop a little short of it. Casting
from the sample needs an offset along the normal, which trades falsely blocked samples
for falsely clear ones. Three things make it hold at any scale.

* Coordinates are relative to the mesh (`RayCaster`), and a ray starts where it is about
  to enter the ball that holds the mesh (or at the device, if that is nearer), so every
  float32 rounding is in proportion to the mesh, wherever it lies and however far the
  device stands.
* Rounding moves a face along its normal by a few 2^-24 of the mesh's half diagonal R;
  along a ray of incidence angle t by 1 / cos t times as much. The ray stops ``slack /
  cos t`` short of the sample, that is ``slack`` above its face, with slack = 2e-6 R.
* Nothing depends on the edges of the mesh: CAD plates with edges of 1 m and walls of
  0.1 mm have no useful mean edge. An occluder is lost only if it is nearer than
  `slack` above the sample's own face: 0.2 micrometres on a part of 200 mm.

`docs/rays.md` has the measurements behind it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .mesh import TriangleMesh
from .rays import RayCaster

# Height above a sample's face at which rays end, in units of the half diagonal.
_SLACK = 2e-6
# Roundings of the float64 coordinates in the file, for meshes very far from its origin.
_SLACK_ULPS = 8.0
# A ray gives up at most `_SLACK` over this of its length, however flatly it meets.
_LEAST_RISE = 1e-4
# In half diagonals: beyond, squares overflow float32.
_FARTHEST = 1e15


@dataclass(frozen=True, eq=False)
class Source:
    """Where the light or view comes from, in the caster's own frame.

    Attributes:
        origin: Optical centre, or where a parallel beam's plane meets `along`, (3, 1).
        along: Unit direction of parallel light, shape (3, 1); None for a centre.
        distance: Of the origin from the middle of the mesh.
    """

    origin: NDArray[np.float32]
    along: NDArray[np.float32] | None
    distance: float


@dataclass(frozen=True, eq=False)
class SampleSet:
    """Samples made ready for many queries: checked, sorted in space, in float32.

    Attributes:
        order: Place of each sorted sample in the caller's order, shape (n,); None if
            the caller's order is kept.
        place: Where in that order each of the caller's samples went; None likewise.
        points: Positions in the caster's own frame, shape (3, n).
        normals: Unit normals, shape (3, n).
        heights: N . P, shape (n,).
        back: Diameter of a ball about the middle that holds the mesh and all samples.
    """

    order: NDArray[np.int64] | None
    place: NDArray[np.int64] | None
    points: NDArray[np.float32]
    normals: NDArray[np.float32]
    heights: NDArray[np.float32]
    back: float

    def __len__(self) -> int:
        return self.points.shape[1]

    def climb(self, part: slice, source: Source) -> NDArray[np.float32]:
        """Return N . (P - O) of some samples in the set's own order; N . L if parallel.

        Negative where a sample faces the device.
        """
        normals = self.normals[:, part]
        if source.along is not None:
            return _dot(normals, source.along)
        return self.heights[part] - _dot(normals, source.origin)


class Visibility:
    """Occlusion queries against one mesh.

    Args:
        mesh: The occluder, on which the samples lie.
        threads: Worker threads; no answer depends on it.

    Attributes:
        slack: Height in [m] above a sample's face at which its ray ends.
    """

    def __init__(self, mesh: TriangleMesh, *, threads: int = 2) -> None:
        self.caster = RayCaster(mesh, threads=threads)
        away = float(np.abs(mesh.bounds).max()) * self.caster.scale
        local = max(
            _SLACK * self.caster.reach, _SLACK_ULPS * float(np.finfo(float).eps) * away
        )
        self.slack = local / self.caster.scale
        self._slack = np.float32(local)

    def samples(
        self,
        points: NDArray[np.float64],
        normals: NDArray[np.float64],
        *,
        sort: bool = True,
    ) -> SampleSet:
        """Return samples made ready for queries.

        Args:
            points: Positions on the mesh in [m], shape (n, 3).
            normals: Unit normal of each sample's face, same shape.
            sort: Whether to sort them along a Morton curve: neighbours then follow each
                other through the tree. Worth it from a few queries on.

        Raises:
            ValueError: If shapes disagree or a number isn't finite.
        """
        points = _finite("points", points)
        normals = _finite("normals", normals)
        if points.ndim != 2 or points.shape[1] != 3 or normals.shape != points.shape:
            raise ValueError(
                "points and normals must both be (n, 3), got "
                f"{points.shape} and {normals.shape}"
            )
        local = self.caster.local(points)
        order = place = None
        if sort:
            order = morton_order(local)
            place = np.empty_like(order)
            place[order] = np.arange(len(order))
            local, normals = local[order], normals[order]
        farthest = float(np.sqrt(np.einsum("ij,ij->i", local, local).max(initial=0.0)))
        across = np.ascontiguousarray(local.T)
        facing = np.ascontiguousarray(normals.T, dtype=np.float32)
        return SampleSet(
            order,
            place,
            across,
            facing,
            _dot(facing, across),
            1.001 * 2.0 * max(self.caster.reach, farthest),
        )

    def blocked(
        self,
        origin: NDArray[np.float64],
        points: NDArray[np.float64] | SampleSet,
        normals: NDArray[np.float64] | None = None,
        *,
        along: NDArray[np.float64] | None = None,
    ) -> NDArray[np.bool_]:
        """Return whether something stands between a device and points.

        Args:
            origin: Optical centre in [m], shape (3,); or any point of the plane that
                parallel light leaves.
            points: Samples on the mesh in [m], shape (n, 3), or a prepared set.
            normals: Unit normals of the samples' faces, (n, 3); None with a set.
            along: Unit direction of parallel light, shape (3,).

        Returns:
            Shape (n,).

        Raises:
            ValueError: If shapes disagree or a number isn't finite.
        """
        if isinstance(points, SampleSet):
            samples = points
        else:
            if normals is None:
                raise ValueError("points need the normals of their faces")
            samples = self.samples(points, normals, sort=False)
        source = self.source(origin, along)
        blocked = np.empty(len(samples), dtype=bool)

        def trace(part: slice) -> None:
            place = part if samples.order is None else samples.order[part]
            climb = samples.climb(part, source)
            blocked[place] = self.trace(
                samples.points[:, part], climb, source, samples.back
            )

        self.caster.share(trace, self.caster.chunks(len(samples)))
        return blocked

    def source(
        self, origin: NDArray[np.float64], along: NDArray[np.float64] | None = None
    ) -> Source:
        """Return a device in the caster's own frame.

        Raises:
            ValueError: If shapes disagree, or a number isn't finite or absurdly far.
        """
        origin = np.asarray(origin, dtype=np.float64)
        local = (origin - self.caster.middle) * self.caster.scale
        if origin.shape != (3,) or not np.all(np.abs(local) < _FARTHEST):
            raise ValueError(
                f"origin must be 3 finite metres, got {origin.tolist()}; "
                f"at most {_FARTHEST:g} times the mesh away"
            )
        if along is None:
            return Source(_column(local), None, float(np.linalg.norm(local)))
        along = np.asarray(along, dtype=np.float64)
        if along.shape != (3,) or not abs(np.linalg.norm(along) - 1.0) < 1e-6:
            raise ValueError(f"along must be a unit vector, got {along.tolist()}")
        # The plane's own point nearest to the mesh keeps float32 from losing digits.
        local = (local @ along) * along
        return Source(_column(local), _column(along), float(np.linalg.norm(local)))

    def trace(
        self,
        points: NDArray[np.float32],
        climb: NDArray[np.float32],
        source: Source,
        back: float,
    ) -> NDArray[np.bool_]:
        """Return whether samples are blocked, shape (n,).

        Every step is elementwise, so an answer depends on its sample and device only.

        Args:
            points: Of the samples, shape (3, n).
            climb: What `SampleSet.climb` returned for them, shape (n,).
            source: The device.
            back: Of the set.
        """
        if source.along is None:
            # All rays shrink towards their samples by one factor. Starts then lie in a
            # ball about the shrunk origin, which the ball of the mesh can't reach.
            away = source.distance + 0.5 * back
            kept = np.float32(min(1.0, back / away))
            ray: NDArray[np.float32] = points - source.origin
            ray *= kept
            rise = np.abs(climb) * kept
            longest = away * kept
        else:
            depth = _dot(points - source.origin, source.along)
            np.minimum(depth, np.float32(back), out=depth)
            ray = depth * source.along
            rise = np.abs(climb * depth)
            longest = back
        # `rise` is cos t times the ray's length, so this is the slack's share of it.
        np.maximum(rise, np.float32(_LEAST_RISE * longest), out=rise)
        np.divide(-self._slack, rise, out=rise)
        rise += np.float32(1.0)
        start: NDArray[np.float32] = points - ray
        return self.caster.blocked_local(start.T, ray.T, rise)


def morton_order(points: NDArray[np.float32]) -> NDArray[np.int64]:
    """Return the order of points along a Morton curve, 10 bits an axis, shape (n,)."""
    if len(points) == 0:
        return np.empty(0, dtype=np.int64)
    low = points.min(axis=0)
    extent = float((points.max(axis=0) - low).max()) or 1.0
    cells = ((points - low) * (1023.0 / extent)).astype(np.uint32)
    for shift, mask in (
        (16, 0x030000FF),
        (8, 0x0300F00F),
        (4, 0x030C30C3),
        (2, 0x09249249),
    ):
        cells = (cells | (cells << np.uint32(shift))) & np.uint32(mask)
    code = cells[:, 0] | (cells[:, 1] << np.uint32(1)) | (cells[:, 2] << np.uint32(2))
    return np.argsort(code, kind="stable")


def _dot(a: NDArray[np.float32], b: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the product of columns, in this order of summation, shape (n,)."""
    total = a[0] * b[0]
    total += a[1] * b[1]
    total += a[2] * b[2]
    return total


def _column(values: NDArray[np.float64]) -> NDArray[np.float32]:
    return values[:, None].astype(np.float32)


def _finite(name: str, values: NDArray[np.float64]) -> NDArray[np.float64]:
    values = np.asarray(values, dtype=np.float64)
    if not np.all(np.isfinite(values)):
        raise ValueError(f"{name} must be finite numbers")
    return values
