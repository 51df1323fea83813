"""A cover by pairs ready for search: elements some pair covers, in whole weights."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from solvers.bit_rows import pack_rows, unpack_rows
from solvers.checked_numbers import WEIGHT_SLACK, whole_weights

from .pair_problem import PairCoverProblem

_BITS = 52


@dataclass(frozen=True, eq=False)
class PairRows:
    """Elements that all sets together cover, and what is required of them.

    Attributes:
        problem: What it was made from.
        rows: The caller's index of each row, shape (n_r,).
        sees: Whether set s sees a row, shape (n_s, n_r).
        good: Bit rows of what sets cover together, shape (n_s, n_s, n_words).
        weights: Integer-valued weight of each row, positive, shape (n_r,).
        views: Sets that must see each row, shape (n_r,).
        quota: Integer-valued weight to reach, rounded in favour of reaching it.
        unit: Weight in the caller's unit that one integer step stands for.
    """

    problem: PairCoverProblem
    rows: NDArray[np.int64]
    sees: NDArray[np.bool_]
    good: NDArray[np.uint64]
    weights: NDArray[np.float64]
    views: NDArray[np.int64]
    quota: float
    unit: float

    @property
    def n_sets(self) -> int:
        """Number of sets n_s."""
        return len(self.sees)

    @property
    def size(self) -> float:
        """Entries of a table of sets and rows: the work of touching each."""
        return float(self.sees.size + self.n_sets + 1)

    @property
    def total(self) -> float:
        """Integer-valued weight of all rows."""
        return float(self.weights.sum())

    @cached_property
    def grain(self) -> float:
        """Integer-valued weight of which any sum of rows is a multiple."""
        return float(np.gcd.reduce(self.weights.astype(np.int64), initial=0) or 1)

    @cached_property
    def alike(self) -> bool:
        """Whether all rows weigh the same."""
        return bool(np.all(self.weights == self.weights[:1]))

    @cached_property
    def loops(self) -> NDArray[np.bool_]:
        """Whether set s covers a row alone, shape (n_s, n_r)."""
        each = np.arange(self.n_sets)
        return unpack_rows(self.good[each, each], len(self.rows))

    @cached_property
    def partnered(self) -> NDArray[np.bool_]:
        """Whether set s covers a row with any set, or alone, shape (n_s, n_r)."""
        if not self.n_sets:
            return np.zeros((0, len(self.rows)), dtype=bool)
        return unpack_rows(np.bitwise_or.reduce(self.good, axis=1), len(self.rows))

    def pairs_of(self, s: int) -> NDArray[np.bool_]:
        """Return with which set which row is covered by set s, (n_s, n_r)."""
        return unpack_rows(self.good[s], len(self.rows))

    def weight_of(self, chosen: NDArray[np.int64]) -> float:
        """Return the integer-valued weight that sets cover together."""
        words = np.zeros(self.good.shape[2], dtype=np.uint64)
        for s in chosen:
            words |= np.bitwise_or.reduce(self.good[s][chosen], axis=0)
        paired = unpack_rows(words[None], len(self.rows))[0]
        paired &= self.sees[chosen].sum(axis=0) >= self.views
        return float(self.weights[paired].sum())

    def meets(self, chosen: NDArray[np.int64]) -> bool:
        """Whether sets cover what is required."""
        return self.weight_of(chosen) >= self.quota


def pair_rows(problem: PairCoverProblem) -> PairRows:
    """Return the rows that some pair covers, in whole weights."""
    kept = problem.covered(np.arange(problem.n_sets)) & (problem.weights > 0)
    rows = np.flatnonzero(kept)
    exponent, whole, rounded = whole_weights(problem.weights[rows], bits=_BITS)
    light = whole > 0
    rows, whole, lost = rows[light], whole[light], float(rounded.sum())
    required = np.ldexp(problem.required_weight * (1.0 - WEIGHT_SLACK), exponent)
    # Half a step of each rounded weight, and the steps of those too light for one.
    quota = max(0.0, float(np.ceil(required - 0.5 * lost)))
    return PairRows(
        problem,
        rows,
        np.ascontiguousarray(problem.sees[rows].T),
        _taken(problem, rows),
        whole,
        problem.views[rows],
        quota,
        float(np.ldexp(1.0, -exponent)),
    )


def _taken(problem: PairCoverProblem, rows: NDArray[np.int64]) -> NDArray[np.uint64]:
    if len(rows) == len(problem.sees):
        return problem.good
    parts = [pack_rows(problem.pairs_of(s)[:, rows]) for s in range(problem.n_sets)]
    return np.array(parts, dtype=np.uint64).reshape(
        problem.n_sets, problem.n_sets, -(-len(rows) // 64)
    )
