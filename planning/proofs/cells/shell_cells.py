"""Cells of a shell about a centre: a cell of a cube map, times an interval of radii.

Seen from a sample P, all of a cell lies within an angle psi of its middle M = C + r e.
Every position of it is within rho = 2 r_far sin(a / 2) of the segment M -+ h e, a the
angle about e, h half the interval, so::

    psi = max angle(M - P, M -+ h e - P) + asin(rho / (|M - P| - h))
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.directions.cube_map import CubeMap, quarters
from geometry.mesh.tensors import lengths

_ROUNDING = 1e-9


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

    def quartered(self) -> "ShellCells":
        """Return the four parts of each cell's directions."""
        four = self.take(np.repeat(np.arange(self.cell.size), 4))
        parts = quarters(self.level, self.cell).ravel()
        return ShellCells(four.level + 1, parts, four.low_m, four.high_m)

    def halved(self) -> "ShellCells":
        """Return the inner and the outer half of each cell."""
        two = np.repeat(np.arange(self.cell.size), 2)
        taken, outer = self.take(two), np.arange(two.size) % 2 == 1
        middle = 0.5 * (taken.low_m + taken.high_m)
        return ShellCells(
            taken.level,
            taken.cell,
            np.where(outer, middle, taken.low_m),
            np.where(outer, taken.high_m, middle),
        )

    def joined(self, more: "ShellCells") -> "ShellCells":
        """Return both as one."""
        return ShellCells(
            np.concatenate([self.level, more.level]),
            np.concatenate([self.cell, more.cell]),
            np.concatenate([self.low_m, more.low_m]),
            np.concatenate([self.high_m, more.high_m]),
        )


@dataclass(frozen=True, eq=False)
class Directions:
    """Cells of directions, of cube maps of any level.

    Attributes:
        middles: Unit directions of their middles, shape (n, 3).
        radii: Angle about them that holds the cell [rad], shape (n,).
    """

    middles: NDArray[np.float64]
    radii: NDArray[np.float64]


def directions_of(
    cubes: Sequence[CubeMap], level: NDArray[np.int64], cell: NDArray[np.int64]
) -> Directions:
    """Return cells of the cube maps of 1, 2, 4, ... cells an edge.

    Args:
        cubes: One of each level.
        level: Of each cell, shape (n,).
        cell: Its number on that map, shape (n,).
    """
    found = Directions(np.empty((cell.size, 3)), np.empty(cell.size))
    for own in np.unique(level):
        some = level == own
        found.middles[some] = cubes[own].centres[cell[some]]
        found.radii[some] = cubes[own].radii[cell[some]]
    return found


@dataclass(frozen=True, eq=False)
class Seen:
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

    def take(self, some: NDArray[np.int64]) -> "Seen":
        """Return some of the pairs."""
        return Seen(
            self.towards[some], self.distance[some], self.extent[some], self.psi[some]
        )


def seen_from(
    cells: ShellCells,
    directions: Directions,
    at: NDArray[np.int64],
    points: NDArray[np.float64],
) -> Seen:
    """Return how points see cells.

    Args:
        cells: Some cells.
        directions: Theirs.
        at: Position of each pair's cell among them, shape (k,).
        points: Of each pair, relative to the centre in [m], shape (k, 3).
    """
    half = 0.5 * (cells.high_m - cells.low_m)
    side = 2.0 * cells.high_m * np.sin(0.5 * directions.radii)
    outwards = directions.middles
    middle = 0.5 * (cells.low_m + cells.high_m)[:, None] * outwards
    towards = middle[at] - points
    distance = lengths(towards)
    psi = spread(towards, distance, outwards[at], half[at], side[at])
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
    along = np.einsum("ij,ij->i", towards, np.broadcast_to(outwards, towards.shape))
    across = np.sqrt(np.maximum(distance**2 - along**2, 0.0))
    # The end of the interval that lies nearer turns by more.
    turn = np.arctan2(half * across, distance**2 - half * np.abs(along))
    nearest = distance - half
    reached = nearest > side
    share = side / np.where(reached, nearest, 1.0)
    psi = turn + np.arcsin(np.where(reached, share, 0.0)) + _ROUNDING
    return np.where(reached, psi, np.pi)
