"""The one or two sets of a cover with floors that lack least, by looking at all.

As in ``pairs``, what a pair leaves open of row set g is a product of matrices::

    missing_g(i, j) = sum_{e in g} w_e (1 - a_ei) (1 - a_ej)
    lacking(i, j)   = sum_g max(0, missing_g - spare_g)  +  max(0, missing - spare)

with spare_g and spare the weight that floors and the total let go.
"""

import numpy as np
from numpy.typing import NDArray

from solvers.covers.bounds.reduced_cover import ReducedCover
from solvers.status import WorkBudget

from .pairs import DENSE_UNIT

_MOST = 2
# Dense multiply-adds, from which on all pairs aren't looked at.
_MAX_PRODUCTS = 2e9


def least_lacking(
    cover: ReducedCover, n_sets: int, budget: WorkBudget
) -> NDArray[np.int64] | None:
    """Return the K sets that lack least of floors and total, of these most weight.

    One set need serve each row. None where K is more than two, or pairs are too many.
    """
    products = float(cover.n_sets) ** n_sets * cover.weights.size
    if n_sets > _MOST or products > _MAX_PRODUCTS:
        return None
    budget.spend(products * DENSE_UNIT + cover.entries)
    # Whole grains, so that their sums are exact in single precision where they are few.
    single = cover.total / cover.grain < 2.0**24
    of_rows = (cover.weights / cover.grain).astype(np.float32 if single else np.float64)
    missed = ~cover.by_set.astype(bool).toarray()
    spare, spare_of_all = cover.totals - cover.quotas, cover.total - cover.quota
    lacking, missing = np.zeros(1), np.zeros(1)
    for g in range(cover.quotas.size):
        rows = np.flatnonzero(cover.row_sets == g)
        weights = of_rows[rows]
        each = missed[:, rows].astype(weights.dtype)
        of_set = each @ weights if n_sets == 1 else (each * weights) @ each.T
        of_set = of_set.astype(np.float64) * cover.grain
        lacking = lacking + np.maximum(of_set - spare[g], 0.0)
        missing = missing + of_set
    lacking = lacking + np.maximum(missing - spare_of_all, 0.0)
    missing[lacking > lacking.min()] = np.inf
    return np.unique(np.unravel_index(int(np.argmin(missing)), missing.shape))
