"""A tree of cells that are made when they are asked for, and kept."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solvers.bit_rows import GrowingArray, pack_rows, unpack_rows, words_for
from solvers.cells.cell_tree import CellBatch

# Work of a cell, and of each of its samples that is looked at.
_UNITS_PER_CELL, _UNITS_PER_PAIR = 6e4, 400.0


class GrownTree(ABC):
    """Keeps the cells made so far, and the bit row of each.

    Attributes:
        units: Counted work of the geometry asked so far.
    """

    def __init__(self, roots: Sequence[NDArray[Any]], n_rows: int) -> None:
        self.n_rows, self._n_roots, self.units = n_rows, len(roots[0]), 0.0
        self._made: dict[int, NDArray[np.int64]] = {}
        none = np.empty((0, words_for(n_rows)), np.uint64)
        self._rows, self._sure = GrowingArray(none), GrowingArray(none)
        self._columns = [GrowingArray(column[:0]) for column in roots]
        every = np.ones((self._n_roots, n_rows), dtype=bool)
        self._append(roots, every, ~every)

    def roots(self) -> CellBatch:
        """Return the cells that hold every pose."""
        n = self._n_roots
        return CellBatch(np.arange(n), np.full(n, -1), self._rows.values[:n])

    def children(self, cells: NDArray[np.int64], /) -> CellBatch:
        """Return the parts of each cell."""
        new = np.array([c for c in cells if int(c) not in self._made], dtype=np.int64)
        if new.size:
            self._grow(new)
        made = [self._made[int(cell)] for cell in cells]
        parents = np.repeat(np.arange(cells.size), [names.size for names in made])
        names = np.concatenate([np.empty(0, dtype=np.int64), *made])
        return CellBatch(names, parents, self._rows.values[names])

    def cells(self, names: NDArray[np.int64]) -> tuple[NDArray[Any], ...]:
        """Return where cells are, by their names."""
        return tuple(column.values[names] for column in self._columns)

    def covered(self, names: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return the samples of cells, by their names, shape (n, n_rows)."""
        return unpack_rows(self._rows.values[names], self.n_rows)

    def _grow(self, names: NDArray[np.int64]) -> None:
        """Make the parts of cells, and note them."""
        owner, columns = self._parts(names)
        order = np.argsort(owner, kind="stable")
        owner = owner[order]
        may, sure = (
            unpack_rows(rows.values[names[owner]], self.n_rows)
            for rows in (self._rows, self._sure)
        )
        made = self._append([column[order] for column in columns], may, sure)
        starts = np.searchsorted(owner, np.arange(names.size + 1))
        for k, name in enumerate(names):
            self._made[int(name)] = made[starts[k] : starts[k + 1]]

    def _append(
        self,
        columns: Sequence[NDArray[Any]],
        may: NDArray[np.bool_],
        sure: NDArray[np.bool_],
    ) -> NDArray[np.int64]:
        """Keep cells, with those of the samples of their parents that they cover."""
        first = self._rows.size
        self.units += _UNITS_PER_CELL * len(may)
        self.units += _UNITS_PER_PAIR * np.count_nonzero(may & ~sure)
        covered, sure = self._coverage(columns, may, sure)
        for column, values in zip(self._columns, columns, strict=True):
            column.append(values)
        self._rows.append(pack_rows(covered))
        self._sure.append(pack_rows(sure))
        return np.arange(first, self._rows.size)

    @abstractmethod
    def _parts(
        self, names: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], Sequence[NDArray[Any]]]:
        """Return the parts of cells: positions of their parents, and where they are."""

    @abstractmethod
    def _coverage(
        self,
        columns: Sequence[NDArray[Any]],
        may: NDArray[np.bool_],
        sure: NDArray[np.bool_],
    ) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return which samples, of those that may be covered, cells cover.

        And for which no part of the cell would be found to miss them, so that they
        aren't looked at again; `sure` are those for which that is known of the parent.
        """
