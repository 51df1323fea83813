"""Linear relaxation of full covers of equal costs, over few of their rows.

Any subset of the rows asks less, so what holds from below for a subset holds for the
whole. The linear program takes rows in until no other is violated.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solvers.status import WorkBudget

from .node_program import NodeProgram

_FIRST_ROWS = 200
_BATCH = 100
_VIOLATED = 1e-6
# Rounding of sums of multipliers.
_ROUNDING = 1e-7


@dataclass(frozen=True, eq=False)
class LinearCover:
    """Linear relaxation of a full cover, by rows.

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
    """Solve the linear relaxation as far as the budget lasts.

    Args:
        covers: Whether set s covers row e, shape (n_e, n_s); every row is covered.
        budget: Work.
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
        missed = missed[np.argsort(reached[missed], kind="stable")][:_BATCH]
        program.take_in(covers[missed])
        rows = np.concatenate([rows, missed])
        taken[missed] = True
    return LinearCover(needed, reduced, tight, primal)
