"""A round of :mod:`solvers.poses.axis_program` in CasADi, and IPOPT on it.

The two variables are a in units of the largest ring, so of order 1, for one camera a
sample. All in it is rational, so derivatives are exact and have no singular point: the
gap damps the axis itself. Every number in it is a parameter.
"""

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from .axis_problem import INSET, PITCH_POWER, AxisProgram
from .compiled import IpoptRun, Light, Nlp, run_solver, slots_for, strict_solver

_COLUMNS = 16
_SLOTS = (64, 128, 256, 512, 1024)
_HELD_SLOTS = (32, 64, 128, 256)


def build_axis_nlp(light: Light, n: int, n_held: int) -> Nlp:
    """State a round for n pairs and n_held points.

    Returns:
        x = a/largest ring, shape (2,); p as :func:`axis_parameters` packs it; f =
        -sum of weight/(1 + e); g = `axis_slack` of each held point.
    """
    x = ca.MX.sym("x", 2)
    p = ca.MX.sym("p", _COLUMNS * n + 3 * n_held + 2)
    table = ca.reshape(p[: _COLUMNS * n], n, _COLUMNS)
    held = ca.reshape(p[_COLUMNS * n : -2], n_held, 3)
    points, rays, slope_u, slope_v = (table[:, 3 * i : 3 * i + 3] for i in range(4))
    weight, fixed, noise, crowding = (table[:, 12 + i] for i in range(4))
    radius, damping = p[-2], p[-1]
    if light == "parallel":
        centre = ca.vertcat(x, 0).T
        d = points - ca.repmat(centre, n, 1)
        g = 1.0 - ca.sum2((held - ca.repmat(centre, n_held, 1)) ** 2)
    else:
        a = radius * x
        square = ca.sumsqr(a)
        z = ca.vertcat(2.0 * a, 1.0 - square) / (1.0 + square)
        cosine = points @ z
        d = ca.repmat(cosine, 1, 3) * points - ca.repmat(z.T, n, 1)
        crowding = crowding / cosine**4
        g = (held @ z * ca.sqrt(1.0 + radius**2) - 1.0) / radius**2
    damped = ca.sum2(d * d) + damping
    c = ca.sum2(rays * d) ** 2 / damped
    k = (ca.sum2(slope_u * d) ** 2 + ca.sum2(slope_v * d) ** 2) / damped
    score = c / (c * (1.0 + (crowding * k) ** PITCH_POWER) + fixed + noise * k)
    return Nlp(x, p, -ca.dot(weight, score), g)


def axis_parameters(
    program: AxisProgram, pairs: NDArray[np.int64], held: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Pack pairs (sample, camera) and held points for :func:`build_axis_nlp`.

    Rows beyond the pairs, and points beyond the held, fill the slots: pairs of weight
    0, and points that are held already.
    """
    slots, places = slots_for(len(pairs), _SLOTS), slots_for(len(held), _HELD_SLOTS)
    rows = np.resize(pairs, (slots, 2))
    at, camera = rows[:, 0], rows[:, 1]
    weight = np.where(np.arange(slots) < len(pairs), 1.0 / len(program.points), 0.0)
    distance = np.linalg.norm(program.points[at], axis=1)
    spacing = program.gap * (1.0 if program.light == "parallel" else distance)
    reach = np.maximum(program.facing[at, camera] * spacing, 1e-300)
    table = np.column_stack(
        [
            _scaled(program, program.points[at]),
            program.rays[at, camera],
            program.slopes[at, camera, 0],
            program.slopes[at, camera, 1],
            weight,
            program.min_conditioning**2
            + (program.placement_m[at, camera] / program.max_sigma_m) ** 2,
            (program.noise[at, camera] / program.max_sigma_m) ** 2,
            (program.min_pitch_px / reach) ** 2,
        ]
    )
    inside = _scaled(program, program.held[np.resize(held, places)])
    unit = program.ring_radius if program.light == "parallel" else 1.0
    return np.concatenate(
        [
            table.ravel(order="F"),
            inside.ravel(order="F"),
            [program.ring_radius, (program.gap / unit) ** 2],
        ]
    )


def run_ipopt(
    program: AxisProgram,
    pairs: NDArray[np.int64],
    held: NDArray[np.int64],
    start: NDArray[np.float64],
    reach: float,
    max_iterations: int,
) -> IpoptRun:
    """Run IPOPT on one camera a sample, from a; x = a/largest ring changes by a reach.

    Args:
        program: The program.
        pairs: Rows (sample, camera), at least one, shape (m, 2).
        held: Held points that may bind.
        start: a to start from, shape (2,).
        reach: Largest change of each coordinate of x.
        max_iterations: Limit of the run.
    """
    sizes = slots_for(len(pairs), _SLOTS), slots_for(len(held), _HELD_SLOTS)
    solver = strict_solver(
        build_axis_nlp, program.light, *sizes, max_iterations=max_iterations
    )
    x0 = start / program.ring_radius
    return run_solver(
        solver,
        x0=x0,
        p=axis_parameters(program, pairs, held),
        lbg=INSET,
        ubg=np.inf,
        lbx=x0 - reach,
        ubx=x0 + reach,
    )


def _scaled(program: AxisProgram, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Directions (diverging), or places in the device plane in largest rings."""
    if program.light == "diverging":
        return points / np.linalg.norm(points, axis=1, keepdims=True)
    return points * [1.0, 1.0, 0.0] / program.ring_radius
