"""Edges across which it may change whether a point sees out.

From a point p, the directions in which a surface stands in the way are bounded by
silhouettes: edges whose two faces p sees from different sides, and edges of one face or
of more than two. Anywhere else a surface goes on. For p and face f with normal N_f
through x_f::

    h_f(p) = N_f . (p - x_f),    edge of f, g is a silhouette iff h_f h_g <= 0

(with the sign turned where f and g run along the edge in the same sense). What is too
near to 0 to call counts as a silhouette. The border of some of the faces is one of
these alone: what they hide, they hide whatever else stands there. There is a bit for
each of 64 points, so that edges are compared for all of them at once.
"""

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array, Ints, Mask, Words, lengths
from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.topology import MeshEdges, face_pairs
from geometry.rays.proximity import triangle_distances

from .product_signs import WORD, ProductSigns, packed, unpacked

# Points that are asked about at once.
POINTS = WORD
# Height, as a share of the mesh's size, within which a side can't be told.
_UNSURE = 1e-9
# What rounding may turn a direction by.
_ANGLE = 1e-6
_NONE = np.uint64(0)


@dataclass(frozen=True, eq=False)
class Sides:
    """From which side points see faces, and which edges change for them.

    Attributes:
        local: The points relative to the middle of the mesh in [m], shape (n, 3).
        normals: Unit axes of their cones, same shape.
        close: Bits of the points that lie close to each face's plane.
        changes: Bits of the points for which each edge is a silhouette.
        above: Bits of the points over whose horizon it rises.
    """

    local: Array
    normals: Array
    close: Words
    changes: Words
    above: Words


class Silhouettes:
    """The edges of a mesh that stands in the way, ready to be compared."""

    def __init__(self, mesh: TriangleMesh) -> None:
        edges = mesh.edges
        pairs, shared = _pairs_and_borders(edges)
        # Column by column: rows of two are too short for numpy's loops.
        self._pairs = np.asfortranarray(pairs)
        single = edges.n_faces[shared] != 2
        self._always = np.where(single, ~_NONE, _NONE)
        self._ends = np.asfortranarray(edges.ends[shared])
        self._middle = mesh.bounds.mean(axis=0)
        self._vertices = mesh.vertices - self._middle
        self._columns = np.ascontiguousarray(self._vertices.T)
        forwards = [_runs_along(mesh.faces[f], self._ends) for f in self._pairs.T]
        self._turned = np.where(forwards[0] == forwards[1], ~_NONE, _NONE)
        anchors = np.einsum(
            "ij,ij->i", mesh.face_normals, mesh.corners[:, 0] - self._middle
        )
        self._planes = ProductSigns(np.column_stack([mesh.face_normals, -anchors]))
        self._normals = mesh.face_normals
        used = np.where(mesh.used[:, None], self._vertices, 0.0)
        self._heights = ProductSigns(np.column_stack([used, np.ones(len(used))]))
        self._faces = mesh.faces
        # Both orders of two faces that agree on their outside.
        f, g = self._pairs[(self._turned == _NONE) & ~single].T
        n = len(mesh.faces)
        self._smooth = np.sort(np.concatenate([f * n + g, g * n + f, [-1]]))
        self._centroids = mesh.face_centroids - self._middle
        spokes = mesh.corners - mesh.face_centroids[:, None]
        self._radii = lengths(spokes).max(axis=1)
        size = float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))
        self._unsure = _UNSURE * size
        self._balls: dict[float, ProductSigns] = {}

    def sides(self, points: Array, normals: Array, close: float = 0.0) -> Sides:
        """Return from which side at most `POINTS` points on the mesh see each face.

        `normals` are unit axes of the cones that are asked about; `close` says in [m]
        how far from a face's plane is close to it.
        """
        local = points - self._middle
        height = np.einsum("ij,ij->i", normals, local)
        above, rows, heights = self._heights.over(np.column_stack([normals, -height]))
        above[rows] = packed(heights > 0.0)
        over, rows, heights = self._planes.over(
            np.column_stack([local, np.ones(len(local))]), max(close, self._unsure)
        )
        # Above the upper mark: over both; between the marks: not sure.
        unsure, beside = np.zeros_like(over), np.zeros_like(over)
        over[rows] = packed(heights > self._unsure)
        unsure[rows] = over[rows] ^ packed(heights > -self._unsure)
        beside[rows] = packed(np.abs(heights) <= close)
        f, g = self._pairs.T
        changes = over.take(f) ^ over.take(g) ^ self._turned
        changes |= unsure.take(f) | unsure.take(g) | self._always
        begin, end = (above.take(ends) for ends in self._ends.T)
        return Sides(local, normals, beside, changes, begin | end)

    def faces_within(self, sides: Sides, reach: float) -> Words:
        """Return for each face the points to which it comes within reach [m], as bits.

        A few faces that don't quite are told too, none that does is left out.
        """
        square = np.einsum("ij,ij->i", sides.local, sides.local)
        columns = np.column_stack([-2.0 * sides.local, np.ones(len(square)), square])
        beyond, rows, excess = self._balls_within(reach).over(columns)
        beyond[rows] = packed(excess > self._unsure**2)
        return ~beyond

    def _balls_within(self, reach: float) -> ProductSigns:
        """Return for each face what |p - c|^2 - limit^2 is a product with."""
        if reach not in self._balls:
            middle, limit = self._centroids, reach + self._radii + self._unsure
            square = np.einsum("ij,ij->i", middle, middle) - limit**2
            rows = np.column_stack([middle, square, np.ones(len(square))])
            self._balls[reach] = ProductSigns(rows)
        return self._balls[reach]

    def seen_from(
        self, sides: Sides, half_angle: float, among: Words | None = None
    ) -> tuple[Ints, Array, Array]:
        """Return the silhouettes that may cross a cone above each point.

        Cones open by at most pi / 2 [rad] to each side. Only faces `among` count for
        the points that their bits name; None: all do for every point.

        Returns:
            The point that each belongs to, (m,), and the edge's ends relative to it in
            [m], shape (m, 3) each.
        """
        words = sides.changes
        if among is not None:
            f, g = (among.take(faces) for faces in self._pairs.T)
            words = (words & f & g) | (f ^ g)
        owners, edges = unpacked(words & sides.above, len(sides.local))
        # Column by column: rows of three are too short for numpy's loops.
        points, axes = (
            np.ascontiguousarray(columns.T).take(owners, axis=1)
            for columns in (sides.local, sides.normals)
        )
        begin, end = (
            self._columns.take(e, axis=1) - points
            for e in self._ends.T.take(edges, axis=1)
        )
        near = np.flatnonzero(_may_cross(begin, end, axes, half_angle))
        return owners[near], begin.take(near, axis=1).T, end.take(near, axis=1).T

    def touched(
        self,
        sides: Sides,
        faces: Ints,
        reach: float,
        half_angle: float,
        among: Words | None = None,
    ) -> Mask:
        """Return to which points something comes near that may rise into a cone, (n,).

        Every face but their own (of `faces`) may, except one that goes on from it
        across an edge and rises by less than the cone leaves. What is `close` to the
        points' sides mustn't be less than the reach [m]; only faces `among` come near
        to the points that their bits name, None: every face may to every point.
        """
        local = sides.local
        close = sides.close if among is None else sides.close & among
        owner, face = unpacked(close, len(local))
        other = face != faces[owner]
        face, owner = face[other], owner[other]
        # In the plane of a face, a circle about it leaves few to be looked at.
        away = lengths(self._centroids[face] - local[owner])
        close = away <= self._radii[face] + reach
        face, owner = face[close], owner[close]
        corners = self._vertices[self._faces[face]]
        near = triangle_distances(local[owner], corners) <= reach
        face, owner = face[near], owner[near]
        home = faces[owner]
        normals = self._normals
        even = np.einsum("ij,ij->i", normals[face], normals[home]) >= np.sin(half_angle)
        key = face * len(self._faces) + home
        place = np.searchsorted(self._smooth, key, side="right") - 1
        even &= self._smooth[place] == key
        rising = np.zeros(len(local), dtype=bool)
        rising[owner[~even]] = True
        return rising


def _may_cross(begin: Array, end: Array, axes: Array, half_angle: float) -> Mask:
    """Return which segments the ball about their middle lets into a cone; (3, m)."""
    middle = begin + end
    distance = lengths(middle.T)
    x, y, z = middle * axes
    along = x + y + z
    # The middles of most lie in the cone: the others alone are worth angles.
    crosses = along > distance * (np.cos(half_angle) + _ANGLE)
    rest = np.flatnonzero(~crosses)
    distance, along = distance[rest], along[rest]
    size = lengths((end.take(rest, axis=1) - begin.take(rest, axis=1)).T)
    around = size >= distance
    apart = np.where(around, 1.0, distance)
    spread = np.arcsin(np.where(around, 0.0, size) / apart)
    off = np.arccos(np.clip(along / apart, -1.0, 1.0))
    crosses[rest] = around | (off - spread <= half_angle + _ANGLE)
    return crosses


def _pairs_and_borders(edges: MeshEdges) -> tuple[Ints, Ints]:
    """Pairs of faces at an edge, a border's one face with itself, and their edges."""
    pairs, shared = face_pairs(edges, manifold_only=False)
    flat = edges.of_face.ravel()
    border = np.flatnonzero(edges.border[flat])
    alone = np.repeat(border[:, None] // 3, 2, axis=1)
    return np.concatenate([pairs, alone]), np.concatenate([shared, flat[border]])


def _runs_along(faces: Ints, ends: Ints) -> Mask:
    """Return whether each face runs along its edge from the first end to the second."""
    after = faces[:, [1, 2, 0]]
    return np.any((faces == ends[:, :1]) & (after == ends[:, 1:]), axis=1)
