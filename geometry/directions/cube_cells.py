"""Which cells of a cube map segments pass through, and which of them hang together."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from geometry.arrays import Array, Ints, Mask, Words
from geometry.rays.rays import equal_parts

from .cube_map import FACES, CubeMap, face_coordinates, in_faces
from .product_signs import WORD, unpacked

# Gnomonic coordinates are exact to this; whatever comes as near as this is met.
_MARGIN = 1e-7
# Segments whose cells are listed at a time: they stay in the second-level cache.
_SEGMENTS = 1 << 14


def mark_segments(
    cube: CubeMap, starts: Array, ends: Array, owners: Ints, marks: Mask
) -> None:
    """Mark every cell that a segment, seen from the origin, passes through.

    A few cells that it misses by less than rounding are marked too, none is left out. A
    segment through the origin itself is seen as its two ends. Starts and ends (m, 3)
    are marked in the rows of their owners (m,), in place, shape (n_owners, cube.size).
    """
    flat = marks.reshape(-1)
    # Column by column: rows of three are too short for numpy's loops.
    starts, ends = (np.ascontiguousarray(each.T).T for each in (starts, ends))
    for part in equal_parts(len(starts), _SEGMENTS):
        first, second, met, face = _clipped(starts[part], ends[part])
        segment, column, low, high = _by_column(cube, first, second)
        begin = (owners[part][met] * FACES + face) * cube.n * cube.n
        begin = begin.take(segment) + column + low * cube.n
        _, cells = _spread(begin, high - low + 1, cube.n)
        flat[cells] = True


def _clipped(starts: Array, ends: Array) -> tuple[Array, Array, Ints, Ints]:
    """Return gnomonic ends, (2, m'), of segments on each face, whose and on which."""
    of_faces = [_may_meet(starts, ends, face) for face in range(FACES)]
    met = np.concatenate(of_faces)
    face = np.repeat(np.arange(FACES), [each.size for each in of_faces])
    a, b = (in_faces(vectors, met, face) for vectors in (starts, ends))
    first, second = _gnomonic(a), _gnomonic(a + (b - a))
    # Most lie on the face from end to end.
    out = np.flatnonzero(~(_on_face(a) & _on_face(b)))
    a, b = a.take(out, axis=1), b.take(out, axis=1)
    first[:, out], second[:, out] = _clipped_ends(a, b)
    kept = np.flatnonzero(~np.isnan(first[0]))
    first, second = first.take(kept, axis=1), second.take(kept, axis=1)
    return first, second, met[kept], face[kept]


def _gnomonic(vectors: Array) -> Array:
    """Return x / z and y / z of vectors in the frame of a face, (3, m) to (2, m)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return vectors[:2] / vectors[2]


def _on_face(vectors: Array) -> Mask:
    """Return which vectors, in the frame of a face, lie on it, off its edge."""
    x, y, z = vectors
    return (1.0 - _MARGIN) * z > np.maximum(np.abs(x), np.abs(y))


def _clipped_ends(a: Array, b: Array) -> tuple[Array, Array]:
    """Return gnomonic ends of what is on a face of each segment, NaN where none is."""
    low, high = np.zeros(a.shape[1]), np.ones(a.shape[1])
    for axis in (0, 1):
        for sign in (1.0, -1.0):
            # A little of the neighbouring face is kept, against rounding.
            inside = (1.0 + _MARGIN) * a[2] + sign * a[axis]
            change = (1.0 + _MARGIN) * b[2] + sign * b[axis] - inside
            with np.errstate(divide="ignore", invalid="ignore"):
                cut = -inside / change
            low = np.where(change > 0, np.maximum(low, cut), low)
            high = np.where(change < 0, np.minimum(high, cut), high)
            high = np.where((change == 0) & (inside < 0), -1.0, high)
    low[low > high + _MARGIN] = np.nan
    first, second = _gnomonic(a + low * (b - a)), _gnomonic(a + high * (b - a))
    # Where a segment passes through the origin one end has no direction.
    bad = ~np.isfinite(first).all(axis=0) & ~np.isnan(low)
    first[:, bad] = second[:, bad]
    bad = ~np.isfinite(second).all(axis=0)
    second[:, bad] = first[:, bad]
    first[:, ~np.isfinite(first).all(axis=0)] = np.nan
    return np.clip(first, -1.0, 1.0), np.clip(second, -1.0, 1.0)


def _may_meet(starts: Array, ends: Array, face: int) -> Ints:
    """Return the segments that don't lie in one of a face's four outer half spaces."""
    outside = np.zeros(len(starts), dtype=bool)
    a, b = face_coordinates(starts, face), face_coordinates(ends, face)
    az, bz = (1.0 + 2.0 * _MARGIN) * a[2], (1.0 + 2.0 * _MARGIN) * b[2]
    for axis in (0, 1):
        outside |= (az < a[axis]) & (bz < b[axis])
        outside |= (az < -a[axis]) & (bz < -b[axis])
    return np.flatnonzero(~outside)


def _by_column(cube: CubeMap, first: Array, second: Array) -> tuple[Ints, ...]:
    """Segment and column of each two that meet, and the first and last row there."""
    low, high = np.minimum(first, second), np.maximum(first, second)
    begin, end = cube.cells_at(low[0] - _MARGIN), cube.cells_at(high[0] + _MARGIN)
    step = second - first
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = step[1] / step[0]
    # Upright segments have no slope: they meet all their rows.
    upright = ~(np.abs(step[0]) > _MARGIN)
    segment, column = _spread(begin, end - begin + 1)
    x, y, slope = first[0].take(segment), first[1].take(segment), slope.take(segment)
    lowest, highest = low[1].take(segment), high[1].take(segment)
    with np.errstate(invalid="ignore"):
        left, right = (
            np.clip(y + (line - x) * slope, lowest, highest)
            for line in (
                cube.lines.take(column) - _MARGIN,
                cube.lines.take(column + 1) + _MARGIN,
            )
        )
    upright = upright.take(segment)
    bottom = np.where(upright, lowest, np.minimum(left, right))
    top = np.where(upright, highest, np.maximum(left, right))
    bottom, top = bottom - _MARGIN, top + _MARGIN
    return segment, column, cube.cells_at(bottom), cube.cells_at(top)


def _spread(begin: Ints, counts: Ints, step: int = 1) -> tuple[Ints, Ints]:
    """Return which thing each of its parts belongs to, and steps from its beginning."""
    which = np.repeat(np.arange(counts.size), counts)
    begin = begin - step * (np.cumsum(counts) - counts)
    return which, begin.take(which) + np.arange(0, step * which.size, step)


def _runs(marks: Mask, n: int) -> tuple[Ints, Ints]:
    """Return the first and last cells of runs of marks in rows of n, among them all."""
    words = _words(marks.ravel())
    first, last = _ends_of_rows(marks.size, n)
    one, across = np.uint64(1), np.uint64(WORD - 1)
    before, after = words << one, words >> one
    before[1:] |= words[:-1] >> across
    after[:-1] |= words[1:] << across
    begin, end = words & (~before | first), words & (~after | last)
    bits = (unpacked(each, WORD) for each in (begin, end))
    start, stop = (word * WORD + bit for bit, word in bits)
    return start, stop


@cache
def _ends_of_rows(size: int, n: int) -> tuple[Words, Words]:
    """Return the first and the last of each n cells, a bit each."""
    place = np.arange(size) % n
    return _words(place == 0), _words(place == n - 1)


def _words(marks: Mask) -> Words:
    """Return marks as bits, those that fill the last word up unset."""
    words = np.zeros(-(-marks.size // WORD), dtype=np.uint64)
    words.view(np.uint8)[: -(-marks.size // 8)] = np.packbits(marks, bitorder="little")
    return words


@dataclass(frozen=True, eq=False)
class Pieces:
    """Cells in runs, and runs in pieces.

    Attributes:
        shape: Of the marks.
        start: First cell of each run among all marks, increasing, shape (n_runs,).
        stop: Last cell of each run, shape (n_runs,).
        piece: Piece that each run belongs to, shape (n_runs,).
        first: First cell of each piece, shape (n_pieces,).
    """

    shape: tuple[int, ...]
    start: Ints
    stop: Ints
    piece: NDArray[np.int32]
    first: Ints

    def cells(self, wanted: Mask) -> Mask:
        """Return the cells of the pieces that are wanted, in the shape of the marks."""
        some = wanted[self.piece]
        start, stop = self.start[some], self.stop[some]
        # Where nothing is wanted, where something is, in turns.
        length = np.empty(2 * start.size + 1, dtype=np.int64)
        length[1::2] = stop - start + 1
        length[0:-1:2] = start
        length[2:-1:2] -= stop[:-1] + 1
        total = int(np.prod(self.shape))
        length[-1] = total - (stop[-1] + 1 if stop.size else 0)
        turn = np.arange(length.size) % 2 == 1
        return np.repeat(turn, length).reshape(self.shape)


def pieces(marks: Mask, n: int) -> Pieces:
    """Return the pieces of marked cells that share an edge within a face of a map.

    Marks (n_maps, 6 n n) are those of square faces of n x n. Runs of cells in a row are
    joined with the runs of the next row that they touch: there are far fewer runs than
    cells.
    """
    start, stop = _runs(marks, n)
    # Runs of the next row whose last cell isn't before, and first cell isn't behind.
    low = np.searchsorted(stop, start + n)
    high = np.searchsorted(start, stop + n, side="right")
    high = np.where(start // n % n == n - 1, low, high)
    number = high - low
    ends_of = np.cumsum(number)
    below = np.arange(number.sum()) + np.repeat(low - (ends_of - number), number)
    links = csr_array(
        (np.ones(below.size, dtype=bool), below, np.concatenate([[0], ends_of])),
        shape=(start.size, start.size),
    )
    n_pieces, piece = connected_components(links, directed=False)
    first = np.empty(n_pieces, dtype=np.int64)
    first[piece[::-1]] = start[::-1]
    return Pieces(marks.shape, start, stop, piece, first)
