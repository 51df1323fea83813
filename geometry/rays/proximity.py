"""Closest points on a mesh, with a sign: outside positive."""

from dataclasses import dataclass
from threading import Lock
from weakref import WeakKeyDictionary

import igl
import numpy as np

from geometry.arrays import Array, Ints, cross, lengths
from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.tensors import summed

# A foot this near to a corner or an edge is on it [m].
_THERE = 1e-12
# Trees by their meshes, whose arrays never change: one takes longer to make than to
# answer for all points of a cloud.
_TREES: WeakKeyDictionary[TriangleMesh, tuple[igl.AABB, Array]] = WeakKeyDictionary()
_MAKING = Lock()


@dataclass(frozen=True, eq=False)
class ClosestPoints:
    """For each query point, the nearest point of a mesh.

    Attributes:
        faces: Face that holds the closest point, shape (n,).
        points: Closest points in [m], shape (n, 3).
        distances: Signed distance in [m], positive on the side of the normals, (n,).
    """

    faces: Ints
    points: Array
    distances: Array


def closest_points(mesh: TriangleMesh, points: Array) -> ClosestPoints:
    """Return the closest point of the mesh to each query point (n, 3) [m].

    The sign is that of (P - C) . n, with n the face normal where the closest point C
    lies inside a face, the sum of the normals of both faces on an edge, and the
    angle-weighted sum at a corner; one face's normal alone gives the wrong sign at
    edges sharper than 90 degrees. Source: Baerentzen and Aanaes, "Signed distance
    computation using the angle weighted pseudonormal", TVCG 2005.

    Raises:
        ValueError: If the points aren't (n, 3) or a coordinate isn't finite.
    """
    points = np.asarray(points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3:
        raise ValueError(f"points must be (n, 3), got {points.shape}")
    if not np.all(np.isfinite(points)):
        raise ValueError("points must be finite numbers")
    if len(points) == 0:
        return ClosestPoints(np.empty(0, np.int64), np.empty((0, 3)), np.empty(0))
    tree, vertices = _tree_of(mesh)
    local = np.ascontiguousarray(points - mesh.centre)
    squares, faces, feet = tree.squared_distance(vertices, mesh.faces, local)
    faces = np.asarray(faces, dtype=np.int64)
    feet = np.asarray(feet, dtype=np.float64)
    normals = _pseudonormals(mesh, vertices, feet, faces)
    sides = np.einsum("ij,ij->i", local - feet, normals)
    distances = np.where(sides >= 0.0, 1.0, -1.0) * np.sqrt(squares)
    return ClosestPoints(faces, feet + mesh.centre, distances)


def _tree_of(mesh: TriangleMesh) -> tuple[igl.AABB, Array]:
    """The tree of a mesh, and the vertices that it is of."""
    with _MAKING:
        if mesh not in _TREES:
            # libigl loses digits far from the origin.
            vertices = np.ascontiguousarray(mesh.vertices - mesh.centre)
            tree = igl.AABB()
            tree.init(vertices, mesh.faces)
            _TREES[mesh] = tree, vertices
        return _TREES[mesh]


def _pseudonormals(
    mesh: TriangleMesh, vertices: Array, feet: Array, faces: Ints
) -> Array:
    """Normals by which feet on faces tell outside from inside, any length, (n, 3)."""
    normals, places = mesh.face_normals[faces], mesh.faces[faces]
    corners = vertices[places]
    at_corner = lengths(feet[:, None] - corners) < _THERE
    found = np.array(at_corner.any(axis=1))
    rows = np.flatnonzero(found)
    at = places[rows, np.argmax(at_corner[rows], axis=1)]
    normals[rows] = _corner_normals(mesh, vertices, at)
    for k in range(3):
        # Sides as they lie opposite to the corners.
        one, other = (k + 1) % 3, (k + 2) % 3
        along, off = corners[:, other] - corners[:, one], feet - corners[:, one]
        square = np.einsum("ij,ij->i", along, along)
        share = np.einsum("ij,ij->i", off, along) / np.where(square > 0, square, 1.0)
        beside = lengths(off - np.clip(share, 0.0, 1.0)[:, None] * along)
        rows = np.flatnonzero(~found & (beside < _THERE))
        normals[rows] = _edge_normals(mesh, places[rows][:, [one, other]])
        found[rows] = True
    return normals


def _corner_normals(mesh: TriangleMesh, vertices: Array, at: Ints) -> Array:
    """Sums of the normals of the faces about vertices, weighted by their angles."""
    total, asked = np.zeros_like(vertices), np.zeros(len(vertices), dtype=bool)
    asked[at] = True
    for k in range(3):
        near = np.flatnonzero(asked[mesh.faces[:, k]])
        own, ahead, behind = (mesh.faces[near, (k + i) % 3] for i in range(3))
        a, b = vertices[ahead] - vertices[own], vertices[behind] - vertices[own]
        angle = np.arctan2(lengths(cross(a, b)), np.einsum("ij,ij->i", a, b))
        total += summed(angle[:, None] * mesh.face_normals[near], own, len(total))
    return total[at]


def _edge_normals(mesh: TriangleMesh, ends: Ints) -> Array:
    """Sums of the normals of the faces that have edges (n, 2), shape (n, 3)."""
    n = len(mesh.vertices)
    asked = np.zeros(n, dtype=bool)
    asked[ends] = True
    near = np.flatnonzero(asked[mesh.faces].sum(axis=1) >= 2)
    wanted, place = np.unique(_edge_numbers(ends, n), return_inverse=True)
    total = np.zeros((len(wanted), 3))
    for k in range(3):
        number = _edge_numbers(mesh.faces[near][:, [k, (k + 1) % 3]], n)
        at = np.minimum(np.searchsorted(wanted, number), len(wanted) - 1)
        own = np.flatnonzero(wanted[at] == number) if len(wanted) else at
        total += summed(mesh.face_normals[near[own]], at[own], len(total))
    return total[place]


def _edge_numbers(ends: Ints, n: int) -> Ints:
    """One number for each edge, whichever way it is run."""
    return ends.min(axis=1) * n + ends.max(axis=1)


def triangle_distances(points: Array, corners: Array) -> Array:
    """Return the distance of each point (n, 3) from its triangle (n, 3, 3), (n,).

    Unlike trimesh's closest points, exact on slivers of CAD parts too.
    """
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = lengths(normals)
    normals /= np.where(length > 0, length, 1.0)[:, None]
    height = np.einsum("ij,ij->i", points - corners[:, 0], normals)
    over = length > 0
    best = np.full(len(points), np.inf)
    for k in range(3):
        start, end = corners[:, k], corners[:, (k + 1) % 3]
        along, off = end - start, points - start
        square = np.einsum("ij,ij->i", along, along)
        share = np.einsum("ij,ij->i", off, along) / np.where(square > 0, square, 1.0)
        foot = np.clip(share, 0.0, 1.0)[:, None] * along
        best = np.minimum(best, lengths(off - foot))
        over &= np.einsum("ij,ij->i", np.cross(along, off), normals) >= 0.0
    return np.where(over, np.minimum(best, np.abs(height)), best)
