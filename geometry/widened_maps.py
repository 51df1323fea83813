"""Maps of open directions, widened: is any direction within an angle open?

A cell of a widened map is set where the cell or one around it is; after k rounds it
answers for all directions within k times the map's clearance. Coarser maps, widened
likewise, answer for larger angles.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .cube_map import CubeMap

# Rounds of widening: the finest map, then the others.
_FINEST = (1, 2, 3)
_COARSER = (2, 3)


@dataclass(frozen=True, eq=False)
class WidenedMap:
    """One map.

    Attributes:
        cube: Its cells.
        angle: Angle within which it answers [rad].
        rows: Samples with an open direction there, bits as `numpy.packbits` leaves
            them along the samples, shape (cube.size, n_bytes).
    """

    cube: CubeMap
    angle: float
    rows: NDArray[np.uint8]


class WidenedMaps:
    """The maps of all samples.

    Args:
        rows: Samples to which each cell is open, packed along the samples as
            `numpy.packbits` does, uint8, shape (cube.size, n_bytes).
        cube: The map, of a power of two cells an edge.
    """

    def __init__(self, rows: NDArray[np.uint64], cube: CubeMap) -> None:
        self._maps: list[WidenedMap] = []
        rounds = _FINEST
        while True:
            wide = rows
            for k in range(1, max(rounds) + 1):
                wide = _widened(wide, cube)
                if k in rounds:
                    own = wide.view(np.uint8)
                    self._maps.append(WidenedMap(cube, k * cube.clearance, own))
            if cube.n <= 2:
                break
            rows, cube, rounds = cube.halved(rows), CubeMap(cube.n // 2), _COARSER
        self._angles = np.array([m.angle for m in self._maps])

    def open(
        self,
        directions: NDArray[np.float64],
        angles: NDArray[np.float64],
        samples: NDArray[np.int64],
    ) -> NDArray[np.bool_]:
        """Return whether a sample has an open direction within an angle of one given.

        More may be called open than is, never less.

        Args:
            directions: Unit directions, shape (m, 3).
            angles: In [rad], shape (m,).
            samples: Number of each sample, shape (m,).
        """
        level = np.searchsorted(self._angles, angles)
        found = np.ones(len(angles), dtype=bool)
        counts = np.bincount(level, minlength=len(self._maps))
        for k in np.flatnonzero(counts[: len(self._maps)]):
            own = self._maps[k]
            some = np.flatnonzero(level == k)
            cell, sample = own.cube.locate(directions[some]), samples[some]
            bits = own.rows[cell, sample // 8] >> (7 - sample % 8).astype(np.uint8)
            found[some] = (bits & 1).astype(bool)
        return found


def _widened(rows: NDArray[np.uint64], cube: CubeMap) -> NDArray[np.uint64]:
    wide = rows.copy()
    for column in cube.neighbours.T:
        np.bitwise_or(wide, rows[column], out=wide)
    return wide
