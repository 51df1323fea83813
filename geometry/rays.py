"""The bare ray caster: embree, called directly and threaded.

It answers two questions about rays and holds no policy: where rays start, how far they
reach and what slack they are given is the caller's business. The planner's visibility
and the checkers each bring a policy of their own.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from embreex.mesh_construction import TriangleMesh as _EmbreeMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from .mesh import TriangleMesh

_CHUNK = 1 << 18


class RayCaster:
    """Casts rays against one mesh.

    Coordinates are centred on the mesh in float64 before embree rounds them to float32,
    so that a mesh far from the origin is hit as precisely as one at it. Rays are traced
    in chunks, so memory stays bounded, and each ray's answer is independent of the
    number of threads.

    Args:
        mesh: The occluder.
        threads: Worker threads; embree releases the interpreter lock.
    """

    def __init__(self, mesh: TriangleMesh, *, threads: int = 2) -> None:
        if threads < 1:
            raise ValueError(f"threads must be at least 1, got {threads}")
        self.mesh = mesh
        self.threads = threads
        self._centre = mesh.centre
        self._scene = EmbreeScene(robust=True)
        vertices = np.ascontiguousarray(mesh.vertices - self._centre, dtype=np.float32)
        faces = np.ascontiguousarray(mesh.faces, dtype=np.int32)
        _EmbreeMesh(self._scene, vertices, faces)
        # The first call commits the scene; do it here, where no thread races.
        self._scene.run(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32))

    def occluded(
        self,
        origins: NDArray[np.float64],
        directions: NDArray[np.float64],
        distances: NDArray[np.float64],
    ) -> NDArray[np.bool_]:
        """Return whether anything is hit closer than a distance along each ray.

        Args:
            origins: Ray origins in [m], shape (n, 3) or (3,) for a common one.
            directions: Unit directions, shape (n, 3).
            distances: Reach of each ray in [m], shape (n,).

        Returns:
            Whether each ray is blocked, shape (n,).

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
            start, along = self._local(origins, directions, part)
            reach = np.ascontiguousarray(distances[part], dtype=np.float32)
            # embree answers 0 for blocked and -1 for clear.
            answer = self._scene.run(start, along, reach, query="OCCLUDED")
            blocked[part] = np.asarray(answer) == 0

        self._spread(trace, len(directions))
        return blocked

    def first_hits(
        self, origins: NDArray[np.float64], directions: NDArray[np.float64]
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return the first face that each ray hits, and how far away it is.

        The distance is recomputed in float64 from the plane of the face.

        Args:
            origins: Ray origins in [m], shape (n, 3) or (3,) for a common one.
            directions: Unit directions, shape (n, 3).

        Returns:
            Face indices, -1 for a miss; distances in [m], inf for a miss; (n,) each.

        Raises:
            ValueError: If shapes disagree or a number isn't finite.
        """
        origins, directions = _checked(origins, directions)
        faces = np.empty(len(directions), dtype=np.int64)
        distances = np.full(len(directions), np.inf)
        normals, anchors = self.mesh.face_normals, self.mesh.corners[:, 0]

        def trace(part: slice) -> None:
            start, along = self._local(origins, directions, part)
            hit = np.asarray(self._scene.run(start, along), dtype=np.int64)
            faces[part] = hit
            on = np.flatnonzero(hit >= 0)
            face = hit[on]
            ray = directions[part][on]
            begin = origins if origins.ndim == 1 else origins[part][on]
            towards = np.einsum("ij,ij->i", normals[face], anchors[face] - begin)
            slope = np.einsum("ij,ij->i", normals[face], ray)
            slope = np.where(np.abs(slope) < 1e-12, np.copysign(1e-12, slope), slope)
            distances[part.start + on] = towards / slope

        self._spread(trace, len(directions))
        return faces, distances

    def _local(
        self, origins: NDArray[np.float64], directions: NDArray[np.float64], part: slice
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        along = np.ascontiguousarray(directions[part], dtype=np.float32)
        begin = origins if origins.ndim == 1 else origins[part]
        start = np.empty_like(along)
        start[:] = begin - self._centre
        return start, along

    def _spread(self, trace: Callable[[slice], None], n: int) -> None:
        size = min(_CHUNK, max(1024, -(-n // self.threads)))
        parts = [slice(i, min(i + size, n)) for i in range(0, n, size)]
        if self.threads == 1 or len(parts) < 2:
            for part in parts:
                trace(part)
            return
        with ThreadPoolExecutor(self.threads) as pool:
            for done in [pool.submit(trace, part) for part in parts]:
                done.result()


def _checked(
    origins: NDArray[np.float64], directions: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
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
