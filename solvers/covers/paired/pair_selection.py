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

        A set prepares open rows that it sees with a partner to be had: what breaks ties
        while no pair is there yet. Selected sets add -1.
        """
        return self._gains_over(~self.covered, self._pairs, self._seen, None)

    def exchanges(self, i: int) -> NDArray[np.float64]:
        """Return the weight covered with each set in the place of set i, (n_s,).

        Selected sets cover -1.
        """
        pairs = self._pairs - self._partners[i] - self._cover.loops[i]
        seen = self._seen - self._cover.sees[i]
        kept = (pairs > 0) & (seen >= self._cover.views)
        left = float(self._cover.weights[kept].sum())
        gains, _ = self._gains_over(~kept, pairs, seen, i)
        return np.where(gains < 0, -1.0, left + gains)

    def _gains_over(
        self,
        open_rows: NDArray[np.bool_],
        pairs: NDArray[np.int32],
        seen: NDArray[np.int32],
        without: int | None,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        cover, rows = self._cover, np.flatnonzero(open_rows)
        self._budget.spend(4.0 * cover.n_sets * (rows.size + 8))
        partners = self._partners[:, rows]
        if without is not None:
            partners = partners - self._bits(without)[:, rows]
        sees, weights = cover.sees[:, rows], cover.weights[rows]
        paired = (pairs[rows] + partners + cover.loops[:, rows]) > 0
        closes = paired & (seen[rows] + sees >= cover.views[rows])
        gains = closes @ weights
        prepared = cover.partnered[:, rows] @ weights
        gains[self.chosen] = -1.0
        return gains, prepared

    def _spread(self, s: int, sign: int) -> None:
        bits = self._bits(s)
        # A set is no partner of its own.
        bits[s] = False
        self._partners += sign * bits
        self._budget.spend(2.0 * self._cover.size)

    def _bits(self, s: int) -> NDArray[np.int8]:
        return unpack_rows(self._cover.good[s], len(self._cover.rows)).view(np.int8)
