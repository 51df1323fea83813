"""Curvature tensors from libigl's quadrics, fitted to two rings about each vertex."""

from collections.abc import Iterator

import igl
import numpy as np

from geometry.arrays import Array, Ints, Mask, cross, lengths
from geometry.mesh.tensors import area_normals, packed, summed, unit
from geometry.mesh.topology import numbered

# A quadric has six coefficients: one ring is too few. More rings would reach farther on
# coarse meshes than on fine ones; the scale is kept by diffusion instead.
RINGS = 2
# Over its shortest edge a surface can't turn by more than half a turn: what is more
# comes of neighbours that hardly determine a quadric, and may be anything.
_MOST_TURN = np.pi
# A vertex normal shorter than this share of its faces' area is none.
_CANCELLED = 1e-6
# Vertices in one call of libigl, which nothing can cut: half a second's work.
_AT_ONCE = 50_000


def fit_quadrics(vertices: Array, faces: Ints) -> tuple[Array, Array, Mask, Mask]:
    """Fit a quadric to two rings about each vertex, over the plane of its normals.

    The tensor is k1 d1 d1^T + k2 d2 d2^T; an outward-oriented sphere is positive.
    Source: Panozzo, Puppo and Rocca, "Efficient multi-scale curvature and crease
    estimation", 2010, as libigl has it, whose thresholds are absolute numbers: vertices
    (n, 3) must have about unit edges near the origin, faces (m, 3) area.

    Returns:
        Tensors as six numbers each (`tensors.packed`), (n, 6); the unit normals that
        they lie across, (n, 3); whether there was a fit, (n,); and where it makes
        sense: the curvature times the shortest edge is no more than pi, (n,). Tensors
        are zero elsewhere.
    """
    k, ways, fitted = _fit(vertices, faces)
    turn = np.linalg.norm(k, axis=0) * _shortest_edges(vertices, faces)
    sensible = fitted & (turn <= _MOST_TURN)
    k[:, ~sensible] = 0.0
    # An exactly flat neighbourhood has no direction of its own, hence no normal.
    normals = cross(ways[0], ways[1])
    length = lengths(normals)[:, None]
    normals = np.where(
        length > 0.5,
        normals / np.maximum(length, 0.5),
        _vertex_normals(vertices, faces),
    )
    return packed((k[0], k[1]), (ways[0], ways[1])), normals, fitted, sensible


def _fit(vertices: Array, faces: Ints) -> tuple[Array, Array, Mask]:
    """Curvatures (2, n), larger first, directions (2, n, 3), success (n,); or zero."""
    n = len(vertices)
    k, ways, fitted = np.zeros((2, n)), np.zeros((2, n, 3)), np.zeros(n, dtype=bool)
    # libigl reads out of bounds at vertices without a face.
    used, local = numbered(_with_normals(vertices, faces), n)
    if len(used) == 0:
        return k, ways, fitted
    for near, patch, mine in _slabs(vertices[used], local):
        first, second, k_first, k_second, bad = igl.principal_curvature(
            np.ascontiguousarray(vertices[used[near]]),
            patch,
            radius=RINGS,
            useKring=True,
        )
        good = mine.copy()
        good[np.array(bad, dtype=np.int64)] = False
        own = used[near[mine]]
        k[:, own] = np.stack([k_first, k_second])[:, mine]
        ways[:, own] = np.stack([first, second])[:, mine]
        fitted[used[near[good]]] = True
    fitted &= np.all(np.isfinite(k), axis=0) & np.all(np.isfinite(ways), axis=(0, 2))
    k[:, ~fitted], ways[:, ~fitted] = 0.0, 0.0
    return k, ways, fitted


def _slabs(points: Array, faces: Ints) -> Iterator[tuple[Ints, Ints, Mask]]:
    """Cut a mesh into slabs with what a fit in them looks at: the same fits in parts.

    Vertices of each, its faces in their numbers, and which vertices are its own.
    """
    n = len(points)
    along = points[:, np.argmax(np.ptp(points, axis=0))]
    order = np.argsort(along, kind="stable")
    # One by one: numpy takes several times as long over rows of three.
    corners = np.ascontiguousarray(faces.T)
    for part in np.array_split(order, -(-n // _AT_ONCE)):
        own = np.zeros(n, dtype=bool)
        own[part] = True
        near = own.copy()
        # One ring more, for the normals of the outermost.
        for _ in range(RINGS + 1):
            a, b, c = (near[corner] for corner in corners)
            for corner in corners:
                near[corner[a | b | c]] = True
        a, b, c = (near[corner] for corner in corners)
        used, patch = numbered(faces[a & b & c], n)
        yield used, patch, own[used]


def _shortest_edges(vertices: Array, faces: Ints) -> Array:
    """Shortest edge at each vertex, infinite without a face, shape (n,)."""
    shortest = np.full(len(vertices), np.inf)
    for a, b in ((0, 1), (1, 2), (2, 0)):
        edge = vertices[faces[:, a]] - vertices[faces[:, b]]
        length = lengths(edge)
        np.minimum.at(shortest, faces[:, a], length)
        np.minimum.at(shortest, faces[:, b], length)
    return shortest


def _vertex_normals(vertices: Array, faces: Ints) -> Array:
    """Unit normals averaged over the area of each vertex's faces, (n, 3)."""
    weighted = np.repeat(area_normals(vertices[faces]), 3, axis=0)
    normals = unit(summed(weighted, faces.ravel(), len(vertices)))
    return np.where(np.any(normals, axis=1, keepdims=True), normals, [0.0, 0.0, 1.0])


def _with_normals(vertices: Array, faces: Ints) -> Ints:
    """Leave out faces at vertices whose normals cancel: libigl crashes there."""
    while len(faces):
        weighted = area_normals(vertices[faces])
        size = lengths(weighted)
        each = np.repeat(np.column_stack([weighted, size]), 3, axis=0)
        sums = summed(each, faces.ravel(), len(vertices)).T
        length = np.linalg.norm(sums[:3], axis=0)
        lost = ~(length > _CANCELLED * sums[3])
        kept = (size > 0) & ~lost[faces].any(axis=1)
        if kept.all():
            break
        faces = faces[kept]
    return faces
