"""The kinds of arrays that geometry is made of."""

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Single = NDArray[np.float32]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]
Words = NDArray[np.uint64]
Length = TypeVar("Length", float, Array)

_Kind = TypeVar("_Kind", bound=np.generic)


def cross(a: Array, b: Array) -> Array:
    """Return a x b of rows, (n, 3) or (3,): what `np.cross` does, in half the time."""
    product = np.empty(np.broadcast_shapes(a.shape, b.shape))
    (a0, a1, a2), (b0, b1, b2) = a.T, b.T
    for column, (p, q, r, s) in enumerate(
        ((a1, b2, a2, b1), (a2, b0, a0, b2), (a0, b1, a1, b0))
    ):
        np.subtract(p * q, r * s, out=product[..., column])
    return product


def lengths(vectors: Array) -> Array:
    """Return sqrt(x^2 + y^2 + ...) of each row, (..., k) to (...), k small.

    To the last bit what `np.linalg.norm` gives along the last axis, whose sums over
    rows of three cost five times as much, and up to thirty.
    """
    first, *others = vectors.T if vectors.ndim < 3 else np.moveaxis(vectors, -1, 0)
    square = first * first
    for other in others:
        square += other * other
    return np.sqrt(square)


def dot(a: Array, b: Array) -> Array:
    """Return the scalar products of rows of three, (n,).

    To the last bit what `np.einsum` gives of rows that lie one after the other.
    """
    (x, y, z), (u, v, w) = a.T, b.T
    return x * u + z * w + y * v


def by_column(vectors: Array, chosen: Ints) -> Array:
    """Return some vectors, (k, 3), that lie in memory column by column.

    Rows of three are too short for numpy's loops.
    """
    return vectors.T.take(chosen, axis=1).T


def rows_of(array: NDArray[_Kind], chosen: Ints | Mask) -> NDArray[_Kind]:
    """Return some rows, by index or mask: up to ten times as fast as `array[chosen]`.

    numpy copies whole rows here, and number by number there.
    """
    if chosen.dtype == np.bool_:
        return array.compress(chosen, axis=0)
    return array.take(chosen, axis=0)
