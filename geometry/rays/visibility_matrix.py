"""Which device sees which sample: a matrix of bits, made in bounded memory."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from .ray_batch import SampleSet, Source
from .rays import equal_parts
from .visibility import BLOCK, Visibility

# Pairs of device and sample that a thread takes on at a time, a byte each.
_GROUP = 1 << 19
# Rows that are unpacked at a time where a result is narrower than the matrix.
_BLOCK_BYTES = 1 << 22


@dataclass(frozen=True, eq=False)
class BitMatrix:
    """A matrix of booleans, eight to a byte along each row.

    Attributes:
        packed: Rows as `numpy.packbits` leaves them, shape (n_rows, ceil(n / 8)),
            uint8, read-only; the bits beyond the last column are zero.
        n_columns: Number of columns n.

    Raises:
        ValueError: If shape or type is wrong, or a bit beyond the last column is set.
    """

    packed: NDArray[np.uint8]
    n_columns: int

    def __post_init__(self) -> None:
        packed, n = self.packed, self.n_columns
        if packed.dtype != np.uint8 or packed.ndim != 2:
            raise ValueError(f"packed must be a 2-D uint8 array, got {packed.dtype}")
        if n < 0 or packed.shape[1] != -(-n // 8):
            raise ValueError(
                f"{n} columns take {-(-n // 8)} bytes a row, got {packed.shape[1]}"
            )
        if n % 8 and np.any(packed[:, -1] & np.uint8(0xFF >> (n % 8))):
            raise ValueError(f"bits beyond column {n - 1} must be zero")
        packed.setflags(write=False)

    @classmethod
    def pack(cls, dense: NDArray[np.bool_]) -> "BitMatrix":
        """Return a boolean matrix packed, shape (n_rows, n)."""
        return cls(np.packbits(dense, axis=1), dense.shape[1])

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return len(self.packed), self.n_columns

    @property
    def nbytes(self) -> int:
        """Bytes that the bits take."""
        return self.packed.nbytes

    def row(self, index: int) -> NDArray[np.bool_]:
        """Return one row, shape (n_columns,)."""
        return self.rows(np.array([index]))[0]

    def rows(self, chosen: NDArray[np.int64] | slice) -> NDArray[np.bool_]:
        """Return some rows, shape (k, n_columns)."""
        bits = np.unpackbits(self.packed[chosen], axis=1, count=self.n_columns)
        return bits.view(np.bool_)

    def column(self, index: int) -> NDArray[np.bool_]:
        """Return one column, shape (n_rows,)."""
        if not -self.n_columns <= index < self.n_columns:
            raise IndexError(f"column {index} of {self.n_columns}")
        index %= self.n_columns
        return (self.packed[:, index // 8] >> np.uint8(7 - index % 8) & 1).astype(bool)

    def columns(self, chosen: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return some columns, shape (n_rows, k)."""
        wanted = np.arange(self.n_columns)[chosen]
        shift = (7 - wanted % 8).astype(np.uint8)
        return (self.packed[:, wanted // 8] >> shift & 1).astype(bool)

    def count(self) -> int:
        """Return how many bits are set."""
        return int(self.row_counts().sum())

    def row_counts(self) -> NDArray[np.int64]:
        """Return how many bits are set in each row, shape (n_rows,)."""
        return np.bitwise_count(self.packed).sum(axis=1, dtype=np.int64)

    def dense(self) -> NDArray[np.bool_]:
        """Return the matrix as booleans, a byte each."""
        return self.rows(slice(None))

    def dense_transposed(self) -> NDArray[np.bool_]:
        """Return the transposed matrix as booleans, a byte each, in C order."""
        return np.ascontiguousarray(self.dense().T)

    def sparse(self) -> csr_array:
        """Return the matrix as sparse booleans, made in blocks of rows."""
        found = [np.nonzero(self.rows(block))[1] for block in self._blocks()]
        columns = np.concatenate([np.empty(0, dtype=np.int64), *found])
        ends = np.concatenate([[0], np.cumsum(self.row_counts())])
        data = np.ones(len(columns), dtype=bool)
        return csr_array((data, columns, ends), shape=self.shape)

    def _blocks(self) -> Iterator[slice]:
        step = max(1, _BLOCK_BYTES // max(1, self.n_columns))
        for begin in range(0, len(self.packed), step):
            yield slice(begin, begin + step)


def visibility_matrix(
    visibility: Visibility,
    origins: NDArray[np.float64],
    points: NDArray[np.float64] | SampleSet,
    normals: NDArray[np.float64] | None = None,
    *,
    along: NDArray[np.float64] | None = None,
    candidates: NDArray[np.bool_] | BitMatrix | None = None,
) -> BitMatrix:
    """Return which device (row) sees which sample (column).

    A bit is set where the pair is a candidate and the segment between them is free. A
    sample that faces away is no candidate: it has ``N . (P - O) >= 0``, or ``N . L >=
    0`` in parallel light. Limits beyond that are the caller's, through `candidates`.

    Devices are shared among the threads. Beside the answer (n_devices * n / 8 bytes)
    and the prepared samples (40 n bytes), a thread holds 3 MB of rays and a byte for
    each of half a million pairs, or of one row, however many devices there are.

    Args:
        visibility: The occluder.
        origins: Optical centres in [m], shape (m, 3); in parallel light, a point of the
            plane that each beam leaves.
        points: Samples on the mesh in [m], shape (n, 3), or a prepared set.
        normals: Unit normals of the samples' faces, (n, 3); None with a set.
        along: Unit directions of parallel light, shape (m, 3); None for centres.
        candidates: Pairs worth a ray, shape (m, n); default all.

    Raises:
        ValueError: If shapes disagree or a number isn't finite.
    """
    if isinstance(points, SampleSet):
        samples = points
    elif normals is None:
        raise ValueError("points need the normals of their faces")
    else:
        samples = visibility.samples(points, normals)
    origins = np.asarray(origins, dtype=np.float64)
    shape = (len(origins), len(samples))
    if origins.ndim != 2 or (along is not None and np.shape(along) != origins.shape):
        raise ValueError(f"origins and along must be (m, 3), got {origins.shape}")
    if candidates is not None and candidates.shape != shape:
        raise ValueError(f"candidates must be {shape}, got {candidates.shape}")
    sources = [
        visibility.source(origin, None if along is None else along[index])
        for index, origin in enumerate(origins)
    ]
    packed = np.empty((len(origins), -(-len(samples) // 8)), dtype=np.uint8)

    def trace(rows: slice) -> None:
        seen = np.zeros((rows.stop - rows.start, len(samples)), dtype=bool)
        own = None if candidates is None else _Candidates(candidates, rows, samples)
        _trace(visibility, samples, sources[rows], own, seen)
        packed[rows] = np.packbits(seen, axis=1)

    most = max(1, _GROUP // max(1, len(samples)))
    caster = visibility.caster
    caster.share(trace, equal_parts(len(origins), most, caster.threads))
    return BitMatrix(packed, len(samples))


class _Candidates:
    """Rows of the candidates, in the order of the samples."""

    def __init__(
        self,
        every: NDArray[np.bool_] | BitMatrix,
        rows: slice,
        samples: SampleSet,
    ) -> None:
        self._rows = every.rows(rows) if isinstance(every, BitMatrix) else every[rows]
        self._order = samples.order

    def of(self, row: int, part: slice) -> NDArray[np.bool_]:
        """Return whether each sample of a part is worth a ray."""
        row_of = self._rows[row]
        return row_of[part] if self._order is None else row_of.take(self._order[part])


def _trace(
    visibility: Visibility,
    samples: SampleSet,
    sources: list[Source],
    candidates: _Candidates | None,
    seen: NDArray[np.bool_],
) -> None:
    """Set what some devices see, in the caller's order; `seen` is all false before."""
    batch = visibility.batch()
    waiting: list[tuple[int, NDArray[np.int64]]] = []

    def settle() -> None:
        clear, begin = batch.clear(), 0
        for row, places in waiting:
            # One index of one dimension: numpy's quick way to scatter.
            seen[row][places] = clear[begin : begin + len(places)]
            begin += len(places)
        waiting.clear()

    order = samples.order
    parts = equal_parts(len(samples), BLOCK)
    for row, source in enumerate(sources):
        for part in parts:
            if batch.room < part.stop - part.start:
                settle()
            wanted = None if candidates is None else candidates.of(row, part)
            rays = batch.add_facing(samples, part, source, wanted)
            places = rays + part.start if order is None else order[part].take(rays)
            waiting.append((row, places))
    settle()
