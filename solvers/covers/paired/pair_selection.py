"""A selection that changes a set at a time, and what each set would add to it.

With n_e good pairs of the selection S over row e (a set that covers it alone counts as
one), d_je partners of set j in S, v_e sets of S that see it, a set j comes at::

    gain_j = sum_{e open} w_e [n_e + d_je + l_je > 0] [v_e + a_je >= k_e]

where l_je says that j covers e alone. Exchanging i for j takes n_e - d_ie - l_ie, which
leaves d_je less the pair of both. The weights are integers: no sum is rounded.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from solvers.bit_rows import unpack_rows
from solvers.status import WorkBudget

from .pair_rows import PairRows

# Work of a row looked at for a set.
_UNITS = 4.0


class PairSelection:
    """A selection under change.

    Attributes:
        chosen: Selected sets, in the order in which they came.
        weight: Integer-valued weight that they cover.
    """

    def __init__(
        self, cover: PairRows, chosen: Iterable[int], budget: WorkBudget
    ) -> None:
        n_r = len(cover.rows)
        self.chosen: list[int] = []
        self._cover, self._budget = cover, budget
        self._partners = np.zeros((cover.n_sets, n_r), dtype=np.int16)
        self._pairs = np.zeros(n_r, dtype=np.int32)
        self._seen = np.zeros(n_r, dtype=np.int32)
        self._kept: dict[int, NDArray[np.int8]] = {}
        for s in chosen:
            self.add(int(s))

    @property
    def covered(self) -> NDArray[np.bool_]:
        """Which rows are covered, shape (n_r,)."""
        return (self._pairs > 0) & (self._seen >= self._cover.views)

    @property
    def weight(self) -> float:
        """Integer-valued weight that the selection covers."""
        return float(self._cover.weights[self.covered].sum())

    def add(self, s: int) -> None:
        """Take a set in that isn't selected."""
        self._pairs += self._partners[s] + self._cover.loops[s]
        self._seen += self._cover.sees[s]
        self._spread(s, 1)
        self.chosen.append(s)

    def remove(self, s: int) -> None:
        """Take a selected set out."""
        self.chosen.remove(s)
        self._spread(s, -1)
        self._pairs -= self._partners[s] + self._cover.loops[s]
        self._seen -= self._cover.sees[s]

    def gains(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the weight that each set would add, and the weight it would prepare.

        A set prepares open rows that want for sets to see them, where it has a partner
        to be had. Selected sets add and prepare -1.
        """
        cover, rows = self._cover, np.flatnonzero(~self.covered)
        gains = self._closed(rows, self._pairs, self._seen, self._partners[:, rows])
        wanting = rows[self._seen[rows] < np.maximum(cover.views[rows], 2) - 1]
        prepared = self._weigh(cover.partnered[:, wanting], wanting)
        gains[self.chosen] = prepared[self.chosen] = -1.0
        return gains, prepared

    def exchanges(self, i: int) -> NDArray[np.float64]:
        """Return the weight covered with each set in the place of set i, (n_s,).

        Selected sets cover -1.
        """
        cover = self._cover
        pairs = self._pairs - self._partners[i] - cover.loops[i]
        seen = self._seen - cover.sees[i]
        kept = (pairs > 0) & (seen >= cover.views)
        rows = np.flatnonzero(~kept)
        partners = self._partners[:, rows] - self._bits(i)[:, rows]
        covered = float(cover.weights[kept].sum())
        covered = covered + self._closed(rows, pairs, seen, partners)
        covered[self.chosen] = -1.0
        return covered

    def _closed(
        self,
        rows: NDArray[np.int64],
        pairs: NDArray[np.int32],
        seen: NDArray[np.int32],
        partners: NDArray[np.int16],
    ) -> NDArray[np.float64]:
        """Return the weight of some rows that each set would cover, (n_s,)."""
        cover = self._cover
        paired = (pairs[rows] + partners + cover.loops[:, rows]) > 0
        lacking = cover.views[rows] - seen[rows]
        if np.any(lacking > 0):
            paired &= cover.sees[:, rows] >= lacking
        return self._weigh(paired, rows)

    def _weigh(
        self, table: NDArray[np.bool_], rows: NDArray[np.int64]
    ) -> NDArray[np.float64]:
        self._budget.spend(_UNITS * (table.size + 100.0 * len(table)))
        if self._cover.alike:
            counts = np.count_nonzero(table, axis=1)
            return counts * self._cover.grain
        return table @ self._cover.weights[rows]

    def _spread(self, s: int, sign: int) -> None:
        bits = self._bits(s)
        self._partners += sign * bits
        # A set is no partner of its own.
        self._partners[s] -= sign * bits[s]
        if sign < 0:
            del self._kept[s]
        self._budget.spend(2.0 * self._cover.size)

    def _bits(self, s: int) -> NDArray[np.int8]:
        """With which set a set covers which row; kept while it is selected."""
        if s not in self._kept:
            self._budget.spend(self._cover.size)
            bits = unpack_rows(self._cover.good[s], len(self._cover.rows))
            self._kept[s] = bits.view(np.int8)
        return self._kept[s]
