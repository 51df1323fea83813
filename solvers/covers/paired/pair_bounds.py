"""Bounds on covers by pairs, from what each set is worth to a row by itself.

A row that needs two sets takes half of itself from each, one that k must see a k-th,
and all from a set that covers it alone. With these shares c_se::

    y_e <= sum_s c_se x_s

holds for every selection, and bounds on parts of the selections follow as they do for
simple covers (`exact.group_bounds`), with c in the place of a. Shares are multiples of
a sixteenth, rounded up, so that sums in single precision stay exact.
"""

import numpy as np
from numpy.typing import NDArray

from solvers.covers.exact.group_bounds import GroupPart, PartBounds
from solvers.status import WorkBudget

from .pair_rows import PairRows

# Sums of multiples of a sixteenth up to this are exact in single precision.
_EXACT = float(1 << 19)
_PARTS = 16


class PairBounds(PartBounds):
    """Bounds parts of the selections of K sets of a cover by pairs."""

    def __init__(
        self,
        cover: PairRows,
        shares: NDArray[np.float32],
        n_sets: int,
        target: float,
        budget: WorkBudget,
    ) -> None:
        self.covers = shares
        self.n_sets = n_sets
        self._weights, self._total = cover.weights, cover.total
        self._target, self._budget = target, budget
        self._leaves_out = False
        self._grid = 2.0 ** max(0.0, np.ceil(np.log2(max(self._total, 1.0) / _EXACT)))

    def without(
        self, fixed: NDArray[np.int64], shares: NDArray[np.float64]
    ) -> GroupPart:
        """Return the part of all selections that hold the fixed sets, not bounded."""
        groups = tuple(np.array([s]) for s in fixed.tolist())
        whole = self.whole(shares)
        return GroupPart(
            whole.closed, groups, whole.shares, whole.primal, whole.costliest, np.inf
        )


def worth(cover: PairRows) -> NDArray[np.float32]:
    """Return the shares c, shape (n_s, n_r), of sets in rows."""
    sees = np.where(cover.views == 2, _useful(cover), cover.sees)
    each = np.ceil(_PARTS / cover.views) / _PARTS
    several = np.where(sees, each, 0.0)
    pair = np.where(cover.loops, 1.0, np.where(cover.partnered, 0.5, 0.0))
    return np.where(cover.views == 1, pair, several).astype(np.float32)


def _useful(cover: PairRows) -> NDArray[np.bool_]:
    """Which sets count where two must see: those of pairs, unless one is enough."""
    return np.where(cover.loops.any(axis=0), cover.sees, cover.partnered)


def count_bound(
    cover: PairRows, shares: NDArray[np.float32], fixed: NDArray[np.int64]
) -> int:
    """Return a number of sets that every cover has, from the sum of the largest."""
    worths = np.sort(shares.astype(np.float64) @ cover.weights)[::-1]
    held = float((shares[fixed].astype(np.float64) @ cover.weights).sum())
    sums = held + np.concatenate([[0.0], np.cumsum(worths)])
    # A share above the true one never makes a sum too small.
    count = int(np.searchsorted(sums * (1.0 + 1e-9), cover.quota))
    least = 1 if np.any(cover.loops & (cover.views == 1)) else 2
    return max(len(fixed), least, len(fixed) + count) if cover.quota > 0 else len(fixed)
