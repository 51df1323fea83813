"""The cells that a bound has asked a tree for so far, checked as they come in."""

import numpy as np
from numpy.typing import NDArray

from solvers.bit_rows import (
    BitSum,
    GrowingArray,
    check_padding,
    exceeds,
    parts,
    words_for,
)
from solvers.status import WorkBudget

from .cell_tree import MAX_BYTES, CellBatch, CellTree, check_size

_UNASKED = -1
# Cells asked about at once, so that the limit is met before much is made.
_ASKED = 1024


class CellStore:
    """Cells in the order in which they came; children come after their parents.

    It is full once a split was refused because of ``MAX_BYTES``.
    """

    def __init__(self, tree: CellTree, budget: WorkBudget) -> None:
        self.tree = tree
        self.full = False
        self._budget = budget
        self._words = words_for(tree.n_rows)
        roots = tree.roots()
        check_size(roots.cells.size, tree.n_rows)
        none = np.empty(0, dtype=np.int64)
        self._name, self._level = GrowingArray(none), GrowingArray(none)
        self._first, self._number = GrowingArray(none), GrowingArray(none)
        self._row = GrowingArray(np.empty((0, self._words), dtype=np.uint64))
        self._append(roots, np.zeros(roots.cells.size, dtype=np.int64))
        self.n_roots = self.size

    @property
    def size(self) -> int:
        """Number of cells so far."""
        return self._name.size

    @property
    def names(self) -> NDArray[np.int64]:
        """The tree's name of each cell."""
        return self._name.values

    @property
    def levels(self) -> NDArray[np.int64]:
        """Splits between a root and each cell."""
        return self._level.values

    @property
    def rows(self) -> NDArray[np.uint64]:
        """Bit rows, shape (size, n_words)."""
        return self._row.values

    @property
    def frontier(self) -> NDArray[np.int64]:
        """Cells that aren't split yet, which hold every pose together."""
        return np.flatnonzero(self._number.values <= 0)

    def is_split(self, cells: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return which cells have children here."""
        return self._number.values[cells] > 0

    def may_split(self, cells: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return which cells the tree hasn't been asked about."""
        return self._number.values[cells] == _UNASKED

    def children(self, cell: int) -> NDArray[np.int64]:
        """Return the children that a cell has here."""
        first = self._first.values[cell]
        return np.arange(first, first + max(0, self._number.values[cell]))

    def split(self, cells: NDArray[np.int64]) -> NDArray[np.int64]:
        """Ask the tree for the children of cells; return those that came.

        Nothing comes of cells that were asked about before, or once the store is full.

        Raises:
            ValueError: If a child serves a row that its parent misses.
        """
        before = self.size
        parents = cells[self.may_split(cells)]
        for part in parts(parents.size, _ASKED):
            self._ask(parents[part])
        return np.arange(before, self.size)

    def _ask(self, parents: NDArray[np.int64]) -> None:
        if self.full:
            return
        before = self.tree.units
        batch = self.tree.children(self.names[parents])
        self._budget.spend(self.tree.units - before)
        if (self.size + batch.cells.size) * self._words * 8 > MAX_BYTES:
            self.full = True
            return
        self._check(parents, batch)
        number = np.bincount(batch.parents, minlength=parents.size)
        self._number.values[parents] = number
        self._first.values[parents] = self.size + np.cumsum(number) - number
        self._append(batch, self.levels[parents[batch.parents]] + 1)

    def costs(
        self, cells: NDArray[np.int64], multipliers: NDArray[np.int64]
    ) -> NDArray[np.int64]:
        """Return lambda(S) of each cell, exactly."""
        cost = BitSum(multipliers)
        self._budget.spend(cells.size * self._words * cost.units + 3e5)
        sums = np.empty(cells.size, dtype=np.int64)
        for part in parts(cells.size):
            sums[part] = cost(self.rows[cells[part]])
        return sums

    def _check(self, parents: NDArray[np.int64], batch: CellBatch) -> None:
        if not np.all(np.diff(batch.parents) >= 0):
            raise ValueError("children must come in the order of the cells asked for")
        bad = exceeds(batch.rows, self.rows, parents[batch.parents])
        if bad >= 0:
            parent = self.names[parents[batch.parents[bad]]]
            raise ValueError(
                f"cell {batch.cells[bad]} serves rows that its parent {parent} misses: "
                f"a parent must hold the union of its children"
            )

    def _append(self, batch: CellBatch, levels: NDArray[np.int64]) -> None:
        n = batch.cells.size
        if batch.rows.shape != (n, self._words) or batch.rows.dtype != np.uint64:
            raise ValueError(
                f"bit rows must be uint64 of shape {(n, self._words)}, got "
                f"{batch.rows.dtype} {batch.rows.shape}"
            )
        check_padding(batch.rows, self.tree.n_rows)
        self._name.append(batch.cells)
        self._level.append(levels)
        self._first.append(np.zeros(n, dtype=np.int64))
        self._number.append(np.full(n, _UNASKED))
        self._row.append(batch.rows)
        self._budget.spend(2.0 * n * self._words)
