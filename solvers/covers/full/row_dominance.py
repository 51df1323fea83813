"""Rows and columns that a full cover can do without.

Where every row must be covered, a row whose columns include all of another's is covered
with it, and a column whose rows another has too is never needed (costs being equal).
Each rule makes room for the other, so they take turns until neither finds anything.
Neither changes the fewest columns. The row rule is *not* valid where rows may be lost.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from solvers.bit_rows import pack_shuffled
from solvers.status import WorkBudget

# Passes after which what is left to find isn't worth looking for.
_MAX_ROUNDS = 10
# As many sets, and fewer, are compared all at once.
_FEW = 600
_UNITS_PER_PRODUCT = 0.05
# What comparing two words costs, and the calls for one pivot.
_UNITS_PER_WORD = 8.0
_CALL_UNITS = 3e4


def essential(
    covers: NDArray[np.bool_], budget: WorkBudget
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return rows and columns, increasing, of a smaller cover with the same optimum.

    Where the budget ends, what wasn't compared is kept.
    """
    rows, columns = (np.arange(n, dtype=np.int64) for n in covers.shape)
    smaller = covers
    for _ in range(_MAX_ROUNDS):
        kept_rows = minimal(smaller, budget)
        smaller = smaller[kept_rows]
        kept_columns = minimal(~smaller.T, budget)
        unchanged = kept_rows.size == rows.size and kept_columns.size == columns.size
        smaller = smaller[:, kept_columns]
        rows, columns = rows[kept_rows], columns[kept_columns]
        if unchanged or budget.exhausted:
            break
    return rows, columns


def separate(
    covers: NDArray[np.bool_],
) -> list[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """Return the rows and columns of each part that shares none with the others."""
    links = sparse.csr_array(covers)
    both = sparse.block_array([[None, links], [links.T, None]])
    labels = connected_components(both, directed=False)[1]
    rows, columns = labels[: len(covers)], labels[len(covers) :]
    return [
        (np.flatnonzero(rows == i), np.flatnonzero(columns == i))
        for i in np.unique(rows)
    ]


def minimal(sets: NDArray[np.bool_], budget: WorkBudget) -> NDArray[np.int64]:
    """Return the sets (n_sets, n_elements) that include no other, the first of equals.

    Where the budget ends, sets that weren't compared are kept.
    """
    if len(sets) <= _FEW:
        return _minimal_of_few(sets, budget)
    order = np.lexsort((np.arange(len(sets)), sets.sum(axis=1)))
    words = np.ascontiguousarray(pack_shuffled(sets).T)[:, order]
    alive = np.ones(order.size, dtype=bool)
    # A superset is larger, so only later sets of this order can include the pivot.
    later = np.arange(order.size)
    while later.size > 1 and not budget.exhausted:
        pivot, later = later[0], later[1:]
        larger = later
        spent = 0
        for word in words:
            spent += larger.size
            larger = larger[(word[pivot] & ~word[larger]) == 0]
            if larger.size == 0:
                break
        budget.spend(_UNITS_PER_WORD * spent + _CALL_UNITS)
        if larger.size:
            alive[larger] = False
            later = later[alive[later]]
    return np.sort(order[alive]).astype(np.int64)


def _minimal_of_few(sets: NDArray[np.bool_], budget: WorkBudget) -> NDArray[np.int64]:
    """Return the same by one product of matrices, which counts what is shared."""
    if budget.exhausted:
        return np.arange(len(sets), dtype=np.int64)
    # Counts below 2^24 are exact in single precision.
    members = sets.astype(np.float32)
    budget.spend(members.size * (1.0 + _UNITS_PER_PRODUCT * len(sets)))
    within = members @ members.T == members.sum(axis=1)[:, None]
    equal = within & within.T
    goes = (within & ~equal).any(axis=0) | np.triu(equal, 1).any(axis=0)
    return np.flatnonzero(~goes).astype(np.int64)
