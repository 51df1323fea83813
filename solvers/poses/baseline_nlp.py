"""The program of ``baseline_program`` in CasADi, one of its own for each problem."""

from dataclasses import dataclass, field

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from .baseline_problem import BaselineProblem

_Array = NDArray[np.float64]
_Matrix = ca.SX | ca.DM

_MEAN_WEIGHT = 0.05
_THIN = 1e-6
_SMOOTH = 1e-12


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
    """State the program."""
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


@dataclass
class _Stated:
    g: list[ca.SX] = field(default_factory=list)
    low: list[_Array] = field(default_factory=list)
    high: list[_Array] = field(default_factory=list)

    def add(self, g: _Matrix, low: float = 0.0, high: float = np.inf) -> None:
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
    every = centres - ca.repmat(ca.DM(shell.centre).T, k, 1)
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
    if len(held.camera):
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


def _dot(a: _Matrix, b: _Matrix) -> _Matrix:
    return ca.sum2(a * b)


def _norm(a: _Matrix) -> _Matrix:
    return ca.sqrt(ca.sum2(a * a))


def _unit(a: _Matrix) -> _Matrix:
    return a / ca.repmat(_norm(a), 1, 3)
