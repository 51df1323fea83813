"""The program of ``baseline_program`` in CasADi, one of its own for each problem."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from .baseline_problem import BaselineProblem

_Array = NDArray[np.float64]
_Matrix = ca.SX | ca.DM

_MEAN_WEIGHT = 0.05
_THIN = 1e-6
_SMOOTH = 1e-12
# Of poses that violate limits as little, the nearest; and what slacks start from.
_NEAR = 1e-3
_SLACK = 0.1


@dataclass(frozen=True, eq=False)
class BaselineProgram:
    """The stated program: minimise f, low <= g <= high.

    Attributes:
        x: Variables O_1, ..., O_k, t, and of an elastic program the aims, the rolls,
            what each limit gives way by, and what camera 1 gains at each E, (n, 1).
        objective: f.
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
    k, begin = len(problem.centres), problem.centres.ravel()
    x, looks = ca.SX.sym("x", 3 * k + 1), np.append(problem.aims, problem.rolls)
    t, free, gives = x[3 * k], ca.SX(looks), _Slacks(problem)
    if problem.elastic:
        free = ca.SX.sym("looks", 4 * k)
    aims, rolls = ca.reshape(free[: 3 * k], 3, k).T, free[3 * k :]
    cameras = _Cameras(problem, ca.reshape(x[: 3 * k], 3, k).T, aims, rolls)
    stated, covering = _Stated(), _Stated()
    apart = _norm(
        _rows(cameras.centres, problem.pairs[:, 0])
        - _rows(cameras.centres, problem.pairs[:, 1])
    )
    if not problem.elastic:
        stated.add(apart - t)
    _state_workspace(stated, problem, cameras.centres)
    if len(problem.seams.points):
        _state_seams(covering, problem, cameras)
    if len(problem.kept.camera):
        _state_kept(covering, problem, cameras, gives.lifts)
    every = ca.vertcat(x, free, gives.slack, gives.gain) if problem.elastic else x
    start = np.append(begin, problem.smallest_baseline)
    if problem.weights is not None:
        first = np.full(len(problem.weights), _SLACK), np.zeros(len(problem.reserves))
        start = np.concatenate([start, looks, *first])
        start[3 * k] = 0.0
        moved = ca.vertcat(x[: 3 * k] - begin, free[: 3 * k] - looks[: 3 * k])
        objective = ca.dot(ca.DM(problem.weights), gives.slack)
        turned = ca.sumsqr(rolls - problem.rolls)
        objective += _NEAR * (ca.sumsqr(moved) / problem.max_step**2 + turned)
    else:
        covering.admit(every, start)
        objective = -t - _MEAN_WEIGHT * ca.sum1(apart) / len(problem.pairs)
    return BaselineProgram(
        every,
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


@dataclass(frozen=True, eq=False)
class _Slacks:
    """What limits give way by; at an end of a part what camera 1 gains there, too."""

    problem: BaselineProblem

    @cached_property
    def alone(self) -> ca.SX:
        n_ends = len(self.problem.reserves)
        return ca.SX.sym("alone", len(self.problem.kept.camera) - 2 * n_ends)

    @cached_property
    def ended(self) -> ca.SX:
        return ca.SX.sym("ended", len(self.problem.reserves))

    @cached_property
    def gain(self) -> ca.SX:
        return ca.SX.sym("gain", len(self.problem.reserves))

    @property
    def slack(self) -> ca.SX:
        return ca.vertcat(self.alone, self.ended)

    @property
    def lifts(self) -> ca.SX:
        """What is added to the margins of kept points."""
        if not self.problem.elastic:
            return ca.SX.zeros(len(self.problem.kept.camera))
        first = -self.gain - ca.DM(self.problem.reserves)
        return ca.vertcat(self.alone, first, self.gain + self.ended)


@dataclass(frozen=True, eq=False)
class _Cameras:
    """Cameras by their centres and aims, (k, 3) each, and rolls, (k, 1)."""

    problem: BaselineProblem
    centres: _Matrix
    aims: _Matrix
    rolls: _Matrix

    @cached_property
    def axes(self) -> _Matrix:
        return _unit(self.aims - self.centres)

    @cached_property
    def sides(self) -> tuple[_Matrix, _Matrix]:
        """The image's own x and y, each (k, 3): `look_at`, turned by the roll."""
        z, ups = self.axes, self.problem.ups
        if ups is None:
            ups = np.tile(self.problem.shell.up, (z.shape[0], 1))
        level = _unit(_cross(z, ca.DM(ups)))
        down = _cross(z, level)
        c, s = (ca.repmat(f(self.rolls), 1, 3) for f in (ca.cos, ca.sin))
        return c * level + s * down, c * down - s * level


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


def _state_seams(stated: _Stated, problem: BaselineProblem, cameras: _Cameras) -> None:
    """Camera 2 has left at E what camera 1 gives up there, and vice versa."""
    left1, left2 = _seam_margins(problem, cameras.centres, cameras.axes)
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
    stated: _Stated, problem: BaselineProblem, cameras: _Cameras, lifts: ca.SX
) -> None:
    kept = problem.kept
    ray = ca.DM(kept.points) - _rows(cameras.centres, kept.camera)
    distance = _norm(ray)
    for margin in _view_margins(problem, cameras, ray, distance):
        stated.add(margin + lifts)
    ringed = np.flatnonzero(np.any(kept.ring_normals != 0.0, axis=1))
    if len(ringed):
        for margin in _ring_margins(problem, _rows(ray, ringed), ringed):
            stated.add(margin + lifts[ringed.tolist()])


def _view_margins(
    problem: BaselineProblem, cameras: _Cameras, ray: _Matrix, distance: _Matrix
) -> Iterator[_Matrix]:
    """Yield what incidence, range and the four sides of the image leave."""
    kept, (near, far) = problem.kept, problem.range_m
    yield -_dot(ray, ca.DM(kept.normals)) / distance - np.cos(problem.max_incidence)
    yield distance / near - 1.0
    yield 1.0 - distance / far
    depth = _dot(ray, _rows(cameras.axes, kept.camera)) / distance
    for low, high, across in zip(*problem.sides, cameras.sides, strict=True):
        aside = _dot(ray, _rows(across, kept.camera)) / distance
        yield (aside - low * depth) / np.hypot(1.0, low)
        yield (high * depth - aside) / np.hypot(1.0, high)


def _ring_margins(
    problem: BaselineProblem, ray: _Matrix, ringed: NDArray[np.int64]
) -> Iterator[_Matrix]:
    """Yield what |r.m|, s_N and ring pitch leave."""
    kept = problem.kept
    m, normal = kept.ring_normals[ringed], kept.normals[ringed]
    distance = _norm(ray)
    along = _dot(ray, ca.DM(m)) / distance
    facing = -_dot(ray, ca.DM(normal)) / distance
    yield along - problem.min_conditioning
    slant = np.einsum("ij,ij->i", m, normal)
    square = along**2 + facing**2 + 2.0 * along * facing * ca.DM(slant)
    # v is null only where ring and surface are parallel; keep the root smooth there.
    spread = distance * ca.sqrt(square + _SMOOTH)
    for coefficient, needed in ((kept.sigma, along), (kept.pitch, facing)):
        if coefficient is not None:
            yield needed - spread * ca.DM(coefficient[ringed])


def _rows(matrix: _Matrix, index: NDArray[np.int64]) -> _Matrix:
    return matrix[[int(i) for i in index], :]


def _dot(a: _Matrix, b: _Matrix) -> _Matrix:
    return ca.sum2(a * b)


def _norm(a: _Matrix) -> _Matrix:
    return ca.sqrt(ca.sum2(a * a))


def _unit(a: _Matrix) -> _Matrix:
    return a / ca.repmat(_norm(a), 1, 3)


def _cross(a: _Matrix, b: _Matrix) -> _Matrix:
    columns = ((1, 2), (2, 0), (0, 1))
    return ca.horzcat(*(a[:, i] * b[:, j] - a[:, j] * b[:, i] for i, j in columns))
