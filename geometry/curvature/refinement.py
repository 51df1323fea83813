"""Cut long edges in half, so that every place has vertices near it."""

import numpy as np

from geometry.arrays import Ints
from geometry.mesh.halving import halved
from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.topology import mesh_edges

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


def cut_for_curvature(
    mesh: TriangleMesh, radius: float | None = None
) -> tuple[TriangleMesh, Ints]:
    """Cut the long edges of a mesh on which curvature knows no places, as of CAD parts.

    Curvature lives at vertices: on triangles far larger than its scale (the radius [m]
    of its neighbourhood, or the size of the facets of a coarse smooth mesh) it depends
    on the triangulation alone, and a face of which a part is curved could only be
    chosen as a whole. Edges are cut to 1.25 times the scale, or twice where it is more
    than 1.5 radii. A mesh with less than a fifth of its area in faces with a longer
    edge comes back as it is. Returns what `cut_long_edges` does.
    """
    radius = DEFAULT_RADIUS_SHARE * mesh.size if radius is None else radius
    facet = facet_size(mesh)
    coarse = facet >= _COARSE * radius
    share = _LONGEST_COARSE_SHARE if coarse else _LONGEST_SHARE
    longest = share * max(radius, facet)
    long = mesh.edge_lengths.max(axis=1) > longest
    if mesh.face_areas[long].sum() < _CUT_SHARE * mesh.area:
        return mesh, np.arange(len(mesh.faces))
    return cut_long_edges(mesh, longest)


def cut_long_edges(mesh: TriangleMesh, longest: float) -> tuple[TriangleMesh, Ints]:
    """Halve edges longer than a length [m] until there are none; the surface stays.

    Where that would make more than 100,000 faces and more than twice those there are,
    shorter edges are left alone. `source` is kept; `origin` isn't, since new vertices
    are none of the file's.

    Returns:
        The mesh (the same object if nothing is long), and of which face each of its
        faces is a part, ascending, shape (n_f,).

    Raises:
        ValueError: If the length isn't positive.
    """
    if not longest > 0:
        raise ValueError(f"longest must be a positive number of metres, got {longest}")
    vertices, faces = mesh.vertices, mesh.faces
    parent = np.arange(len(faces))
    most = max(_MAX_FACES, _MAX_GROWTH * len(faces))
    for _ in range(_MAX_ROUNDS):
        edges = mesh_edges(faces)
        ends = vertices[edges.ends]
        lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        # Every edge that is cut in a face makes one face more of it.
        while len(faces) + (lengths > longest)[edges.of_face].sum() > most:
            longest *= _LESS_FINE
        cut = lengths > longest
        if not cut.any():
            break
        vertices, faces, part_of = halved(vertices, faces, edges, cut)
        parent = parent[part_of]
    if len(faces) == len(mesh.faces):
        return mesh, parent
    order = np.argsort(parent, kind="stable")
    return TriangleMesh(vertices, faces[order], mesh.source), parent[order]
