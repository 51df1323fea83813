"""Make a cover smaller without changing its optimum, and its arithmetic exact.

Valid for partial cover: equal rows merge with added weight; column j goes if a column l
has a_j subset of a_l and c_l <= c_j. Row dominance is *not* valid there and isn't used.

Weights become integers below 2^52 (a power of two times the given ones, rounded), kept
as float64: sums of them are exact in any order, so neither BLAS nor the number of
threads can decide a comparison.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

WEIGHT_SLACK = 1e-12
_SKETCH_WORDS = 4


@dataclass(frozen=True, eq=False)
class ReducedCover:
    """A partial cover ready for search.

    Attributes:
        by_set: Ones where set s covers row e, shape (n_s, n_e), CSR.
        by_row: The transpose, shape (n_e, n_s), CSR.
        weights: Integer-valued weight of each row, positive, shape (n_e,).
        costs: Cost of each set, shape (n_s,).
        required: Integer-valued weight to reach; rounding is in favour of reaching it.
        unit: Weight in the caller's unit that one integer step stands for.
        kept: The caller's index of each set, increasing, shape (n_s,).
        stand_in: For each of the caller's sets the set here that covers at least as
            much for at most its cost, -1 where it covers nothing.
    """

    by_set: sparse.csr_array
    by_row: sparse.csr_array
    weights: NDArray[np.float64]
    costs: NDArray[np.float64]
    required: float
    unit: float
    kept: NDArray[np.int64]
    stand_in: NDArray[np.int64]

    @property
    def n_sets(self) -> int:
        """Number of sets left."""
        return self.kept.size

    @property
    def total(self) -> float:
        """Integer-valued weight of all rows that some set covers."""
        return float(self.weights.sum())

    @property
    def grain(self) -> float:
        """Integer-valued weight of which every row's, hence any sum, is a multiple."""
        return float(np.gcd.reduce(self.weights.astype(np.int64), initial=0) or 1)

    @property
    def entries(self) -> int:
        """Nonzeros of the matrix: the work of one product with a vector."""
        return int(self.by_set.nnz) + self.n_sets

    def weight_of(self, selected: NDArray[np.int64]) -> float:
        """Return the exact integer-valued weight that sets cover together."""
        if selected.size == 0:
            return 0.0
        counts = np.asarray(self.by_set[selected].sum(axis=0)).ravel()
        return float(self.weights[counts > 0].sum())


def reduce_cover(
    covers: sparse.csr_array,
    weights: NDArray[np.float64],
    costs: NDArray[np.float64],
    required: float,
) -> ReducedCover:
    """Return an equivalent cover with fewer rows and columns.

    Args:
        covers: Boolean, shape (n_e, n_s).
        weights: Non-negative, shape (n_e,).
        costs: Positive, shape (n_s,).
        required: Weight to reach, in the unit of the weights.

    Returns:
        The reduced cover; rows that nothing covers or that weigh nothing are gone.
    """
    total = float(weights.sum())
    exponent = 51 - int(np.floor(np.log2(total))) if total > 0 else 0
    scaled = np.ldexp(weights, exponent)
    whole = np.rint(scaled)
    inexact = int(np.count_nonzero(whole != scaled))
    needed = np.ldexp(required, exponent) * (1.0 - WEIGHT_SLACK) - 0.5 * inexact

    live = (whole > 0) & (np.diff(covers.indptr) > 0)
    bits, merged = _merge_rows(covers[live], whole[live])
    dense = np.unpackbits(bits, axis=1, count=costs.size).astype(bool)
    kept, stand_in = _undominated(dense, merged, costs)
    by_row = sparse.csr_array(sparse.csr_array(dense[:, kept]), dtype=np.float64)
    return ReducedCover(
        by_set=sparse.csr_array(by_row.T),
        by_row=by_row,
        weights=merged,
        costs=costs[kept],
        required=max(0.0, float(np.floor(needed))),
        unit=float(np.ldexp(1.0, -exponent)),
        kept=kept,
        stand_in=stand_in,
    )


def _merge_rows(
    covers: sparse.csr_array, weights: NDArray[np.float64]
) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """Return distinct rows, bit-packed, and the summed weight of each."""
    packed = np.packbits(covers.toarray(), axis=1)
    if packed.shape[0] == 0 or packed.shape[1] == 0:
        return packed[:0], weights[:0]
    key = np.ascontiguousarray(packed).view(f"V{packed.shape[1]}").ravel()
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    order = np.argsort(first, kind="stable")
    summed = np.bincount(inverse.ravel(), weights=weights).astype(np.float64)
    return packed[first[order]], summed[order]


def _undominated(
    dense: NDArray[np.bool_], weights: NDArray[np.float64], costs: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the columns that no other makes superfluous, and who stands in for each.

    The first are column numbers, increasing; the second count among these.
    """
    n_sets = dense.shape[1]
    gains = sparse.csr_array(dense.T) @ weights
    # A superset weighs more, so only earlier columns of this order can dominate.
    order = np.lexsort((np.arange(n_sets), costs, -gains))
    order = order[gains[order] > 0]
    words = _column_words(dense[:, order])
    sketch = np.ascontiguousarray(words[:, :_SKETCH_WORDS])

    better = np.arange(order.size)
    standing = np.zeros(order.size, dtype=np.int64)
    n_standing = 0
    for j in range(order.size):
        rivals = standing[:n_standing]
        rivals = rivals[costs[order[rivals]] <= costs[order[j]]]
        rivals = rivals[~np.any(sketch[j] & ~sketch[rivals], axis=1)]
        rivals = rivals[~np.any(words[j] & ~words[rivals], axis=1)]
        if rivals.size:
            better[j] = rivals[0]
        else:
            standing[n_standing] = j
            n_standing += 1
    kept = np.sort(order[standing[:n_standing]]).astype(np.int64)
    stand_in = np.full(n_sets, -1, dtype=np.int64)
    stand_in[order] = np.searchsorted(kept, order[better])
    return kept, stand_in


def _column_words(dense: NDArray[np.bool_]) -> NDArray[np.uint64]:
    """Return columns as bit rows, shape (n_s, n_words), elements in random order."""
    n_rows, n_sets = dense.shape
    padded = np.zeros((n_sets, -(-max(n_rows, 1) // 64) * 64), dtype=bool)
    # Shuffled, so that the first words are a fair sketch of the column.
    padded[:, :n_rows] = dense[np.random.default_rng(0).permutation(n_rows)].T
    return np.packbits(padded, axis=1).view(np.uint64)
