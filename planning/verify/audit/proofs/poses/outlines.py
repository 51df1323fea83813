"""Outlines on the sky of a sample: where what is blocked of it may begin or end.

Whether a direction is blocked changes only across edges whose two faces the sample sees
from different sides, and across edges of one face, or of more than two. What is too
near to call counts as such an edge. Of some of the faces alone the same holds, and what
they block is blocked.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from geometry.arrays import Array, Ints, Mask
from geometry.mesh.mesh import TriangleMesh

# Of the size of the mesh: nearer to the plane of a face its side isn't called.
_UNCALLED = 1e-9


@dataclass(frozen=True, eq=False)
class Outlines:
    """The edges of a mesh, looked at from samples."""

    mesh: TriangleMesh

    @cached_property
    def size(self) -> float:
        """Largest side of the mesh [m]."""
        return float(np.ptp(self.mesh.bounds, axis=0).max())

    @cached_property
    def _heights(self) -> Array:
        return np.einsum("ij,ij->i", self.mesh.face_normals, self.mesh.corners[:, 0])

    @cached_property
    def _boxes(self) -> tuple[Array, Array]:
        return self.mesh.corners.min(axis=1), self.mesh.corners.max(axis=1)

    @cached_property
    def _faces(self) -> tuple[Ints, Ints, Mask]:
        """A face of each edge, its other one, and whether both are wound alike.

        The same twice where it has one.
        """
        of_face = self.mesh.edges.of_face.ravel()
        side = np.arange(len(of_face))
        first, last = (np.zeros(len(self.mesh.edges.ends), np.int64) for _ in range(2))
        last[of_face] = side
        first[of_face[::-1]] = side[::-1]
        faces = self.mesh.faces
        rising = (faces < faces[:, [1, 2, 0]]).ravel()
        return first // 3, last // 3, rising[first] != rising[last]

    def _any_of(self, some: Mask) -> Mask:
        """Return which edges some of the faces have, however many others do."""
        edges: Mask = np.zeros(len(self.mesh.edges.ends), dtype=bool)
        edges[self.mesh.edges.of_face[some]] = True
        return edges

    def sides(self, point: Array) -> Array:
        """Return how far a point is before the plane of each face [m], (n_f,)."""
        return self.mesh.face_normals @ point - self._heights

    def touching(self, point: Array, sides: Array, within_m: float) -> Ints:
        """Return the faces that may come nearer to a point, its own among them."""
        near = np.flatnonzero(np.abs(sides) <= within_m)
        low, high = (box[near] for box in self._boxes)
        inside = (point >= low - within_m) & (point <= high + within_m)
        return near[np.all(inside, axis=1)]

    def of_faces(self, sides: Array, some: Mask) -> Ints:
        """Return the edges that are outlines of some of the faces, (k,)."""
        first, last, alike = self._faces
        n_faces = self.mesh.edges.n_faces
        side = np.sign(sides)
        side[np.abs(sides) <= _UNCALLED * self.size] = np.nan
        here, there = some[first], some[last]
        # NaN equals nothing: what isn't called is an outline. Of faces that aren't
        # wound alike a point is before one and behind the other where it sees no fold.
        folded = side[first] != np.where(alike, side[last], -side[last])
        alone = (here != there) | (n_faces != 2)
        return np.flatnonzero(self._any_of(some) & (folded | alone))

    def above(self, point: Array, normal: Array, edges: Ints) -> Mask:
        """Return which edges have an end before the plane of a point, (k,)."""
        ends = self.mesh.vertices[self.mesh.edges.ends[edges]]
        above: Mask = np.any((ends - point) @ normal > 0.0, axis=1)
        return above

    def arcs(self, point: Array, edges: Ints, step: float) -> Array:
        """Return directions from a point along edges, no two neighbours further apart.

        Each edge is walked from end to end in equal steps of at most so much [rad]; an
        edge whose line meets the point has its ends alone. Shape (k, 3).
        """
        begin, end = (self.mesh.vertices[self.mesh.edges.ends[edges]] - point).swapaxes(
            0, 1
        )
        way = end - begin
        length = np.linalg.norm(way, axis=1)
        way /= np.where(length > 0.0, length, 1.0)[:, None]
        start = np.einsum("ij,ij->i", begin, way)
        foot = begin - start[:, None] * way
        off = np.linalg.norm(foot, axis=1)
        foot /= np.where(off > 0.0, off, 1.0)[:, None]
        first = np.arctan2(start, off)
        swept = np.arctan2(start + length, off) - first
        steps = np.maximum(np.ceil(swept / step), 1.0).astype(np.int64)
        of = np.repeat(np.arange(len(edges)), steps + 1)
        place = np.arange(len(of)) - np.repeat(
            np.cumsum(steps + 1) - steps - 1, steps + 1
        )
        angle = first[of] + swept[of] * place / steps[of]
        return np.cos(angle)[:, None] * foot[of] + np.sin(angle)[:, None] * way[of]
