"""The ring axis of a projector: where its cameras measure most, and most exactly.

In the frame in which the axis moves the rings' centre is the origin and X a point; an
axis is two numbers a. With u = X/|X| and z(a) the unit vector a along the axis::

    parallel:   the axis runs along +z through (a_x, a_y, 0),   d = (X_x, X_y, 0) - a
    diverging:  z(a) = (2 a_x, 2 a_y, 1 - a.a)/(1 + a.a),       d = (u.z) u - z

so m = d/|d| is the ring normal at X and |a| = tan(half the tilt) in diverging light.
For a camera with viewing ray r and g = G m (`docs/reference/semantics.md`, G = J_r^T
(N r^T - (N.r) I)) the three limits on a measurable pair, each as a share of its limit,
make a smooth count of what is measured::

    c = (r.d)^2/(d.d + gap^2),   k = |G d|^2/(d.d + gap^2)
    e = (c_0^2 + (s_R^2 + s^2 k)/s_max^2) / c + (p_0^2 k / (f h)^2)^4
    maximise  sum over samples of max over cameras of 1/(1 + e)
    subject to  every held point inside the largest ring

The gap damps what is inside the innermost ring, where m turns through all directions.
The max over cameras is that of the best at the current axis, which touches the true
sum from below: no round makes it less. ``axis_nlp`` states a round in CasADi; answers
are checked here in numpy, with formulas of their own.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solvers.status import SolveStatus

from .axis_problem import PITCH_POWER, AxisProgram
from .compiled import local_status

_ROUNDS, _ITERATIONS = 10, 100
# Of a round, in units of the largest ring.
_REACH = 0.5
_SHRINK = 0.3
_DIRECTIONS = 32
_SETTLED = 1e-5
_AZIMUTHS = 12
# Of the largest ring, the axis' distance from the middle.
_REACHES = (0.15, 0.3, 0.45, 0.6)


@dataclass(frozen=True, eq=False)
class AxisSolution:
    """Answer of :func:`solve_axis`; figures are recomputed in numpy over all samples.

    Attributes:
        program: The program this answers.
        status: ``LOCALLY_OPTIMAL`` if at IPOPT's answer the cameras that it was given
            are the best, ``FEASIBLE`` if the rounds ended before, ``UNKNOWN`` if no
            axis held every point inside the largest ring.
        axis: a, shape (2,); the start unless a better was found.
        value: Mean of :func:`axis_scores`.
        slack: Least of :func:`axis_slack`.
    """

    program: AxisProgram
    status: SolveStatus
    axis: NDArray[np.float64]
    value: float
    slack: float

    @property
    def moved(self) -> bool:
        """Whether the axis differs from the start."""
        return not np.array_equal(self.axis, self.program.start)


def axis_direction(axis: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return z(a) of diverging light, unit, shape (3,)."""
    square = float(axis @ axis)
    return np.array([2.0 * axis[0], 2.0 * axis[1], 1.0 - square]) / (1.0 + square)


def pair_scores(program: AxisProgram, axis: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return 1/(1 + e) of every sample and camera, shape (n, k); 0 where not seen."""
    points = program.points
    if program.light == "parallel":
        d = np.column_stack([points[:, :2] - axis, np.zeros(len(points))])
        spacing = np.full(len(points), program.gap)
    else:
        z, distance = axis_direction(axis), np.linalg.norm(points, axis=1)
        u = points / distance[:, None]
        cosine = u @ z
        d = cosine[:, None] * u - z
        spacing = distance * program.gap * cosine**2
    damped = (np.einsum("ij,ij->i", d, d) + program.gap**2)[:, None]
    c = np.einsum("ikj,ij->ik", program.rays, d) ** 2 / damped
    k = np.sum(np.einsum("ikaj,ij->ika", program.slopes, d) ** 2, axis=2) / damped
    variance = (program.placement_m**2 + program.noise**2 * k) / program.max_sigma_m**2
    reach = program.facing * spacing[:, None]
    crowding = program.min_pitch_px**2 * k / np.maximum(reach, 1e-300) ** 2
    score = c / (
        c * (1.0 + crowding**PITCH_POWER) + program.min_conditioning**2 + variance
    )
    return np.where(program.seen, score, 0.0)


def axis_scores(program: AxisProgram, axis: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return each sample's best 1/(1 + e), over cameras and projectors, (n,)."""
    scores = pair_scores(program, axis).max(axis=1, initial=0.0)
    return np.maximum(scores, program.others)


def axis_slack(program: AxisProgram, axis: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return by how much each held point is inside the largest ring, shape (h,).

    1 - (distance to the axis / largest ring)^2 (parallel), or
    (cos(angle to the axis) / cos(atan(largest ring)) - 1) / (largest ring)^2.
    """
    held, radius = program.held, program.ring_radius
    if program.light == "parallel":
        return 1.0 - np.sum((held[:, :2] - axis) ** 2, axis=1) / radius**2
    u = held / np.linalg.norm(held, axis=1, keepdims=True)
    return (u @ axis_direction(axis) * np.hypot(1.0, radius) - 1.0) / radius**2


def solve_axis(program: AxisProgram) -> AxisSolution:
    """Move an axis to where cameras measure most, near its start; never a worse one."""
    from .axis_nlp import run_ipopt

    best = np.array(program.start, dtype=np.float64)
    best_value, best_slack = _figures(program, best)
    binding, reach, settled = _outermost(program), _REACH, False
    for _ in range(_ROUNDS):
        pairs = _assigned(program, best)
        if pairs.size == 0:
            break
        outcome = run_ipopt(program, pairs, binding, best, reach, _ITERATIONS)
        axis = program.ring_radius * outcome.x
        if not np.all(np.isfinite(axis)):
            break
        broken = np.flatnonzero(axis_slack(program, axis) < 0.0)
        if broken.size:
            binding = np.union1d(binding, broken[:_DIRECTIONS])
            continue
        value, slack = _figures(program, axis)
        gain = value - best_value
        if best_slack >= 0.0 and gain < -_SETTLED:
            # IPOPT may leap over a peak into a lower valley: no farther than this.
            reach *= _SHRINK
            continue
        inside = np.max(np.abs(axis - best)) < 0.99 * reach * program.ring_radius
        if gain > 0.0 or not best_slack >= 0.0:
            best, best_value, best_slack = axis, value, slack
        settled = outcome.success and bool(inside)
        settled &= np.array_equal(pairs, _assigned(program, axis))
        if settled or (inside and gain < _SETTLED):
            break
    status = local_status(held=best_slack >= 0.0, settled=settled)
    return AxisSolution(program, status, best, best_value, best_slack)


def better_starts(program: AxisProgram) -> list[NDArray[np.float64]]:
    """Return the axes of a polar grid that are better than the start, best first.

    Blind curves make the program many-peaked.
    """
    angle = 2.0 * np.pi * np.arange(_AZIMUTHS) / _AZIMUTHS
    ways = np.column_stack([np.cos(angle), np.sin(angle)])
    sizes = np.array(_REACHES) * program.ring_radius
    axes = (sizes[:, None, None] * ways).reshape(-1, 2)
    value, slack = _figures(program, program.start)
    least = value if slack >= 0.0 else -np.inf
    figures = [_figures(program, axis) for axis in axes]
    values = np.array([v if inside >= 0.0 else -np.inf for v, inside in figures])
    order = np.argsort(-values, kind="stable")
    return [axes[i] for i in order if values[i] > least]


def _figures(program: AxisProgram, axis: NDArray[np.float64]) -> tuple[float, float]:
    return (
        float(np.mean(axis_scores(program, axis))),
        float(np.min(axis_slack(program, axis), initial=np.inf)),
    )


def _assigned(program: AxisProgram, axis: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the best camera of each sample that this projector has, shape (m, 2)."""
    scores = pair_scores(program, axis)
    camera = (
        np.argmax(scores, axis=1)
        if scores.shape[1]
        else np.zeros(len(scores), dtype=int)
    )
    seen = program.seen.any(axis=1)
    best = scores.max(axis=1, initial=0.0)
    rows = np.flatnonzero(seen & (best >= program.others))
    return np.column_stack([rows, camera[rows]]).astype(np.int64)


def _outermost(program: AxisProgram) -> NDArray[np.int64]:
    held = program.held
    if not len(held):
        return np.zeros(0, dtype=np.int64)
    flat = held[:, :2] if program.light == "parallel" else held[:, :2] / held[:, 2:]
    angle = 2.0 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    ways = np.stack([np.cos(angle), np.sin(angle)])
    return np.unique(np.argmax(flat @ ways, axis=0))
