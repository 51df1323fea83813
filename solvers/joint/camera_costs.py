"""What cameras cost with some of the projectors, at most and at least.

Each answer is kept: a cover by cameras is asked of the same projectors again and again.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solvers.covers.cover import solve_cover
from solvers.covers.cover_problem import CoverProblem
from solvers.status import SolveStatus

from .few_sets import MOST_SETS, cheapest_of_all
from .joint_problem import JointProblem

_Index = NDArray[np.int64]
# Times the work of a cover that one of two requirements may take: there are few.
_BOTH = 8.0
# Covers that one counts for whose count isn't settled.
_UNSETTLED = 4
# Wall time that no cover of counted work takes [s].
_LONG = 3600.0
# Sums of costs that are told apart; more are taken together.
_MOST_SUMS = 64
# Sums of the same costs in another order.
SAME = 1e-9


@dataclass(frozen=True, eq=False)
class Taken:
    """Devices of one kind for a cover, and what is proved of any.

    Attributes:
        chosen: Devices in increasing order; None: none were found.
        cost: What they cost; inf for none.
        bound: No devices that do cost less; inf where none do.
    """

    chosen: _Index | None
    cost: float
    bound: float


class CoverCosts:
    """Solves covers of a joint problem, at most so many, with counted work for each."""

    def __init__(
        self, problem: JointProblem, n_covers: int, budget: float, seed: int
    ) -> None:
        self.problem, self.left = problem, n_covers
        self._budget, self._seed = budget, seed
        self._known: dict[frozenset[int], Taken] = {}

    @property
    def exhausted(self) -> bool:
        """Whether no further cover may be solved."""
        return self.left <= 0

    def cameras(self, projectors: frozenset[int]) -> Taken:
        """Return the cheapest cameras found with these projectors."""
        if projectors not in self._known:
            problem = self.problem.camera_cover(sorted(projectors))
            self._known[projectors] = self._solved(
                problem, self.problem.most[1], self._budget
            )
        return self._known[projectors]

    def projectors(self, cameras: _Index) -> Taken:
        """Return the cheapest projectors found with these cameras."""
        problem = self.problem.projector_cover(cameras)
        return self._solved(problem, self.problem.most[0], _BOTH * self._budget)

    def lighting(self, hits: list[NDArray[np.bool_]]) -> Taken:
        """Return the cheapest projectors that light enough, one of each hit's."""
        problem = self.problem.projector_cover(None, hits)
        return self._solved(problem, self.problem.most[0], self._budget)

    def _solved(self, problem: CoverProblem, most: int | None, budget: float) -> Taken:
        self.left -= 1
        if problem.costs.size <= MOST_SETS:
            few = cheapest_of_all(problem, most)
            if few is None:
                return Taken(None, np.inf, np.inf)
            cost = float(problem.costs[few].sum())
            return Taken(few, cost, cost)
        found = solve_cover(
            problem,
            max_sets=most,
            time_limit=_LONG,
            seed=self._seed,
            budget=budget,
            heaviest=False,
        )
        if found.status is SolveStatus.INFEASIBLE:
            return Taken(None, np.inf, np.inf)
        if not found.lower_bound >= found.cost * (1.0 - SAME):
            # It has spent all its work.
            self.left -= _UNSETTLED - 1
        if not found.status.has_point:
            return Taken(None, np.inf, found.lower_bound)
        return Taken(found.selected, found.cost, min(found.lower_bound, found.cost))


@dataclass(frozen=True)
class CostStep:
    """Sums of camera costs that are looked at together: at least low, at most high."""

    low: float
    high: float


def cost_steps(
    costs: NDArray[np.float64], least: float, below: float
) -> list[CostStep]:
    """Return what cameras may cost from `least` on and below a number, ascending.

    All sums of the costs, each cost as often as there are cameras of it; where these
    are very many, neighbours are taken as one.
    """
    sums = sorted(_sums(costs, below * (1.0 - SAME)))
    sums = [cost for cost in sums if cost >= least * (1.0 - SAME)]
    size = -(-len(sums) // _MOST_SUMS) if sums else 1
    parts = (sums[i : i + size] for i in range(0, len(sums), size))
    return [CostStep(part[0], part[-1]) for part in parts]


def _sums(costs: NDArray[np.float64], below: float) -> Iterator[float]:
    """Yield the different sums below a number, 0 among them."""
    known = {0.0}
    values, counts = np.unique(costs, return_counts=True)
    for cost, count in zip(values.tolist(), counts.tolist(), strict=True):
        largest = min(count, int(below // cost) if below > 0.0 else 0)
        known = {
            float(f"{one + n * cost:.12g}")
            for one in known
            for n in range(largest + 1)
            if one + n * cost < below
        }
    yield from known
