"""Slide cameras apart: the largest smallest baseline that coverage allows.

Given cameras that aim at fixed points, seams where their parts meet and points that a
camera must keep, choose centres O_c::

    maximise    t + w mean_pairs |O_a - O_b|
    subject to  |O_a - O_b| >= t                              neighbouring pairs
                phi_s(O_1, O_2) <= phi_max                    seam points, eq. (10)
                N.(O_c - P) >= cos(theta) |O_c - P|           kept points: incidence
                lo <= |O_c - P| <= hi                         range
                a_c.(P - O_c) >= cos(b) |O_c - P|             field
                m.(P - O_c) >= e |O_c - P|                    ring conditioning
                m.r >= q t |v|,  -N.r >= p t |v|              s_N and ring pitch
                O_c in the workspace shell,  |O_c - start| <= step

with a_c the direction from O_c to its aim, r = (P - O_c)/t, t = |P - O_c| and
v = r x (N x m), so that |v|^2 = (r.m)^2 + (r.N)^2 - 2 (r.m)(r.N)(N.m). At a seam point
with its frame (out, on) frozen, angles are signed and smooth: with v_i = O_i - E and
g(v) = atan2(v.on, v.out)::

    iota_1 = -g(v_1),  iota_2 = g(v_2) - delta,  beta_1 = g(-a_1) - g(v_1),
    beta_2 = g(v_2) - g(-a_2),   phi = iota_1 + delta + iota_2

Camera 1 is held at the end of its coverage: with r its smaller margin at the start,
both (theta - iota_1 - r) and (b_1 - beta_1 - r), what camera 1 gains, added to either
theta - iota_2 or b_2 - beta_2, what camera 2 has left, stay >= 0. Where both meet the
incidence limit this reads phi <= 2 theta + delta, and so for the field. What is past a
limit at the start may stay there but gets no worse.

The program is smooth and not convex; IPOPT gives a local optimum from exact
derivatives. What coverage really does is for the caller's rays to say.

Source: Lee and Krim, 2014, eqs. (9)-(10); `formulation.md` section 6.
"""

from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from solvers.status import SolveStatus, interruptible

from .baseline_problem import BaselineProblem, smallest_baseline

_Array = NDArray[np.float64]
_Matrix = ca.SX | ca.DM

_MEAN_WEIGHT = 0.05
_MAX_ITERATIONS = 150
# The monotone barrier is robust but creeps, 300 steps against 10: it comes last.
_BARRIERS = (
    {"ipopt.mu_strategy": "adaptive", "ipopt.mu_oracle": "loqo"},
    {"ipopt.mu_strategy": "monotone"},
)
# MUMPS spends a third less on these small systems by approximate minimum degree.
_AMD = 0
_THIN = 1e-6
_SMOOTH = 1e-12


@dataclass(frozen=True, eq=False)
class BaselineSolution:
    """Answer to a :class:`BaselineProblem`.

    Attributes:
        problem: The problem this answers.
        status: `LOCALLY_OPTIMAL`, or `UNKNOWN` where IPOPT failed.
        centres: O_c in [m], shape (k, 3); those of the start where it failed.
        iterations: Of IPOPT, over all its runs.
    """

    problem: BaselineProblem
    status: SolveStatus
    centres: _Array
    iterations: int

    @property
    def smallest_baseline(self) -> float:
        """Smallest baseline of neighbours in [m], recomputed from the centres."""
        return smallest_baseline(self.centres, self.problem.pairs)


@dataclass(frozen=True, eq=False)
class BaselineProgram:
    """The stated program: x = (O_1, ..., O_k, t), minimise f, low <= g <= high.

    Attributes:
        x: Variables, (3 k + 1, 1).
        objective: f, to be minimised.
        constraints: g.
        low: Lower bounds of g.
        high: Upper bounds of g.
        start: Where to start.
    """

    x: ca.SX
    objective: ca.SX
    constraints: ca.SX
    low: _Array
    high: _Array
    start: _Array


def build_baseline_program(problem: BaselineProblem) -> BaselineProgram:
    """State the program of a problem."""
    k = len(problem.centres)
    x = ca.SX.sym("x", 3 * k + 1)
    centres = ca.reshape(x[: 3 * k], 3, k).T
    t = x[3 * k]
    axes = _unit(ca.SX(problem.aims) - centres)
    apart = _norm(
        _rows(centres, problem.pairs[:, 0]) - _rows(centres, problem.pairs[:, 1])
    )
    stated = _Stated()
    stated.add(apart - t)
    _state_workspace(stated, problem, centres)
    covering = _Stated()
    if len(problem.seams.points):
        _state_seams(covering, problem, centres, axes)
    if len(problem.kept.camera):
        _state_kept(covering, problem, centres, axes)
    start = np.append(problem.centres.ravel(), problem.smallest_baseline)
    covering.admit(x, start)
    objective = -t - _MEAN_WEIGHT * ca.sum1(apart) / len(problem.pairs)
    return BaselineProgram(
        x,
        objective,
        ca.vertcat(*stated.g, *covering.g),
        np.concatenate(stated.low + covering.low),
        np.concatenate(stated.high + covering.high),
        start,
    )


def solve_baseline(problem: BaselineProblem) -> BaselineSolution:
    """Solve a problem with IPOPT (MUMPS), from its centres.

    A local optimum, the same on every run; no clock is consulted.
    """
    program = build_baseline_program(problem)
    iterations = 0
    for barrier in _BARRIERS:
        found, stats = _run_ipopt(problem, program, barrier)
        iterations += int(stats["iter_count"])
        if stats["success"] and np.all(np.isfinite(found)):
            centres = found[:-1].reshape(-1, 3)
            status = SolveStatus.LOCALLY_OPTIMAL
            return BaselineSolution(problem, status, centres, iterations)
    return BaselineSolution(problem, SolveStatus.UNKNOWN, problem.centres, iterations)


def _run_ipopt(
    problem: BaselineProblem, program: BaselineProgram, barrier: dict[str, str]
) -> tuple[_Array, dict[str, Any]]:
    solver = ca.nlpsol(
        "baseline",
        "ipopt",
        {"x": program.x, "f": program.objective, "g": program.constraints},
        {
            **barrier,
            "ipopt.linear_solver": "mumps",
            "ipopt.mumps_pivot_order": _AMD,
            "ipopt.print_level": 0,
            "ipopt.sb": "yes",
            "ipopt.max_iter": _MAX_ITERATIONS,
            "ipopt.tol": 1e-7,
            "ipopt.acceptable_iter": 0,
            "print_time": False,
            "show_eval_warnings": False,
            "error_on_fail": False,
            # The gradient by parameters, of which there are none.
            "no_nlp_grad": True,
        },
    )
    # The step's ball holds these bounds too; they keep iterates from running away.
    reach = np.full(len(program.start) - 1, 1.1 * problem.max_step)
    longest = 2.0 * (np.abs(program.start[:-1]).max() + reach[0])
    reach.reshape(-1, 3)[list(problem.fixed)] = 0.0
    with interruptible():
        answer = solver(
            x0=program.start,
            lbx=np.append(program.start[:-1] - reach, 0.0),
            ubx=np.append(program.start[:-1] + reach, 2.0 * longest),
            lbg=program.low,
            ubg=program.high,
        )
    return np.asarray(answer["x"], dtype=np.float64).ravel(), solver.stats()


@dataclass
class _Stated:
    """Constraints gathered so far."""

    g: list[ca.SX] = field(default_factory=list)
    low: list[_Array] = field(default_factory=list)
    high: list[_Array] = field(default_factory=list)

    def add(self, g: _Matrix, low: float = 0.0, high: float = np.inf) -> None:
        """Add rows low <= g <= high."""
        n = g.numel()
        self.g.append(ca.SX(g))
        self.low.append(np.full(n, low))
        self.high.append(np.full(n, high))

    def admit(self, x: ca.SX, start: _Array) -> None:
        """Let what is past a limit at the start stay there, but get no worse."""
        if self.g:
            g = ca.Function("g", [x], [ca.vertcat(*self.g)])
            now = np.asarray(g(start), dtype=np.float64).ravel()
            self.low = [np.minimum(np.concatenate(self.low), now)]
            self.high = [np.maximum(np.concatenate(self.high), now)]


def _state_workspace(
    stated: _Stated, problem: BaselineProblem, centres: _Matrix
) -> None:
    shell = problem.shell
    k = len(problem.centres)
    every = centres - _repeated(shell.centre, k)
    # What stays may stand anywhere: the workspace holds the others.
    free = np.setdiff1d(np.arange(k), problem.fixed)
    offset = _rows(every, free) if problem.fixed else every
    distance = _norm(offset)
    low, high = shell.radius
    # A shell thinner than this is a sphere, and an equation suits IPOPT better.
    thin = high - low < _THIN * high
    stated.add(distance, *((0.5 * (low + high),) * 2 if thin else (low, high)))
    if shell.half_angle < np.pi:
        stated.add(offset @ ca.DM(shell.axis) - np.cos(shell.half_angle) * distance)
    if shell.floor is not None:
        stated.add(offset @ ca.DM(shell.up), shell.floor)
    held = problem.half_spaces
    if held is not None and len(held.camera):
        along = _dot(_rows(every, held.camera), ca.DM(held.normals))
        stated.add(along - ca.DM(held.offsets))
    # Squared, since the distance from the start has no derivative at the start.
    stated.add(
        ca.sum2((centres - ca.SX(problem.centres)) ** 2), 0.0, problem.max_step**2
    )


def _state_seams(
    stated: _Stated, problem: BaselineProblem, centres: _Matrix, axes: _Matrix
) -> None:
    """Camera 2 has left at E what camera 1 gives up there, and vice versa."""
    left1, left2 = _seam_margins(problem, centres, axes)
    now1, _ = _seam_margins(
        problem, ca.DM(problem.centres), _unit(ca.DM(problem.aims - problem.centres))
    )
    reserve = ca.fmin(*now1)
    for first in left1:
        for second in left2:
            stated.add(first - reserve + second)


def _seam_margins(
    problem: BaselineProblem, centres: _Matrix, axes: _Matrix
) -> tuple[tuple[_Matrix, _Matrix], tuple[_Matrix, _Matrix]]:
    """Return theta - iota_i and b_i - beta_i of both cameras at every seam point."""
    seams = problem.seams
    points, turn = ca.DM(seams.points), ca.DM(seams.turn)

    def bearing(v: _Matrix) -> _Matrix:
        return ca.atan2(_dot(v, ca.DM(seams.onward)), _dot(v, ca.DM(seams.outward)))

    one, two = seams.cameras[:, 0], seams.cameras[:, 1]
    at1 = bearing(_rows(centres, one) - points)
    at2 = bearing(_rows(centres, two) - points)
    back1, back2 = bearing(-_rows(axes, one)), bearing(-_rows(axes, two))
    theta, half = problem.max_incidence, ca.DM(seams.half_fields)
    return (
        (theta + at1, half[:, 0] - back1 + at1),
        (theta - at2 + turn, half[:, 1] - at2 + back2),
    )


def _state_kept(
    stated: _Stated, problem: BaselineProblem, centres: _Matrix, axes: _Matrix
) -> None:
    kept = problem.kept
    ray = ca.DM(kept.points) - _rows(centres, kept.camera)
    distance = _norm(ray)
    stated.add(
        -_dot(ray, ca.DM(kept.normals)) / distance, float(np.cos(problem.max_incidence))
    )
    stated.add(distance, problem.range_m[0], problem.range_m[1])
    stated.add(_dot(ray, _rows(axes, kept.camera)) / distance - kept.field_cosine)
    ringed = np.flatnonzero(np.any(kept.ring_normals != 0.0, axis=1))
    if len(ringed):
        _state_rings(stated, problem, _rows(ray, ringed), ringed)


def _state_rings(
    stated: _Stated,
    problem: BaselineProblem,
    ray: _Matrix,
    ringed: NDArray[np.int64],
) -> None:
    kept = problem.kept
    m, normal = kept.ring_normals[ringed], kept.normals[ringed]
    distance = _norm(ray)
    along = _dot(ray, ca.DM(m)) / distance
    facing = -_dot(ray, ca.DM(normal)) / distance
    stated.add(along, problem.min_conditioning)
    slant = np.einsum("ij,ij->i", m, normal)
    square = along**2 + facing**2 + 2.0 * along * facing * ca.DM(slant)
    # v is null only where ring and surface are parallel; keep the root smooth there.
    spread = distance * ca.sqrt(square + _SMOOTH)
    for coefficient, needed in ((kept.sigma, along), (kept.pitch, facing)):
        if coefficient is not None:
            stated.add(needed - spread * ca.DM(coefficient[ringed]))


def _rows(matrix: _Matrix, index: NDArray[np.int64]) -> _Matrix:
    return matrix[[int(i) for i in index], :]


def _repeated(row: _Array, n: int) -> ca.DM:
    return ca.repmat(ca.DM(row).T, n, 1)


def _dot(a: _Matrix, b: _Matrix) -> _Matrix:
    return ca.sum2(a * b)


def _norm(a: _Matrix) -> _Matrix:
    return ca.sqrt(ca.sum2(a * a))


def _unit(a: _Matrix) -> _Matrix:
    return a / ca.repmat(_norm(a), 1, 3)
