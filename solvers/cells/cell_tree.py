"""A tree of cells of device poses, each with the rows that it may serve.

A cell stands for every pose in a part of the workspace: any number of devices may stand
in it. Its bit row is a superset of what any one of them serves. A child is a part of
its parent, so the parent's row holds the union of its children's; together the children
hold every pose of the parent. A cell without children can't be split.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from solvers.bit_rows import words_for

# Bit rows of all cells together, 100,000 cells x 8,192 rows take 0.1 GB; a bound holds
# at most three times this.
MAX_BYTES = 2_000_000_000


def check_size(n_cells: int, n_rows: int) -> None:
    """Raise ValueError on bit rows of more than ``MAX_BYTES``, yet to be allocated."""
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

    @property
    def units(self) -> float:
        """Counted work of making the cells that were handed out so far."""
        ...

    def roots(self) -> CellBatch:
        """Return the cells that hold every pose together."""
        ...

    def children(self, cells: NDArray[np.int64], /) -> CellBatch:
        """Return the parts of each cell; none for one that can't be split."""
        ...
