"""Edges, borders and components of triangles; indices only, no positions."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from geometry.arrays import Ints, Mask


@dataclass(frozen=True, eq=False)
class MeshEdges:
    """The undirected edges of a mesh and the three that each face has.

    Attributes:
        ends: Vertices of each edge, lower index first, shape (n_e, 2).
        of_face: Edges of each face, from corner 0 to 1, 1 to 2 and 2 to 0, (n_f, 3).
        n_faces: Faces at each edge, shape (n_e,).
    """

    ends: Ints
    of_face: Ints
    n_faces: Ints

    @property
    def border(self) -> Mask:
        """Edges with one face, shape (n_e,)."""
        return self.n_faces == 1


def mesh_edges(faces: Ints) -> MeshEdges:
    """Return the edges of triangles (n_f, 3)."""
    begin, end = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    low, high = np.minimum(begin, end), np.maximum(begin, end)
    span = int(faces.max()) + 1
    key, of_face, counts = np.unique(
        low * span + high, return_inverse=True, return_counts=True
    )
    return MeshEdges(
        np.stack([key // span, key % span], axis=1),
        of_face.reshape(-1, 3),
        counts.astype(np.int64),
    )


def face_pairs(edges: MeshEdges, *, manifold_only: bool = True) -> tuple[Ints, Ints]:
    """Return pairs of faces that share an edge, shape (m, 2), and the edge of each.

    Around an edge of more than two faces, consecutive faces are paired, unless
    ``manifold_only`` leaves such edges out.
    """
    flat = edges.of_face.ravel()
    if manifold_only or not np.any(edges.n_faces > 2):
        # Two faces at most: the first and the last one at each edge, without sorting.
        first = np.empty(len(edges.n_faces), dtype=np.int64)
        last = np.empty_like(first)
        last[flat] = at = np.arange(len(flat))
        first[flat[::-1]] = at[::-1]
        edge = np.flatnonzero(edges.n_faces == 2)
        return np.stack([first[edge] // 3, last[edge] // 3], axis=1), edge
    order = np.argsort(flat, kind="stable")
    same = flat[order][1:] == flat[order][:-1]
    pairs = np.stack([order[:-1][same] // 3, order[1:][same] // 3], axis=1)
    return pairs, flat[order][1:][same]


def components(pairs: Ints, n: int) -> tuple[int, Ints]:
    """Return the number of connected components of n nodes, and each node's, (n,).

    Components are numbered by their lowest node, as scipy meets them.
    """
    links = coo_array(
        (np.ones(len(pairs), np.int8), (pairs[:, 0], pairs[:, 1])), (n, n)
    )
    count, label = connected_components(links, directed=False)
    return int(count), label.astype(np.int64)


def used_vertices(faces: Ints, n: int) -> Mask:
    """Return which of n vertices faces use, shape (n,)."""
    used = np.zeros(n, dtype=bool)
    used[faces] = True
    return used


def grouped(group: Ints, count: int) -> list[Ints]:
    """Return the members of each group, ascending; -1 is no group."""
    held = np.flatnonzero(group >= 0)
    order = held[np.argsort(group[held], kind="stable")]
    ends = np.cumsum(np.bincount(group[held], minlength=count))
    return [np.asarray(part) for part in np.split(order, ends)[:count]]


def numbered(faces: Ints, n: int) -> tuple[Ints, Ints]:
    """Vertices of n that faces use, ascending, and the faces in their numbers."""
    used = used_vertices(faces, n)
    return np.flatnonzero(used), (np.cumsum(used) - 1)[faces]
