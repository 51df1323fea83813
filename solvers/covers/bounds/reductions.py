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

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from solvers.bit_rows import pack_shuffled, sparse_rows
from solvers.checked_numbers import WEIGHT_SLACK, whole_weights
from solvers.covers.cover_problem import CoverProblem

# Bits of the largest price of a floor (`floors`).
PRICE_BITS = 12
_SKETCH_WORDS = 4
# Words of columns that are compared, some seconds; so many are reached beyond about
# ten thousand columns.
_MOST_COMPARED = 400_000_000


@dataclass(frozen=True, eq=False)
class ReducedCover:
    """A partial cover ready for search.

    Attributes:
        problem: What it was made from.
        by_set: Ones where set s serves row e, shape (n_s, n_e), CSR.
        by_row: The transpose, shape (n_e, n_s), CSR.
        weights: Integer-valued weight of each row, positive, shape (n_e,).
        needs: Sets that must serve each row, positive, shape (n_e,).
        row_sets: Row set of each row, shape (n_e,).
        quotas: Integer-valued weight to reach in each row set, rounded in favour of
            reaching it, shape (n_g,).
        quota: Integer-valued weight to reach in all, beside that of each row set.
        costs: Cost of each set, shape (n_s,).
        unit: Weight in the caller's unit that one integer step stands for.
        settled: Integer-valued weight that the fixed sets cover already.
        kept: The caller's index of each set, increasing, shape (n_s,).
        stand_in: For each of the caller's sets the set here that may take its place,
            -1 where it serves nothing.
        kinds: Kind of each set, shape (n_s,).
        stock: Sets of each kind that may be taken, shape (n_k,).
    """

    problem: CoverProblem
    by_set: sparse.csr_array
    by_row: sparse.csr_array
    weights: NDArray[np.float64]
    needs: NDArray[np.int64]
    row_sets: NDArray[np.int64]
    quotas: NDArray[np.float64]
    quota: float
    costs: NDArray[np.float64]
    unit: float
    settled: float
    kept: NDArray[np.int64]
    stand_in: NDArray[np.int64]
    kinds: NDArray[np.int64]
    stock: NDArray[np.int64]

    @property
    def n_sets(self) -> int:
        """Number of sets."""
        return self.kept.size

    @cached_property
    def simple(self) -> bool:
        """Whether one set suffices for any row and there is one row set."""
        return self.quotas.size == 1 and bool(np.all(self.needs == 1))

    @property
    def floored(self) -> bool:
        """Whether row sets have floors beside what is required of all."""
        return self.problem.required_total is not None and self.quotas.size > 1

    @cached_property
    def without_floors(self) -> "ReducedCover":
        """The same cover with what is required of all rows alone."""
        one = np.zeros(self.weights.size, dtype=np.int64)
        return replace(self, row_sets=one, quotas=np.array([self.quota]), quota=0.0)

    @cached_property
    def limited(self) -> bool:
        """Whether there are more sets of a kind than its stock holds."""
        there = np.bincount(self.kinds, minlength=self.stock.size)
        return bool(np.any(there > self.stock))

    @cached_property
    def without_stock(self) -> "ReducedCover":
        """The same cover with as many sets of each kind as are wanted."""
        return replace(self, stock=np.full(self.stock.size, self.n_sets))

    def left(self, selected: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return what sets leave of each kind's stock, shape (n_k,)."""
        taken = np.bincount(self.kinds[selected], minlength=self.stock.size)
        return self.stock - taken

    def in_stock(self, sets: NDArray[np.int64]) -> tuple[int, ...]:
        """Return of some sets the first of each kind that the stock holds."""
        kept: list[int] = []
        left = self.stock.copy()
        for s in sets.tolist():
            if left[self.kinds[s]] > 0:
                left[self.kinds[s]] -= 1
                kept.append(s)
        return tuple(kept)

    @property
    def required(self) -> float:
        """Integer-valued weight to reach, all row sets together."""
        return max(self.quota, float(self.quotas.sum()))

    @property
    def total(self) -> float:
        """Integer-valued weight of all rows that can be covered."""
        return float(self.weights.sum())

    @property
    def totals(self) -> NDArray[np.float64]:
        """The same by row set, shape (n_g,)."""
        return self.by_row_set(self.weights)

    @property
    def reachable(self) -> bool:
        """Whether all sets together reach what is required."""
        return self._enough(self.totals)

    @cached_property
    def full(self) -> bool:
        """Whether no row may be lost."""
        lightest = np.full(self.quotas.size, np.inf)
        np.minimum.at(lightest, self.row_sets, self.weights)
        each = bool(np.all(self.totals - self.quotas < lightest))
        return each or self.total - self.quota < lightest.min(initial=np.inf)

    @cached_property
    def grain(self) -> float:
        """Integer-valued weight of which every row's, hence any sum, is a multiple."""
        return float(np.gcd.reduce(self.weights.astype(np.int64), initial=0) or 1)

    @property
    def entries(self) -> int:
        """Nonzeros of the matrix: the work of one product with a vector."""
        return int(self.by_set.nnz) + self.n_sets

    def members(self, s: int) -> NDArray[np.signedinteger]:
        """Return the rows that set s serves."""
        return self.by_set.indices[self.by_set.indptr[s] : self.by_set.indptr[s + 1]]

    def by_row_set(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return sums over each row set, shape (n_g,)."""
        return np.bincount(
            self.row_sets, weights=values, minlength=self.quotas.size
        ).astype(np.float64)

    def served(self, selected: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return how many of the selected sets serve each row, shape (n_e,)."""
        counts = np.zeros(self.weights.size, dtype=np.int64)
        for s in selected:
            counts[self.members(int(s))] += 1
        return counts

    def weight_of(self, selected: NDArray[np.int64]) -> float:
        """Return the exact integer-valued weight that sets cover together."""
        return float(self.weights[self.served(selected) >= self.needs].sum())

    def meets(self, selected: NDArray[np.int64]) -> bool:
        """Whether a selection reaches what every row set requires."""
        return self._enough(self.covered_by(selected))

    def covered_by(self, selected: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the weight that sets cover of each row set, shape (n_g,)."""
        served = self.served(selected) >= self.needs
        return self.by_row_set(served * self.weights)

    def shortage(self, selected: NDArray[np.int64]) -> float:
        """Return the weight that is lacking of row sets, and of all of them."""
        covered = self.covered_by(selected)
        lacking = np.clip(self.quotas - covered, 0.0, None).sum()
        return float(lacking) + max(0.0, self.quota - float(covered.sum()))

    def _enough(self, covered: NDArray[np.float64]) -> bool:
        return bool(np.all(covered >= self.quotas) and covered.sum() >= self.quota)


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
    dense = np.unpackbits(bits, axis=1, count=costs.size).astype(bool)
    merged = np.bincount(inverse, weights=whole[live], minlength=first.size)
    merged, needs = merged.astype(np.float64), needs[live][first]
    stock = problem.stock - np.bincount(
        problem.kinds[problem.fixed], minlength=problem.stock.size
    )
    free = stock >= np.bincount(problem.kinds, minlength=stock.size)
    own = np.where(free[problem.kinds], -1, problem.kinds)
    kept, stand_in = _undominated(dense, merged, needs, costs, own)
    by_row = sparse.csr_array(sparse_rows(dense[:, kept]), dtype=np.float64)
    return ReducedCover(
        problem=problem,
        by_set=sparse.csr_array(by_row.T),
        by_row=by_row,
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
    dense: NDArray[np.bool_],
    weights: NDArray[np.float64],
    needs: NDArray[np.int64],
    costs: NDArray[np.float64],
    own: NDArray[np.int64],
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the columns that no others make superfluous, and who stands in for each.

    The first are column numbers, increasing; the second count among these. Columns of
    a kind whose stock binds, `own` >= 0, stand in only for that kind.
    """
    n_sets = dense.shape[1]
    # Weights are whole numbers: their sums don't depend on the order.
    gains = sparse_rows(dense).T @ weights
    # A superset weighs more, so only earlier columns of this order can dominate.
    order = np.lexsort((np.arange(n_sets), costs, -gains))
    order = order[gains[order] > 0]
    words = pack_shuffled(dense[:, order].T)
    sketch = np.ascontiguousarray(words[:, :_SKETCH_WORDS])
    rivals_wanted = np.ones(order.size, dtype=np.int64)
    for need in np.unique(needs[needs > 1]):
        served = np.any(dense[needs == need], axis=0)
        rivals_wanted[np.flatnonzero(served[order])] = need

    better = np.arange(order.size)
    standing = np.zeros(order.size, dtype=np.int64)
    n_standing, compared = 0, 0
    for j in range(order.size):
        # Whoever isn't compared any more stays: correct, but slower to search.
        rivals = standing[: n_standing if compared < _MOST_COMPARED else 0]
        compared += rivals.size * sketch.shape[1]
        rivals = rivals[costs[order[rivals]] <= costs[order[j]]]
        kind = own[order[rivals]]
        rivals = rivals[(kind < 0) | (kind == own[order[j]])]
        rivals = rivals[~np.any(sketch[j] & ~sketch[rivals], axis=1)]
        compared += rivals.size * words.shape[1]
        rivals = rivals[~np.any(words[j] & ~words[rivals], axis=1)]
        if rivals.size >= rivals_wanted[j]:
            better[j] = rivals[0]
        else:
            standing[n_standing] = j
            n_standing += 1
    kept = np.sort(order[standing[:n_standing]]).astype(np.int64)
    stand_in = np.full(n_sets, -1, dtype=np.int64)
    stand_in[order] = np.searchsorted(kept, order[better])
    return kept, stand_in
