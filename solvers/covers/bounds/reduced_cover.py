"""A partial cover ready for search: rows, sets and requirements in whole numbers."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from solvers.bit_rows import transposed
from solvers.covers.cover_problem import CoverProblem


@dataclass(frozen=True, eq=False)
class ReducedCover:
    """A partial cover ready for search.

    Attributes:
        problem: What it was made from.
        by_set: Ones where set s serves row e, shape (n_s, n_e), CSR.
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
    def by_row(self) -> sparse.csr_array:
        """Ones where row e is served by set s, shape (n_e, n_s), CSR."""
        return sparse.csr_array(self.by_set.T)

    def dense_rows(self) -> NDArray[np.bool_]:
        """Return whether row e is served by set s, shape (n_e, n_s)."""
        return transposed(self.by_set.astype(bool).toarray())

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

    def of_row_set(self, g: int) -> "ReducedCover":
        """The same sets with one row set alone, and what that requires."""
        rows = np.flatnonzero(self.row_sets == g)
        return replace(
            self,
            by_set=self.by_set[:, rows],
            weights=self.weights[rows],
            needs=self.needs[rows],
            row_sets=np.zeros(rows.size, dtype=np.int64),
            quotas=self.quotas[[g]],
            quota=0.0,
        )

    def of_sets(self, sets: NDArray[np.int64]) -> "ReducedCover":
        """The same rows with some of the sets, in increasing order."""
        place = np.full(self.n_sets + 1, -1, dtype=np.int64)
        place[sets] = np.arange(sets.size)
        return replace(
            self,
            by_set=self.by_set[sets],
            costs=self.costs[sets],
            kept=self.kept[sets],
            stand_in=place[self.stand_in],
            kinds=self.kinds[sets],
        )

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
