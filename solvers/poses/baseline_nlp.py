"""The program of ``baseline_program`` in CasADi, one of its own for each problem."""

from collections.abc import Iterator
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from . import baseline_formulas as formulas
from .baseline_problem import BaselineProblem
from .baseline_rows import Formula, Rows, StackedRows, kind_of
from .baseline_variables import Variables

_Array = NDArray[np.float64]

_MEAN_WEIGHT = 0.05
_THIN = 1e-6


@dataclass(frozen=True, eq=False)
class BaselineProgram:
    """The stated program: minimise f, low <= g <= high.

    Attributes:
        x: Variables O_1, ..., O_k, t, and of an elastic program the aims, the rolls,
            what each limit gives way by, and what camera 1 gains at each E, (n, 1).
        objective: f.
        constraints: g.
        derivatives: Functions `jac_g` and `hess_lag` as `casadi.nlpsol` takes them.
        low: Lower bounds of g.
        high: Upper bounds of g.
        start: Where to start.
    """

    x: ca.MX
    objective: ca.MX
    constraints: ca.MX
    derivatives: dict[str, ca.Function]
    low: _Array
    high: _Array
    start: _Array


def build_baseline_program(problem: BaselineProblem) -> BaselineProgram:
    """State the program."""
    names = Variables(problem)
    blocks = [*_apart(names), *_workspace(names)]
    if len(problem.seams.points):
        blocks.append(_seams(names))
    kept = list(_kept(names)) if len(problem.kept.camera) else []
    first = sum(block.n_rows for block in blocks)
    start, x = names.start, ca.MX.sym("x", names.n)
    rows = StackedRows(x, (*blocks, *kept), *_lifted(names, kept, first))
    bounds = [block.bounds(start) for block in rows.blocks]
    constraints, none = rows.values(), ca.MX.sym("p", 0)
    both = constraints, rows.jacobian()
    jacobian = ca.Function("jac_g", [x, none], both, ["x", "p"], ["g", "jac_g_x"])
    return BaselineProgram(
        x,
        _objective(names, x),
        constraints,
        {"jac_g": jacobian, "hess_lag": _hessian(names, rows)},
        np.concatenate([low for low, _ in bounds]),
        np.concatenate([high for _, high in bounds]),
        start,
    )


def _hessian(names: Variables, rows: StackedRows) -> ca.Function:
    """Return the Hessian of sigma f + lambda.g, its upper triangle."""
    weights, scale = ca.MX.sym("lambda", rows.constant.size), ca.MX.sym("sigma")
    lambdas, near, moving = weights, np.zeros(0), np.zeros(0, dtype=np.int64)
    if names.problem.elastic:
        near, moving = names.near
    else:
        # The mean of the baselines is of the same rows as the least.
        n = len(names.problem.pairs)
        lambdas = ca.vertcat(weights[:n] - scale * _MEAN_WEIGHT / n, weights[n:])
    return ca.Function(
        "hess_lag",
        [rows.x, ca.MX.sym("p", 0), scale, weights],
        [rows.hessian(lambdas, 2.0 * scale * ca.DM(near), moving)],
        ["x", "p", "lam_f", "lam_g"],
        ["triu_hess_gamma_x_x"],
    )


def _objective(names: Variables, x: ca.MX) -> ca.MX:
    problem = names.problem
    if problem.weights is None:
        one, two = (names.centres(problem.pairs[:, i]) for i in range(2))
        apart = x[one.ravel().tolist()] - x[two.ravel().tolist()]
        baselines = ca.sqrt(ca.sum1(ca.reshape(apart, 3, len(one)) ** 2))
        return -x[names.t] - _MEAN_WEIGHT * ca.sum2(baselines) / len(one)
    near, moving = names.near
    moved = x[moving.tolist()] - ca.DM(names.start[moving])
    slacks = x[names.slacks : names.slacks + len(problem.weights)]
    return ca.dot(ca.DM(problem.weights), slacks) + ca.dot(ca.DM(near), moved**2)


def _lifted(
    names: Variables, kept: list[Rows], first: int
) -> tuple[sparse.csc_array, _Array]:
    """What is added to the margins of kept points, whose rows begin at `first`.

    A limit gives way by its slack; at an end of a part camera 1 leaves its reserve and
    what it gains to camera 2, whose own limits give way.
    """
    n_rows = first + sum(block.n_rows for block in kept)
    constant = np.zeros(n_rows)
    if not names.problem.elastic or not kept:
        return sparse.csc_array((n_rows, names.n)), constant
    n_ends, n_alone = names.n_ends, names.n_alone
    end, gain = np.arange(n_ends), names.slacks + n_alone + n_ends
    # Of each kept point up to two columns with their signs, and a constant.
    columns = np.full((n_alone + 2 * n_ends, 2), -1)
    signs, lifts = np.ones(columns.shape), np.zeros(len(columns))
    firsts = slice(n_alone, n_alone + n_ends)
    columns[:n_alone, 0] = names.slacks + np.arange(n_alone)
    columns[firsts, 0], signs[firsts, 0] = gain + end, -1.0
    lifts[firsts] = -names.problem.reserves
    both = gain + end, names.slacks + n_alone + end
    columns[n_alone + n_ends :] = np.column_stack(both)
    point = np.concatenate(
        [
            np.repeat(of_point, block.kind.n_values)
            for block, of_point in zip(kept, _kept_points(names), strict=False)
        ]
    )
    constant[first:] = lifts[point]
    row, side = np.nonzero(columns[point] >= 0)
    at = first + row, columns[point][row, side]
    matrix = sparse.csc_array((signs[point][row, side], at), shape=(n_rows, names.n))
    return matrix, constant


def _kept_points(names: Variables) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Kept points, and those of them at which rings bind."""
    kept = names.problem.kept
    ringed = np.flatnonzero(np.any(kept.ring_normals != 0.0, axis=1))
    return np.arange(len(kept.camera)), ringed


def _apart(names: Variables) -> Iterator[Rows]:
    """Yield |O_a - O_b| >= t of pairs; of an elastic program there are none."""
    problem = names.problem
    if problem.elastic:
        return
    one, two = (names.centres(problem.pairs[:, i]) for i in range(2))
    t = np.full((len(one), 1), names.t)
    yield _rows(formulas.apart, np.concatenate([one, two, t], axis=1))


def _workspace(names: Variables) -> Iterator[Rows]:
    problem, shell = names.problem, names.problem.shell
    every = np.arange(names.k)
    # What stays may stand anywhere: the workspace holds the others.
    free = names.centres(np.setdiff1d(every, problem.fixed))
    low, high = shell.radius
    # A shell thinner than this is a sphere, and an equation suits IPOPT better.
    thin = high - low < _THIN * high
    radius = (0.5 * (low + high),) * 2 if thin else (low, high)
    if len(free):
        yield _rows(formulas.distance, free, shell.centre, *radius)
        if shell.half_angle < np.pi:
            cone = *shell.centre, *shell.axis, np.cos(shell.half_angle)
            yield _rows(formulas.in_cone, free, np.array(cone))
        if shell.floor is not None:
            yield _rows(
                formulas.height, free, np.append(shell.centre, shell.up), shell.floor
            )
    held = problem.half_spaces
    if len(held.camera):
        centre = np.tile(shell.centre, (len(held.camera), 1))
        data = np.concatenate([centre, held.normals], axis=1)
        places = names.centres(held.camera)
        yield _rows(formulas.height, places, data, held.offsets[:, None])
    # Squared, since the distance from the start has no derivative at the start.
    places, most = names.centres(every), problem.max_step**2
    yield _rows(formulas.square, places, problem.centres, 0.0, most)


def _seams(names: Variables) -> Rows:
    """Camera 2 has left at E what camera 1 gives up there, and vice versa."""
    problem, seams = names.problem, names.problem.seams
    one, two = seams.cameras.T
    data = np.concatenate(
        [
            *(seams.points, seams.outward, seams.onward, seams.turn[:, None]),
            *(seams.half_fields, problem.aims[one], problem.aims[two]),
            np.full((len(one), 1), problem.max_incidence),
        ],
        axis=1,
    )
    places = np.concatenate([names.centres(one), names.centres(two)], axis=1)
    now = _rows(formulas.margins, places, data).at(names.start)
    data = np.concatenate([data, now[:, :2].min(axis=1, keepdims=True)], axis=1)
    return _rows(formulas.shared_margins, places, data, admitted=True)


def _kept(names: Variables) -> Iterator[Rows]:
    """Yield what incidence, range, the image and rings leave at kept points."""
    problem, kept = names.problem, names.problem.kept
    camera, admitted = kept.camera, not problem.elastic
    shared = np.array(
        [*problem.sides.ravel(), np.cos(problem.max_incidence), *problem.range_m]
    )
    ups = problem.ups
    ups = np.tile(problem.shell.up, (names.k, 1)) if ups is None else ups
    looks = np.column_stack([problem.aims, problem.rolls])
    data = np.concatenate(
        [
            *(kept.points, kept.normals, ups[camera]),
            np.tile(shared, (len(camera), 1)),
        ],
        axis=1,
    )
    if problem.elastic:
        yield _rows(formulas.view, names.poses(camera), data)
    else:
        data = np.concatenate([data, looks[camera]], axis=1)
        yield _rows(formulas.held_view, names.centres(camera), data, admitted=admitted)
    _, ringed = _kept_points(names)
    if len(ringed):
        m, normal = kept.ring_normals[ringed], kept.normals[ringed]
        none = np.zeros(len(camera))
        factors = (none if f is None else f for f in (kept.sigma, kept.pitch))
        data = np.column_stack(
            [
                *(kept.points[ringed], m, normal, np.einsum("ij,ij->i", m, normal)),
                np.full(len(ringed), problem.min_conditioning),
                *(factor[ringed] for factor in factors),
            ]
        )
        places = names.centres(camera[ringed])
        yield _rows(formulas.ring, places, data, admitted=admitted)


def _rows(
    formula: Formula,
    places: NDArray[np.int64],
    data: _Array | None = None,
    low: _Array | float = 0.0,
    high: float = np.inf,
    *,
    admitted: bool = False,
) -> Rows:
    """Return rows of a formula; data of one row are those of all."""
    data = np.zeros(0) if data is None else data
    data = np.broadcast_to(data, (len(places), data.shape[-1]))
    kind = kind_of(formula, places.shape[1], data.shape[1])
    return Rows(kind, places, data, np.asarray(low), np.asarray(high), admitted)
