"""The tree of cells as the tuple search walks it: halved, and trimmed by multipliers.

With M the costliest cell of the frontier, K poses that serve enough satisfy
lambda(S_k) + (K - 1) M >= need(lambda) each: cells below that hold none of them. A
coarse cell then serves at most what its remaining parts serve together. Cells with many
parts are split in halves, so that a cell used m times splits in m + 1 ways.
"""

import math

import numpy as np
from numpy.typing import NDArray

from solvers.bit_rows import BitSum, GrowingArray

from .cell_problem import WholeRows
from .cell_store import CellStore

VOID = -1
_UNKNOWN = -2


class Subtrees:
    """Groups of sibling cells, made when the search comes to them.

    Attributes:
        floor: What the cells of a tuple must cost together.
        root: The subtree of all remaining roots, `VOID` if none remain.
    """

    def __init__(
        self,
        whole: WholeRows,
        store: CellStore,
        n_poses: int,
        multipliers: NDArray[np.int64],
    ) -> None:
        self._store = store
        self._cost_sum = BitSum(multipliers)
        self._multipliers = multipliers
        costs = store.costs(np.arange(store.size), multipliers)
        largest_cost = int(costs[store.frontier].max(initial=0))
        self.floor = math.ceil(whole.least_cost(multipliers))
        self._least = self.floor - (n_poses - 1) * largest_cost
        self._kept = GrowingArray(costs >= self._least)
        self._trim()
        self._groups: list[NDArray[np.int64]] = []
        none = np.empty(0, dtype=np.int64)
        self._halves = GrowingArray(np.empty((0, 2), dtype=np.int64))
        self._coarseness, self._cost = GrowingArray(none), GrowingArray(none)
        self._bits = GrowingArray(store.rows[:0])
        self.root = self._make([self._remaining(np.arange(store.n_roots))])[0]

    @property
    def costs(self) -> NDArray[np.int64]:
        """lambda(S) of each subtree."""
        return self._cost.values

    @property
    def rows(self) -> NDArray[np.uint64]:
        """Bit row of each subtree, over what remains of it."""
        return self._bits.values

    @property
    def coarseness(self) -> NDArray[np.int64]:
        """Rank of each subtree: split the smallest first."""
        return self._coarseness.values

    def cell(self, subtree: int) -> int:
        """Return the cell that a subtree which can't be split consists of."""
        return int(self._groups[subtree][0])

    def halves(self, subtrees: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the two halves of each subtree, shape (n, 2).

        A half is `VOID` where nothing remains of it; of a subtree that can't be split
        the first half is the subtree itself.
        """
        halves = self._halves.values
        new = np.unique(subtrees[halves[subtrees, 0] == _UNKNOWN])
        single = [int(t) for t in new if self._groups[t].size == 1]
        self._ask(np.array([self.cell(t) for t in single], dtype=np.int64))
        parts: list[NDArray[np.int64]] = []
        for subtree in new:
            parts += self._parts(int(subtree))
        made = np.array(self._make(parts), dtype=np.int64).reshape(-1, 2)
        halves = self._halves.values
        halves[new] = made
        for subtree in single:
            if not self._store.is_split(self._groups[subtree])[0]:
                halves[subtree] = subtree, VOID
        return halves[subtrees]

    def _remaining(self, cells: NDArray[np.int64]) -> NDArray[np.int64]:
        return cells[self._kept.values[cells]]

    def _parts(self, subtree: int) -> list[NDArray[np.int64]]:
        group = self._groups[subtree]
        if group.size == 1:
            group = self._remaining(self._store.children(int(group[0])))
        middle = (group.size + 1) // 2
        return [group[:middle], group[middle:]]

    def _make(self, groups: list[NDArray[np.int64]]) -> list[int]:
        filled = [g for g in groups if g.size]
        first = len(self._groups)
        self._groups += filled
        numbers = iter(range(first, first + len(filled)))
        if filled:
            bits = np.stack([self._union(g) for g in filled])
            levels = self._store.levels
            # Deeper levels are finer, and among one level's groups the smaller ones.
            ranks = [(int(levels[g[0]]) << 32) - g.size for g in filled]
            self._bits.append(bits)
            self._cost.append(self._cost_sum(bits))
            self._coarseness.append(np.array(ranks))
            self._halves.append(np.full((len(filled), 2), _UNKNOWN))
        return [next(numbers) if g.size else VOID for g in groups]

    def _ask(self, cells: NDArray[np.int64]) -> None:
        new = self._store.split(cells)
        if new.size:
            costs = self._store.costs(new, self._multipliers)
            self._kept.append(costs >= self._least)

    def _union(self, group: NDArray[np.int64]) -> NDArray[np.uint64]:
        """Return what a group's cells serve, as far as they remain."""
        known = group[group < self._place.size]
        place = self._place[known]
        plain = np.concatenate([known[place < 0], group[group >= self._place.size]])
        whole = np.bitwise_or.reduce(self._store.rows[plain], axis=0)
        trimmed = self._trimmed[place[place >= 0]]
        return whole | np.bitwise_or.reduce(trimmed, axis=0)

    def _trim(self) -> None:
        """Reduce what is split to the union of its remaining parts, deepest first."""
        store, kept = self._store, self._kept.values
        split = np.flatnonzero(store.is_split(np.arange(store.size)))
        self._place = np.full(store.size, _UNKNOWN)
        self._place[split] = np.arange(split.size)
        self._trimmed = np.zeros((split.size, store.rows.shape[1]), dtype=np.uint64)
        for cell in split[::-1]:
            parts = self._remaining(store.children(int(cell)))
            kept[cell] = parts.size > 0
            self._trimmed[self._place[cell]] = self._union(parts)
