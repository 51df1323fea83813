"""Triangles with some of their edges cut in half."""

import numpy as np

from geometry.arrays import Array, Ints, Mask

from .topology import MeshEdges

# Corners 0..2 and middles 3..5 (of edges 01, 12, 20) of the faces that come of one
# whose edges are cut by the bits of the key.
_PATTERNS: dict[int, tuple[tuple[int, int, int], ...]] = {
    0: ((0, 1, 2),),
    1: ((0, 3, 2), (3, 1, 2)),
    2: ((1, 4, 0), (4, 2, 0)),
    4: ((2, 5, 1), (5, 0, 1)),
    3: ((3, 1, 4), (0, 3, 4), (0, 4, 2)),
    6: ((4, 2, 5), (1, 4, 5), (1, 5, 0)),
    5: ((5, 0, 3), (2, 5, 3), (2, 3, 1)),
    7: ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)),
}


def halved(
    vertices: Array, faces: Ints, edges: MeshEdges, cut: Mask
) -> tuple[Array, Ints, Ints]:
    """Cut edges of faces in half, the same on every side of an edge.

    Returns:
        Vertices, the old ones first; faces; and of which face each is a part.
    """
    number = len(vertices) + np.cumsum(cut) - 1
    vertices = np.concatenate([vertices, vertices[edges.ends[cut]].mean(axis=1)])
    six = np.concatenate([faces, number[edges.of_face]], axis=1)
    key = np.where(cut[edges.of_face], [1, 2, 4], 0).sum(axis=1)
    parts: list[Ints] = []
    parents: list[Ints] = []
    for pattern, children in _PATTERNS.items():
        chosen = np.flatnonzero(key == pattern)
        for child in children:
            parts.append(six[chosen][:, child])
            parents.append(chosen)
    return vertices, np.concatenate(parts), np.concatenate(parents)
