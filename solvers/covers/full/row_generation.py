"""Linear relaxation of full covers of equal costs, over few of their rows.

Any subset of the rows asks less, so what holds from below for a subset holds for the
whole. The linear program takes rows in until no other is violated; its multipliers y
give, evaluated here in numpy, for any y >= 0::

    count >= sum_e y_e + sum_j min(0, 1 - y a_j)

One thread and limits on iterations, so that the answer doesn't depend on the machine.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from solvers.one_thread import quiet_highs, row_program, run_highs, seconds_left
from solvers.status import WorkBudget

_FIRST_ROWS = 200
_BATCH = 100
_VIOLATED = 1e-6
# Rounding of sums of multipliers.
_ROUNDING = 1e-7
# Units of work a nonzero of a simplex iteration.
_UNITS_PER_ITERATION = 4.0


@dataclass(frozen=True, eq=False)
class LinearCover:
    """Linear relaxation of a full cover, by rows.

    Attributes:
        lower_bound: Sets that any cover needs at least, by the multipliers.
        needed: The same before it was rounded up.
        reduced: Sets that a cover with set j needs beyond these, shape (n_s,).
        rows: Rows that the solution meets without slack, increasing.
        primal: Share of each set, shape (n_s,).
    """

    lower_bound: int
    needed: float
    reduced: NDArray[np.float64]
    rows: NDArray[np.int64]
    primal: NDArray[np.float64]


def by_multipliers(
    covers: NDArray[np.bool_], multipliers: NDArray[np.float64]
) -> tuple[float, NDArray[np.float64]]:
    """Return the bound by multipliers, not rounded up, and the reduced costs."""
    usable = np.clip(np.nan_to_num(multipliers), 0.0, 1.0)
    reduced = 1.0 - usable @ covers.astype(np.float64)
    return needed_sets(usable, reduced), reduced


def needed_sets(
    multipliers: NDArray[np.float64], reduced: NDArray[np.float64]
) -> float:
    """Return the bound by multipliers and the reduced costs of the sets allowed."""
    bound = float(multipliers.sum() + np.minimum(reduced, 0.0).sum())
    return bound * (1.0 - 1e-9)


def _rounded_up(bound: float) -> int:
    return max(0, int(np.ceil(bound - _ROUNDING)))


def linear_cover(covers: NDArray[np.bool_], budget: WorkBudget) -> LinearCover:
    """Solve the linear relaxation as far as the budget lasts.

    Args:
        covers: Whether set s covers row e, shape (n_e, n_s); every row is covered.
        budget: Work.
    """
    n_rows, n_sets = covers.shape
    rows = np.argsort(covers.sum(axis=1), kind="stable")[:_FIRST_ROWS]
    solver = program(covers[rows], budget)
    primal, dual = np.zeros(n_sets), np.zeros(rows.size)
    taken = np.zeros(n_rows, dtype=bool)
    needed, reduced = 0.0, np.ones(n_sets)
    taken[rows] = True
    tight = np.sort(rows)
    while not budget.exhausted:
        entries = float(np.count_nonzero(covers[rows]) + n_sets)
        steps = int(budget.remaining / (_UNITS_PER_ITERATION * entries))
        solver.setOptionValue("simplex_iteration_limit", max(1, min(steps, 10**7)))
        solver.setOptionValue("time_limit", solver.getRunTime() + seconds_left(budget))
        run_highs(solver)
        done = float(solver.getInfo().simplex_iteration_count)
        budget.spend(_UNITS_PER_ITERATION * entries * done + 2.0 * covers.size)
        solution = solver.getSolution()
        dual = np.asarray(solution.row_dual, dtype=np.float64)
        primal = np.asarray(solution.col_value, dtype=np.float64)
        if dual.size != rows.size or primal.size != n_sets:
            break
        bound, costs = by_multipliers(covers[rows], dual)
        if bound > needed:
            needed, reduced = bound, costs
        support = np.flatnonzero(primal > 0)
        reached = covers[:, support] @ primal[support]
        tight = np.sort(rows[reached[rows] < 1.0 + _VIOLATED])
        missed = np.flatnonzero((reached < 1.0 - _VIOLATED) & ~taken)
        if missed.size == 0:
            break
        missed = missed[np.argsort(reached[missed], kind="stable")][:_BATCH]
        for row in missed:
            sets = np.flatnonzero(covers[row]).astype(np.int32)
            solver.addRow(1.0, np.inf, sets.size, sets, np.ones(sets.size))
        rows = np.concatenate([rows, missed])
        taken[missed] = True
    return LinearCover(_rounded_up(needed), needed, reduced, tight, primal)


def program(covers: NDArray[np.bool_], budget: WorkBudget) -> Any:  # noqa: ANN401
    """Return a HiGHS instance that holds min sum x, A x >= 1, 0 <= x <= 1."""
    n_rows, n_sets = covers.shape
    solver = quiet_highs(time_limit=seconds_left(budget))
    endless = np.full(n_rows, np.inf)
    rows = sparse.csr_array(covers)
    solver.passModel(row_program(np.ones(n_sets), rows, np.ones(n_rows), endless))
    return solver
