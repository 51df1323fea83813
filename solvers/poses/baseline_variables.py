"""Which variables of the program of ``baseline_program`` are what."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .baseline_problem import BaselineProblem

_Array = NDArray[np.float64]

# Of poses that violate limits as little, the nearest; and what slacks start from.
_NEAR = 1e-3
_SLACK = 0.1


@dataclass(frozen=True, eq=False)
class Variables:
    """Which variables of x are what."""

    problem: BaselineProblem

    @property
    def k(self) -> int:
        """How many cameras there are."""
        return len(self.problem.centres)

    @property
    def t(self) -> int:
        """The least baseline."""
        return 3 * self.k

    @property
    def n(self) -> int:
        """How many variables there are."""
        return len(self.start)

    @property
    def n_ends(self) -> int:
        """How many ends of parts there are."""
        return len(self.problem.reserves)

    @property
    def slacks(self) -> int:
        """The first of what limits give way by."""
        return 7 * self.k + 1

    @property
    def n_alone(self) -> int:
        """How many kept points are at no end of a part."""
        return len(self.problem.kept.camera) - 2 * self.n_ends

    def centres(self, cameras: NDArray[np.int64]) -> NDArray[np.int64]:
        """Those of O_c, shape (m, 3)."""
        return 3 * cameras[:, None] + np.arange(3)

    def poses(self, cameras: NDArray[np.int64]) -> NDArray[np.int64]:
        """Those of O_c, the aim and the roll, shape (m, 7)."""
        k, aims = self.k, 3 * self.k + 1
        rolls = aims + 3 * k + cameras[:, None]
        centres = self.centres(cameras)
        return np.concatenate([centres, aims + centres, rolls], axis=1)

    @cached_property
    def near(self) -> tuple[_Array, NDArray[np.int64]]:
        """What a square of a pose's variables costs, and which these are.

        Centres and aims count by the step, rolls in [rad].
        """
        n_moved = 3 * self.k
        moving = np.append(np.arange(n_moved), n_moved + 1 + np.arange(4 * self.k))
        near = np.full(moving.size, _NEAR / self.problem.max_step**2)
        near[2 * n_moved :] = _NEAR
        return near, moving

    @cached_property
    def start(self) -> _Array:
        """Where to start, (n,)."""
        problem = self.problem
        begin = problem.centres.ravel()
        if problem.weights is None:
            return np.append(begin, problem.smallest_baseline)
        slacks = np.full(len(problem.weights), _SLACK)
        looks = np.append(problem.aims, problem.rolls)
        return np.concatenate([begin, [0.0], looks, slacks, np.zeros(self.n_ends)])
