"""Cells of positions for diverging light: a tree that `solvers.bound_count` asks.

The workspace is a shell about the centre C, cut into cells: a cell of a cube map of
directions e from C, times an interval of radii. A cell's row holds the samples that a
projector anywhere inside it could light, wherever it looks: those in range to which one
of the directions towards the cell is open. The field of view is left out, which only
adds samples.

Seen from a sample P, all of a cell lies within an angle psi of its middle M = C + r e.
Every position of it is within rho = 2 r_far sin(a / 2) of the segment M -+ h e, a the
angle about e, h half the interval, so::

    psi = max angle(M - P, M -+ h e - P) + asin(rho / (|M - P| - h))
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.cube_map import FACES, CubeMap, angle_between, middles, quarters
from geometry.lengths import lengths
from geometry.widened_maps import WidenedMaps
from solvers.bit_rows import GrowingArray, words_for
from solvers.cells import CellBatch

from .requirements import Workspace
from .zone_limits import may_hold

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


class PositionTree:
    """Cells of positions, made when they are asked for.

    Args:
        workspace: Where projectors may stand; samples may lie in the shell, too.
        range_m: Least and largest distance of a lit sample [m].
        points: Samples in [m], shape (n_rows, 3).
        maps: Directions that are open to each sample, widened.
        finest: Level beyond which directions aren't split.
    """

    def __init__(
        self,
        workspace: Workspace,
        range_m: tuple[float, float],
        points: NDArray[np.float64],
        maps: WidenedMaps,
        *,
        finest: int,
    ) -> None:
        self.n_rows = len(points)
        self._workspace, self._range = workspace, range_m
        self._points = points - np.array(workspace.centre)
        self._reach = float(np.linalg.norm(self._points, axis=1).max(initial=0.0))
        self._maps, self._finest = maps, finest
        self._cubes = [CubeMap(1 << level) for level in range(finest + 1)]
        self._made: dict[int, NDArray[np.int64]] = {}
        none = np.empty(0, dtype=np.int64)
        zero = np.empty(0)
        self._level, self._cell = GrowingArray(none), GrowingArray(none)
        self._low, self._high = GrowingArray(zero), GrowingArray(zero)
        self._rows = GrowingArray(np.empty((0, words_for(self.n_rows)), np.uint64))
        low, high = workspace.projector_radius_m
        cells = ShellCells(
            np.zeros(FACES, dtype=np.int64),
            np.arange(FACES),
            np.full(FACES, low),
            np.full(FACES, high),
        )
        every = np.ones((FACES, self.n_rows), dtype=bool)
        self._roots = self._append(cells, every)

    def roots(self) -> CellBatch:
        """Return the six faces, over all radii."""
        rows = self._rows.values[self._roots]
        return CellBatch(self._roots, np.full(FACES, -1), rows)

    def children(self, cells: NDArray[np.int64], /) -> CellBatch:
        """Return the four parts of each cell, or its inner and outer half."""
        new = np.array([c for c in cells if int(c) not in self._made], dtype=np.int64)
        if new.size:
            self._split(new)
        parts = [self._made[int(cell)] for cell in cells]
        parents = np.repeat(np.arange(cells.size), [part.size for part in parts])
        names = np.concatenate([np.empty(0, dtype=np.int64), *parts])
        return CellBatch(names, parents, self._rows.values[names])

    def spread_cells(self) -> tuple[NDArray[np.int64], NDArray[np.uint64]]:
        """Return the cells made so far that aren't split, and their rows."""
        split = [name for name, parts in self._made.items() if parts.size]
        names = np.setdiff1d(np.arange(self._level.size), split)
        return names, self._rows.values[names]

    def directions(self, names: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the direction of the middle of cells from the centre, shape (n, 3)."""
        cells = self.cells(names)
        return middles(cells.level, cells.cell)

    def cells(self, names: NDArray[np.int64]) -> ShellCells:
        """Return where cells are, by their names."""
        return ShellCells(
            self._level.values[names],
            self._cell.values[names],
            self._low.values[names],
            self._high.values[names],
        )

    def _split(self, names: NDArray[np.int64]) -> None:
        cells = self.cells(names)
        middle = 0.5 * (cells.low_m + cells.high_m)
        angle = np.array([self._cubes[k].radii.max() for k in cells.level])
        # How much of psi comes from the radii, and how much from the directions.
        along = 0.5 * (cells.high_m - cells.low_m) * self._reach / middle
        deep = along > cells.high_m * angle
        wide = ~deep & (cells.level < self._finest)
        four, two = np.flatnonzero(wide), np.flatnonzero(deep)
        parts = [_quartered(cells.take(four)), _halved(cells.take(two))]
        owner = np.concatenate([np.repeat(four, 4), np.repeat(two, 2)])
        order = np.argsort(owner, kind="stable")
        owner = owner[order]
        every = _joined(*parts).take(order)
        given = self._rows.values[names[owner]]
        may = np.unpackbits(given.view(np.uint8), axis=1, count=self.n_rows)
        found = self._append(every, may.view(np.bool_))
        starts = np.searchsorted(owner, np.arange(names.size + 1))
        for k, name in enumerate(names):
            self._made[int(name)] = found[starts[k] : starts[k + 1]]

    def _append(self, cells: ShellCells, may: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Keep cells, with the samples of those given that each may light."""
        first = self._level.size
        served = np.zeros((len(may), words_for(self.n_rows) * 64), dtype=bool)
        for k in range(len(may)):
            rows = np.flatnonzero(may[k])
            served[k, rows] = self._served(cells.take(np.array([k])), rows)
        self._level.append(cells.level)
        self._cell.append(cells.cell)
        self._low.append(cells.low_m)
        self._high.append(cells.high_m)
        self._rows.append(np.packbits(served, axis=1).view(np.uint64))
        return np.arange(first, first + len(may))

    def _served(self, cell: ShellCells, rows: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return which of some samples a projector in a cell may light."""
        cube = self._cubes[cell.level[0]]
        outwards, angle = cube.centres[cell.cell[0]], cube.radii[cell.cell[0]]
        low, high = cell.low_m[0], cell.high_m[0]
        if not self._admissible(outwards, angle, low, high):
            return np.zeros(rows.size, dtype=bool)
        half = 0.5 * (high - low)
        towards = 0.5 * (low + high) * outwards - self._points[rows]
        distance = lengths(towards)
        side = 2.0 * high * np.sin(0.5 * angle)
        extent = half + side + _ROUNDING
        near, far = self._range
        served = (distance - extent <= far) & (distance + extent >= near)
        psi = _spread(towards, distance, outwards, half, side)
        # A sample in the middle of a cell has no direction; any is open to it there.
        directions = towards / np.where(distance > 0.0, distance, 1.0)[:, None]
        served[served] = self._maps.open(directions[served], psi[served], rows[served])
        return served

    def _admissible(
        self,
        outwards: NDArray[np.float64],
        angle: float,
        low: float,
        high: float,
    ) -> bool:
        """Return whether a cell may hold a position that all limits allow."""
        space = self._workspace
        axis, up = np.array(space.axis), np.array(space.up)
        least = max(0.0, float(angle_between(outwards, axis)) - angle)
        if not least <= space.half_angle + _ROUNDING:
            return False
        if not may_hold(space, outwards[None], angle, low, high)[0]:
            return False
        if space.floor_m is None:
            return True
        rise = np.cos(max(0.0, float(angle_between(outwards, up)) - angle))
        return bool(rise * (high if rise > 0 else low) >= space.floor_m - _ROUNDING)


def _spread(
    towards: NDArray[np.float64],
    distance: NDArray[np.float64],
    outwards: NDArray[np.float64],
    half: float,
    side: float,
) -> NDArray[np.float64]:
    """Return psi of a cell for each sample, shape (n,)."""
    along = towards @ outwards
    across = np.sqrt(np.maximum(distance**2 - along**2, 0.0))
    # The end of the interval that lies nearer turns by more.
    turn = np.arctan2(half * across, distance**2 - half * np.abs(along))
    nearest = distance - half
    reached = nearest > side
    share = side / np.where(reached, nearest, 1.0)
    psi = turn + np.arcsin(np.where(reached, share, 0.0)) + _ROUNDING
    return np.where(reached, psi, np.pi)


def _quartered(cells: ShellCells) -> ShellCells:
    four = cells.take(np.repeat(np.arange(cells.cell.size), 4))
    parts = quarters(cells.level, cells.cell).ravel()
    return ShellCells(four.level + 1, parts, four.low_m, four.high_m)


def _halved(cells: ShellCells) -> ShellCells:
    two = np.repeat(np.arange(cells.cell.size), 2)
    taken, outer = cells.take(two), np.arange(two.size) % 2 == 1
    middle = 0.5 * (taken.low_m + taken.high_m)
    return ShellCells(
        taken.level,
        taken.cell,
        np.where(outer, middle, taken.low_m),
        np.where(outer, taken.high_m, middle),
    )


def _joined(a: ShellCells, b: ShellCells) -> ShellCells:
    return ShellCells(
        np.concatenate([a.level, b.level]),
        np.concatenate([a.cell, b.cell]),
        np.concatenate([a.low_m, b.low_m]),
        np.concatenate([a.high_m, b.high_m]),
    )
