"""Cells of positions times cells of aims: where the field of view binds, it counts.

A camera in a cell of positions that looks along an axis a sees sample P only if P lies
in the cone about a that holds its image (`image_cone`), of half angle beta, however it
is rolled. With the axis in a cell of directions, within omega of its middle a_c, and
the cell of positions within psi of direction u_c from P::

    angle(a_c, -u_c) <= beta + omega + psi

A cell starts with every aim. Its aims or its positions are cut, whichever leave more of
that angle open. A cell's row holds what its cell of positions does, if that passes.
"""

import numpy as np
from numpy.typing import NDArray

from geometry.directions.cube_map import FACES, CubeMap, quarters
from solvers.bit_rows import GrowingArray, pack_rows, parts, unpack_rows
from solvers.cells.cell_tree import CellBatch

from .grown_tree import GrownTree
from .position_cells import PAIRS, PositionTree
from .shell_cells import directions_of

_ROUNDING = 1e-9
_EVERY = -1


class AimTree(GrownTree):
    """Cells of positions and aims, made when they are asked for.

    Args:
        positions: Cells of positions.
        half_angle: beta [rad].
        finest: Level beyond which aims aren't split.
    """

    def __init__(
        self, positions: PositionTree, half_angle: float, *, finest: int
    ) -> None:
        super().__init__(positions.n_rows)
        self.positions, self._beta, self._finest = positions, half_angle, finest
        self._cubes = [CubeMap(1 << level) for level in range(finest + 1)]
        none = np.empty(0, dtype=np.int64)
        self._place, self._level = GrowingArray(none), GrowingArray(none)
        self._aim = GrowingArray(none)
        batch = positions.roots()
        every = np.full(batch.cells.size, _EVERY)
        self._roots = self._append(batch.cells, every, 0 * every, batch.rows)

    def roots(self) -> CellBatch:
        """Return the roots of the positions, with every aim."""
        rows = self._rows.values[self._roots]
        return CellBatch(self._roots, np.full(self._roots.size, -1), rows)

    def cells(
        self, names: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        """Return the cell of positions of each, and level and number of its aims.

        Level -1 holds every aim.
        """
        return (
            self._place.values[names],
            self._level.values[names],
            self._aim.values[names],
        )

    def _split(self, names: NDArray[np.int64]) -> None:
        names = np.unique(names)
        place, level, _ = self.cells(names)
        turning = (self._open_by_aim(level) > self.positions.widths(place)) & (
            level < self._finest
        )
        moved = self._moved(names[~turning])
        # What can't be cut by position any more may still be by aim.
        whole = np.setdiff1d(names[~turning], moved[0])
        more = self._level.values[whole] < self._finest
        turned = self._turned(np.concatenate([names[turning], whole[more]]))
        owner, place, level, aim = (
            np.concatenate(both) for both in zip(moved, turned, strict=True)
        )
        order = np.argsort(owner, kind="stable")
        owner, place = owner[order], place[order]
        given = self._rows.values[owner] & self.positions.rows_of(place)
        found = self._append(place, level[order], aim[order], given)
        starts = np.searchsorted(owner, names)
        ends = np.searchsorted(owner, names, side="right")
        for name, start, end in zip(names, starts, ends, strict=True):
            self._made[int(name)] = found[start:end]

    def _moved(self, names: NDArray[np.int64]) -> tuple[NDArray[np.int64], ...]:
        """Return cells cut by position: whose they are, position, level and aim."""
        place, level, aim = self.cells(names)
        own, back = np.unique(place, return_inverse=True)
        batch = self.positions.children(own)
        starts = np.searchsorted(batch.parents, np.arange(own.size + 1))
        number = np.diff(starts)[back]
        of = np.repeat(np.arange(names.size), number)
        within = np.arange(of.size) - np.repeat(np.cumsum(number) - number, number)
        return names[of], batch.cells[starts[back][of] + within], level[of], aim[of]

    def _turned(self, names: NDArray[np.int64]) -> tuple[NDArray[np.int64], ...]:
        """Return cells cut by aim, likewise."""
        _, level, aim = self.cells(names)
        every = level == _EVERY
        faces = np.tile(np.arange(FACES), np.count_nonzero(every))
        owner = np.concatenate(
            [np.repeat(names[every], FACES), np.repeat(names[~every], 4)]
        )
        aims = np.concatenate([faces, quarters(level[~every], aim[~every]).ravel()])
        place, level, _ = self.cells(owner)
        return owner, place, level + 1, aims

    def _open_by_aim(self, level: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return omega of cells of a level; of those with every aim, pi."""
        widths = np.array([cube.radii.max() for cube in self._cubes] + [np.pi])
        return widths[level]

    def _append(
        self,
        place: NDArray[np.int64],
        level: NDArray[np.int64],
        aim: NDArray[np.int64],
        given: NDArray[np.uint64],
    ) -> NDArray[np.int64]:
        """Keep cells, with the samples of those given that may be in the image."""
        first = self._level.size
        served = unpack_rows(given, self.n_rows)
        at, rows = np.nonzero(served & (level != _EVERY)[:, None])
        # Of cells with every aim nothing is asked.
        aims = directions_of(self._cubes, np.maximum(level, 0), aim)
        cells = self.positions.cells(place)
        for part in parts(at.size, PAIRS):
            own, row = at[part], rows[part]
            seen = self.positions.seen_from(cells, own, row)
            cosine = -np.einsum("ij,ij->i", aims.middles[own], seen.towards)
            reach = self._beta + aims.radii[own] + seen.psi + _ROUNDING
            served[own, row] = cosine >= np.cos(np.minimum(reach, np.pi)) - _ROUNDING
        self._place.append(place)
        self._level.append(level)
        self._aim.append(aim)
        self._rows.append(pack_rows(served))
        return np.arange(first, first + place.size)
