"""A tree of cells that exists as arrays, checked as it is made."""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from solvers.bit_rows import check_padding, exceeds, words_for
from solvers.cells.cell_tree import CellBatch, check_size


@dataclass(frozen=True, eq=False)
class ArrayTree:
    """A tree of cells that exists as arrays; a cell's name is its position.

    Attributes:
        parents: Each cell's parent, which comes before it, or -1, shape (n_cells,).
        rows: Bit rows, shape (n_cells, n_words), as `pack_rows` makes them.
        n_rows: Number of rows.

    Raises:
        ValueError: On wrong shapes, parents that don't come first, bits past the last
            row, a parent that misses a row of a child, or more than ``MAX_BYTES``.
    """

    parents: NDArray[np.int64]
    rows: NDArray[np.uint64]
    n_rows: int
    units: ClassVar[float] = 0.0
    _order: NDArray[np.int64] = field(init=False, repr=False)
    _starts: NDArray[np.int64] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        parents = _parents(self.parents)
        check_size(parents.size, self.n_rows)
        rows = np.asarray(self.rows)
        shape = (parents.size, words_for(self.n_rows))
        if rows.dtype != np.uint64 or rows.shape != shape:
            raise ValueError(
                f"rows must be uint64 of shape {shape}, got {rows.dtype} {rows.shape}"
            )
        check_padding(rows, self.n_rows)
        below = np.flatnonzero(parents >= 0)
        bad = exceeds(rows[below], rows, parents[below])
        if bad >= 0:
            child = int(below[bad])
            raise ValueError(
                f"cell {child} serves rows that its parent {parents[child]} misses: "
                f"a parent must hold the union of its children"
            )
        order = np.argsort(parents, kind="stable").astype(np.int64)
        starts = np.searchsorted(parents[order], np.arange(-1, parents.size + 1))
        rows = rows.view()
        for name, value in (
            ("parents", parents),
            ("rows", rows),
            ("_order", order),
            ("_starts", starts.astype(np.int64)),
        ):
            value.flags.writeable = False
            object.__setattr__(self, name, value)

    def roots(self) -> CellBatch:
        """Return the cells without a parent."""
        cells = self._order[: self._starts[1]]
        return CellBatch(cells, np.full(cells.size, -1), self.rows[cells])

    def children(self, cells: NDArray[np.int64], /) -> CellBatch:
        """Return the children of each cell, in the order of the cells."""
        first, stop = self._starts[cells + 1], self._starts[cells + 2]
        number = stop - first
        of = np.repeat(np.arange(cells.size), number)
        within = np.arange(of.size) - np.repeat(np.cumsum(number) - number, number)
        found = self._order[first[of] + within]
        return CellBatch(found, of, self.rows[found])


def _parents(numbers: NDArray[np.int64]) -> NDArray[np.int64]:
    parents = np.array(numbers)
    if parents.ndim != 1 or parents.dtype.kind not in "iu":
        raise ValueError(
            f"parents must be a vector of integers, got {parents.dtype} of shape "
            f"{parents.shape}"
        )
    parents = parents.astype(np.int64)
    if not np.all((parents >= -1) & (parents < np.arange(parents.size))):
        raise ValueError("parents must come before their children; roots have -1")
    return parents
