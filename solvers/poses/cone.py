"""The direction of parallel light with the largest margin over a set of normals.

Without occlusion and steep sides, eqs. (1)-(2) for parallel light are convex::

    maximise    t
    subject to  -N_i.L >= t,   |L| <= 1

If t* > 0 then |L*| = 1, -L* is the axis of the smallest cap that holds the normals
and cos of its half angle is t*. t* = 0 (reached by L = 0) means that no direction faces
all of them. With ``|T_i.L| <= cos(tau_min)`` the program is a relaxation where |L| < 1:
its value is then a bound, and no direction is claimed.

The cone program states it (cvxpy, CLARABEL); :func:`smallest_cap` reaches the same
optimum by an active set of at most four normals, many times faster.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solvers.status import SolveStatus

_UNIT = 1e-6
_EDGE = 1e-12


@dataclass(frozen=True, eq=False)
class DirectionSolution:
    """Answer for one direction of light.

    Attributes:
        normals: Unit normals that the light must face, shape (n, 3).
        steep: Unit steep directions, zero where there is none, or None.
        tau_min: Least angle of the light to the line of a steep direction in [rad].
        status: ``OPTIMAL``: ``light`` is the best direction. ``INFEASIBLE``: no
            direction faces all normals within the limits. ``UNKNOWN``: the relaxation
            has no unit solution; its value is a bound on every direction.
        light: Unit direction L, shape (3,), or None.
        value: t*, the cosine of the largest incidence; an upper bound in any case.
        multipliers: Of -N_i.L >= t, at least 0, shape (n,); None where no program was
            solved.
        steep_multipliers: Of |T_i.L| <= cos(tau_min), 0 where there is no T, (n,).
    """

    normals: NDArray[np.float64]
    steep: NDArray[np.float64] | None
    tau_min: float
    status: SolveStatus
    light: NDArray[np.float64] | None
    value: float
    multipliers: NDArray[np.float64] | None = None
    steep_multipliers: NDArray[np.float64] | None = None

    @property
    def max_incidence(self) -> float:
        """Largest incidence in [rad], from the normals; nan without light."""
        if self.light is None:
            return float("nan")
        facing = float(np.min(-self.normals @ self.light))
        return float(np.arccos(np.clip(facing, -1.0, 1.0)))

    @property
    def min_tangent_angle(self) -> float:
        """Least angle to a steep line in [rad], recomputed; pi/2 without any."""
        if self.light is None or self.steep is None:
            return float("nan") if self.light is None else np.pi / 2
        along = float(np.max(np.abs(self.steep @ self.light), initial=0.0))
        return float(np.arccos(np.clip(along, 0.0, 1.0)))


def max_margin_direction(
    normals: NDArray[np.float64],
    steep: NDArray[np.float64] | None = None,
    tau_min: float | None = None,
) -> DirectionSolution:
    """Solve the cone program for one direction of parallel light.

    Args:
        normals: Unit normals, shape (n, 3), n at least 1.
        steep: Unit steep directions, zero where there is none, shape (n, 3).
        tau_min: Least angle to the line of a steep direction in [rad].

    Raises:
        ValueError: If the arrays are empty, not finite or don't match.
    """
    import cvxpy as cp

    _check(normals, steep, tau_min)
    light, t = cp.Variable(3), cp.Variable()
    constraints: list[Any] = [-normals @ light >= t, cp.norm(light, 2) <= 1]
    limit = 0.0 if tau_min is None else tau_min
    binds = np.zeros(len(normals), dtype=bool)
    if steep is not None and limit > 0:
        binds = np.any(steep != 0.0, axis=1)
        if np.any(binds):
            constraints.append(cp.abs(steep[binds] @ light) <= np.cos(limit))
    problem = cp.Problem(cp.Maximize(t), constraints)
    try:
        problem.solve(solver=cp.CLARABEL)
    except cp.SolverError:
        return _answer(normals, steep, limit, SolveStatus.UNKNOWN, None, 1.0)
    if problem.status != cp.OPTIMAL or light.value is None:
        return _answer(normals, steep, limit, SolveStatus.UNKNOWN, None, 1.0)
    value, found = float(problem.value), np.asarray(light.value, dtype=np.float64)  # type: ignore[arg-type]
    length = float(np.linalg.norm(found))
    if not value > _UNIT:
        # Feasible is L = 0 always, so "optimal" says nothing; its length does.
        answer = _answer(normals, steep, limit, SolveStatus.INFEASIBLE, None, 0.0)
    elif length < 1.0 - _UNIT:
        answer = _answer(normals, steep, limit, SolveStatus.UNKNOWN, None, value)
    else:
        light_of = found / length
        answer = _answer(normals, steep, limit, SolveStatus.OPTIMAL, light_of, value)
    lines = np.zeros(len(normals))
    if np.any(binds):
        lines[binds] = constraints[-1].dual_value
    prices = np.asarray(constraints[0].dual_value, dtype=np.float64)
    return replace(answer, multipliers=prices, steep_multipliers=lines)


def smallest_cap(normals: NDArray[np.float64]) -> DirectionSolution:
    """Solve the cone program without steep directions by its active set.

    The optimum is the foot of the perpendicular from 0 to the convex hull of the
    normals, which at most four of them span (Gilbert, Johnson and Keerthi's distance
    algorithm): t* is its length and -L its direction.

    Args:
        normals: Unit normals, shape (n, 3), n at least 1.
    """
    _check(normals, None, None)
    support = normals[np.argmax(normals @ normals.mean(axis=0))][None]
    nearest = support[0]
    for _ in range(4 * len(normals) + 100):
        length = float(np.linalg.norm(nearest))
        if length < _UNIT:
            break
        depths = normals @ nearest
        lowest = int(np.argmin(depths))
        if length * length - depths[lowest] <= _EDGE * length:
            break
        support, foot = _nearest_of(np.vstack([support, normals[lowest]]))
        if float(np.linalg.norm(foot)) >= length:
            break
        nearest = foot
    length = float(np.linalg.norm(nearest))
    if length < _UNIT:
        return _answer(normals, None, 0.0, SolveStatus.INFEASIBLE, None, 0.0)
    light = -nearest / length
    value = float(np.min(-normals @ light))
    if not value > 0:
        return _answer(normals, None, 0.0, SolveStatus.INFEASIBLE, None, 0.0)
    return _answer(normals, None, 0.0, SolveStatus.OPTIMAL, light, value)


def _nearest_of(
    points: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the face of a simplex nearest to 0 and its nearest point.

    Args:
        points: At most four corners, shape (k, 3).
    """
    best, foot, distance = points[:1], points[0], np.inf
    for mask in range(1, 2 ** len(points)):
        face = points[[i for i in range(len(points)) if mask >> i & 1]]
        edges = face[1:] - face[0]
        shares = np.linalg.lstsq(edges.T, -face[0], rcond=None)[0]
        if np.any(shares < -_EDGE) or shares.sum() > 1.0 + _EDGE:
            continue
        point = face[0] + shares @ edges
        if float(point @ point) < distance:
            best, foot, distance = face, point, float(point @ point)
    return best, foot


def _answer(
    normals: NDArray[np.float64],
    steep: NDArray[np.float64] | None,
    tau_min: float,
    status: SolveStatus,
    light: NDArray[np.float64] | None,
    value: float,
) -> DirectionSolution:
    return DirectionSolution(normals, steep, tau_min, status, light, value)


def _check(
    normals: NDArray[np.float64],
    steep: NDArray[np.float64] | None,
    tau_min: float | None,
) -> None:
    if normals.ndim != 2 or normals.shape[1] != 3 or len(normals) == 0:
        raise ValueError(f"normals must be (n, 3) with n >= 1, got {normals.shape}")
    if not np.all(np.abs(np.linalg.norm(normals, axis=1) - 1.0) < _UNIT):
        raise ValueError("normals must be unit vectors")
    if steep is not None:
        if steep.shape != normals.shape or not np.all(np.isfinite(steep)):
            raise ValueError(f"steep must be finite and {normals.shape}")
        if tau_min is None:
            raise ValueError("steep directions need tau_min")
    if tau_min is not None and not 0.0 <= tau_min <= np.pi / 2:
        raise ValueError(f"tau_min is {tau_min} rad, must lie within 0 and pi/2")
