"""The planner's visibility: whether the segment from a device to a sample is free.

Policy: rays run *from the device to the sample* and stop a little short of it. Casting
from the sample needs an offset along the normal, which trades falsely blocked samples
for falsely clear ones. Coordinates are relative to the mesh (`RayCaster`), and a ray
starts where it is about to enter the ball that holds the mesh (or at the device, if
that is nearer), so every float32 rounding is in proportion to the mesh. It moves a face
along its normal by a few 2^-24 of the mesh's half diagonal R; along a ray of incidence
angle t by 1 / cos t times as much. The ray stops ``slack / cos t`` short of the sample,
that is ``slack`` above its face, with slack = 2e-6 R: an occluder is lost only if it is
nearer than that, 0.2 micrometres on a part of 200 mm. Edges have no say: CAD plates
have no useful mean edge.

`docs/method/rays.md` has the measurements behind it.
"""

import threading

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array, Ints, Mask, Single
from geometry.mesh.mesh import TriangleMesh

from .ray_batch import RayBatch, SampleSet, Source
from .rays import RayCaster

# Height above a sample's face at which rays end, in units of the half diagonal.
_SLACK = 2e-6
# Roundings of the float64 coordinates in the file, for meshes very far from its origin.
_SLACK_ULPS = 8.0
# Rays that go to embree in one call.
_BATCH = 1 << 16
# Samples whose facing test is done at a time: its numbers stay in the cache.
BLOCK = 1 << 14
# In half diagonals: beyond, squares overflow float32.
_FARTHEST = 1e15


class Visibility:
    """Occlusion queries against one mesh, on which the samples lie.

    Attributes:
        slack: Height in [m] above a sample's face at which its ray ends.
    """

    def __init__(self, mesh: TriangleMesh, *, threads: int | None = None) -> None:
        self.caster = RayCaster(mesh, threads=threads)
        away = float(np.abs(mesh.bounds).max()) * self.caster.scale
        local = max(
            _SLACK * self.caster.reach, _SLACK_ULPS * float(np.finfo(float).eps) * away
        )
        self.slack = local / self.caster.scale
        self._slack = local
        self._own = threading.local()

    def samples(self, points: Array, normals: Array, *, sort: bool) -> SampleSet:
        """Return samples (n, 3), and normals of their faces, ready for queries.

        Sorted along a Morton curve, neighbours follow each other through the tree,
        which is worth it from a few queries on.

        Raises:
            ValueError: If shapes disagree or a number isn't finite.
        """
        points, normals = np.asarray(points, float), np.asarray(normals, float)
        if points.ndim != 2 or points.shape[1] != 3 or normals.shape != points.shape:
            raise ValueError(
                "points and normals must both be (n, 3), got "
                f"{points.shape} and {normals.shape}"
            )
        for name, values in (("points", points), ("normals", normals)):
            if not np.all(np.isfinite(values)):
                raise ValueError(f"{name} must be finite numbers")
        local = self.caster.local(points)
        order = morton_order(local) if sort else np.arange(len(local))
        if sort:
            local, normals = local.take(order, axis=0), normals.take(order, axis=0)
        across, facing = _columns(local), _columns(normals)
        farthest = float(np.sqrt(_dot(across, across).max(initial=0.0)))
        padded = np.zeros((len(local), 4), dtype=np.float32)
        padded[:, :3] = local
        back = 1.001 * 2.0 * max(self.caster.reach, farthest)
        return SampleSet(order, padded, facing, _dot(facing, across), back)

    def blocked(
        self,
        origin: Array,
        points: Array,
        normals: Array,
        *,
        along: Array | None = None,
    ) -> Mask:
        """Return whether something stands between a device and samples, shape (n,).

        Args:
            origin: Optical centre in [m], shape (3,); or any point of the plane that
                parallel light leaves.
            points: Samples on the mesh in [m], shape (n, 3).
            normals: Unit normals of the samples' faces, (n, 3).
            along: Unit direction of parallel light, shape (3,).

        Raises:
            ValueError: If shapes disagree or a number isn't finite.
        """
        samples = self.samples(points, normals, sort=False)
        source = self.source(origin, along)
        blocked = np.empty(len(samples), dtype=bool)

        def trace(part: slice) -> None:
            batch = self.batch()
            batch.add(samples, part, source, facing=False)
            blocked[part] = ~batch.clear()

        self.caster.share(trace, self.caster.chunks(len(samples)))
        return blocked

    def batch(self) -> RayBatch:
        """Return the calling thread's own buffers, empty."""
        local = self._own
        if not hasattr(local, "batch"):
            local.batch = RayBatch(self.caster, self._slack, _BATCH, BLOCK)
        local.batch.filled = 0
        return local.batch

    def source(self, origin: Array, along: Array | None = None) -> Source:
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
        if along is not None:
            along = np.asarray(along, dtype=np.float64)
            if along.shape != (3,) or not abs(np.linalg.norm(along) - 1.0) < 1e-6:
                raise ValueError(f"along must be a unit vector, got {along.tolist()}")
            # The plane's own point nearest to the mesh keeps float32 from losing
            # digits.
            local = (local @ along) * along
        light = None if along is None else along.astype(np.float32)
        return Source(local.astype(np.float32), light, float(np.linalg.norm(local)))


def morton_order(points: Single) -> Ints:
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


def _dot(a: Single, b: Single) -> Single:
    """Return the product of columns, in this order of summation, shape (n,)."""
    total = a[0] * b[0]
    total += a[1] * b[1]
    total += a[2] * b[2]
    return total


def _columns(rows: NDArray[np.floating]) -> Single:
    return np.ascontiguousarray(rows.T, dtype=np.float32)
