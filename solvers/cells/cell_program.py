"""The linear program that proposes multipliers, by rows added where they are broken.

The least upper bound on what K poses serve, over multipliers lambda_i = w_i u_i / r_i::

    minimise    K theta + sum_g t_g (w(g) - W_g) - sum_i w_i u_i
    subject to  sum_{i in S} (w_i / r_i) u_i <= theta   for the poses S in hand
                0 <= u_i <= t_g,  sum_g t_g = 1

Where W is required of all rows as well, t <= t_g for all sets adds -t (W - sum_g W_g).

A negative value refutes K poses of those in hand: its multipliers satisfy need(lambda)
> K M. Rows are a few hundred poses. What comes back is a proposal, evaluated again in
integers by who uses it.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solvers.one_thread import quiet_highs, run_highs, seconds_left
from solvers.status import WorkBudget

from .cell_problem import WholeRows

# Work of one simplex iteration for each row and pose in hand.
_UNITS_PER_ENTRY = 0.25


@dataclass(frozen=True, eq=False)
class Proposal:
    """Multipliers of one linear program.

    Attributes:
        multipliers: Shape (n_rows,), at least 0.
        value: The optimum over the poses in hand.
    """

    multipliers: NDArray[np.float64]
    value: float


class MultiplierProgram:
    """A program that keeps its basis while poses come."""

    def __init__(self, whole: WholeRows, budget: WorkBudget) -> None:
        import highspy

        self._highs = highspy
        self._budget = budget
        self._whole = whole
        self._live = np.flatnonzero((whole.weights > 0) & (whole.needs > 0))
        scale = self._live.size / max(1, int(whole.weights[self._live].sum()))
        self._gains = whole.weights[self._live] * scale
        self._costs = self._gains / whole.needs[self._live]
        self._sets = whole.row_sets[self._live]
        # A set that its free rows meet alone needs nothing.
        self._slack = np.array(
            [
                (int(whole.weights[whole.row_sets == g].sum()) - needed) * scale
                for g, needed in enumerate(whole.needed)
            ]
        )
        lacking = whole.needed_total - sum(whole.needed)
        # The price of what is required of all, where that is more than the floors.
        self._of_all = np.full(int(lacking > 0), -lacking * scale)
        self.poses = np.empty(0, dtype=np.int64)
        self._solver = self._model()

    def set_count(self, n_poses: float) -> None:
        """Ask about this number of poses from now on."""
        self._solver.changeColCost(self._live.size, float(n_poses))

    def add(self, poses: NDArray[np.int64], serves: NDArray[np.bool_]) -> None:
        """Take poses in hand, with their rows as a matrix (n, n_rows)."""
        n, ones = len(poses), np.ones((len(poses), 1), dtype=bool)
        row, column = np.nonzero(np.hstack([serves[:, self._live], ones]))
        starts = np.searchsorted(row, np.arange(n)).astype(np.int32)
        values = np.append(self._costs, -1.0)[column]
        below = np.full(n, -self._highs.kHighsInf)
        self._solver.addRows(
            n, below, np.zeros(n), row.size, starts, column.astype(np.int32), values
        )
        self.poses = np.concatenate([self.poses, poses])

    def solve(self) -> Proposal | None:
        """Return the program's multipliers, or None if it wasn't solved."""
        cost = _UNITS_PER_ENTRY * self._live.size * (self.poses.size + 12)
        steps = int(min(self._budget.remaining / cost, 1e7))
        if steps < 1 or self._budget.exhausted:
            return None
        self._solver.setOptionValue("simplex_iteration_limit", steps)
        # HiGHS' time counts from when the model was made.
        clock = float(self._solver.getRunTime()) + seconds_left(self._budget)
        self._solver.setOptionValue("time_limit", clock)
        run_highs(self._solver)
        taken = self._solver.getInfo().simplex_iteration_count
        self._budget.spend(max(0, int(taken)) * cost + 1e5)
        solution = self._solver.getSolution()
        values = np.asarray(solution.col_value, dtype=np.float64)
        n = self._live.size
        if values.size <= n or not np.all(np.isfinite(values)):
            return None
        multipliers = np.zeros(self._whole.weights.size)
        multipliers[self._live] = self._costs * np.clip(values[:n], 0.0, None)
        value = float(self._solver.getInfo().objective_function_value)
        return Proposal(multipliers, value)

    def _model(self) -> Any:  # noqa: ANN401
        n, n_sets = self._live.size, self._slack.size
        solver = quiet_highs(solver="simplex")
        infinity = self._highs.kHighsInf
        upper = np.concatenate(
            [np.ones(n), [infinity], np.ones(n_sets + self._of_all.size)]
        )
        lower = np.zeros_like(upper)
        solver.addVars(lower.size, lower, upper)
        costs = np.concatenate([-self._gains, [1.0], self._slack, self._of_all])
        every = np.arange(lower.size, dtype=np.int32)
        solver.changeColsCost(every.size, every, costs)
        places = (n + 1 + np.arange(n_sets)).astype(np.int32)
        solver.addRow(1.0, 1.0, n_sets, places, np.ones(n_sets))
        for place in places[: n_sets * self._of_all.size]:
            pair = np.array([n + 1 + n_sets, place], dtype=np.int32)
            solver.addRow(-infinity, 0.0, 2, pair, np.array([1.0, -1.0]))
        if n_sets > 1:
            # With one set its share is 1, and the bound of u says the same.
            for i, g in enumerate(self._sets):
                pair = np.array([i, n + 1 + int(g)], dtype=np.int32)
                solver.addRow(-infinity, 0.0, 2, pair, np.array([1.0, -1.0]))
        return solver
