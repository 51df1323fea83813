"""Cells of a shell: a part of the directions from its centre, an interval of radii."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.cube_map import quarters


@dataclass(frozen=True, eq=False)
class ShellCells:
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

    def take(self, some: NDArray[np.int64] | NDArray[np.bool_]) -> "ShellCells":
        """Return some of the cells."""
        return ShellCells(
            self.level[some], self.cell[some], self.low_m[some], self.high_m[some]
        )


def quartered(cells: ShellCells) -> ShellCells:
    """Return the four parts of each cell by direction, cell by cell."""
    four = cells.take(np.repeat(np.arange(cells.cell.size), 4))
    parts = quarters(cells.level, cells.cell).ravel()
    return ShellCells(four.level + 1, parts, four.low_m, four.high_m)


def halved(cells: ShellCells) -> ShellCells:
    """Return the inner and the outer half of each cell, cell by cell."""
    two = np.repeat(np.arange(cells.cell.size), 2)
    taken, outer = cells.take(two), np.arange(two.size) % 2 == 1
    middle = 0.5 * (taken.low_m + taken.high_m)
    return ShellCells(
        taken.level,
        taken.cell,
        np.where(outer, middle, taken.low_m),
        np.where(outer, taken.high_m, middle),
    )


def joined(a: ShellCells, b: ShellCells) -> ShellCells:
    """Return both sets of cells as one."""
    return ShellCells(
        np.concatenate([a.level, b.level]),
        np.concatenate([a.cell, b.cell]),
        np.concatenate([a.low_m, b.low_m]),
        np.concatenate([a.high_m, b.high_m]),
    )
