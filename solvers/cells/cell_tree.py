"""A tree of cells of device poses, each with the rows that it may serve.

A cell stands for every pose in a part of the workspace: any number of devices may stand
in it. Its bit row is a superset of what any one of them serves. A child is a part of
its parent, so the parent's row holds the union of its children's; together the children
hold every pose of the parent. A cell without children can't be split.
"""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from solvers.bit_rows import check_padding, exceeds, words_for

# Bit rows of all cells together, 100,000 cells x 8,192 rows take 0.1 GB; a bound holds
# at most three times this.
MAX_BYTES = 2_000_000_000


def check_size(n_cells: int, n_rows: int) -> None:
    """Refuse bit rows that take more than ``MAX_BYTES``, before they are allocated.

    Raises:
        ValueError: With the size, the limit and what to do.
    """
    size = n_cells * words_for(n_rows) * 8
    if not size <= MAX_BYTES:
        raise ValueError(
            f"{n_cells} cells x {n_rows} rows take {size / 1e9:.1f} GB, more than the "
            f"limit of {MAX_BYTES / 1e9:.1f} GB: use fewer samples or coarser cells"
        )


@dataclass(frozen=True, eq=False)
class CellBatch:
    """Cells that a tree hands out.

    Attributes:
        cells: The tree's own names of the cells, shape (n,).
        parents: Position of each one's parent among the cells that were asked for, not
            decreasing, shape (n,); for roots all -1.
        rows: Bit rows, shape (n, n_words), as `pack_rows` makes them.
    """

    cells: NDArray[np.int64]
    parents: NDArray[np.int64]
    rows: NDArray[np.uint64]


class CellTree(Protocol):
    """What the bounds ask of a tree; geometry may make its cells when asked.

    Equal questions get equal answers. Children's rows lie within their parent's (what
    isn't so by construction is made so by intersecting), and a cell that serves
    nothing is handed out like any other, so that no pose is lost.
    """

    @property
    def n_rows(self) -> int:
        """Number of rows, that is of bits that count."""
        ...

    def roots(self) -> CellBatch:
        """Return the cells that hold every pose together."""
        ...

    def children(self, cells: NDArray[np.int64], /) -> CellBatch:
        """Return the parts of each cell; none for one that can't be split."""
        ...


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
