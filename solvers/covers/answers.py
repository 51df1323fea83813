"""What the searches over a reduced cover answer, before it goes back to the caller.

In an exact search, improvements below the rounding of a sum of all weights are no
weight: the next selection has to be better by more than that, and by a grain at least.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solvers.covers.bounds.reduced_cover import ReducedCover
from solvers.covers.bounds.relaxation import rounding
from solvers.status import SolveStatus, WorkBudget

NONE = np.empty(0, dtype=np.int64)
INTEGER_PROOF = "branch and bound (HiGHS)"
FLOORS_COUNTED = "floors counted"
HARDEST = "of the floor that takes most"
IN_STOCK = "Lagrangian bound, stock counted"


@dataclass(frozen=True, eq=False)
class Answer:
    """Sets chosen, by their indices of the reduced cover.

    Attributes:
        status: How the search ended.
        selected: The sets.
        bound: On the number or the cost of sets from below, or on the integer-valued
            weight from above, as was asked.
        proof: What proves the bound.
        total_bound: As `CoverSolution.total_bound`; None: the bound.
    """

    status: SolveStatus
    selected: NDArray[np.int64]
    bound: float
    proof: str
    total_bound: float | None = None


def cut_short(proof: str, budget: WorkBudget) -> str:
    """Return the sentence for a proof that didn't come to its end."""
    if budget.out_of_time:
        return f"{proof}; search cut by the time limit"
    return f"{proof}; no more was proved within the work budget"


@dataclass(frozen=True, eq=False)
class ExactSearch:
    """What an exact search for K sets found.

    Attributes:
        selected: Best selection found that reaches the target, or None.
        weight: Integer-valued weight that it covers, 0 without one.
        upper_bound: No K sets cover more than this.
        complete: Whether nothing is left open.
    """

    selected: NDArray[np.int64] | None
    weight: float
    upper_bound: float
    complete: bool


class Incumbent:
    """The most weight of K sets that a search has met.

    Args:
        cover: The cover.
        target: Integer-valued weight below which nothing is of interest; raised beyond
            each selection that is kept.
        first: Whether any selection that reaches the target will do.
    """

    def __init__(self, cover: ReducedCover, target: float, *, first: bool) -> None:
        self.target = target
        self.selected: NDArray[np.int64] | None = None
        self.weight = 0.0
        self._first = first
        self._grain = cover.grain
        least = np.floor(cover.total * rounding(cover.weights.size))
        self._least = max(cover.grain, float(least))

    def offer(self, chosen: NDArray[np.int64], weight: float) -> None:
        """Keep a selection that reaches the target, and ask for more from then on."""
        if weight >= self.target:
            self.selected, self.weight = chosen, weight
            self.target = weight + self._least

    @property
    def refuted(self) -> float:
        """Most weight that a sum may have below the target, where all is pruned."""
        grain = int(self._grain)
        return float((math.ceil(self.target) - 1) // grain * grain)

    @property
    def done(self) -> bool:
        """Whether any selection will do, and one is there."""
        return self._first and self.selected is not None
