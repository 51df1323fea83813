"""Closest points on a mesh, with a sign: outside positive."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import igl
import numpy as np
from numpy.typing import NDArray

from geometry.mesh.mesh import TriangleMesh

_CHUNK = 1 << 14
# Barycentric coordinates below this put the closest point on an edge or a corner.
_ON_EDGE = 1e-9


@dataclass(frozen=True, eq=False)
class ClosestPoints:
    """For each query point, the nearest point of a mesh.

    Attributes:
        faces: Face that holds the closest point, shape (n,).
        points: Closest points in [m], shape (n, 3).
        distances: Signed distance in [m], positive on the side of the normals, (n,).
    """

    faces: NDArray[np.int64]
    points: NDArray[np.float64]
    distances: NDArray[np.float64]


def closest_points(
    mesh: TriangleMesh, points: NDArray[np.float64], *, threads: int = 2
) -> ClosestPoints:
    """Return the closest point of the mesh to each query point.

    The sign is that of (P - C) . n, with n the face normal where the closest point C
    lies inside a face, the sum of the normals of both faces on an edge, and the
    angle-weighted sum at a corner; one face's normal alone gives the wrong sign at
    edges sharper than 90 degrees. Source: Baerentzen and Aanaes, "Signed distance
    computation using the angle weighted pseudonormal", TVCG 2005.

    Args:
        mesh: The surface.
        points: Query points in [m], shape (n, 3).
        threads: Worker threads; the answer doesn't depend on them.

    Raises:
        ValueError: If the points aren't (n, 3) or a coordinate isn't finite.
    """
    points = np.asarray(points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3:
        raise ValueError(f"points must be (n, 3), got {points.shape}")
    if not np.all(np.isfinite(points)):
        raise ValueError("points must be finite numbers")
    if threads < 1:
        raise ValueError(f"threads must be at least 1, got {threads}")
    # libigl crashes on read-only zero-size views and loses digits far from the origin.
    vertices = np.ascontiguousarray(mesh.vertices - mesh.centre)
    local = np.ascontiguousarray(points - mesh.centre)
    faces = np.empty(len(points), dtype=np.int64)
    closest = np.empty((len(points), 3))
    tree = igl.AABB()
    tree.init(vertices, mesh.faces)

    def search(start: int) -> None:
        part = slice(start, start + _CHUNK)
        _, faces[part], closest[part] = tree.squared_distance(
            vertices, mesh.faces, local[part]
        )

    with ThreadPoolExecutor(threads) as pool:
        for done in [pool.submit(search, i) for i in range(0, len(points), _CHUNK)]:
            done.result()
    away = local - closest
    side = np.einsum("ij,ij->i", away, _pseudonormals(mesh, vertices, faces, closest))
    distances = np.copysign(np.linalg.norm(away, axis=1), side)
    return ClosestPoints(faces, closest + mesh.centre, distances)


def _pseudonormals(
    mesh: TriangleMesh,
    vertices: NDArray[np.float64],
    faces: NDArray[np.int64],
    closest: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Normal of the feature (face, edge or corner) that each closest point lies on."""
    normals = mesh.face_normals[faces]
    near = _barycentric(vertices[mesh.faces[faces]], closest) < _ON_EDGE
    n_zero = near.sum(axis=1)
    corner = np.flatnonzero(n_zero >= 2)
    if len(corner):
        at = mesh.faces[faces[corner], np.argmin(near[corner], axis=1)]
        normals[corner] = _corner_normals(mesh)[at]
    edge = np.flatnonzero(n_zero == 1)
    if len(edge):
        opposite = np.argmax(near[edge], axis=1)
        normals[edge] = _edge_normals(mesh)[3 * faces[edge] + opposite]
    return normals


def _barycentric(
    corners: NDArray[np.float64], points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Barycentric coordinates (n, 3) of points in the planes of triangles (n, 3, 3)."""
    a = corners[:, 0]
    ab, ac, ap = corners[:, 1] - a, corners[:, 2] - a, points - a
    bb, bc, cc, pb, pc = (
        np.einsum("ij,ij->i", x, y)
        for x, y in ((ab, ab), (ab, ac), (ac, ac), (ap, ab), (ap, ac))
    )
    area = bb * cc - bc * bc
    area = np.where(area > 0, area, 1.0)
    v, w = (cc * pb - bc * pc) / area, (bb * pc - bc * pb) / area
    return np.column_stack([1.0 - v - w, v, w])


def _corner_normals(mesh: TriangleMesh) -> NDArray[np.float64]:
    """Angle-weighted sum of the face normals about each vertex, shape (n_v, 3)."""
    after = np.roll(mesh.corners, -1, axis=1) - mesh.corners
    before = -np.roll(after, 1, axis=1)
    cosine = np.einsum("ijk,ijk->ij", after, before)
    sine = np.linalg.norm(np.cross(after, before), axis=2)
    weighted = np.arctan2(sine, cosine)[..., None] * mesh.face_normals[:, None]
    sums = [
        np.bincount(mesh.faces.ravel(), weighted[..., k].ravel(), len(mesh.vertices))
        for k in range(3)
    ]
    return np.stack(sums, axis=1, dtype=np.float64)


def _edge_normals(mesh: TriangleMesh) -> NDArray[np.float64]:
    """Sum of the normals of the faces at each face's edge, shape (3 n_f, 3).

    Row 3 f + k belongs to the edge of face f opposite its corner k.
    """
    ends = np.sort(mesh.faces[:, [[1, 2], [2, 0], [0, 1]]].reshape(-1, 2), axis=1)
    key = ends[:, 0] * len(mesh.vertices) + ends[:, 1]
    _, edge = np.unique(key, return_inverse=True)
    normals = np.repeat(mesh.face_normals, 3, axis=0)
    sums = [np.bincount(edge, normals[:, k]) for k in range(3)]
    return np.stack(sums, axis=1, dtype=np.float64)[edge]
