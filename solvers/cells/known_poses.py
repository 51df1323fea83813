"""The poses in hand: what multipliers prove over these alone, and what they propose.

Over all poses no more can be proved than over some, so that few of them tell where a
search over cells would be in vain.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from solvers.bit_rows import BitSum, GrowingArray, pack_rows, unpack_rows
from solvers.one_thread import on_one_thread
from solvers.status import WorkBudget

from .cell_problem import CellProblem, WholeRows, whole_rows
from .cell_program import MultiplierProgram

# Rows taken into the program at a time.
_TAKEN = 100
TOLERANCE = 1e-6


class Proposed(NamedTuple):
    """Multipliers, what the dearest known pose costs by them, and whether poses reach.

    If those in hand may be enough, no multipliers refute their number, though good ones
    help whoever looks on.
    """

    multipliers: NDArray[np.int64]
    largest_cost: int
    reached: bool


class KnownPoses:
    """Proposes multipliers by which poses in hand aren't enough.

    Args:
        whole: What must be served.
        rows: Bit rows of the poses, shape (k, n_words).
        budget: Of the program.

    Attributes:
        most_proved: The most that multipliers prove over the first poses alone, as far
            as was looked; inf if there were none.
    """

    def __init__(
        self, whole: WholeRows, rows: NDArray[np.uint64], budget: WorkBudget
    ) -> None:
        self._whole, self._rows = whole, GrowingArray(rows)
        self._n_first, self.most_proved = len(rows), 0.0 if len(rows) else float("inf")
        self._program = MultiplierProgram(whole, budget)

    def append(self, rows: NDArray[np.uint64]) -> None:
        """Take more poses in hand."""
        self._rows.append(rows)

    def proposed(self, n_poses: int) -> Proposed | None:
        """Return the multipliers that so many poses miss most; None if work ended."""
        self._program.set_count(n_poses)
        while (proposal := self._program.solve()) is not None:
            reached = proposal.value > -TOLERANCE * self._whole.weights.size
            multipliers = self._whole.multipliers(proposal.multipliers)
            costs = BitSum(multipliers)(self._rows.values)
            largest = int(costs.max(initial=0))
            if largest and self._rows.size == self._n_first:
                least = float(self._whole.least_cost(multipliers) / largest)
                self.most_proved = max(self.most_proved, least)
            in_hand = np.zeros(costs.size, dtype=bool)
            in_hand[self._program.poses] = True
            most = int(costs[in_hand].max(initial=0))
            costs[in_hand] = 0
            dearest = np.argsort(-costs, kind="stable")[:_TAKEN]
            dearest = dearest[costs[dearest] > most * (1.0 + TOLERANCE)]
            if reached or not dearest.size:
                return Proposed(multipliers, max(1, largest), reached)
            rows = unpack_rows(self._rows.values[dearest], self._whole.weights.size)
            self._program.add(dearest, rows)
        return None


@on_one_thread
def proved_over(
    problem: CellProblem, known: NDArray[np.bool_], n_poses: int, budget: float
) -> float:
    """Return the most that multipliers prove over some poses.

    It is more than ``n_poses`` only where so many of them aren't enough.

    Args:
        problem: What must be served.
        known: Which rows each of the poses serves, shape (k, n_rows).
        n_poses: How many are asked about.
        budget: Counted work; where it ends, nothing is known: inf.
    """
    poses = KnownPoses(whole_rows(problem), pack_rows(known), WorkBudget(budget))
    proposal = poses.proposed(n_poses)
    if proposal is None:
        return float("inf")
    return float(n_poses) if proposal.reached else poses.most_proved
