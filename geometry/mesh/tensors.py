"""Symmetric tensors on a surface: their average, and their values in a plane."""

import numpy as np

from geometry.arrays import Array, Ints, cross, lengths

_UPPER = np.triu_indices(3)
# Entries beside the diagonal stand for two: with the root of two, the sum of squares is
# the tensor's own, which no turn changes.
_DOUBLED = np.where(_UPPER[0] == _UPPER[1], 1.0, np.sqrt(2.0))
_PACKED_AT = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])


def packed(values: tuple[Array, Array], ways: tuple[Array, Array]) -> Array:
    """Return k1 d1 d1^T + k2 d2 d2^T as six numbers each, (n, 6), of the same norm.

    `values` are k1 and k2, each (n,); `ways` d1 and d2, each (n, 3).
    """
    i, j = _UPPER
    first, second = (
        k[:, None] * d[:, i] * d[:, j] for k, d in zip(values, ways, strict=True)
    )
    return np.asarray((first + second) * _DOUBLED, dtype=np.float64)


def unpacked(tensors: Array) -> Array:
    """Return what `packed` packed, (n, 3, 3)."""
    return (tensors / _DOUBLED)[:, _PACKED_AT]


def tangent_planes(normals: Array) -> Array:
    """Return two unit vectors across each unit normal, as columns, shape (n, 3, 2)."""
    least = np.argmin(np.abs(normals), axis=1)
    rows = np.arange(len(normals))
    # The cross product with the axis that is farthest from the normal.
    first = np.zeros_like(normals)
    first[rows, (least + 1) % 3] = normals[rows, (least + 2) % 3]
    first[rows, (least + 2) % 3] = -normals[rows, (least + 1) % 3]
    first = unit(first)
    return np.stack([first, cross(normals, first)], axis=2)


def area_normals(corners: Array) -> Array:
    """Return normals of triangles (n, 3, 3), twice as long as their areas, (n, 3)."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    return cross(b - a, c - a)


def unit(vectors: Array) -> Array:
    """Return vectors (k, 3) of length one; zero stays."""
    length = lengths(vectors)[:, None]
    return vectors / np.maximum(length, 1e-300)


def summed(vectors: Array, of: Ints, n: int) -> Array:
    """Return the sums of rows (m, k) that belong to each of n things, shape (n, k)."""
    sums = [np.bincount(of, column, n) for column in vectors.T]
    return np.stack(sums, axis=1).astype(np.float64, copy=False)


def principal(tensors: Array, planes: Array) -> tuple[Array, Array]:
    """Return eigenvalues (2, n), larger first, and unit eigenvectors (2, n, 3).

    Tensors are symmetric, (n, 3, 3); two orthonormal vectors span each plane, as
    columns, (n, 3, 2).
    """
    a, b = planes[:, :, 0], planes[:, :, 1]
    across_a = np.einsum("nij,nj->ni", tensors, a)
    aa = np.einsum("ni,ni->n", across_a, a)
    twist = np.einsum("ni,ni->n", across_a, b)
    bb = np.einsum("nij,ni,nj->n", tensors, b, b, optimize=False)
    half_sum, half_gap = 0.5 * (aa + bb), 0.5 * (aa - bb)
    spread = np.hypot(half_gap, twist)
    angle = 0.5 * np.arctan2(twist, half_gap)
    cosine, sine = np.cos(angle)[:, None], np.sin(angle)[:, None]
    ways = np.stack([cosine * a + sine * b, cosine * b - sine * a])
    return np.stack([half_sum + spread, half_sum - spread]), ways
