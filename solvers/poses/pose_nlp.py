"""The pose program of :mod:`solvers.poses.pose_program` in CasADi, and IPOPT on it.

Variables, all of order 1: q = (Q - Q0)/size, Gibbs vector s of the turn about the start
rotation R0, margin t [rad]::

    R = R0 [(1 - s.s) I + 2 s s^T + 2 [s]x] / (1 + s.s)

Both are rational, so derivatives are exact and have no singular point nearby. A ridge
1e-6 (q.q + s.s) makes the free directions (a turn that no limit feels) stay where they
are. Every number in it is a parameter.
"""

from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from .compiled import IpoptRun, Light, Nlp, run_solver, slots_for, strict_solver
from .pose_problem import INSET, PoseProgram, pose_margins

RIDGE = 1e-6
_N_SCALARS = 44
# Parameters of the device among them.
_DEVICE = 8
# Turns stay below 90 degrees.
_MAX_GIBBS = 0.577
_SLOTS = (16, 32, 64, 128, 256, 512)
# Half-spaces come in steps of this, so that few programs are built.
_PLANES = 8


def build_pose_nlp(light: Light, n: int, n_planes: int = 0) -> Nlp:
    """State the program for n samples and n_planes half-spaces.

    Returns:
        x = (q, s, t); p as :func:`pose_parameters` packs it.
    """
    x = ca.MX.sym("x", 7)
    p = ca.MX.sym("p", 9 * n + _N_SCALARS + 4 * n_planes)
    q, s, t = x[0:3], x[3:6], x[6]
    points = ca.reshape(p[: 3 * n], n, 3)
    normals = ca.reshape(p[3 * n : 6 * n], n, 3)
    steep = ca.reshape(p[6 * n : 9 * n], n, 3)
    c = p[9 * n :]
    start = ca.reshape(c[0:9], 3, 3)
    rotation = start @ _gibbs(s)
    away = points - ca.repmat(q.T, n, 1)
    local = away @ rotation
    ring = local @ ca.reshape(c[9:18], 3, 3) + ca.repmat(c[18:21].T, n, 1)
    squares = ca.sum2(away * away)
    across = ring[:, 0] ** 2 + ring[:, 1] ** 2
    if light == "diverging":
        distance = ca.sqrt(squares)
        rays = away / ca.repmat(distance, 1, 3)
        facing = -ca.sum2(normals * rays)
        along = ca.sum2(steep * rays)
        x_, y_, z_ = (local[:, i] / distance for i in range(3))
        lows = [
            x_ - c[21] * z_,
            c[22] * z_ - x_,
            y_ - c[23] * z_,
            c[24] * z_ - y_,
            squares - c[25],
            c[26] - squares,
            (c[27] * ring[:, 2] ** 2 - across) / squares,
        ]
    else:
        beam = rotation[:, 2]
        facing = -normals @ beam
        along = steep @ beam
        lows = [
            local[:, 0] - c[21],
            c[22] - local[:, 0],
            local[:, 1] - c[23],
            c[24] - local[:, 1],
            local[:, 2] - c[25],
            c[26] - local[:, 2],
            c[27] - across,
            c[28] - local[:, 0] ** 2 - local[:, 1] ** 2,
        ]
    tangent = ca.cos(c[30] + t)
    offset = q + c[31:34]
    radius = ca.sumsqr(offset)
    g = ca.vertcat(
        facing - ca.cos(c[29] - t),
        tangent - along,
        tangent + along,
        *lows,
        radius - c[34],
        c[35] - radius,
        ca.dot(c[36:39], offset) - c[39] * ca.sqrt(radius),
        ca.dot(c[40:43], q) - c[43],
    )
    if n_planes:
        planes = ca.reshape(c[_N_SCALARS:], n_planes, 4)
        g = ca.vertcat(g, planes[:, :3] @ q - planes[:, 3])
    f = -t + RIDGE * (ca.sumsqr(q) + ca.sumsqr(s))
    return Nlp(x, p, f, g)


def pose_parameters(
    program: PoseProgram, index: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Pack samples and limits for :func:`build_pose_nlp`.

    Returns:
        The parameters p, and the lower bound of each g: ``INSET`` for a hard limit, 0
        for a margin, -inf for what doesn't apply.
    """
    n = index.size
    size = _size(program)
    start = program.world_from_device
    points = (program.points[index] - start[:3, 3]) / size
    steep = program.steep[index]
    frame = np.eye(4) if program.ring_from_device is None else program.ring_from_device
    device = _device_limits(program, size)
    up = np.zeros(3) if program.up is None else program.up
    scalars = np.concatenate(
        [
            start[:3, :3].ravel(order="F"),
            frame[:3, :3].T.ravel(order="F"),
            frame[:3, 3] / size,
            np.pad(device, (0, _DEVICE - device.size)),
            [program.max_incidence, program.min_tangent_angle],
            (start[:3, 3] - program.centre) / size,
            np.square(program.shell_m) / size**2,
            program.axis,
            [np.cos(program.half_angle)],
            up,
            [(program.floor - up @ start[:3, 3]) / size],
        ]
    )
    bent = np.where(np.any(steep != 0.0, axis=1), 0.0, -np.inf)
    bounded = program.half_angle < np.pi
    floored = program.up is not None and np.isfinite(program.floor)
    normals, offsets = program.half_spaces[:, :3], program.half_spaces[:, 3]
    held = np.column_stack([normals, (offsets - normals @ start[:3, 3]) / size])
    planes = np.pad(held, ((0, n_planes_of(program) - len(held)), (0, 0)))
    last = [True, True, bounded, floored, *(np.arange(len(planes)) < len(held))]
    lower = np.concatenate(
        [
            np.zeros(n),
            bent,
            bent,
            np.repeat(np.where(np.isfinite(device), INSET, -np.inf), n),
            np.where(last, INSET, -np.inf),
        ]
    )
    columns = [a.ravel(order="F") for a in (points, program.normals[index], steep)]
    packed = np.concatenate([*columns, scalars, planes.ravel(order="F")])
    return np.nan_to_num(packed, posinf=0, neginf=0), lower


def n_planes_of(program: PoseProgram) -> int:
    """Return how many half-spaces the program is built with."""
    return -(-len(program.half_spaces) // _PLANES) * _PLANES


def _device_limits(program: PoseProgram, size: float) -> NDArray[np.float64]:
    """Return the device parameters; those of constraints that don't apply are inf."""
    sides, ring = program.sides.T.ravel(), program.ring_radius
    if program.light == "diverging":
        return np.array([*sides, *np.square(program.range_m) / size**2, ring**2])
    across = np.square([ring / size, program.beam_radius_m / size])
    return np.array([*sides / size, *np.array(program.range_m) / size, *across])


def run_ipopt(
    program: PoseProgram,
    active: NDArray[np.int64],
    start: NDArray[np.float64],
    *,
    max_iterations: int,
) -> IpoptRun:
    """Run IPOPT over some samples, at least one, from a pose, shape (4, 4)."""
    slots = slots_for(active.size, _SLOTS)
    index = np.resize(active, slots)
    p, lower = pose_parameters(program, index)
    sizes = slots, n_planes_of(program)
    solver = strict_solver(
        build_pose_nlp, program.light, *sizes, max_iterations=max_iterations
    )
    reach = program.max_move_m / _size(program)
    box = np.array([*[reach] * 3, *[_MAX_GIBBS] * 3])
    return run_solver(
        solver,
        x0=variables_of(program, start),
        p=p,
        lbg=lower,
        ubg=np.inf,
        lbx=np.append(-box, -0.5 * np.pi),
        ubx=np.append(box, program.max_incidence),
    )


def pose_of(program: PoseProgram, x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return ``world_from_device`` of variables (q, s, t)."""
    start = program.world_from_device
    s = x[3:6]
    cross = np.array([[0, -s[2], s[1]], [s[2], 0, -s[0]], [-s[1], s[0], 0]])
    turn = ((1 - s @ s) * np.eye(3) + 2 * np.outer(s, s) + 2 * cross) / (1 + s @ s)
    pose = np.eye(4)
    pose[:3, :3] = start[:3, :3] @ turn
    pose[:3, 3] = start[:3, 3] + _size(program) * x[:3]
    return pose


def variables_of(
    program: PoseProgram, pose: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return variables (q, s, t) of a pose turned by less than pi from the start."""
    start = program.world_from_device
    turn = start[:3, :3].T @ pose[:3, :3]
    twist = np.array(
        [turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]
    )
    q = (pose[:3, 3] - start[:3, 3]) / _size(program)
    margin = float(np.min(pose_margins(program, pose)))
    return np.array([*q, *(twist / (1.0 + np.trace(turn))), margin])


def _gibbs(s: Any) -> Any:  # noqa: ANN401
    squares = ca.sumsqr(s)
    numerator = (1 - squares) * ca.MX.eye(3) + 2 * (s @ s.T) + 2 * ca.skew(s)
    return numerator / (1 + squares)


def _size(program: PoseProgram) -> float:
    """Length in [m] that the program is scaled by: mean distance of the samples."""
    away = program.points - program.world_from_device[:3, 3]
    return float(np.mean(np.linalg.norm(away, axis=1)))
