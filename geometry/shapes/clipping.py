"""What of a surface lies within a ball."""

import numpy as np

from geometry.arrays import Array
from geometry.mesh.mesh import TriangleMesh
from geometry.shapes.primitives import sphere

# 42 planes: what they leave of a ball is nowhere thinner than nine tenths of it.
_SUBDIVISIONS = 1


def clipped_to_ball(
    mesh: TriangleMesh, centre: Array, radius: float
) -> TriangleMesh | None:
    """Return the part of a surface within a polytope in a ball; None if it is empty.

    No part lies outside the ball; what lies in its outermost tenth may be cut away.

    Args:
        mesh: The surface.
        centre: Of the ball [m], shape (3,).
        radius: Of the ball [m].
    """
    from trimesh.intersections import slice_faces_plane

    directions = sphere(1.0, subdivisions=_SUBDIVISIONS)
    # The corners that these planes leave lie over the faces between the directions.
    heights = np.abs(
        np.einsum("ij,ij->i", directions.face_normals, directions.corners[:, 0])
    )
    depth = radius * float(heights.min())
    vertices, faces = mesh.vertices - centre, mesh.faces
    for outwards in directions.vertices:
        if np.all(vertices[faces] @ outwards <= depth):
            continue
        vertices, faces, _ = slice_faces_plane(
            vertices, faces, plane_normal=-outwards, plane_origin=depth * outwards
        )
        if len(faces) == 0:
            return None
    return TriangleMesh(vertices + centre, faces)
