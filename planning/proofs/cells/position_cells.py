"""Cells of positions: a tree that `solvers.bound_count` asks.

The workspace is a shell about the centre C, cut into cells: a cell of a cube map of
directions e from C, times an interval of radii. A cell's row holds the samples that a
projector of diverging light, or a camera, anywhere inside it could serve, wherever it
looks: those in range to which one of the directions towards the cell is open, and which
no other limit forbids from all of it. The field of view is left out, which only adds
samples.
"""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from geometry.directions.cube_map import FACES, CubeMap, angle_between, middles
from geometry.directions.widened_maps import WidenedMaps
from planning.model.requirements import Workspace
from planning.scene.workspace.zone_limits import may_hold
from solvers.bit_rows import GrowingArray, parts, words_for
from solvers.cells.cell_tree import CellBatch

from .grown_tree import GrownTree
from .shell_cells import Directions, Seen, ShellCells, directions_of, seen_from

_ROUNDING = 1e-9
# Pairs of cell and sample looked at together: they stay in the second-level cache.
PAIRS = 1 << 13


class CellLimits(Protocol):
    """What else forbids a sample from everywhere in a cell."""

    def admits(
        self,
        samples: NDArray[np.int64],
        towards: NDArray[np.float64],
        nearest: NDArray[np.float64],
        psi: NDArray[np.float64],
    ) -> NDArray[np.bool_]:
        """Return which samples some place in a cell may serve, each with its cell.

        Args:
            samples: Their numbers, shape (k,).
            towards: Unit directions from them to the cell's middle, shape (k, 3).
            nearest: No place of the cell is nearer to them, in [m], shape (k,).
            psi: Angle about `towards` that holds the cell [rad], shape (k,).
        """
        ...


class PositionTree(GrownTree):
    """Cells of positions, made when they are asked for.

    Args:
        workspace: Where devices may stand; samples may lie in the shell, too.
        radius_m: Least and largest distance of devices from its centre [m].
        range_m: Least and largest distance of a sample that is served [m].
        points: Samples in [m], shape (n_rows, 3).
        maps: Directions that are open to each sample, widened; None: all are.
        finest: Level beyond which directions aren't split.
        limits: What else forbids samples; None: nothing.
    """

    def __init__(
        self,
        workspace: Workspace,
        radius_m: tuple[float, float],
        range_m: tuple[float, float],
        points: NDArray[np.float64],
        maps: WidenedMaps | None,
        *,
        finest: int,
        limits: CellLimits | None = None,
    ) -> None:
        super().__init__(len(points))
        self._workspace, self._range = workspace, range_m
        self._points = points - np.array(workspace.centre)
        self._reach = float(np.linalg.norm(self._points, axis=1).max(initial=0.0))
        self._maps, self._finest, self._limits = maps, finest, limits
        self._cubes = [CubeMap(1 << level) for level in range(finest + 1)]
        none = np.empty(0, dtype=np.int64)
        zero = np.empty(0)
        self._level, self._cell = GrowingArray(none), GrowingArray(none)
        self._low, self._high = GrowingArray(zero), GrowingArray(zero)
        low, high = radius_m
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

    def spread_cells(self) -> tuple[NDArray[np.int64], NDArray[np.uint64]]:
        """Return the cells made so far that aren't split, and their rows."""
        split = [name for name, made in self._made.items() if made.size]
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
        finer = cells.take(four).quartered().joined(cells.take(two).halved())
        owner = np.concatenate([np.repeat(four, 4), np.repeat(two, 2)])
        order = np.argsort(owner, kind="stable")
        owner = owner[order]
        every = finer.take(order)
        given = self._rows.values[names[owner]]
        may = np.unpackbits(given.view(np.uint8), axis=1, count=self.n_rows)
        found = self._append(every, may.view(np.bool_))
        starts = np.searchsorted(owner, np.arange(names.size + 1))
        for k, name in enumerate(names):
            self._made[int(name)] = found[starts[k] : starts[k + 1]]

    def _append(self, cells: ShellCells, may: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Keep cells, with the samples of those given that each may serve."""
        first = self._level.size
        served = np.zeros((len(may), words_for(self.n_rows) * 64), dtype=bool)
        at, rows = np.nonzero(may & self._admissible(cells)[:, None])
        for part in parts(at.size, PAIRS):
            own, row = at[part], rows[part]
            kept = self._served(cells, own, row)
            served[own[kept], row[kept]] = True
        self._level.append(cells.level)
        self._cell.append(cells.cell)
        self._low.append(cells.low_m)
        self._high.append(cells.high_m)
        self._rows.append(np.packbits(served, axis=1).view(np.uint64))
        return np.arange(first, first + len(may))

    def rows_of(self, names: NDArray[np.int64]) -> NDArray[np.uint64]:
        """Return the bit rows of cells, by their names."""
        return self._rows.values[names]

    def widths(self, names: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return about how wide cells look from the centre [rad], shape (n,)."""
        cells = self.cells(names)
        side = cells.high_m * self._directions(cells).radii
        deep = 0.5 * (cells.high_m - cells.low_m) * self._reach / cells.low_m
        return (side + deep) / cells.low_m

    def seen_from(
        self, cells: ShellCells, at: NDArray[np.int64], rows: NDArray[np.int64]
    ) -> Seen:
        """Return how samples see cells.

        Args:
            cells: Some cells.
            at: Position of each pair's cell among them, shape (k,).
            rows: Number of each pair's sample, shape (k,).
        """
        return seen_from(cells, self._directions(cells), at, self._points[rows])

    def _directions(self, cells: ShellCells) -> Directions:
        return directions_of(self._cubes, cells.level, cells.cell)

    def _served(
        self, cells: ShellCells, at: NDArray[np.int64], rows: NDArray[np.int64]
    ) -> NDArray[np.int64]:
        """Return the pairs of cell and sample that a device in the cell may serve."""
        seen, (near, far) = self.seen_from(cells, at, rows), self._range
        ranged = seen.distance - seen.extent <= far
        some = np.flatnonzero(ranged & (seen.distance + seen.extent >= near))
        if self._limits is not None:
            own = seen.take(some)
            nearest = np.maximum(own.distance - own.extent, 0.0)
            kept = self._limits.admits(rows[some], own.towards, nearest, own.psi)
            some = some[kept]
        if self._maps is not None:
            own = seen.take(some)
            some = some[self._maps.open(own.towards, own.psi, rows[some])]
        return some

    def _admissible(self, cells: ShellCells) -> NDArray[np.bool_]:
        """Return which cells may hold a position that all limits allow, shape (n,)."""
        space = self._workspace
        own = self._directions(cells)
        outwards, angle = own.middles, own.radii
        axis, up = np.array(space.axis), np.array(space.up)
        least = np.maximum(0.0, angle_between(outwards, axis) - angle)
        kept = least <= space.half_angle + _ROUNDING
        kept &= may_hold(space, outwards, angle, cells.low_m, cells.high_m)
        if space.floor_m is not None:
            rise = np.cos(np.maximum(0.0, angle_between(outwards, up) - angle))
            highest = rise * np.where(rise > 0, cells.high_m, cells.low_m)
            kept &= highest >= space.floor_m - _ROUNDING
        return kept
