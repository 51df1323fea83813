"""Closed-form shapes in metres, faces counter-clockwise seen from outside."""

from itertools import combinations

import numpy as np

from geometry.arrays import Array, Ints, Mask
from geometry.mesh.halving import halved
from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.topology import mesh_edges

_PHI = (1.0 + np.sqrt(5.0)) / 2.0
# Squared edges of an icosahedron about this edge's are 4, its diagonals over 10.
_LINKED = 4.5


def box(size: tuple[float, float, float]) -> TriangleMesh:
    """Return an axis-aligned closed box about the origin, sides in [m]."""
    import trimesh.creation

    plain = trimesh.creation.box(extents=size)
    return TriangleMesh(np.array(plain.vertices), np.array(plain.faces))


def cylinder(radius: float, height: float) -> TriangleMesh:
    """Return a closed prism of 64 sides about the origin, its axis along z.

    Args:
        radius: To its edges, in [m].
        height: In [m].
    """
    import trimesh.creation

    plain = trimesh.creation.cylinder(radius=radius, height=height, sections=64)
    return TriangleMesh(np.array(plain.vertices), np.array(plain.faces))


def sphere(radius: float, *, subdivisions: int = 4) -> TriangleMesh:
    """Return a subdivided icosahedron about the origin, 20 * 4^subdivisions faces.

    Not trimesh's: samples of a surface follow the order of its faces, and with them
    every plan of a body that is known by its ranges. Every vertex lies at the radius
    in [m].

    Raises:
        ValueError: If the radius isn't positive or subdivisions is negative.
    """
    if not (radius > 0 and np.isfinite(radius)):
        raise ValueError(f"radius must be a positive number of metres, got {radius}")
    if not subdivisions >= 0:
        raise ValueError(f"subdivisions must be at least 0, got {subdivisions}")
    ends = [(a, b * _PHI) for b in (1.0, -1.0) for a in (-1.0, 1.0)]
    corners = np.array(
        [(a, b, 0.0) for a, b in ends]
        + [(0.0, a, b) for a, b in ends]
        + [(b, 0.0, a) for a, b in ends]
    )
    faces, outward = icosahedron_faces(corners)
    faces = np.where(outward[:, None], faces, faces[:, ::-1])
    vertices = corners / np.linalg.norm(corners[0])
    for _ in range(subdivisions):
        edges = mesh_edges(faces)
        every = np.ones(len(edges.ends), dtype=bool)
        vertices, faces, _ = halved(vertices, faces, edges, every)
        vertices /= np.linalg.norm(vertices, axis=1, keepdims=True)
    return TriangleMesh(radius * vertices, faces)


def icosahedron_faces(corners: Array) -> tuple[Ints, Mask]:
    """Return the triangles between the corners (12, 3) of an icosahedron of edge 2.

    Corners of each, ascending, (20, 3), and whether they run counter-clockwise.
    """
    triples = np.array(list(combinations(range(12), 3)))
    sides = corners[triples] - corners[np.roll(triples, -1, axis=1)]
    faces = triples[np.all(np.sum(sides**2, axis=2) < _LINKED, axis=1)]
    return faces, np.linalg.det(corners[faces]) > 0.0
