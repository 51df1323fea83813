"""Cells of positions: a tree that `solvers.bound_count` asks.

The workspace is a shell about the centre C, cut into cells: a cell of a cube map of
directions e from C, times an interval of radii. A cell's row holds the samples that a
projector of diverging light, or a camera, anywhere inside it could serve, wherever it
looks: those in range to which one of the directions towards the cell is open, and which
no other limit forbids from all of it. The field of view is left out, which only adds
samples.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import by_column
from geometry.directions.cube_map import FACES, circles, middles, widest
from geometry.directions.widened_maps import WidenedMaps
from geometry.parallel import mapped
from planning.model.requirements import Workspace
from planning.scene.workspace.admissible import may_be_admissible
from solvers.bit_rows import parts

from .cell_limits import CellLimits
from .grown_tree import GrownTree
from .lit_cells import LitCells
from .shell_cells import Facing, Seen, ShellCells, seen_from

# Pairs of cell and sample looked at together: they stay in the second-level cache.
PAIRS = 1 << 15


class PositionTree(GrownTree):
    """Cells of positions, made when they are asked for.

    Args:
        workspace: Where devices may stand; samples may lie in the shell, too.
        radius_m: Least and largest distance of devices from its centre [m].
        range_m: Least and largest distance of a sample that is served [m].
        points: Samples in [m], shape (n_rows, 3).
        maps: Directions that are open to each sample, widened; None: all are.
        finest: Level beyond which directions aren't split.
        limits: What else forbids samples.
        threads: That look at cells.
        closed: Directions that aren't open, widened: where none is near, parts of a
            cell need no look. None: all are looked at.
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
        limits: CellLimits | LitCells,
        threads: int,
        closed: WidenedMaps | None = None,
    ) -> None:
        self._workspace, self._range = workspace, range_m
        self._points = np.asfortranarray(points - np.array(workspace.centre))
        self._reach = float(np.linalg.norm(self._points, axis=1).max(initial=0.0))
        self._maps, self._closed = maps, closed
        self._finest, self._limits, self._threads = finest, limits, threads
        whole, (low, high) = np.arange(FACES), radius_m
        faces = ShellCells(0 * whole, whole, np.full(FACES, low), np.full(FACES, high))
        super().__init__(faces, len(points))

    def spread_cells(self) -> tuple[NDArray[np.int64], NDArray[np.uint64]]:
        """Return the cells made so far that aren't split, and their rows."""
        split = [name for name, made in self._made.items() if made.size]
        names = np.setdiff1d(np.arange(self._rows.size), split)
        return names, self._rows.values[names]

    def directions(self, names: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the direction of the middle of cells from the centre, shape (n, 3)."""
        cells = self.cells(names)
        return middles(cells.level, cells.cell)

    def cells(self, names: NDArray[np.int64]) -> ShellCells:
        """Return where cells are, by their names."""
        return ShellCells(*super().cells(names))

    def _parts(
        self, names: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], Sequence[NDArray[Any]]]:
        cells = self.cells(names)
        middle = 0.5 * (cells.low_m + cells.high_m)
        # How much of psi comes from the radii, and how much from the directions.
        along = 0.5 * (cells.high_m - cells.low_m) * self._reach / middle
        deep = along > cells.high_m * widest(cells.level)
        two = np.flatnonzero(deep)
        four = np.flatnonzero(~deep & (cells.level < self._finest))
        finer = cells.take(four).quartered(), cells.take(two).halved()
        owner = np.concatenate([np.repeat(four, 4), np.repeat(two, 2)])
        return owner, [np.concatenate(both) for both in zip(*finer, strict=True)]

    def _coverage(
        self,
        columns: Sequence[NDArray[Any]],
        may: NDArray[np.bool_],
        sure: NDArray[np.bool_],
    ) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        cells = ShellCells(*columns)
        facing = self.facing(cells)
        admissible = self._admissible(cells, facing)[:, None]
        sure = sure & admissible
        covered = sure.copy()
        # Numpy finds what isn't zero in one dimension five times as fast as in two.
        asked = np.flatnonzero(may & ~sure & admissible)

        def look(some: slice) -> None:
            pairs = asked[some]
            cell, sample = np.divmod(pairs, self.n_rows)
            seen = self.seen_from(cells, facing, cell, sample)
            passed, certain = self._passed(seen, sample)
            covered.reshape(-1)[pairs[passed]] = True
            sure.reshape(-1)[pairs[passed[certain]]] = True

        mapped(look, parts(asked.size, PAIRS), self._threads)
        return covered, sure

    def widths(self, names: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return about how wide cells look from the centre [rad], shape (n,)."""
        cells = self.cells(names)
        _, radii = self.facing(cells)
        side = cells.high_m * radii
        deep = 0.5 * (cells.high_m - cells.low_m) * self._reach / cells.low_m
        return (side + deep) / cells.low_m

    def facing(self, cells: ShellCells) -> Facing:
        """Return where cells are from the centre, for `seen_from`."""
        return circles(cells.level, cells.cell)

    def seen_from(
        self,
        cells: ShellCells,
        facing: Facing,
        at: NDArray[np.int64],
        samples: NDArray[np.int64],
    ) -> Seen:
        """Return how samples see cells; `facing` is that of all of these."""
        return seen_from(cells, facing, at, by_column(self._points, samples))

    def _passed(
        self, seen: Seen, samples: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Return the pairs of cell and sample that a device in the cell may cover.

        And of which no part of the cell would be found to miss the sample, as far as
        that is known; of cameras that isn't asked.
        """
        near, far = self._range
        nearest, farthest = seen.distance - seen.extent, seen.distance + seen.extent
        pairs = np.flatnonzero((nearest <= far) & (farthest >= near))
        sure = (nearest >= near) & (farthest <= far)
        sure &= self._closed is not None and isinstance(self._limits, LitCells)
        if isinstance(self._limits, LitCells):
            view = seen.take(pairs)
            may, surely = self._limits.admitted(samples[pairs], view.towards, view.psi)
            sure[pairs] &= surely
            pairs = pairs[may]
        else:
            view = seen.take(pairs)
            least = np.maximum(nearest[pairs], 0.0)
            may = self._limits.admits(samples[pairs], view.towards, least, view.psi)
            pairs = pairs[may]
        if self._maps is None:
            return pairs, sure[pairs]
        view = seen.take(pairs)
        places = self._maps.places(view.towards, view.psi)
        passed = self._maps.open(view.towards, view.psi, samples[pairs], places)
        some = np.flatnonzero(passed & sure[pairs])
        if self._closed is not None and some.size:
            view = view.take(some)
            sure[pairs[some]] = ~self._closed.open(
                view.towards, view.psi, samples[pairs[some]], places[some]
            )
        pairs = pairs[passed]
        return pairs, sure[pairs]

    def _admissible(self, cells: ShellCells, facing: Facing) -> NDArray[np.bool_]:
        """Return which cells may hold a position that all limits allow, shape (n,)."""
        outwards, angle = facing
        low_m, high_m = cells.low_m, cells.high_m
        return may_be_admissible(self._workspace, outwards, angle, low_m, high_m)
