"""Maps of open directions, widened: is any direction within an angle open?

A cell of a widened map is set where the cell or one around it is; after k rounds it
answers for all directions within k times the map's clearance. Coarser maps, widened
likewise, answer for larger angles. For half the clearance the four cells suffice that
meet in the corner nearest to a direction.
"""

import numpy as np

from geometry.arrays import Array, Ints, Mask, Words

from .cube_map import CubeMap, cube_map, located, nearest_corner

# Rounds of widening: the finest map, then the others.
_FINEST = (1, 2, 3)
_COARSER = (2, 3)


class WidenedMaps:
    """The maps of all samples, on a map of a power of two cells an edge.

    `rows` are the samples to which each cell is open, packed along the samples as
    `numpy.packbits` does, uint8, shape (cube.size, n_bytes).
    """

    def __init__(self, rows: Words, cube: CubeMap) -> None:
        made: list[Words] = [_joined(rows, cube.around_corners)]
        angles: list[float] = [cube.corner_clearance]
        cells: list[int] = [cube.n]
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
        self._first = np.cumsum([0, *(len(maps) for maps in made[:-1])])

    def open(self, directions: Array, angles: Array, samples: Ints) -> Mask:
        """Return whether samples (m,) have an open direction near to one given, (m,).

        Directions (m, 3) have any length, but 0 only if no map answers; angles (m,) say
        in [rad] how near. More may be called open than is, never less.
        """
        level = np.searchsorted(self._angles, angles)
        answer = np.ones(len(angles), dtype=bool)
        # Beyond the widest map's angle anything may be open.
        some = np.flatnonzero(level < self._angles.size)
        level, sample = level[some], samples[some]
        towards = directions.take(some, axis=0)
        cell = located(towards, self._cells[level])
        corner = np.flatnonzero(level == 0)
        cell[corner] = nearest_corner(towards[corner], int(self._cells[0]))
        byte = (self._first[level] + cell) * self._rows.shape[1] + sample // 8
        bits = self._rows.ravel().take(byte) >> (7 - sample % 8).astype(np.uint8)
        answer[some] = (bits & 1).view(np.bool_)
        return answer


def _widened(rows: Words, cube: CubeMap) -> Words:
    return _joined(rows, cube.neighbours)


def _joined(rows: Words, of: Ints) -> Words:
    """Return the union of the rows of cells (m, k), one of each m."""
    wide = rows[of[:, 0]]
    for column in of.T[1:]:
        np.bitwise_or(wide, rows[column], out=wide)
    return wide
