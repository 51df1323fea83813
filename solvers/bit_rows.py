"""Rows of bits, 64 to a word: packed, compared and weighed without unpacking them.

Bit rows of one problem have the same number of words; bits past the last row are 0.
`sparse_rows` is for matrices of booleans that stay sparse.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

_CHUNK = 128
_LARGE = 4096
# Rows of a strip: columns of so many stay in the cache.
_STRIP = 256
# Distinct values up to which counting bits under masks beats looking bytes up.
_FEW_VALUES = 8


def words_for(n_rows: int) -> int:
    """Return the number of 64-bit words of a bit row."""
    return -(-n_rows // 64)


def pack_rows(serves: NDArray[np.bool_]) -> NDArray[np.uint64]:
    """Return bit rows, shape (n_cells, n_words), of a matrix (n_cells, n_rows)."""
    serves = np.asarray(serves, dtype=bool)
    if serves.ndim != 2:
        raise ValueError(f"serves must be a matrix, got shape {serves.shape}")
    packed = np.zeros((serves.shape[0], words_for(serves.shape[1]) * 8), dtype=np.uint8)
    packed[:, : -(-serves.shape[1] // 8)] = np.packbits(serves, axis=1)
    return packed.view(np.uint64)


def pack_shuffled(sets: NDArray[np.bool_]) -> NDArray[np.uint64]:
    """Return sets (n_sets, n_elements) as bit rows, elements in one random order.

    So the first words are a fair sketch of a set.
    """
    order = np.random.default_rng(0).permutation(sets.shape[1])
    return pack_rows(sets.take(order, axis=1))


def sparse_rows(dense: NDArray[np.bool_]) -> sparse.csr_array:
    """Return what `scipy.sparse.csr_array` does, in a third of the time.

    Numpy finds what isn't zero in one dimension five times as fast as in two.
    """
    n_rows, n_columns = dense.shape
    places = np.flatnonzero(np.ascontiguousarray(dense).ravel())
    ends = np.searchsorted(places, n_columns * np.arange(n_rows + 1))
    small = max(n_columns, places.size) <= np.iinfo(np.int32).max
    index = np.int32 if small else np.int64
    return sparse.csr_array(
        (
            np.ones(places.size, dtype=bool),
            (places % max(n_columns, 1)).astype(index),
            ends.astype(index),
        ),
        shape=dense.shape,
    )


def transposed(dense: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return a transpose of its own, strip by strip, in a third of numpy's time."""
    turned = np.empty(dense.shape[::-1], dtype=bool)
    for part in parts(len(dense), _STRIP):
        turned[:, part] = dense[part].T
    return turned


def unpack_rows(rows: NDArray[np.uint64], n_rows: int) -> NDArray[np.bool_]:
    """Return the matrix, shape (n_cells, n_rows), of a few bit rows."""
    whole = np.ascontiguousarray(rows)
    return np.unpackbits(whole.view(np.uint8), axis=1, count=n_rows).view(np.bool_)


def exceeds(
    rows: NDArray[np.uint64], limits: NDArray[np.uint64], of: NDArray[np.int64]
) -> int:
    """Return the first row that isn't within ``limits[of]``, or -1."""
    for part in parts(of.size):
        outside = np.any(rows[part] & ~limits[of[part]], axis=1)
        if np.any(outside):
            return part.start + int(np.argmax(outside))
    return -1


def check_padding(rows: NDArray[np.uint64], n_rows: int) -> None:
    """Raise ValueError if a bit past the last row is set: no weight belongs to it."""
    if rows.size == 0:
        return
    last = pack_rows(np.ones((1, n_rows), dtype=bool))[0, -1]
    bad = np.flatnonzero(rows[:, -1] & ~last)
    if bad.size:
        raise ValueError(
            f"bit row {bad[0]} has bits set past its {n_rows} rows: pack it with "
            f"pack_rows"
        )


def parts(n: int, size: int = _LARGE) -> Iterator[slice]:
    """Return the slices that cut n things into parts of a size."""
    return (slice(i, min(i + size, n)) for i in range(0, n, size))


class GrowingArray:
    """Rows of an array to which more are appended, in room that grows by halves."""

    def __init__(self, like: NDArray[Any]) -> None:
        self._data = like.copy()
        self.size = len(like)

    @property
    def values(self) -> NDArray[Any]:
        """What was appended so far; valid until more is."""
        return self._data[: self.size]

    def append(self, more: NDArray[Any]) -> None:
        """Append rows of the same shape."""
        stop = self.size + len(more)
        if stop > len(self._data):
            room = (max(stop, 3 * self.size // 2), *self._data.shape[1:])
            new = np.empty(room, dtype=self._data.dtype)
            new[: self.size] = self.values
            self._data = new
        self._data[self.size : stop] = more
        self.size = stop


class BitSum:
    """Exact sum of integer values over the bits that are set.

    Few distinct values are counted under one mask each; many are looked up a byte at a
    time.
    """

    def __init__(self, values: NDArray[np.int64]) -> None:
        n = values.size
        distinct = np.unique(values[values != 0])
        self._masks = None
        if distinct.size <= _FEW_VALUES:
            self._values = distinct.astype(np.int64)
            self._masks = pack_rows(values == distinct[:, None])
            return
        padded = np.zeros((words_for(n) * 8, 8), dtype=np.int64)
        padded.reshape(-1)[:n] = values
        bits = np.unpackbits(np.arange(256, dtype=np.uint8)[:, None], axis=1)
        self._table = (padded @ bits.T.astype(np.int64)).ravel()
        self._offsets = np.arange(padded.shape[0], dtype=np.intp) * 256

    @property
    def units(self) -> float:
        """Work that a word costs."""
        return 28.0 if self._masks is None else 2.0 * max(1, self._values.size)

    def __call__(self, rows: NDArray[np.uint64]) -> NDArray[np.int64]:
        """Return the sum of each bit row, shape (n,)."""
        if self._masks is not None:
            total = np.zeros(len(rows), dtype=np.int64)
            for value, mask in zip(self._values, self._masks, strict=True):
                counts = np.bitwise_count(rows & mask)
                total += value * np.add.reduce(counts, axis=1, dtype=np.int64)
            return total
        total = np.empty(len(rows), dtype=np.int64)
        for part in parts(len(rows), _CHUNK):
            places = np.ascontiguousarray(rows[part]).view(np.uint8).astype(np.intp)
            places += self._offsets
            total[part] = self._table.take(places).sum(axis=1)
        return total


class BitSums:
    """Several of them, (n_sums, n), at once: numpy's calls cost more than few rows."""

    def __init__(self, values: NDArray[np.int64]) -> None:
        self._each = [BitSum(each) for each in values]
        distinct = np.unique(values[values != 0])
        self._masks = None
        if distinct.size <= _FEW_VALUES:
            self._masks = [(value, pack_rows(values == value)) for value in distinct]

    @property
    def units(self) -> float:
        """Work that a word costs."""
        return sum(each.units for each in self._each)

    def __call__(self, rows: NDArray[np.uint64]) -> NDArray[np.int64]:
        """Return the sums of each bit row, shape (n, n_sums)."""
        if self._masks is None:
            return np.stack([each(rows) for each in self._each], axis=1)
        total = np.zeros((len(rows), len(self._each)), dtype=np.int64)
        for part in parts(len(rows), _LARGE // len(self._each) + 1):
            for value, masks in self._masks:
                counts = np.bitwise_count(rows[part, None] & masks)
                total[part] += value * np.add.reduce(counts, axis=2, dtype=np.int64)
        return total
