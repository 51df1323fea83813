"""Linear programs of full covers of equal costs, one HiGHS instance for many.

What a node may claim is evaluated here from its multipliers y >= 0, whatever HiGHS says
of them::

    count >= sum_e y_e + sum_j min(0, 1 - y a_j)
"""

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from solvers.one_thread import quiet_highs, row_program, run_highs, seconds_left
from solvers.status import WorkBudget

# Units of work a nonzero of a simplex iteration.
_UNITS_PER_ITERATION = 4.0
# A call, and each row and column that its basis is handed over for.
_CALL_UNITS = 3e5
_BASIS_UNITS = 1e3
# Of the relaxation of a whole cover: rows at first, and more at a time.
_FIRST_ROWS = 200
_MISSED_ROWS = 100
_VIOLATED = 1e-6
# Rounding of sums of multipliers.
_ROUNDING = 1e-7

Basis = tuple[list[Any], list[Any], list[Any]]


@dataclass(frozen=True, eq=False)
class NodePart:
    """A part of the covers.

    Attributes:
        allowed: Sets that may be taken, shape (n_s,).
        taken: Those of them that are, shape (n_s,).
        added: Further rows, of shape (n_s,): some set of each is taken.
        symmetric: Whether symmetries of what is left are worth looking for.
    """

    allowed: NDArray[np.bool_]
    taken: NDArray[np.bool_]
    added: tuple[NDArray[np.bool_], ...] = ()
    symmetric: bool = True


@dataclass(frozen=True, eq=False)
class Node:
    """A part of the covers with its bound and what its program left."""

    part: NodePart
    bound: float
    basis: Basis
    primal: NDArray[np.float64]
    reduced: NDArray[np.float64]
    dual: NDArray[np.float64]


class NodeProgram:
    """Minimises sum x, A x >= 1, 0 <= x <= 1, over parts of the covers.

    Args:
        rows: Rows of the cover that are in every node's program, shape (m, n_s).
        budget: Work.
        options: Of HiGHS.

    Attributes:
        rows: With those taken in since.
    """

    def __init__(
        self, rows: NDArray[np.bool_], budget: WorkBudget, **options: object
    ) -> None:
        import highspy

        self.rows = rows
        self.budget = budget
        n_rows, n_sets = rows.shape
        ones, endless = np.ones(n_rows), np.full(n_rows, np.inf)
        self._solver = quiet_highs(**options)
        self._solver.passModel(
            row_program(np.ones(n_sets), sparse.csr_array(rows), ones, endless)
        )
        whole = np.ones(n_sets, dtype=bool)
        self._whole = self._part = NodePart(whole, ~whole)
        self._basic = highspy.HighsBasisStatus.kBasic
        self._basis = highspy.HighsBasis()
        self._measure()

    def root(self) -> Node | None:
        """Return all covers bounded, or None where the budget ended before."""
        return self.solve(self._whole, None)

    def take_in(self, rows: NDArray[np.bool_]) -> None:
        """Add rows to every node's program."""
        self._change(dataclasses.replace(self._part, added=()))
        self._add(rows)
        self.rows = np.concatenate([self.rows, rows])
        self._measure()

    def solve(self, part: NodePart, basis: Basis | None) -> Node | None:
        """Return a part bounded, or None where the budget ended before."""
        if self.budget.exhausted:
            return None
        self._change(part)
        added = part.added
        n_base = len(self.rows)
        if basis is not None:
            columns, base, local = basis
            new = [self._basic] * (n_base - len(base))
            last = [self._basic] * (len(added) - len(local))
            self._basis.col_status = columns
            self._basis.row_status = [*base, *new, *local, *last][: n_base + len(added)]
            self._basis.valid = True
            self._solver.setBasis(self._basis)
        steps = self.budget.remaining / (_UNITS_PER_ITERATION * self._entries)
        limit = max(1, int(min(steps, 1e7)))
        self._solver.setOptionValue("simplex_iteration_limit", limit)
        clock = self._solver.getRunTime() + seconds_left(self.budget)
        self._solver.setOptionValue("time_limit", clock)
        run_highs(self._solver)
        steps = float(self._solver.getInfo().simplex_iteration_count)
        self.budget.spend(_UNITS_PER_ITERATION * self._entries * steps + _CALL_UNITS)
        self.budget.spend(_BASIS_UNITS * (n_base + part.allowed.size))
        solution = self._solver.getSolution()
        dual = np.clip(np.nan_to_num(np.asarray(solution.row_dual)), 0.0, None)
        primal = np.asarray(solution.col_value, dtype=np.float64)
        if dual.size != n_base + len(added) or primal.size != part.taken.size:
            dual, primal = np.zeros(n_base + len(added)), np.zeros(part.taken.size)
        reduced = 1.0 - dual[:n_base] @ self._values
        for y, row in zip(dual[n_base:], added, strict=True):
            reduced[row] -= y
        bound = needed_sets(dual, reduced[part.allowed & ~part.taken])
        bound += float(reduced[part.taken].sum())
        if not self._served(part):
            bound = np.inf
        kept = self._solver.getBasis()
        status = list(kept.row_status)
        basis = list(kept.col_status), status[:n_base], status[n_base:]
        return Node(part, bound, basis, primal, reduced, dual)

    def _measure(self) -> None:
        self._values = self.rows.astype(np.float64)
        self._entries = float(np.count_nonzero(self.rows) + sum(self.rows.shape))

    def _served(self, part: NodePart) -> bool:
        if not np.all(self._values @ part.allowed.astype(np.float64) > 0):
            return False
        return all(bool(np.any(row & part.allowed)) for row in part.added)

    def _change(self, part: NodePart) -> None:
        old, self._part = self._part, part
        other = (part.allowed != old.allowed) | (part.taken != old.taken)
        moved = np.flatnonzero(other).astype(np.int32)
        if moved.size:
            lower = part.taken[moved].astype(np.float64)
            upper = part.allowed[moved].astype(np.float64)
            self._solver.changeColsBounds(moved.size, moved, lower, upper)
        common = 0
        for before, now in zip(old.added, part.added, strict=False):
            if before is not now:
                break
            common += 1
        first, stop = len(self.rows) + common, len(self.rows) + len(old.added)
        if stop > first:
            stale = np.arange(first, stop, dtype=np.int32)
            self._solver.deleteRows(stale.size, stale)
        self._add(part.added[common:])

    def _add(self, rows: Iterable[NDArray[np.bool_]]) -> None:
        for row in rows:
            sets = np.flatnonzero(row).astype(np.int32)
            self._solver.addRow(1.0, np.inf, sets.size, sets, np.ones(sets.size))


def needed_sets(
    multipliers: NDArray[np.float64], reduced: NDArray[np.float64]
) -> float:
    """Return the bound by multipliers and the reduced costs of the sets allowed."""
    bound = float(multipliers.sum() + np.minimum(reduced, 0.0).sum())
    return bound * (1.0 - 1e-9)


@dataclass(frozen=True, eq=False)
class LinearCover:
    """Linear relaxation of a full cover, as far as the budget lasted.

    Attributes:
        needed: Sets that any cover needs at least, by the multipliers, not rounded up.
        reduced: Sets that a cover with set j needs beyond these, shape (n_s,).
        rows: Rows that the solution meets without slack, increasing.
        primal: Share of each set, shape (n_s,).
    """

    needed: float
    reduced: NDArray[np.float64]
    rows: NDArray[np.int64]
    primal: NDArray[np.float64]

    @property
    def lower_bound(self) -> int:
        """Sets that any cover needs at least."""
        return max(0, int(np.ceil(self.needed - _ROUNDING)))


def linear_cover(covers: NDArray[np.bool_], budget: WorkBudget) -> LinearCover:
    """Solve the linear relaxation over few rows, taking in those that it violates.

    What holds from below for a subset of the rows holds for the whole.
    """
    n_rows, n_sets = covers.shape
    rows = np.argsort(covers.sum(axis=1), kind="stable")[:_FIRST_ROWS]
    program = NodeProgram(covers[rows], budget)
    primal, tight = np.zeros(n_sets), np.sort(rows)
    needed, reduced = 0.0, np.ones(n_sets)
    taken = np.zeros(n_rows, dtype=bool)
    taken[rows] = True
    while (node := program.root()) is not None:
        budget.spend(2.0 * covers.size)
        if node.bound > needed:
            needed, reduced = node.bound, node.reduced
        primal = node.primal
        support = np.flatnonzero(primal > 0)
        reached = covers[:, support] @ primal[support]
        tight = np.sort(rows[reached[rows] < 1.0 + _VIOLATED])
        missed = np.flatnonzero((reached < 1.0 - _VIOLATED) & ~taken)
        if missed.size == 0 or budget.exhausted:
            break
        missed = missed[np.argsort(reached[missed], kind="stable")][:_MISSED_ROWS]
        program.take_in(covers[missed])
        rows = np.concatenate([rows, missed])
        taken[missed] = True
    return LinearCover(needed, reduced, tight, primal)
