"""Cut long edges in half, so that every place has vertices near it."""

import numpy as np
from numpy.typing import NDArray

from .topology import mesh_edges

_MAX_ROUNDS = 24

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


def refined(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int64],
    longest: float,
    *,
    max_faces: int,
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Halve edges longer than a length until there are none; the surface stays.

    Args:
        vertices: Shape (n, 3); they keep their numbers.
        faces: Shape (m, 3).
        longest: Length that an edge may have.
        max_faces: Where there would be more, edges stay longer.

    Returns:
        Vertices, faces, and of which face each is a part.
    """
    parent = np.arange(len(faces))
    for _ in range(_MAX_ROUNDS):
        edges = mesh_edges(faces)
        ends = vertices[edges.ends]
        long = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) > longest
        key = long[edges.of_face] @ np.array([1, 2, 4])
        growth = np.array([0, 1, 1, 2, 1, 2, 2, 3])[key].sum()
        if not long.any() or len(faces) + growth > max_faces:
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
