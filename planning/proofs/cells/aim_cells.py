"""Cells of positions times cells of aims: where the field of view binds, it counts.

A camera in a cell of positions that looks along an axis a sees sample P only if P lies
in the cone about a that holds its image (`image_cone`), of half angle beta, however it
is rolled. With the axis in a cell of directions, within omega of its middle a_c, and
the cell of positions within psi of direction u_c from P::

    angle(a_c, -u_c) <= beta + omega + psi

A cell starts with every aim. Its aims or its positions are cut, whichever leave more of
that angle open. A cell's row holds what its cell of positions does, if that passes.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.directions.cube_map import FACES, circles, quarters, widest
from solvers.bit_rows import parts

from .grown_tree import GrownTree
from .position_cells import PAIRS, PositionTree

_ROUNDING = 1e-9
_EVERY = -1


class AimTree(GrownTree):
    """Cells of positions, and level and number of their aims; level -1 holds all.

    Args:
        positions: Cells of positions.
        half_angle: beta [rad].
        finest: Level beyond which aims aren't split.
    """

    def __init__(
        self, positions: PositionTree, half_angle: float, *, finest: int
    ) -> None:
        self.positions, self._beta, self._finest = positions, half_angle, finest
        place = positions.roots().cells
        every_aim = np.full(place.size, _EVERY), 0 * place
        super().__init__((place, *every_aim), positions.n_rows)

    def _parts(
        self, names: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], Sequence[NDArray[Any]]]:
        place, level, _ = self.cells(names)
        may_turn = level < self._finest
        # Every aim, named by level -1, is open by pi.
        every = level == _EVERY
        width = np.where(every, np.pi, widest(np.where(every, 0, level)))
        turning = (width > self.positions.widths(place)) & may_turn
        moved = self._moved(names, np.flatnonzero(~turning))
        # What can't be cut by position any more may still be by aim.
        whole = ~turning & may_turn
        whole[moved[0]] = False
        turned = self._turned(names, np.flatnonzero(turning | whole))
        owner, *columns = (
            np.concatenate(both) for both in zip(moved, turned, strict=True)
        )
        return owner, columns

    def _moved(
        self, names: NDArray[np.int64], at: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], ...]:
        """Return cells cut by position: whose they are, position, level and aim."""
        place, level, aim = self.cells(names[at])
        places, back = np.unique(place, return_inverse=True)
        batch = self.positions.children(places)
        starts = np.searchsorted(batch.parents, np.arange(places.size + 1))
        number = np.diff(starts)[back]
        of = np.repeat(np.arange(at.size), number)
        within = np.arange(of.size) - np.repeat(np.cumsum(number) - number, number)
        return at[of], batch.cells[starts[back][of] + within], level[of], aim[of]

    def _turned(
        self, names: NDArray[np.int64], at: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], ...]:
        """Return cells cut by aim, likewise."""
        _, level, aim = self.cells(names[at])
        every = level == _EVERY
        faces = np.tile(np.arange(FACES), np.count_nonzero(every))
        owner = np.concatenate([np.repeat(at[every], FACES), np.repeat(at[~every], 4)])
        aims = np.concatenate([faces, quarters(level[~every], aim[~every]).ravel()])
        place, level, _ = self.cells(names[owner])
        return owner, place, level + 1, aims

    def _coverage(
        self,
        columns: Sequence[NDArray[Any]],
        may: NDArray[np.bool_],
        sure: NDArray[np.bool_],
    ) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        place, level, aim = columns
        covered = may & self.positions.covered(place)
        at, samples = np.nonzero(covered & (level != _EVERY)[:, None])
        # Of cells with every aim nothing is asked.
        middles, radii = circles(np.maximum(level, 0), aim)
        cells = self.positions.cells(place)
        facing = self.positions.facing(cells)
        for pairs in parts(at.size, PAIRS):
            cell, sample = at[pairs], samples[pairs]
            seen = self.positions.seen_from(cells, facing, cell, sample)
            cosine = -np.einsum("ij,ij->i", middles[cell], seen.towards)
            reach = self._beta + radii[cell] + seen.psi + _ROUNDING
            passed = cosine >= np.cos(np.minimum(reach, np.pi)) - _ROUNDING
            covered[cell, sample] = passed
        return covered, sure
