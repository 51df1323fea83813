"""Cut long edges in half, so that every place has vertices near it."""

import numpy as np

from geometry.arrays import Array, Ints, Mask
from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.topology import MeshEdges, mesh_edges

from .curvature import DEFAULT_RADIUS_SHARE, facet_size

_MAX_ROUNDS = 24
# Edges longer than this share of the scale are long. Where facets are far larger than
# the radius, only those are that are long beside them: a cut facet of a smooth surface
# is a flat with creases about it.
_LONGEST_SHARE = 1.25
_COARSE, _LONGEST_COARSE_SHARE = 1.5, 2.0
# Faces with a long edge must hold this share of the area before a mesh is touched.
_CUT_SHARE = 0.2
_MAX_FACES, _MAX_GROWTH = 100_000, 2
_LESS_FINE = 2.0**0.25

# Corners 0..2 and middles 3..5 (of edges 01, 12, 20) of the faces that come of one
# whose edges are cut by the bits of the key.
_PATTERNS: dict[int, tuple[tuple[int, int, int], ...]] = {
    1: ((0, 3, 2), (3, 1, 2)),
    2: ((1, 4, 0), (4, 2, 0)),
    4: ((2, 5, 1), (5, 0, 1)),
    3: ((3, 1, 4), (0, 3, 4), (0, 4, 2)),
    6: ((4, 2, 5), (1, 4, 5), (1, 5, 0)),
    5: ((5, 0, 3), (2, 5, 3), (2, 3, 1)),
    7: ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)),
}
_GROWTH = np.array([0, 1, 1, 2, 1, 2, 2, 3])


def cut_for_curvature(
    mesh: TriangleMesh, radius: float | None = None
) -> tuple[TriangleMesh, Ints]:
    """Cut the long edges of a mesh on which curvature knows no places, as of CAD parts.

    Curvature lives at vertices: on triangles far larger than its scale (the radius, or
    the size of the facets of a coarse smooth mesh) it depends on the triangulation
    alone, and a face of which a part is curved could only be chosen as a whole. Edges
    are cut to 1.25 times the scale, or twice where it is more than 1.5 radii. A mesh
    with less than a fifth of its area in faces with a longer edge comes back as it is.

    Args:
        mesh: The surface.
        radius: Of the curvature's neighbourhood in [m]; default 2 % of the mesh's size.

    Returns:
        The mesh, and of which face each of its faces is a part, as `cut_long_edges`.
    """
    radius = DEFAULT_RADIUS_SHARE * mesh.size if radius is None else radius
    edges = np.linalg.norm(mesh.corners - np.roll(mesh.corners, 1, axis=1), axis=2)
    largest = edges.max(axis=1)

    def fine(longest: float) -> bool:
        area = mesh.face_areas[largest > longest].sum()
        return bool(area < _CUT_SHARE * mesh.area)

    # The scale is no less than the radius: most meshes needn't be looked at closer.
    if fine(_LONGEST_SHARE * radius):
        return mesh, np.arange(len(mesh.faces))
    facet = facet_size(mesh)
    coarse = facet >= _COARSE * radius
    share = _LONGEST_COARSE_SHARE if coarse else _LONGEST_SHARE
    longest = share * max(radius, facet)
    if fine(longest):
        return mesh, np.arange(len(mesh.faces))
    return cut_long_edges(mesh, longest)


def cut_long_edges(mesh: TriangleMesh, longest: float) -> tuple[TriangleMesh, Ints]:
    """Halve edges longer than a length until there are none; the surface stays.

    Where that would make more than 100,000 faces and more than twice those there are,
    shorter edges are left alone. `source` is kept; `origin` isn't, since new vertices
    are none of the file's.

    Args:
        mesh: The surface.
        longest: Length in [m] that an edge may have.

    Returns:
        The mesh (the same object if nothing is long), and of which face each of its
        faces is a part, ascending, shape (n_f,).

    Raises:
        ValueError: If the length isn't positive.
    """
    if not longest > 0:
        raise ValueError(f"longest must be a positive number of metres, got {longest}")
    vertices, faces, parent = refined(
        mesh.vertices,
        mesh.faces,
        longest,
        max_faces=max(_MAX_FACES, _MAX_GROWTH * len(mesh.faces)),
    )
    if len(faces) == len(mesh.faces):
        return mesh, parent
    order = np.argsort(parent, kind="stable")
    return TriangleMesh(vertices, faces[order], mesh.source), parent[order]


def refined(
    vertices: Array, faces: Ints, longest: float, *, max_faces: int
) -> tuple[Array, Ints, Ints]:
    """Halve edges longer than a length until there are none; the surface stays.

    Args:
        vertices: Shape (n, 3); they keep their numbers.
        faces: Shape (m, 3).
        longest: Length that an edge may have.
        max_faces: Where there would be more, only the longer ones are halved.

    Returns:
        Vertices, faces, and of which face each is a part.
    """
    parent = np.arange(len(faces))
    for _ in range(_MAX_ROUNDS):
        edges = mesh_edges(faces)
        ends = vertices[edges.ends]
        lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        long, key = _to_cut(edges, lengths, longest)
        while len(faces) + _GROWTH[key].sum() > max_faces:
            longest *= _LESS_FINE
            long, key = _to_cut(edges, lengths, longest)
        if not long.any():
            break
        number = len(vertices) + np.cumsum(long) - 1
        vertices = np.concatenate([vertices, ends[long].mean(axis=1)])
        six = np.concatenate([faces, number[edges.of_face]], axis=1)
        parts, parents = [faces[key == 0]], [parent[key == 0]]
        for pattern, children in _PATTERNS.items():
            chosen = np.flatnonzero(key == pattern)
            for child in children:
                parts.append(six[chosen][:, child])
                parents.append(parent[chosen])
        faces, parent = np.concatenate(parts), np.concatenate(parents)
    return vertices, faces, parent


def _to_cut(edges: MeshEdges, lengths: Array, longest: float) -> tuple[Mask, Ints]:
    """Which edges are long, and for each face the key of its pattern."""
    long = lengths > longest
    return long, np.where(long[edges.of_face], [1, 2, 4], 0).sum(axis=1)
