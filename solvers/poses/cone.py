"""The direction of parallel light with the largest margin over a set of normals.

Without occlusion and tangent limits, eqs. (1)-(2) for parallel light are convex::

    maximise    t
    subject to  -N_i.L >= t,   |L| <= 1

If t* > 0 then |L*| = 1, -L* is the axis of the smallest cap that holds the normals
and cos of its half angle is t*. t* = 0 (reached by L = 0) means that no direction faces
all of them. Multipliers a >= 0 of sum 1 prove it: no L faces all normals by more than
|sum a_i N_i|, which is t* at the optimum.

The program is stated once for each number of slots, with the normals as a parameter.
Importing cvxpy takes 0.5 to 0.9 s, stating a program 10 to 25 ms, a solve 1 to 12 ms.
"""

import warnings
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solvers.status import SolveStatus

from .compiled import slots_for

_UNIT = 1e-6
# What the value may lack of the bound that its multipliers prove.
_GAP = 1e-7
_SLOTS = (64, 256, 1024, 4096, 16384)


@dataclass(frozen=True, eq=False)
class DirectionSolution:
    """Answer for one direction of light.

    Attributes:
        status: ``OPTIMAL``: ``light`` is the best direction, as the multipliers prove.
            ``INFEASIBLE``: no direction faces all normals. ``UNKNOWN``: the solver
            failed, or its multipliers prove too little.
        light: Unit direction L, shape (3,); None unless optimal.
        value: Cosine of the largest incidence under that light; 0 without light.
        bound: No direction has a larger one, by the multipliers.
        multipliers: Of -N_i.L >= t, at least 0, of sum 1, shape (n,).
    """

    status: SolveStatus
    light: NDArray[np.float64] | None
    value: float
    bound: float
    multipliers: NDArray[np.float64]

    @property
    def max_incidence(self) -> float:
        """Largest incidence in [rad]; nan without light."""
        if self.light is None:
            return float("nan")
        return float(np.arccos(np.clip(self.value, -1.0, 1.0)))


def max_margin_direction(normals: NDArray[np.float64]) -> DirectionSolution:
    """Solve the cone program over unit normals, shape (n, 3), n at least 1.

    Raises:
        ValueError: If the normals aren't such an array.
    """
    _check(normals)
    light, multipliers = _solved(normals)
    total = float(multipliers.sum())
    if not (np.all(np.isfinite(light)) and total > 0.0):
        none = np.zeros(len(normals))
        return DirectionSolution(SolveStatus.UNKNOWN, None, 0.0, 1.0, none)
    multipliers = multipliers / total
    bound = float(np.linalg.norm(multipliers @ normals))
    if bound <= _UNIT:
        # L = 0 holds the limits always, so "optimal" alone says nothing.
        return DirectionSolution(SolveStatus.INFEASIBLE, None, 0.0, bound, multipliers)
    light = light / np.linalg.norm(light)
    value = float(np.min(-normals @ light))
    if not value >= bound - _GAP:
        return DirectionSolution(SolveStatus.UNKNOWN, None, 0.0, bound, multipliers)
    return DirectionSolution(SolveStatus.OPTIMAL, light, value, bound, multipliers)


def _solved(
    normals: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return L and the multipliers as the solver leaves them; nan where it fails."""
    import cvxpy as cp

    slots = slots_for(len(normals), _SLOTS)
    index = np.resize(np.arange(len(normals)), slots)
    problem, parameter, light, facing = _program(slots)
    parameter.value = normals[index]
    try:
        with warnings.catch_warnings():
            # That an answer may be inaccurate is for the multipliers to say.
            warnings.simplefilter("ignore", UserWarning)
            # A warm start would make the answer depend on the programs before.
            problem.solve(solver=cp.CLARABEL, warm_start=False)
    except cp.SolverError:
        return np.full(3, np.nan), np.zeros(len(normals))
    if light.value is None or facing.dual_value is None:
        return np.full(3, np.nan), np.zeros(len(normals))
    multipliers = np.zeros(len(normals))
    np.add.at(multipliers, index, np.maximum(facing.dual_value, 0.0))
    return light.value, multipliers


@lru_cache(maxsize=len(_SLOTS))
def _program(slots: int) -> tuple[Any, Any, Any, Any]:
    """Return the program for so many normals: it, them, L, and the limit on each."""
    import cvxpy as cp

    normals = cp.Parameter((slots, 3))
    light, t = cp.Variable(3), cp.Variable()
    facing = -normals @ light >= t
    problem = cp.Problem(cp.Maximize(t), [facing, cp.norm(light, 2) <= 1])
    return problem, normals, light, facing


def _check(normals: NDArray[np.float64]) -> None:
    if normals.ndim != 2 or normals.shape[1] != 3 or len(normals) == 0:
        raise ValueError(f"normals must be (n, 3) with n >= 1, got {normals.shape}")
    if not np.all(np.abs(np.linalg.norm(normals, axis=1) - 1.0) < _UNIT):
        raise ValueError("normals must be unit vectors")
