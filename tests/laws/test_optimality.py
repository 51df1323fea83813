"""Optima of the cone and the pose program, derived again: KKT, derivatives, searches.

Nothing here comes from CasADi or cvxpy but the answer and its multipliers. The pose
program is stated once more in numpy, with scipy's rotations.
"""

import itertools

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from geometry.poses import look_at
from solvers.poses.cone import max_margin_direction
from solvers.poses.pose_nlp import (
    _MAX_GIBBS,
    RIDGE,
    build_pose_nlp,
    pose_of,
    pose_parameters,
    run_ipopt,
)
from solvers.poses.pose_problem import INSET, PoseProgram, pose_margins
from solvers.poses.pose_program import solve_pose

K = np.array([[1400.0, 0.0, 639.5], [0.0, 1400.0, 399.5], [0.0, 0.0, 1.0]])
IMAGE = (np.array([[0.0, 0.0], [1279.0, 799.0]]) - K[:2, 2]) / 1400.0
PANEL = np.outer([-1.0, 1.0], (0.07, 0.065))
LIGHTS = ["diverging", "parallel"]


def unit(v):
    v = np.asarray(v, dtype=float)
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def cap(rng, n, half_angle, axis=(0.0, -1.0, 0.0)):
    """Normals within an angle of an axis."""
    lean = unit(np.cross(axis, rng.normal(size=(n, 3))))
    angle = half_angle * np.sqrt(rng.random(n))[:, None]
    return np.cos(angle) * unit(axis) + np.sin(angle) * lean


# --- the cone program


@pytest.mark.parametrize("seed", range(8))
def test_kkt_of_the_cone_program_from_its_multipliers(seed):
    """With a the multipliers of -N.L >= t::

    a >= 0,   sum a = 1,   -N^T a = t* L,   a_i (-N_i.L - t) = 0
    """
    normals = cap(np.random.default_rng(seed), 40, 1.1)
    found = max_margin_direction(normals)
    a, light = found.multipliers, found.light
    assert a.min() >= 0.0
    assert a.sum() == pytest.approx(1.0, abs=1e-12)
    assert -normals.T @ a == pytest.approx(found.value * light, abs=3e-5)
    assert a * (-normals @ light - found.value) == pytest.approx(0.0, abs=2e-7)


def test_cone_program_against_every_set_of_three():
    """The best cap is that of one, two or three of its normals."""
    rng = np.random.default_rng(1)
    for trial in range(60):
        normals = cap(rng, int(rng.integers(1, 9)), rng.uniform(0.2, 1.5))
        best = -1.0
        for k in (1, 2, 3):
            for chosen in itertools.combinations(normals, min(k, len(normals))):
                three = np.array(chosen)
                if np.linalg.matrix_rank(three, tol=1e-9) < len(three):
                    continue
                # Equal cosines to all, in their span.
                axis = np.linalg.pinv(three) @ np.ones(len(three))
                best = max(best, float(np.min(normals @ unit(axis))))
        found = max_margin_direction(normals)
        assert found.value == pytest.approx(max(best, 0.0), abs=2e-7), trial


# --- the pose program


def program_for(light, seed, **changes):
    """A body whose normals lean aside: field, cone, floor, ring and range all apply."""
    rng = np.random.default_rng(seed)
    normals = cap(rng, 16, 0.6, axis=(0.35, -1.0, 0.25))
    steep = unit(np.cross(normals, rng.normal(size=normals.shape)))
    steep[::3] = 0.0
    start = look_at(np.array([0.05, -1.0, 0.02]), np.zeros(3), np.array([0, 0, 1.0]))
    ring = np.eye(4)
    ring[:3, :3] = Rotation.from_rotvec([0.05, -0.03, 0.02]).as_matrix()
    ring[:3, 3] = [0.002, 0.001, 0.003]
    arguments = {
        "points": 0.05 * normals,
        "normals": normals,
        "steep": steep,
        "light": light,
        "world_from_device": start,
        "max_incidence": np.radians(60),
        "min_tangent_angle": np.radians(25),
        "range_m": (0.85, 1.3),
        "shell_m": (0.9, 1.1),
        "centre": np.array([0.01, 0.0, -0.01]),
        "axis": unit([0.1, -1.0, 0.0]),
        "half_angle": 0.22,
        "sides": IMAGE if light == "diverging" else PANEL,
        "beam_radius_m": 0.075,
        "ring_radius": 0.12 if light == "diverging" else 0.08,
        "ring_from_device": ring,
        "up": np.array([0.0, 0.0, 1.0]),
        "floor": -0.2,
    }
    return PoseProgram(**(arguments | changes))


def stated(program, x):
    """f and g of the pose program at x = (q, s, t), in numpy alone."""
    q, s, t = x[:3], x[3:6], x[6]
    start, n = program.world_from_device, len(program.points)
    size = np.linalg.norm(program.points - start[:3, 3], axis=1).mean()
    position = start[:3, 3] + size * q
    turn = start[:3, :3] @ Rotation.from_quat([*s, 1.0]).as_matrix()
    away = program.points - position
    local = away @ turn
    frame = program.ring_from_device
    ring = (local @ frame[:3, :3].T + frame[:3, 3]) / size
    local, across = local / size, ring[:, 0] ** 2 + ring[:, 1] ** 2
    if program.light == "diverging":
        distance = np.linalg.norm(local, axis=1)
        rays = unit(away)
        (left, top), (right, bottom) = program.sides
        u = local / distance[:, None]
        lows = [
            u[:, 0] - left * u[:, 2],
            right * u[:, 2] - u[:, 0],
            u[:, 1] - top * u[:, 2],
            bottom * u[:, 2] - u[:, 1],
            distance**2 - (program.range_m[0] / size) ** 2,
            (program.range_m[1] / size) ** 2 - distance**2,
            (
                (program.ring_radius * ring[:, 2]) ** 2
                - ring[:, 0] ** 2
                - ring[:, 1] ** 2
            )
            / distance**2,
        ]
    else:
        rays = np.broadcast_to(turn[:, 2], (n, 3))
        half = program.sides[1] / size
        lows = [
            local[:, 0] + half[0],
            half[0] - local[:, 0],
            local[:, 1] + half[1],
            half[1] - local[:, 1],
            local[:, 2] - program.range_m[0] / size,
            program.range_m[1] / size - local[:, 2],
            (program.ring_radius / size) ** 2 - across,
            (program.beam_radius_m / size) ** 2 - local[:, 0] ** 2 - local[:, 1] ** 2,
        ]
    facing = -np.sum(program.normals * rays, axis=1)
    along = np.sum(program.steep * rays, axis=1)
    tangent = np.cos(program.min_tangent_angle + t)
    offset = (position - program.centre) / size
    radius = offset @ offset
    g = np.concatenate(
        [
            facing - np.cos(program.max_incidence - t),
            tangent - along,
            tangent + along,
            *lows,
            [
                radius - (program.shell_m[0] / size) ** 2,
                (program.shell_m[1] / size) ** 2 - radius,
                program.axis @ offset - np.cos(program.half_angle) * np.sqrt(radius),
                (program.up @ position - max(program.floor, -9.0)) / size,
            ],
        ]
    )
    return -t + RIDGE * (q @ q + s @ s), g


def slopes(program, x, step=1e-6):
    """Central differences of f (7,) and g (m, 7)."""
    f, g = [], []
    for e in np.eye(7):
        (f1, g1), (f0, g0) = (stated(program, x + k * step * e) for k in (1, -1))
        f.append((f1 - f0) / (2 * step))
        g.append((g1 - g0) / (2 * step))
    return np.array(f), np.stack(g, axis=1)


@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize("seed", range(3))
def test_gradient_and_jacobian_are_those_of_the_statement_in_numpy(light, seed):
    program = program_for(light, seed)
    rng = np.random.default_rng(100 + seed)
    nlp = build_pose_nlp(light, 16)
    both = ca.vertcat(nlp.f, nlp.g)
    exact = ca.Function("e", [nlp.x, nlp.p], [both, ca.jacobian(both, nlp.x)])
    p, lower = pose_parameters(program, np.arange(16))
    steep = np.any(program.steep != 0.0, axis=1)
    applies = np.isfinite(lower)
    # All kinds apply: everything but the tangent limit where there is no T.
    assert np.array_equal(applies[16:48], np.tile(steep, 2))
    assert applies[48:].all()
    for _ in range(4):
        x = np.append(rng.normal(0, 0.05, 6), rng.uniform(0.0, 0.4))
        value, slope = (np.asarray(part) for part in exact(x, p))
        f, g = stated(program, x)
        assert value.ravel() == pytest.approx(np.array([f, *g]), abs=1e-12)
        of_f, of_g = slopes(program, x)
        assert slope[0] == pytest.approx(of_f, abs=1e-8)
        assert slope[1:] == pytest.approx(of_g, abs=2e-8)


@pytest.mark.parametrize("light", LIGHTS)
def test_hessian_times_vector_is_the_change_of_the_gradient(light):
    """Of the Lagrangian f + y.g, against differences of its numpy gradient."""
    program = program_for(light, 0)
    rng = np.random.default_rng(7)
    nlp = build_pose_nlp(light, 16)
    y = ca.MX.sym("y", nlp.g.shape[0])
    hessian, gradient = ca.hessian(nlp.f + ca.dot(y, nlp.g), nlp.x)
    exact = ca.Function("h", [nlp.x, nlp.p, y], [hessian, gradient])
    p, _ = pose_parameters(program, np.arange(16))
    x = np.append(rng.normal(0, 0.05, 6), 0.2)
    prices = rng.normal(size=nlp.g.shape[0])
    table = np.asarray(exact(x, p, prices)[0])
    assert table == pytest.approx(table.T, abs=1e-12)

    def gradient_at(at):
        of_f, of_g = slopes(program, at, step=1e-4)
        return of_f + of_g.T @ prices

    for _ in range(3):
        v = rng.normal(size=7)
        step = 1e-3
        change = (gradient_at(x + step * v) - gradient_at(x - step * v)) / (2 * step)
        # Differences twice over are good to five digits.
        assert table @ v == pytest.approx(change, rel=1e-4, abs=1e-3)


def multipliers_of_an_optimum(program):
    """IPOPT's answer and its multipliers, once stationarity, signs and all else hold.

    Derivatives are from numpy alone.
    """
    index = np.arange(16)
    outcome = run_ipopt(program, index, program.world_from_device, max_iterations=300)
    assert outcome.success
    x, y = outcome.x, outcome.multipliers
    _, lower = pose_parameters(program, index)
    applies = np.isfinite(lower)
    _, g = stated(program, x)
    assert np.all((g - lower)[applies] >= -1e-8)
    assert set(lower[applies]) <= {0.0, INSET}
    of_f, of_g = slopes(program, x)
    # What is left over, bounds on the turn hold: it pulls outwards there, and nowhere.
    pull = -(of_f + of_g[applies].T @ y[applies])
    held = np.isclose(np.abs(x), _MAX_GIBBS) & (np.arange(7) // 3 == 1)
    assert pull[~held] == pytest.approx(0.0, abs=2e-6)
    assert np.all((pull * x)[held] >= 0.0)
    assert np.all(y <= 1e-9)
    assert y[~applies] == pytest.approx(0.0, abs=1e-15)
    assert y[applies] * (g - lower)[applies] == pytest.approx(0.0, abs=1e-7)
    # The margin is what is bought: dt = 1 is shared out among the limits that bind.
    assert (of_g[applies, 6] * -y[applies]).sum() == pytest.approx(-1.0, abs=1e-5)
    margin = pose_margins(program, pose_of(program, x)).min()
    assert margin == pytest.approx(x[6], abs=1e-7)
    return y


@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize(
    ("seed", "changes", "kinds"),
    [
        (0, {}, {"cone"}),
        (1, {"half_angle": np.pi, "floor": -np.inf}, set()),
        (2, {"half_angle": 0.15, "floor": 0.03}, {"cone"}),
        (3, {"min_tangent_angle": np.radians(55.0)}, {"tangent"}),
        (4, {"up": np.array([0.0, 0.0, -1.0]), "floor": -0.04}, {"floor"}),
    ],
)
def test_kkt_of_the_pose_program_from_ipopts_multipliers(light, seed, changes, kinds):
    """Stationarity, complementarity and signs, and which limits are felt."""
    y = multipliers_of_an_optimum(program_for(light, seed, **changes))
    binds = y < -1e-6
    binding = {name for name, k in (("cone", -2), ("floor", -1)) if binds[k]}
    binding |= {"tangent"} if binds[16:48].any() else set()
    assert binding >= kinds
    # Parallel light feels its panel, beam or ring, diverging light the shell.
    assert "tangent" in kinds or binds[48:-4].any() or binds[-4:-2].any()


@pytest.mark.parametrize(
    ("side", "limits", "binding"),
    [
        # A ball is lit best from afar, a bowl from near by.
        (1.0, {"range_m": (0.85, 1.02)}, "far"),
        (-1.0, {"range_m": (0.97, 1.3)}, "near"),
        (-1.0, {"range_m": (0.5, 1.3), "shell_m": (0.5, 1.3)}, "field"),
        (-1.0, {"range_m": (0.5, 1.3), "shell_m": (0.5, 1.3)}, "ring"),
    ],
)
def test_kkt_where_field_and_range_bind_in_diverging_light(side, limits, binding):
    """What holds a projector back is its image, its last ring, or its focus."""
    free = {"half_angle": np.pi, "floor": -np.inf, "min_tangent_angle": 0.0}
    shell = {"shell_m": (0.5, 1.5)}
    normals = cap(np.random.default_rng(5), 16, 0.6)
    points = side * 0.05 * normals
    start = look_at(np.array([0.05, -1.0, 0.02]), np.zeros(3), np.array([0, 0, 1.0]))
    ring, narrow = (0.035 if binding == "ring" else 0.2), {}
    if binding == "field":
        # A strip of 60 columns, far off the axis: turned until the bowl is in it.
        aside = np.arctan2(K[0, 2] - 29.5, K[0, 0])
        start[:3, :3] @= Rotation.from_rotvec([0.0, aside, 0.0]).as_matrix()
        strip = np.where(IMAGE == IMAGE[1, 0], (59.0 - K[0, 2]) / K[0, 0], IMAGE)
        ring, narrow = 0.7, {"sides": strip}
    program = program_for(
        "diverging",
        5,
        points=points,
        normals=normals,
        steep=np.zeros((16, 3)),
        ring_radius=ring,
        world_from_device=start,
        **(free | shell | limits | narrow),
    )
    y = multipliers_of_an_optimum(program)
    places = {"field": (48, 112), "near": (112, 128), "far": (128, 144)}
    places["ring"] = (144, 160)
    bound = {name for name, (a, b) in places.items() if (y[a:b] < -1e-6).any()}
    assert binding in bound


@pytest.mark.parametrize("seed", range(4))
def test_pose_program_against_a_search_over_all_directions(seed):
    """Parallel light with steep sides: nothing on a grid of 1 degree is better."""
    rng = np.random.default_rng(40 + seed)
    normals = cap(rng, 6, 0.9)
    steep = unit(np.cross(normals, rng.normal(size=normals.shape)))
    steep[::2] = 0.0
    i = np.arange(40_000) + 0.5
    z, turn = 1 - 2 * i / i.size, np.pi * (1 + 5**0.5) * i
    grid = np.column_stack(
        [np.sqrt(1 - z * z) * np.cos(turn), np.sqrt(1 - z * z) * np.sin(turn), z]
    )
    incidence = np.arccos(np.clip(normals @ grid.T, -1, 1)).max(axis=0)
    along = np.abs(steep[1::2] @ grid.T).max(axis=0)
    least = np.radians(25)
    margins = np.minimum(np.radians(60) - incidence, np.arccos(along) - least)
    best = grid[np.argmax(margins)]
    up = np.array([0.0, 0.0, 1.0])
    program = program_for(
        "parallel",
        0,
        points=0.02 * normals,
        normals=normals,
        steep=steep,
        world_from_device=look_at(best + 0.02 * rng.normal(size=3), np.zeros(3), up),
        half_angle=np.pi,
        floor=-np.inf,
        shell_m=(0.8, 1.2),
        range_m=(0.5, 1.5),
    )
    solution = solve_pose(program)
    assert solution.status.has_point
    spacing = np.sqrt(4 * np.pi / i.size)
    margin = pose_margins(program, solution.world_from_device).min()
    assert margins.max() - 1e-6 <= margin <= margins.max() + spacing
