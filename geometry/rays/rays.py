"""The bare ray caster: embree, called directly and threaded.

It answers two questions about rays and holds no policy: where rays start, how far they
reach and what slack they are given is the caller's business. The planner's visibility
and the checkers each bring a policy of their own.
"""

from collections.abc import Callable, Iterable
from functools import cached_property
from itertools import pairwise
from threading import Lock
from weakref import WeakKeyDictionary

import numpy as np
from embreex.mesh_construction import TriangleMesh as _EmbreeMesh
from embreex.rtcore_scene import EmbreeScene

from geometry.arrays import Array, Ints, Mask, Single, rows_of
from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.topology import numbered
from geometry.parallel import mapped, n_threads

# Rays in one call of embree: their arrays stay in the second-level cache.
CHUNK = 1 << 14
# Embree's trees by their meshes, whose arrays never change: a tree takes longer to make
# than most of its casters trace.
_TREES: WeakKeyDictionary[TriangleMesh, EmbreeScene] = WeakKeyDictionary()
_MAKING = Lock()


class RayCaster:
    """Casts rays against one mesh.

    Embree computes in float32. Coordinates are therefore taken relative to the middle
    of the mesh, in float64, and scaled by a power of two (so exactly) to a mesh of
    about unit size before they are rounded: a mesh far from the origin, or a tiny one,
    is hit as precisely as any. Rays are traced in chunks, so memory stays bounded, and
    each ray's answer is independent of the number of threads. Casters of one mesh share
    its tree, which is made once.

    Attributes:
        middle: Of the bounding box in [m]; the origin of the caster's own frame. (Not
            `mesh.centre`, which may leave small fragments out of account.)
        scale: Metres to the caster's own unit.
        reach: Half the diagonal of the bounding box in the caster's own unit: every
            vertex of a face lies within it, and it is in [1, 2).
    """

    def __init__(self, mesh: TriangleMesh, *, threads: int | None = None) -> None:
        threads = n_threads() if threads is None else threads
        if threads < 1:
            raise ValueError(f"threads must be at least 1, got {threads}")
        self.mesh = mesh
        self.threads = threads
        low, high = mesh.bounds
        self.middle = 0.5 * (low + high)
        half = 0.5 * float(np.linalg.norm(high - low))
        self.scale = float(np.exp2(-np.floor(np.log2(half)))) if half > 0 else 1.0
        self.reach = half * self.scale
        with _MAKING:
            if mesh not in _TREES:
                tree = EmbreeScene(robust=True)
                # Vertices that no face uses may lie anywhere, also beyond float32.
                used, faces = numbered(mesh.faces, len(mesh.vertices))
                vertices = self.local(mesh.vertices[used])
                corners = np.ascontiguousarray(faces, dtype=np.int32)
                _EmbreeMesh(tree, vertices, corners)
                # The first call commits the tree; do it here, where no thread races.
                tree.run(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32))
                _TREES[mesh] = tree
            self._scene = _TREES[mesh]

    @cached_property
    def extent(self) -> float:
        """Length in [m] that offsets of rays are shares of.

        The radius of the object, or a quarter of the bounding box's diagonal: far
        fragments don't make the object larger, but every ray coarser.
        """
        return max(self.mesh.radius, 0.5 * self.reach / self.scale)

    def local(self, points: Array) -> Single:
        """Return points in the caster's own frame, shape (n, 3)."""
        return np.ascontiguousarray((points - self.middle) * self.scale, np.float32)

    def occluded(self, origins: Array, directions: Array, distances: Array) -> Mask:
        """Return whether anything is hit closer than a distance along each ray.

        Args:
            origins: Ray origins in [m], shape (n, 3) or (3,) for a common one.
            directions: Unit directions, shape (n, 3).
            distances: Reach of each ray in [m], shape (n,).

        Raises:
            ValueError: If shapes disagree or a number isn't finite (embree would read
                out of bounds, or let the ray through, without a word).
        """
        origins, directions = _checked(origins, directions)
        distances = np.asarray(distances, dtype=np.float64)
        if distances.shape != (len(directions),) or not np.all(np.isfinite(distances)):
            raise ValueError(f"distances must be ({len(directions)},) and finite")
        blocked = np.empty(len(directions), dtype=bool)

        def trace(part: slice) -> None:
            start, along = self._rays(origins, directions, part)
            reach = (distances[part] * self.scale).astype(np.float32)
            blocked[part] = self.blocked_local(start, along, reach)

        self.share(trace, self.chunks(len(directions)))
        return blocked

    def met(self, origins: Array, directions: Array) -> Mask:
        """Return whether anything is hit at all by rays that begin near the mesh.

        As `occluded`; sooner than `first_hits`, which looks for what is hit first.
        """
        # Farther than this from a place near the surface there is none of it.
        beyond = np.full(len(directions), 4.0 * self.reach / self.scale)
        return self.occluded(origins, directions, beyond)

    def blocked_local(self, start: Single, along: Single, reach: Single) -> Mask:
        """Return whether rays in the caster's own frame are blocked; checks nothing.

        For engines that prepare float32 rays themselves, in their own threads: one call
        of embree on at most `CHUNK` rays, origins and directions (n, 3) of any strides,
        whose reach (n,) is in units of their directions.
        """
        # embree answers 0 for blocked and -1 for clear.
        answer = self._scene.run(start, along, reach, query="OCCLUDED")
        return np.equal(answer, 0)

    def first_hits(self, origins: Array, directions: Array) -> tuple[Ints, Array]:
        """Return the first face that each ray hits, and how far away it is in [m].

        The distance is recomputed in float64 from the plane of the face; a miss is face
        -1 at inf. Arguments and errors are those of `occluded`.
        """
        origins, directions = _checked(origins, directions)
        faces = np.empty(len(directions), dtype=np.int64)
        distances = np.full(len(directions), np.inf)
        normals, anchors = self.mesh.face_normals, self.mesh.corners[:, 0]

        def trace(part: slice) -> None:
            start, along = self._rays(origins, directions, part)
            hit = np.asarray(self._scene.run(start, along), dtype=np.int64)
            faces[part] = hit
            on = np.flatnonzero(hit >= 0)
            face, ray = hit[on], rows_of(directions[part], on)
            normal = rows_of(normals, face)
            begin = origins if origins.ndim == 1 else rows_of(origins[part], on)
            towards = np.einsum("ij,ij->i", normal, anchors[face] - begin)
            slope = np.einsum("ij,ij->i", normal, ray)
            slope = np.where(np.abs(slope) < 1e-12, np.copysign(1e-12, slope), slope)
            distances[part.start + on] = towards / slope

        self.share(trace, self.chunks(len(directions)))
        return faces, distances

    def chunks(self, n: int) -> list[slice]:
        """Return n rays in equal parts of at most `CHUNK`, threads evenly loaded."""
        return equal_parts(n, CHUNK, self.threads if n >= 1024 * self.threads else 1)

    def share(self, work: Callable[[slice], None], parts: Iterable[slice]) -> None:
        """Do work on every part, shared among the threads; raise the first failure."""
        mapped(work, parts, self.threads)

    def _rays(
        self, origins: Array, directions: Array, part: slice
    ) -> tuple[Single, Single]:
        along = np.ascontiguousarray(directions[part], dtype=np.float32)
        if origins.ndim == 1:
            return np.broadcast_to(self.local(origins), along.shape), along
        return self.local(origins[part]), along


def equal_parts(n: int, most: int, multiple: int = 1) -> list[slice]:
    """Return n things in equal parts of at most `most`, their number a multiple."""
    parts = min(-(-n // (most * multiple)) * multiple, n)
    ends = [n * k // parts for k in range(parts + 1)] if parts else [0]
    return [slice(a, b) for a, b in pairwise(ends)]


def _checked(origins: Array, directions: Array) -> tuple[Array, Array]:
    origins = np.asarray(origins, dtype=np.float64)
    directions = np.asarray(directions, dtype=np.float64)
    if directions.ndim != 2 or directions.shape[1] != 3:
        raise ValueError(f"directions must be (n, 3), got {directions.shape}")
    if origins.shape not in ((3,), directions.shape):
        raise ValueError(
            f"origins must be (3,) or {directions.shape}, got {origins.shape}"
        )
    if not (np.all(np.isfinite(origins)) and np.all(np.isfinite(directions))):
        raise ValueError("ray origins and directions must be finite numbers")
    return origins, directions
