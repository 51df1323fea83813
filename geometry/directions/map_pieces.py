"""Pieces of cells that hang together on the faces of cube maps.

Cells hang together where they share an edge, within a face of a map. Runs of cells in a
row are joined with the runs of the next row that they touch: there are far fewer runs
than cells.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from geometry.arrays import Ints, Mask


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
    """Return the pieces of cells that are marked.

    Args:
        marks: Of the cells of any number of square faces of n x n, (n_maps, 6 n n).
        n: Cells along an edge of a face.
    """
    rows = np.ascontiguousarray(marks).reshape(-1, n)
    begins, ends = rows.copy(), rows.copy()
    begins[:, 1:] &= ~rows[:, :-1]
    ends[:, :-1] &= ~rows[:, 1:]
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
