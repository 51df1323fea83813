"""A tree of cells that are made when they are asked for."""

import numpy as np
from numpy.typing import NDArray

from solvers.bit_rows import GrowingArray, words_for
from solvers.cells.cell_tree import CellBatch


class GrownTree:
    """Keeps the cells made so far, and the bit row of each.

    Args:
        n_rows: Number of samples.
    """

    def __init__(self, n_rows: int) -> None:
        self.n_rows = n_rows
        self._made: dict[int, NDArray[np.int64]] = {}
        self._rows = GrowingArray(np.empty((0, words_for(n_rows)), np.uint64))

    def children(self, cells: NDArray[np.int64], /) -> CellBatch:
        """Return the parts of each cell."""
        new = np.array([c for c in cells if int(c) not in self._made], dtype=np.int64)
        if new.size:
            self._split(new)
        made = [self._made[int(cell)] for cell in cells]
        parents = np.repeat(np.arange(cells.size), [part.size for part in made])
        names = np.concatenate([np.empty(0, dtype=np.int64), *made])
        return CellBatch(names, parents, self._rows.values[names])

    def _split(self, names: NDArray[np.int64]) -> None:
        """Make the parts of cells, and note them."""
        raise NotImplementedError
