"""Which cells of a cube map segments pass through, and which of them hang together."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from geometry.arrays import Array, Ints, Mask
from geometry.rays.rays import equal_parts

from .cube_map import FACES, CubeMap, face_coordinates

# Gnomonic coordinates are exact to this; whatever comes as near as this is met.
_MARGIN = 1e-7
# Segments whose cells are listed at a time.
_SEGMENTS = 1 << 16


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
        for face in range(FACES):
            first, second, met = _clipped(starts[part], ends[part], face)
            segment, column, low, high = _by_column(cube, first, second)
            begin = (owners[part][met[segment]] * FACES + face) * cube.n * cube.n
            which, nth = _spread(high - low + 1)
            flat[(begin + column)[which] + (low[which] + nth) * cube.n] = True


def _clipped(starts: Array, ends: Array, face: int) -> tuple[Array, Array, Ints]:
    """Return gnomonic ends, (m', 2), of the parts of segments on a face, and whose."""
    met = _may_meet(starts, ends, face)
    a, b = (
        np.stack([axis.take(met) for axis in face_coordinates(vectors, face)])
        for vectors in (starts, ends)
    )
    low, high = np.zeros(met.size), np.ones(met.size)
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
    kept = np.flatnonzero(low <= high + _MARGIN)
    a, b, met = a.take(kept, axis=1), b.take(kept, axis=1), met[kept]
    ends_met = []
    for t in (low[kept], high[kept]):
        point = a + t * (b - a)
        with np.errstate(divide="ignore", invalid="ignore"):
            ends_met.append((point[:2] / point[2]).T)
    first, second = ends_met
    # Where a segment passes through the origin one end has no direction.
    bad = ~np.isfinite(first).all(axis=1)
    first[bad] = second[bad]
    bad = ~np.isfinite(second).all(axis=1)
    second[bad] = first[bad]
    seen = np.isfinite(first).all(axis=1)
    first = np.clip(first[seen], -1.0, 1.0)
    return first, np.clip(second[seen], -1.0, 1.0), met[seen]


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
    begin, end = _index(cube, low[:, 0] - _MARGIN), _index(cube, high[:, 0] + _MARGIN)
    step = second - first
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = step[:, 1] / step[:, 0]
    segment, nth = _spread(end - begin + 1)
    column = begin[segment] + nth
    reached = []
    for x in (cube.lines[column] - _MARGIN, cube.lines[column + 1] + _MARGIN):
        with np.errstate(invalid="ignore"):
            y = first[segment, 1] + (x - first[segment, 0]) * slope[segment]
        reached.append(np.clip(y, low[segment, 1], high[segment, 1]))
    # Upright segments have no slope: they meet all their rows.
    upright = ~(np.abs(step[segment, 0]) > _MARGIN)
    bottom = np.where(upright, low[segment, 1], np.minimum(*reached))
    top = np.where(upright, high[segment, 1], np.maximum(*reached))
    return segment, column, _index(cube, bottom - _MARGIN), _index(cube, top + _MARGIN)


def _index(cube: CubeMap, steps: Array) -> Ints:
    line = np.searchsorted(cube.lines, steps, side="right") - 1
    return np.clip(line, 0, cube.n - 1)


def _spread(counts: Ints) -> tuple[Ints, Ints]:
    """Return which thing each of its parts belongs to, and its number among them."""
    which = np.repeat(np.arange(counts.size), counts)
    nth = np.arange(which.size) - np.repeat(np.cumsum(counts) - counts, counts)
    return which, nth


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
    flat = np.ascontiguousarray(marks).ravel()
    # All cells as one row first: rows are too short for numpy's loops.
    begins, ends = flat.copy(), flat.copy()
    np.greater(flat[1:], flat[:-1], out=begins[1:])
    np.greater(flat[:-1], flat[1:], out=ends[:-1])
    begins[::n] = flat[::n]
    ends[n - 1 :: n] = flat[n - 1 :: n]
    start, stop = np.flatnonzero(begins), np.flatnonzero(ends)
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
