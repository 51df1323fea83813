"""Slide cameras apart: the largest smallest baseline that coverage allows.

Given cameras that aim at fixed points, seams where their parts meet and points that a
camera must keep, choose centres O_c::

    maximise    t + w mean_pairs |O_a - O_b|
    subject to  |O_a - O_b| >= t                              neighbouring pairs
                phi_s(O_1, O_2) <= phi_max                    seam points, eq. (10)
                N.(O_c - P) >= cos(theta) |O_c - P|           kept points: incidence
                lo <= |O_c - P| <= hi                         range
                a_c.(P - O_c) >= cos(b) |O_c - P|             field
                sign m.(P - O_c) >= e |O_c - P|               ring conditioning
                O_c in the workspace shell,  |O_c - start| <= step

with a_c the direction from O_c to its aim. At a seam point with its frame (out, on)
frozen, angles are signed and smooth, g(v) = atan2(v.on, v.out), v_i = O_i - E::

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

from .status import SolveStatus

_Array = NDArray[np.float64]
_Matrix = ca.SX | ca.DM

_MEAN_WEIGHT = 0.05
_MAX_ITERATIONS = 150
_THIN = 1e-6


@dataclass(frozen=True, eq=False)
class Shell:
    """Where camera centres may stand: a shell, a cone cut from it, a floor.

    Attributes:
        centre: Centre of the shell in [m], shape (3,).
        radius: Least and largest distance from the centre in [m].
        axis: Unit axis of the cone, shape (3,).
        half_angle: Half opening of the cone in [rad]; pi is the whole shell.
        up: Unit vector, shape (3,).
        floor: Least height above the centre along `up` in [m]; None: no floor.
    """

    centre: _Array
    radius: tuple[float, float]
    axis: _Array
    half_angle: float
    up: _Array
    floor: float | None = None


@dataclass(frozen=True, eq=False)
class SeamPoints:
    """Points E where the parts of two cameras meet; every array has one row a point.

    Attributes:
        cameras: Indices of camera 1 and camera 2, shape (s, 2).
        points: E in [m], shape (s, 3).
        outward: Unit normal in the plane O1, E, O2 at the start, shape (s, 3).
        onward: Unit direction in it towards camera 2's stretch, shape (s, 3).
        turn: delta, turn of the surface at E, convex positive [rad], shape (s,).
        half_fields: b_1 and b_2 in [rad], shape (s, 2).
    """

    cameras: NDArray[np.int64]
    points: _Array
    outward: _Array
    onward: _Array
    turn: _Array
    half_fields: _Array


@dataclass(frozen=True, eq=False)
class KeptPoints:
    """Points that one camera must go on to measure; one row a point.

    Attributes:
        camera: Index of the camera, shape (m,).
        points: P in [m], shape (m, 3).
        normals: Unit normals, shape (m, 3).
        field_cosine: Least cosine between ray and optical axis, shape (m,).
        ring_normals: Ring normals m, signed so that m.r > 0 at the start, shape (m, 3);
            zero rows don't bind.
    """

    camera: NDArray[np.int64]
    points: _Array
    normals: _Array
    field_cosine: _Array
    ring_normals: _Array


@dataclass(frozen=True, eq=False)
class BaselineProblem:
    """Data of the program in the module's docstring.

    Attributes:
        centres: O_c to start from in [m], shape (k, 3).
        aims: Point that each camera looks at in [m], shape (k, 3).
        pairs: Indices of neighbouring cameras, shape (p, 2), p >= 1.
        shell: Where centres may stand.
        seams: Where parts meet.
        kept: What each camera must keep.
        max_incidence: theta in [rad].
        range_m: Least and largest |O - P| of kept points in [m].
        min_conditioning: e, least |r.m| of kept points.
        max_step: Farthest that a centre may move in [m].
    """

    centres: _Array
    aims: _Array
    pairs: NDArray[np.int64]
    shell: Shell
    seams: SeamPoints
    kept: KeptPoints
    max_incidence: float
    range_m: tuple[float, float]
    min_conditioning: float
    max_step: float

    def __post_init__(self) -> None:
        k = len(self.centres)
        if self.centres.shape != (k, 3) or self.aims.shape != (k, 3):
            raise ValueError(f"centres and aims must be ({k}, 3)")
        if self.pairs.ndim != 2 or self.pairs.shape[1] != 2 or len(self.pairs) < 1:
            raise ValueError(
                f"pairs must be (p, 2) with p >= 1, got {self.pairs.shape}"
            )
        indices = (self.pairs, self.seams.cameras, self.kept.camera)
        if not all(np.all((i >= 0) & (i < k)) for i in indices):
            raise ValueError(f"camera indices must lie in 0 to {k - 1}")
        if not 0.0 < self.max_step < np.inf:
            raise ValueError(f"max_step is {self.max_step} m, must be positive")
        if not np.all(np.linalg.norm(self.aims - self.centres, axis=1) > 0.0):
            raise ValueError("an aim coincides with its camera's centre")

    @property
    def smallest_baseline(self) -> float:
        """Smallest baseline of neighbours at the start in [m]."""
        return smallest_baseline(self.centres, self.pairs)


@dataclass(frozen=True, eq=False)
class BaselineSolution:
    """Answer to a :class:`BaselineProblem`.

    Attributes:
        problem: The problem this answers.
        status: `LOCALLY_OPTIMAL`, or `UNKNOWN` where IPOPT failed.
        centres: O_c in [m], shape (k, 3); those of the start where it failed.
        iterations: Of IPOPT.
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


def smallest_baseline(centres: _Array, pairs: NDArray[np.int64]) -> float:
    """Return the smallest distance over pairs of centres in [m]."""
    apart = centres[pairs[:, 0]] - centres[pairs[:, 1]]
    return float(np.linalg.norm(apart, axis=1).min())


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
    solver = ca.nlpsol(
        "baseline",
        "ipopt",
        {"x": program.x, "f": program.objective, "g": program.constraints},
        {
            "ipopt.linear_solver": "mumps",
            "ipopt.print_level": 0,
            "ipopt.sb": "yes",
            "ipopt.max_iter": _MAX_ITERATIONS,
            "ipopt.tol": 1e-7,
            "ipopt.acceptable_iter": 0,
            # Monotone barriers creep here: 300 steps and more, against 9 or so.
            "ipopt.mu_strategy": "adaptive",
            "print_time": False,
            "error_on_fail": False,
        },
    )
    answer = solver(x0=program.start, lbg=program.low, ubg=program.high)
    stats: dict[str, Any] = solver.stats()
    iterations = int(stats["iter_count"])
    found = np.asarray(answer["x"], dtype=np.float64).ravel()
    if not (stats["success"] and np.all(np.isfinite(found))):
        return BaselineSolution(
            problem, SolveStatus.UNKNOWN, problem.centres, iterations
        )
    centres = found[:-1].reshape(-1, 3)
    return BaselineSolution(problem, SolveStatus.LOCALLY_OPTIMAL, centres, iterations)


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
    offset = centres - _repeated(shell.centre, k)
    distance = _norm(offset)
    low, high = shell.radius
    # A shell thinner than this is a sphere, and an equation suits IPOPT better.
    thin = high - low < _THIN * high
    stated.add(distance, *((0.5 * (low + high),) * 2 if thin else (low, high)))
    if shell.half_angle < np.pi:
        stated.add(offset @ ca.DM(shell.axis) - np.cos(shell.half_angle) * distance)
    if shell.floor is not None:
        stated.add(offset @ ca.DM(shell.up), shell.floor)
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
        along = _dot(_rows(ray, ringed), ca.DM(kept.ring_normals[ringed]))
        stated.add(along / _rows(distance, ringed), problem.min_conditioning)


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
