"""Maps of open directions, widened: is any direction within an angle open?

A cell of a widened map is set where the cell or one around it is; after k rounds it
answers for all directions within k times the map's clearance. Coarser maps, widened
likewise, answer for larger angles. Of a cone that is no wider than a cell of the finest
map those that it meets are looked at, four at most, unless it leaves its face.
"""

import numpy as np

from geometry.arrays import Array, Ints, Mask, Words, by_column

from .cube_map import FACES, CubeMap, cells_within, cube_map, located

# Rounds of widening: the finest map, then the others.
_FINEST = (1, 2, 3)
_COARSER = (2, 3)


class WidenedMaps:
    """The maps of all samples, on a map of a power of two cells an edge.

    `rows` are the samples to which each cell is open, packed along the samples as
    `numpy.packbits` does, uint8, shape (cube.size, n_bytes).
    """

    def __init__(self, rows: Words, cube: CubeMap) -> None:
        made: list[Words] = [rows]
        angles: list[float] = []
        cells: list[int] = []
        rounds = _FINEST
        while True:
            wide = rows
            for k in range(1, max(rounds) + 1):
                wide = _widened(wide, cube)
                if k in rounds:
                    made.append(wide)
                    angles.append(k * cube.clearance)
                    cells.append(cube.n)
            if cube.n <= 2:
                break
            rows, cube, rounds = cube.halved(rows), cube_map(cube.n // 2), _COARSER
        self._angles, self._cells = np.array(angles), np.array(cells)
        # All maps one below the other, so that one look answers from all of them.
        self._rows = np.concatenate(made).view(np.uint8)
        self._first = np.cumsum([len(maps) for maps in made[:-1]])

    def places(self, directions: Array, angles: Array) -> Ints:
        """Return where any maps of as many cells answer for directions, (m,).

        Directions (m, 3) have any length, but 0 only if no map answers; angles (m,) say
        in [rad] how near. Beyond the widest map's angle anything may be open: -1.
        """
        level = np.searchsorted(self._angles, angles)
        some = np.flatnonzero(level < self._angles.size)
        places, level = np.full(len(angles), -1), level[some]
        cells = located(by_column(directions, some), self._cells[level])
        places[some] = self._first[level] + cells
        return places

    def open(
        self, directions: Array, angles: Array, samples: Ints, places: Ints
    ) -> Mask:
        """Return whether samples (m,) have an open direction near to one given, (m,).

        Directions and angles are those of `places`. More may be called open than is,
        never less.
        """
        answer = self._bits(places, samples) | (places < 0)
        # What may yet be closed by a closer look: where its own cell is.
        near = (places >= 0) & (places < self._first[1])
        small = np.flatnonzero(answer & near)
        own = places[small] - self._first[0]
        small = small[~self._bits(own, samples[small])]
        if small.size:
            four, do = cells_within(
                by_column(directions, small), angles[small], int(self._cells[0])
            )
            small, four = small[do], four[do]
            answer[small] = False
            for cells in four.T:
                answer[small] |= self._bits(cells, samples[small])
        return answer

    def _bits(self, cells: Ints, samples: Ints) -> Mask:
        """Return the bit of each pair of row and sample, (m,)."""
        byte = cells * self._rows.shape[1] + (samples >> 3)
        bits = self._rows.ravel().take(byte) >> (~samples & 7).astype(np.uint8)
        return (bits & 1).view(np.bool_)


def _widened(rows: Words, cube: CubeMap) -> Words:
    """Return the union of the rows of each cell and those around it."""
    within = rows.reshape(FACES, cube.n, cube.n, -1)
    across = within.copy()
    across[:, :, 1:] |= within[:, :, :-1]
    across[:, :, :-1] |= within[:, :, 1:]
    wide = across.copy()
    wide[:, 1:] |= across[:, :-1]
    wide[:, :-1] |= across[:, 1:]
    wide = wide.reshape(rows.shape)
    border, around = cube.around_border
    wide[border] = np.bitwise_or.reduce(rows[around], axis=1)
    return wide
