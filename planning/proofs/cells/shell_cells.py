"""Cells of a shell about a centre: a cell of a cube map, times an interval of radii.

Seen from a sample P, all of a cell lies within an angle psi of its middle M = C + r e.
Every position of it is within rho = 2 r_far sin(a / 2) of the segment M -+ h e, a the
angle about e, h half the interval, so::

    psi = max angle(M - P, M -+ h e - P) + asin(rho / (|M - P| - h))
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import by_column, dot, lengths
from geometry.directions.cube_map import quarters

_ROUNDING = 1e-9
# Unit middles of cells (n, 3), and the angle about each that holds it [rad], (n,).
Facing = tuple[NDArray[np.float64], NDArray[np.float64]]


class ShellCells(NamedTuple):
    """Cells of a shell.

    Attributes:
        level: Cube map of 2^level cells an edge, shape (n,).
        cell: Cell of it, shape (n,).
        low_m: Least radius [m], shape (n,).
        high_m: Largest radius [m], shape (n,).
    """

    level: NDArray[np.int64]
    cell: NDArray[np.int64]
    low_m: NDArray[np.float64]
    high_m: NDArray[np.float64]

    def take(self, chosen: NDArray[np.int64]) -> "ShellCells":
        """Return the chosen cells."""
        columns: list[Any] = [column[chosen] for column in self]
        return ShellCells(*columns)

    def quartered(self) -> "ShellCells":
        """Return the four parts of each cell's directions."""
        four = self.take(np.repeat(np.arange(self.cell.size), 4))
        cell = quarters(self.level, self.cell).ravel()
        return four._replace(level=four.level + 1, cell=cell)

    def halved(self) -> "ShellCells":
        """Return the inner and the outer half of each cell."""
        two = self.take(np.repeat(np.arange(self.cell.size), 2))
        outer = np.arange(two.cell.size) % 2 == 1
        middle = 0.5 * (two.low_m + two.high_m)
        return two._replace(
            low_m=np.where(outer, middle, two.low_m),
            high_m=np.where(outer, two.high_m, middle),
        )


class Seen(NamedTuple):
    """Cells as samples see them, a pair each.

    Attributes:
        towards: Unit directions to the cell's middle, shape (k, 3).
        distance: Of the middle in [m], shape (k,).
        extent: By how much places of the cell may be nearer or farther [m], (k,).
        psi: Angle about `towards` that holds the cell [rad], shape (k,).
    """

    towards: NDArray[np.float64]
    distance: NDArray[np.float64]
    extent: NDArray[np.float64]
    psi: NDArray[np.float64]

    def take(self, chosen: NDArray[np.int64]) -> "Seen":
        """Return the chosen pairs."""
        towards, *others = self
        return Seen(by_column(towards, chosen), *(each[chosen] for each in others))


def seen_from(
    cells: ShellCells,
    directions: Facing,
    at: NDArray[np.int64],
    points: NDArray[np.float64],
) -> Seen:
    """Return how points see cells.

    `at` is the position of each pair's cell among the cells, (k,); points are relative
    to the centre in [m], (k, 3).
    """
    half = 0.5 * (cells.high_m - cells.low_m)
    outwards, radii = directions
    side = 2.0 * cells.high_m * np.sin(0.5 * radii)
    middle = 0.5 * (cells.low_m + cells.high_m)[:, None] * outwards
    towards = by_column(middle, at) - points
    distance = lengths(towards)
    psi = spread(towards, distance, by_column(outwards, at), half[at], side[at])
    # A point in the middle of a cell has no direction; any is open to it there.
    towards /= np.where(distance > 0.0, distance, 1.0)[:, None]
    return Seen(towards, distance, (half + side + _ROUNDING)[at], psi)


def spread(
    towards: NDArray[np.float64],
    distance: NDArray[np.float64],
    outwards: NDArray[np.float64],
    half: NDArray[np.float64] | float,
    side: NDArray[np.float64] | float,
) -> NDArray[np.float64]:
    """Return psi of a cell for each sample, shape (n,)."""
    along = dot(towards, outwards)
    across = np.sqrt(np.maximum(distance**2 - along**2, 0.0))
    # The end of the interval that lies nearer turns by more.
    turn = np.arctan2(half * across, distance**2 - half * np.abs(along))
    nearest = distance - half
    reached = nearest > side
    share = side / np.where(reached, nearest, 1.0)
    psi = turn + np.arcsin(np.where(reached, share, 0.0)) + _ROUNDING
    return np.where(reached, psi, np.pi)
