"""A selection that changes a set at a time, with the worth of every swap kept current.

With n_e sets of the selection S over row e, the weight that set j adds, and what it
wins back of that which set i of S covers alone::

    gain_j = sum_{e: n_e = 0} w_e a_ej
    regain_ij = sum_{e: n_e = 1, a_ei = 1} w_e a_ej

so i makes room for j at the change gain_j + regain_ij - regain_ii. A set that comes or
goes changes them only by the rows whose n_e goes between 0, 1 and 2. The weights are
integers, so what was added and taken away again leaves no trace of rounding.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from solvers.covers.bounds.reduced_cover import ReducedCover
from solvers.status import WorkBudget

# Entries that are widened from one byte to eight at a time.
_BLOCK = 2**18
# What a change costs however few rows it touches.
_CALL_UNITS = 3e4
# What a multiply-add of a product of matrices costs.
_PRODUCT_UNIT = 0.3
# Owner of rows that no chosen set covers.
_NOBODY = -1


class Swaps:
    """A selection under change.

    Attributes:
        chosen: Selected sets, in the order in which they came.
        covered: Weight that they cover.
        gain: Weight that each set would add, shape (n_s,).
        regain: Weight that each set would win back of what one chosen set covers
            alone, shape (k, n_s).
    """

    def __init__(
        self, cover: ReducedCover, chosen: Iterable[int], budget: WorkBudget
    ) -> None:
        self.chosen: list[int] = []
        self.covered = 0.0
        self.gain: NDArray[np.float64] = cover.by_set @ cover.weights
        self.regain: NDArray[np.float64] = np.zeros((0, cover.n_sets))
        self._cover = cover
        self._budget = budget
        self._unit = _exact_unit(cover.weights)
        exact = np.float64 if self._unit is None else np.float32
        self._weights = (cover.weights / (self._unit or 1.0)).astype(exact)
        self._serves = cover.dense_rows()
        self._counts = np.zeros(cover.weights.size, dtype=np.int64)
        # Sum of 1 + s over the sets that cover a row: its owner, where there's but one.
        self._owners = np.zeros(cover.weights.size, dtype=np.int64)
        self._places = np.zeros(cover.n_sets + 1, dtype=np.int64)
        budget.spend(float(self._serves.size))
        for s in chosen:
            self.add(s)

    def add(self, s: int) -> None:
        """Select one set more."""
        rows = self._members(s)
        counts = self._counts[rows]
        touched = rows[counts <= 1]
        # What was open is its own now; what one set covered alone isn't any more.
        sums = self._sums_by_owner([*self.chosen, _NOBODY], touched)
        self.covered += float(self.gain[s])
        self.gain -= sums[-1]
        self.regain -= sums[:-1]
        self.regain = np.concatenate([self.regain, sums[-1:]])
        self.chosen.append(s)
        self._counts[rows] = counts + 1
        self._owners[rows] += s + 1

    def drop(self, position: int) -> None:
        """Give up the set at a position of the selection."""
        s = self.chosen.pop(position)
        lost = self.regain[position]
        self.gain += lost
        self.covered -= float(lost[s])
        others = self.regain[:position], self.regain[position + 1 :]
        self.regain = np.concatenate(others)
        rows = self._members(s)
        self._counts[rows] = counts = self._counts[rows] - 1
        self._owners[rows] -= s + 1
        self.regain += self._sums_by_owner(self.chosen, rows[counts == 1])

    def best_swap(
        self,
        *,
        stay: NDArray[np.bool_] | None = None,
        barred: NDArray[np.bool_] | None = None,
        beyond: float = np.inf,
        sold_out: NDArray[np.bool_] | None = None,
    ) -> tuple[float, int, int]:
        """Return the largest change in weight, the position that goes, what comes.

        Positions that stay, (k,), and barred sets, (n_s,), count beyond a change; what
        is sold out for a position, (k, n_s), never does.
        """
        losses = self.regain[np.arange(len(self.chosen)), self.chosen]
        change = self.regain + self.gain - losses[:, None]
        self._budget.spend(float(change.size))
        if stay is not None and barred is not None:
            tabu = stay[:, None] | barred
            change[tabu & (change <= beyond)] = -np.inf
        if sold_out is not None:
            change[sold_out] = -np.inf
        out, into = divmod(int(change.argmax()), change.shape[1])
        return float(change[out, into]), out, into

    def _members(self, s: int) -> NDArray[np.signedinteger]:
        by_set = self._cover.by_set
        return by_set.indices[by_set.indptr[s] : by_set.indptr[s + 1]]

    def _sums_by_owner(
        self, owners: list[int], rows: NDArray[np.signedinteger]
    ) -> NDArray[np.float64]:
        """Return w(rows of owner o that set j covers), shape (n_owners, n_s)."""
        n_sets = self._cover.n_sets
        self._places[[s + 1 for s in owners]] = np.arange(len(owners))
        owner = self._places[self._owners[rows]]
        # Sorted by owner, so that a block of rows has few of them.
        order = owner.argsort(kind="stable")
        rows, owner = rows[order], owner[order]
        total = np.zeros((len(owners), n_sets))
        step = max(1, _BLOCK // max(1, n_sets))
        for start in range(0, rows.size, step):
            part = slice(start, start + step)
            weights = self._weights[rows[part]]
            serves = self._serves.take(rows[part], axis=0).astype(weights.dtype)
            few = np.arange(owner[part][0], owner[part][-1] + 1)
            ends, begin = owner[part].searchsorted(few, side="right"), 0
            # One by one, since BLAS copies the rows for several before it multiplies.
            for o, end in zip(few.tolist(), ends.tolist(), strict=True):
                total[o] += weights[begin:end] @ serves[begin:end]
                begin = end
            self._budget.spend(serves.size * (1.0 + _PRODUCT_UNIT * few.size))
        self._budget.spend(total.size + _CALL_UNITS)
        return total if self._unit is None else total * self._unit


def _exact_unit(weights: NDArray[np.float64]) -> float | None:
    """Return a power of two in which sums are exact in single precision, or None."""
    unit = float(np.gcd.reduce(weights.astype(np.int64), initial=0)) or 1.0
    unit = float(np.gcd(int(unit), 1 << 62))
    return unit if float(weights.sum()) / unit < 2.0**24 else None
