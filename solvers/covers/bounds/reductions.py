"""Make a cover smaller without changing its optimum, and its arithmetic exact.

Valid for partial cover: equal rows merge with added weight; column j goes if r columns
that stay each serve all that j serves and cost no more, r the largest need among j's
rows: wherever j is taken, one of them is free to take its place, or all are taken and j
adds nothing. Where a kind's stock binds, its columns stand in only for their own. Row
dominance is *not* valid for partial cover and isn't used here. Fixed sets are taken out
with what they serve; rows that too few sets serve are lost.

Weights become integers below 2^52 (a power of two times the given ones, rounded), kept
as float64: sums of them are exact in any order, so neither BLAS nor the number of
threads can decide a comparison.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from solvers.bit_rows import pack_shuffled, sparse_rows, transposed
from solvers.checked_numbers import WEIGHT_SLACK, whole_weights
from solvers.covers.cover_problem import CoverProblem

from .reduced_cover import ReducedCover

# Bits of the largest price of a floor (`floors`).
PRICE_BITS = 12
# Words of columns that are looked at first, one by one.
_SKETCH_WORDS = 4
# Words of columns that are compared, some seconds; so many are reached beyond about
# ten thousand columns.
_MOST_COMPARED = 400_000_000


def reduce_problem(
    problem: CoverProblem, *, costs: NDArray[np.float64] | None = None
) -> ReducedCover:
    """Return an equivalent cover with fewer rows and columns.

    Costs, positive, shape (n_s,), count instead of the problem's.
    """
    costs = problem.costs if costs is None else costs
    exponent, whole, inexact = _whole_weights(problem)
    row_sets, total = problem.row_sets, np.array([problem.required_total or 0.0])
    quotas = _quotas(problem, problem.required_weight, exponent, inexact)
    quota = float(_quotas(problem, total, exponent, inexact.sum())[0])

    already = np.asarray(problem.covers[:, problem.fixed].sum(axis=1)).ravel()
    needs = problem.needs - already
    done = problem.by_row_set(np.where(needs <= 0, whole, 0.0))
    quotas = np.maximum(quotas - done, 0.0)
    quota = max(quota - float(done.sum()), 0.0)
    alone = quotas.size == 1 or not np.any(quotas > 0)
    if problem.required_total is not None and alone:
        # No floor is left, and only they tell rows apart.
        quotas, quota = np.array([max(quota, quotas.max())]), 0.0
        row_sets = np.zeros_like(row_sets)
    servers = np.diff(problem.covers.indptr) - already
    live = (whole > 0) & (needs > 0) & (servers >= needs)
    labels = np.stack([needs[live], row_sets[live]], axis=1)
    bits, first, inverse = _merge_rows(problem, live, labels)
    rows = np.unpackbits(bits, axis=1, count=costs.size).view(bool)
    sets = transposed(rows)
    merged = np.bincount(inverse, weights=whole[live], minlength=first.size)
    merged, needs = merged.astype(np.float64), needs[live][first]
    stock = problem.stock - np.bincount(
        problem.kinds[problem.fixed], minlength=problem.stock.size
    )
    free = stock >= np.bincount(problem.kinds, minlength=stock.size)
    own = np.where(free[problem.kinds], -1, problem.kinds)
    by_set = sparse_rows(sets)
    # Weights are whole numbers: their sums don't depend on the order.
    kept, stand_in = _undominated(sets, by_set @ merged, needs, costs, own)
    return ReducedCover(
        problem=problem,
        by_set=sparse.csr_array(by_set[kept], dtype=np.float64),
        weights=merged,
        needs=needs,
        row_sets=row_sets[live][first],
        quotas=quotas,
        quota=quota,
        costs=costs[kept],
        unit=float(np.ldexp(1.0, -exponent)),
        settled=float(done.sum()),
        kept=kept,
        stand_in=stand_in,
        kinds=problem.kinds[kept],
        stock=stock,
    )


def _quotas(
    problem: CoverProblem,
    wanted: NDArray[np.float64],
    exponent: int,
    inexact: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return wanted weights as whole weight to reach, rounded in favour of reaching."""
    total = problem.total_weight
    if not total > 0:
        # Nothing can be had, so anything is too much.
        return (wanted > 0).astype(np.float64)
    # More than there is can't be had, however much more.
    required = np.ldexp(np.minimum(wanted, 4.0 * total), exponent)
    return np.floor(required * (1.0 - WEIGHT_SLACK) - 0.5 * inexact)


def forgiven(problem: CoverProblem) -> NDArray[np.float64]:
    """Return the weight that each row set may lack by rounding, shape (n_g,).

    Of the requirement, of each weight to a whole number of units, and of the sums.
    """
    total = problem.total_weight
    exponent, _, inexact = _whole_weights(problem)
    required = np.minimum(problem.required_weight, 4.0 * total)
    return WEIGHT_SLACK * (required + total) + np.ldexp(inexact + 1.0, -exponent)


def _whole_weights(
    problem: CoverProblem,
) -> tuple[int, NDArray[np.float64], NDArray[np.float64]]:
    """Return the unit's exponent, weights in it, and how many each row set rounds."""
    # Prices of floors multiply weights, and sums of these must be exact as well.
    bits = 52 if problem.required_total is None else 52 - PRICE_BITS
    exponent, whole, inexact = whole_weights(problem.weights, bits=bits)
    return exponent, whole, problem.by_row_set(inexact.astype(np.float64))


def _merge_rows(
    problem: CoverProblem, live: NDArray[np.bool_], labels: NDArray[np.int64]
) -> tuple[NDArray[np.uint8], NDArray[np.int64], NDArray[np.int64]]:
    """Return the live rows that differ in sets that aren't fixed, or in their labels.

    Packed, shape (n, bytes); the first live row like each; which each live row is like.
    """
    covers = problem.covers[live]
    dense = covers.toarray()
    dense[:, problem.fixed] = False
    packed = np.packbits(dense, axis=1)
    if packed.shape[0] == 0 or packed.shape[1] == 0:
        none = np.empty(0, dtype=np.int64)
        return packed[:0], none, none
    marked = np.ascontiguousarray(np.hstack([labels.view(np.uint8), packed]))
    key = marked.view(f"V{marked.shape[1]}").ravel()
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    order = np.argsort(first, kind="stable")
    rank = np.empty(order.size, dtype=np.int64)
    rank[order] = np.arange(order.size)
    return packed[first[order]], first[order], rank[inverse.ravel()]


def _undominated(
    sets: NDArray[np.bool_],
    gains: NDArray[np.float64],
    needs: NDArray[np.int64],
    costs: NDArray[np.float64],
    own: NDArray[np.int64],
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the sets that no others make superfluous, and who stands in for each.

    The first are numbers of sets, rows of a matrix (n_s, n_e), increasing; the second
    count among these. Gains are what sets weigh. Sets of a kind whose stock binds,
    `own` >= 0, stand in only for that kind.
    """
    n_sets = len(sets)
    # A superset weighs more, so only earlier columns of this order can dominate.
    order = np.lexsort((np.arange(n_sets), costs, -gains))
    order = order[gains[order] > 0]
    words = pack_shuffled(sets)[order]
    sketch = words[:, :_SKETCH_WORDS]
    rivals_wanted = np.ones(order.size, dtype=np.int64)
    for need in np.unique(needs[needs > 1]):
        served = np.any(sets[:, needs == need], axis=1)
        rivals_wanted[np.flatnonzero(served[order])] = need

    better = np.arange(order.size)
    standing = np.zeros(order.size, dtype=np.int64)
    # What those that stand lack, word by word: few pass the first.
    lacks = np.empty((sketch.shape[1], order.size), dtype=np.uint64)
    costs, own = costs[order], own[order]
    n_standing, compared = 0, 0
    for j in range(order.size):
        # Whoever isn't compared any more stays: correct, but slower to search.
        n = n_standing if compared < _MOST_COMPARED else 0
        compared += n * sketch.shape[1]
        places = np.arange(n)
        for lack, word in zip(lacks, sketch[j], strict=True):
            # All of a row at once is quicker than the places of it.
            some = lack[:n] if places.size == n else lack[places]
            places = places[(some & word) == 0]
        rivals = standing[places]
        if rivals.size:
            rivals = rivals[costs[rivals] <= costs[j]]
            kind = own[rivals]
            rivals = rivals[(kind < 0) | (kind == own[j])]
            compared += rivals.size * words.shape[1]
            rivals = rivals[~np.any(words[j] & ~words[rivals], axis=1)]
        if rivals.size >= rivals_wanted[j]:
            better[j] = rivals[0]
        else:
            standing[n_standing], lacks[:, n_standing] = j, ~sketch[j]
            n_standing += 1
    kept = np.sort(order[standing[:n_standing]]).astype(np.int64)
    stand_in = np.full(n_sets, -1, dtype=np.int64)
    stand_in[order] = np.searchsorted(kept, order[better])
    return kept, stand_in
