"""What the searches over a reduced cover answer, before it goes back to the caller."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solvers.covers.bounds.reductions import ReducedCover
from solvers.covers.search.neighbourhood import prune
from solvers.status import SolveStatus, WorkBudget

NONE = np.empty(0, dtype=np.int64)
INTEGER_PROOF = "branch and bound (HiGHS)"


@dataclass(frozen=True, eq=False)
class CountAnswer:
    """Fewest or cheapest sets that reach the weight; indices of the reduced cover.

    The bound counts sets or sums costs, as was asked.
    """

    status: SolveStatus
    selected: NDArray[np.int64]
    lower_bound: float
    proof: str


@dataclass(frozen=True, eq=False)
class WeightAnswer:
    """Most weight of K sets; indices and weight of the reduced cover."""

    status: SolveStatus
    selected: NDArray[np.int64]
    upper_bound: float
    proof: str


def better(
    cover: ReducedCover, selected: NDArray[np.int64], other: NDArray[np.int64] | None
) -> NDArray[np.int64]:
    """Return the cheaper of a cover and a proposal that may not be one."""
    if other is None or not cover.meets(other):
        return selected
    other = prune(cover, other)
    cheaper = cover.costs[other].sum() < cover.costs[selected].sum() * (1.0 - 1e-12)
    return other if cheaper else selected


def cut_short(proof: str, budget: WorkBudget) -> str:
    """Return the sentence for a proof that didn't come to its end."""
    if budget.out_of_time:
        return f"{proof}; search cut by the time limit"
    return f"{proof}; no more was proved within the work budget"
