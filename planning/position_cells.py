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

from geometry.cube_map import FACES, CubeMap, angle_between, middles
from geometry.lengths import lengths
from geometry.widened_maps import WidenedMaps
from solvers.bit_rows import GrowingArray, parts, words_for
from solvers.cells import CellBatch

from .requirements import Workspace
from .shell_cells import ShellCells, halved, joined, quartered
from .zone_limits import may_hold

_ROUNDING = 1e-9
# Pairs of cell and sample that are looked at at a time: they stay in the cache.
_PAIRS = 1 << 13


@dataclass(frozen=True, eq=False)
class _Places:
    """Where cells are, relative to the centre of the workspace.

    Attributes:
        outwards: Direction of their middles, shape (n, 3).
        middle: Their middles in [m], shape (n, 3).
        half: Half their interval of radii [m], shape (n,).
        side: Farthest that a position is from the interval's middle line [m], (n,).
    """

    outwards: NDArray[np.float64]
    middle: NDArray[np.float64]
    half: NDArray[np.float64]
    side: NDArray[np.float64]

    def take(self, some: NDArray[np.int64]) -> "_Places":
        """Return some of them, the same one several times if need be."""
        return _Places(
            self.outwards.take(some, axis=0),
            self.middle.take(some, axis=0),
            self.half.take(some),
            self.side.take(some),
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
        own = [self._made[int(cell)] for cell in cells]
        parents = np.repeat(np.arange(cells.size), [part.size for part in own])
        names = np.concatenate([np.empty(0, dtype=np.int64), *own])
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
        made = quartered(cells.take(four)), halved(cells.take(two))
        owner = np.concatenate([np.repeat(four, 4), np.repeat(two, 2)])
        order = np.argsort(owner, kind="stable")
        owner = owner[order]
        every = joined(*made).take(order)
        given = self._rows.values[names[owner]]
        may = np.unpackbits(given.view(np.uint8), axis=1, count=self.n_rows)
        found = self._append(every, may.view(np.bool_))
        starts = np.searchsorted(owner, np.arange(names.size + 1))
        for k, name in enumerate(names):
            self._made[int(name)] = found[starts[k] : starts[k + 1]]

    def _append(self, cells: ShellCells, may: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Keep cells, with the samples of those given that each may light."""
        first, n_cells = self._level.size, len(may)
        places, angle = self._places(cells)
        may = may & self._admissible(cells, places.outwards, angle)[:, None]
        pairs = np.flatnonzero(may)
        width = words_for(self.n_rows) * 64
        served = np.zeros(n_cells * width, dtype=bool)
        for part in parts(pairs.size, _PAIRS):
            own, rows = np.divmod(pairs[part], self.n_rows)
            served[own * width + rows] = self._served(places.take(own), rows)
        self._level.append(cells.level)
        self._cell.append(cells.cell)
        self._low.append(cells.low_m)
        self._high.append(cells.high_m)
        packed = np.packbits(served).reshape(n_cells, width // 8)
        self._rows.append(packed.view(np.uint64))
        return np.arange(first, first + n_cells)

    def _places(self, cells: ShellCells) -> tuple["_Places", NDArray[np.float64]]:
        """Return where cells are, and the angle about their middles' directions."""
        outwards, angle = np.empty((cells.level.size, 3)), np.empty(cells.level.size)
        for level in np.unique(cells.level):
            some, cube = cells.level == level, self._cubes[level]
            outwards[some] = cube.centres[cells.cell[some]]
            angle[some] = cube.radii[cells.cell[some]]
        low, high = cells.low_m, cells.high_m
        middle, side = 0.5 * (low + high), 2.0 * high * np.sin(0.5 * angle)
        return _Places(
            outwards, middle[:, None] * outwards, 0.5 * (high - low), side
        ), angle

    def _served(self, places: "_Places", rows: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return whether a projector in each cell may light the sample beside it."""
        towards = places.middle - self._points.take(rows, axis=0)
        distance = lengths(towards)
        extent = places.half + places.side + _ROUNDING
        near, far = self._range
        served = (distance - extent <= far) & (distance + extent >= near)
        psi = _spread(towards, distance, places.outwards, places.half, places.side)
        # A sample in the middle of a cell has no direction, and psi is pi there.
        some = np.flatnonzero(served)
        served[some] = self._maps.open(
            towards.take(some, axis=0), psi.take(some), rows.take(some)
        )
        return served

    def _admissible(
        self,
        cells: ShellCells,
        outwards: NDArray[np.float64],
        angle: NDArray[np.float64],
    ) -> NDArray[np.bool_]:
        """Return which cells may hold a position that all limits allow."""
        space, low, high = self._workspace, cells.low_m, cells.high_m
        axis, up = np.array(space.axis), np.array(space.up)
        least = np.maximum(0.0, angle_between(outwards, axis) - angle)
        allowed = least <= space.half_angle + _ROUNDING
        allowed &= may_hold(space, outwards, angle, low, high)
        if space.floor_m is not None:
            rise = np.cos(np.maximum(0.0, angle_between(outwards, up) - angle))
            highest = rise * np.where(rise > 0, high, low)
            allowed &= highest >= space.floor_m - _ROUNDING
        return allowed


def _spread(
    towards: NDArray[np.float64],
    distance: NDArray[np.float64],
    outwards: NDArray[np.float64],
    half: NDArray[np.float64] | float,
    side: NDArray[np.float64] | float,
) -> NDArray[np.float64]:
    """Return psi of one cell, or of a cell each, for samples, shape (n,)."""
    x, y, z = (towards * outwards).T
    along = x + y + z
    across = np.sqrt(np.maximum(distance**2 - along**2, 0.0))
    # The end of the interval that lies nearer turns by more.
    turn = np.arctan2(half * across, distance**2 - half * np.abs(along))
    nearest = distance - half
    reached = nearest > side
    share = side / np.where(reached, nearest, 1.0)
    psi = turn + np.arcsin(np.where(reached, share, 0.0)) + _ROUNDING
    return np.where(reached, psi, np.pi)
