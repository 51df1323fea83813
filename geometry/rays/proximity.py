"""Closest points on a mesh, with a sign: outside positive."""

from dataclasses import dataclass

import igl
import numpy as np

from geometry.arrays import Array, Ints, lengths
from geometry.mesh.mesh import TriangleMesh


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
    # libigl loses digits far from the origin.
    distances, faces, closest, _ = igl.signed_distance(
        np.ascontiguousarray(points - mesh.centre),
        np.ascontiguousarray(mesh.vertices - mesh.centre),
        mesh.faces,
        sign_type=igl.SIGNED_DISTANCE_TYPE_PSEUDONORMAL,
    )
    return ClosestPoints(
        np.asarray(faces, dtype=np.int64),
        np.asarray(closest, dtype=np.float64) + mesh.centre,
        np.asarray(distances, dtype=np.float64),
    )


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
