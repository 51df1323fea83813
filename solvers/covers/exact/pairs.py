"""The one or two sets of a simple cover that cover the most, by looking at all.

What a pair leaves open is a product of matrices over the open rows::

    missing(i, j) = sum_e w_e (1 - a_ei) (1 - a_ej)

Integer-valued weights make it exact, whatever the BLAS and its threads.
"""

import numpy as np
from numpy.typing import NDArray

from solvers.covers.answers import ExactSearch, Incumbent
from solvers.covers.bounds.reduced_cover import ReducedCover
from solvers.covers.bounds.relaxation import sets_worth_taking
from solvers.status import WorkBudget

# Larger covers aren't searched: the dense copy takes a byte an entry.
_MAX_DENSE = 200_000_000
_PAIR_BLOCK = 256
_FIRST_ROWS = 64
# Pairs are looked at one by one once fewer than this fraction is left.
_FEW_PAIRS = 64
# A dense multiply-add costs this share of a unit.
DENSE_UNIT = 1.0 / 8.0
_CALL_UNITS = 1e5


def best_pair(
    cover: ReducedCover,
    n_sets: int,
    *,
    target: float,
    multipliers: NDArray[np.float64],
    budget: WorkBudget,
    first: bool = False,
) -> ExactSearch:
    """Find one or two sets that cover at least a target, the most if work lasts.

    Args:
        cover: A simple cover.
        n_sets: K, 1 or 2.
        target: Integer-valued weight below which nothing is of interest.
        multipliers: Of the rows, in [0, w], that leave sets out, shape (n_e,).
        budget: Work.
        first: Whether any selection that reaches the target will do.
    """
    if cover.n_sets * cover.weights.size > _MAX_DENSE:
        return ExactSearch(None, 0.0, cover.total, complete=False)
    best = Incumbent(cover, target, first=first)
    gains = np.asarray(cover.by_set @ cover.weights)
    budget.spend(cover.by_set.nnz + 8.0 * cover.weights.size + _CALL_UNITS)
    if min(n_sets, cover.n_sets) == 1:
        one = int(np.argmax(gains))
        best.offer(np.array([one]), float(gains[one]))
        complete = True
    else:
        complete = _Pairs(cover, best, budget).search(gains, multipliers)
    upper = best.refuted if complete else cover.total
    return ExactSearch(best.selected, best.weight, upper, complete)


class _Pairs:
    """All pairs of a simple cover that may reach a target."""

    def __init__(
        self,
        cover: ReducedCover,
        best: Incumbent,
        budget: WorkBudget,
    ) -> None:
        self.cover, self.best, self.budget = cover, best, budget
        # Rows that few sets cover refute most.
        servers = np.bincount(cover.by_set.indices, minlength=cover.weights.size)
        order = np.argsort(servers, kind="stable")
        self._weights = cover.weights[order]
        self._missed = ~cover.by_set.astype(bool).toarray()[:, order]

    def search(
        self, gains: NDArray[np.float64], multipliers: NDArray[np.float64]
    ) -> bool:
        """Offer the best pair of each block of leaders; return whether all were met."""
        cover, best = self.cover, self.best
        sets = np.intersect1d(
            sets_worth_taking(cover, 2, cover.weights, best.target),
            sets_worth_taking(cover, 2, multipliers, best.target),
        )
        self.budget.spend(float(cover.by_set.nnz))
        # The larger of a pair meets the need with every partner that can.
        sets = sets[np.argsort(-gains[sets], kind="stable")]
        gains, missed = gains[sets], self._missed[sets]
        self.budget.spend(2.0 * missed.size + _CALL_UNITS)
        for start in range(0, sets.size, _PAIR_BLOCK):
            # Partners before the leaders were leaders; those of too little gain end.
            short = best.target - gains[start]
            stop = int(np.searchsorted(-gains, -short, side="right"))
            if stop <= start or best.done:
                break
            if self.budget.exhausted:
                return False
            block = slice(start, start + _PAIR_BLOCK)
            i, j, missing = self._best_of(missed[block], missed[start:stop])
            if missing is not None:
                ends = np.unique([start + i, start + j])
                best.offer(np.sort(sets[ends]), cover.total - missing)
        return True

    def _best_of(
        self, ones: NDArray[np.bool_], others: NDArray[np.bool_]
    ) -> tuple[int, int, float | None]:
        """Return the pair that leaves the least weight, if that is little enough.

        Rows that fewest sets cover come first and refute most pairs.
        """
        weights, allowed = self._weights, self.cover.total - self.best.target
        missing = np.zeros((len(ones), len(others)))
        start, length = 0, _FIRST_ROWS
        while start < weights.size:
            part = slice(start, start + length)
            missing += (ones[:, part] * weights[part]) @ others[:, part].T.astype(float)
            width = min(length, weights.size - start)
            self.budget.spend(missing.size * (4.0 + width * DENSE_UNIT))
            start, length = start + length, 4 * length
            alive = missing <= allowed
            n_alive = int(np.count_nonzero(alive))
            if n_alive == 0:
                return 0, 0, None
            if n_alive * _FEW_PAIRS < missing.size and start < weights.size:
                i, j = np.nonzero(alive)
                tail = slice(start, None)
                for k in range(0, i.size, _PAIR_BLOCK):
                    few = slice(k, k + _PAIR_BLOCK)
                    both = ones[i[few], tail] & others[j[few], tail]
                    missing[i[few], j[few]] += both @ weights[tail]
                    self.budget.spend(2.0 * both.size)
                missing[~alive] = np.inf
                break
        i, j = np.unravel_index(int(np.argmin(missing)), missing.shape)
        value = float(missing[i, j])
        return int(i), int(j), value if value <= allowed else None
