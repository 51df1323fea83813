"""Signs of many small scalar products, a bit each for up to 64 columns.

Planes against points, vertices against normals: long thin products of which only the
sign counts. Single precision tells most of them at a quarter of the time; rows in which
it may err, or that come near to zero, are computed again in double precision, so that
no sign depends on it. With rows scaled to at most 1, columns to at most R and k terms::

    |single - exact| <= k (k + 3) 2^-24 R
"""

import numpy as np

from geometry.arrays import Array, Ints, Mask, Words

# Columns at most: bits of a word.
WORD = 64
# Rows whose products are taken at a time: they stay in the second-level cache.
_ROWS = 1 << 11


class ProductSigns:
    """Rows (m, k) of finite numbers, ready to be multiplied."""

    def __init__(self, rows: Array) -> None:
        self._rows = rows
        largest = np.abs(rows).max(axis=0, initial=0.0)
        self._scale = np.where(largest > 0.0, largest, 1.0)
        self._single = (rows / self._scale).astype(np.float32)

    def over(self, columns: Array, near: float = 0.0) -> tuple[Words, Ints, Array]:
        """Return which products with at most 64 columns (n, k) are above zero.

        Returns:
            A word for each row, column i in bit i, true of all rows but those told
            next; numbers of rows of which some product is `near` to zero, or can't be
            told from it in single precision, shape (r,); and their products in double
            precision, shape (r, n).
        """
        scaled = columns * self._scale
        top = float(np.abs(scaled).max(initial=0.0)) or 1.0
        n_terms = columns.shape[1]
        doubt = near / top + n_terms * (n_terms + 3) * 2.0**-24
        full = np.empty((WORD, n_terms))
        full[: len(columns)] = scaled / top
        # What fills the word up must be near to zero nowhere else.
        full[len(columns) :] = full[:1]
        right = np.ascontiguousarray(full.T, dtype=np.float32)
        words = np.empty(len(self._rows), dtype=np.uint64)
        unsure = np.empty(len(self._rows), dtype=bool)
        for begin in range(0, len(words), _ROWS):
            part = slice(begin, begin + _ROWS)
            products = self._single[part] @ right
            words[part] = packed(products > 0.0)
            np.abs(products, out=products)
            unsure[part] = packed(products <= np.float32(doubt)) != 0
        rows = np.flatnonzero(unsure)
        return words, rows, self._rows.take(rows, axis=0) @ columns.T


def packed(bits: Mask) -> Words:
    """Return a word for each row of at most 64 bits: column i in bit i."""
    if bits.shape[1] < WORD:
        whole = np.zeros((len(bits), WORD), dtype=bool)
        whole[:, : bits.shape[1]] = bits
        bits = whole
    return np.packbits(bits.ravel(), bitorder="little").view(np.uint64)


def unpacked(words: Words, n: int) -> tuple[Ints, Ints]:
    """Return the rows and columns of the bits that are set."""
    words = words & np.uint64((1 << n) - 1)
    some = np.flatnonzero(words)
    bits = np.unpackbits(words[some].view(np.uint8), bitorder="little")
    # Numpy finds what isn't zero in one dimension five times as fast as in two.
    place = np.flatnonzero(bits.view(np.bool_))
    return place & (WORD - 1), some.take(place // WORD)
