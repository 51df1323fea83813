"""The axis program: derivatives, optimality, blind curves in closed form, ring limit.

Nothing here comes from CasADi but the answer and its multipliers. r.m is stated once
more, from the ring surfaces' definition.
"""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from solvers.poses.axis_nlp import axis_parameters, build_axis_nlp, run_ipopt
from solvers.poses.axis_problem import INSET, AxisProgram
from solvers.poses.axis_program import (
    axis_direction,
    axis_scores,
    axis_slack,
    better_starts,
    pair_scores,
    solve_axis,
)
from solvers.status import SolveStatus

LIGHTS = ["diverging", "parallel"]


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def program_for(
    light, seed=0, cameras=((0.3, 0.1, 0.05), (-0.1, 0.35, 0.0)), **changes
):
    """A bumpy patch a metre away, and cameras beside the projector."""
    rng = np.random.default_rng(seed)
    points = np.column_stack(
        [rng.uniform(-0.1, 0.1, (40, 2)), rng.uniform(0.95, 1.05, 40)]
    )
    normals = unit(np.column_stack([rng.normal(0, 0.3, (40, 2)), -np.ones(40)]))
    away = points[:, None] - np.array(cameras)
    distance = np.linalg.norm(away, axis=2)
    rays = away / distance[..., None]
    facing = -np.einsum("ij,ikj->ik", normals, rays)
    across = np.eye(3) - rays[..., :, None] * rays[..., None, :]
    jacobian = across[..., :2] / 1400.0
    spread = normals[:, None, :, None] * rays[:, :, None, :]
    spread = spread + facing[..., None, None] * np.eye(3)
    arguments = {
        "light": light,
        "points": points,
        "rays": rays,
        "slopes": np.swapaxes(jacobian, 2, 3) @ spread,
        "seen": np.ones(distance.shape, dtype=bool),
        "noise": 0.1 * distance,
        "placement_m": 1e-5 * facing,
        "facing": facing / distance,
        "others": np.zeros(40),
        "held": points,
        "start": np.array([0.03, -0.05]),
        "ring_radius": 0.3,
        "gap": 0.004,
        "min_conditioning": 0.1,
        "max_sigma_m": 3e-4,
        "min_pitch_px": 6.0,
    }
    return AxisProgram(**(arguments | changes))


def ring_normals(program, axis):
    """m from the ring coordinate's gradient, by central differences."""

    def coordinate(x):
        if program.light == "parallel":
            return np.hypot(*(x[:, :2] - axis).T)
        along = x @ axis_direction(axis)
        return np.sqrt(np.sum(x**2, axis=1) - along**2) / along

    h = 1e-6
    slope = [
        (coordinate(program.points + h * e) - coordinate(program.points - h * e))
        for e in np.eye(3)
    ]
    return unit(np.stack(slope, axis=1)), np.linalg.norm(slope, axis=0) / (2 * h)


@pytest.mark.parametrize("light", LIGHTS)
def test_scores_are_the_three_limits_of_a_measurable_pair(light):
    """As in semantics.md, m and h by differences; rings too fine to damp."""
    program = program_for(light, gap=1e-4, min_pitch_px=0.15)
    axis = np.array([0.11, 0.09])
    m, steepness = ring_normals(program, axis)
    conditioning = np.einsum("ikj,ij->ik", program.rays, m)
    g = np.linalg.norm(np.einsum("ikaj,ij->ika", program.slopes, m), axis=2)
    sigma = np.hypot(program.noise * g, program.placement_m) / abs(conditioning)
    pitch = (program.gap / steepness)[:, None] * program.facing / g
    e = (0.1 / conditioning) ** 2 + (sigma / 3e-4) ** 2 + (0.15 / pitch) ** 8
    assert pair_scores(program, axis) == pytest.approx(1 / (1 + e), rel=2e-3)
    assert np.ptp(e) > 1.0


def test_what_is_not_seen_scores_nothing_and_other_projectors_count():
    program = program_for("parallel")
    seen = program.seen.copy()
    seen[::2, 0] = False
    seen[::4] = False
    others = np.where(np.arange(40) % 8 == 0, 0.9, 0.0)
    changed = replace(program, seen=seen, others=others)
    axis = program.start
    full, score = pair_scores(program, axis), axis_scores(changed, axis)
    assert np.array_equal(score[1::2], full[1::2].max(axis=1))
    assert np.array_equal(score[2::4], full[2::4, 1])
    assert np.array_equal(score[4::8], np.zeros(5))
    assert np.array_equal(score[::8], np.full(5, 0.9))


def stated(program, pairs, x):
    """f and g at x = a/largest ring, in numpy alone."""
    axis = program.ring_radius * x
    scores = pair_scores(program, axis)[pairs[:, 0], pairs[:, 1]]
    return -scores.sum() / len(program.points), axis_slack(program, axis)


def slopes(program, pairs, x, step=1e-6):
    f, g = [], []
    for e in np.eye(2):
        (f1, g1), (f0, g0) = (stated(program, pairs, x + k * step * e) for k in (1, -1))
        f.append((f1 - f0) / (2 * step))
        g.append((g1 - g0) / (2 * step))
    return np.array(f), np.stack(g, axis=1)


def some_pairs(n=40):
    return np.column_stack([np.arange(n), np.arange(n) % 2])


@pytest.mark.parametrize("light", LIGHTS)
def test_derivatives_are_those_of_the_statement_in_numpy(light):
    program, pairs = program_for(light), some_pairs()
    nlp = build_axis_nlp(light, 64, 64)
    multipliers = ca.MX.sym("y", 64)
    both = ca.vertcat(nlp.f, nlp.g)
    hessian, _ = ca.hessian(nlp.f + ca.dot(multipliers, nlp.g), nlp.x)
    exact = ca.Function(
        "e", [nlp.x, nlp.p, multipliers], [both, ca.jacobian(both, nlp.x), hessian]
    )
    p = axis_parameters(program, pairs, np.arange(40))
    prices = np.append(np.linspace(-1.0, 1.0, 40), np.zeros(24))

    def gradient(x):
        of_f, of_g = slopes(program, pairs, x, step=1e-4)
        return of_f + of_g.T @ prices[:40]

    for x in np.array([[0.1, -0.2], [0.3, 0.4], [-0.7, 0.05]]):
        value, slope, second = (np.asarray(part) for part in exact(x, p, prices))
        f, g = stated(program, pairs, x)
        # Slots beyond the samples weigh nothing and hold what is held.
        assert value.ravel() == pytest.approx(np.array([f, *g, *g[:24]]), abs=1e-12)
        of_f, of_g = slopes(program, pairs, x)
        assert slope[0] == pytest.approx(of_f, abs=2e-7)
        assert slope[1:41] == pytest.approx(of_g, abs=2e-7)
        change = np.stack(
            [
                (gradient(x + 1e-3 * e) - gradient(x - 1e-3 * e)) / 2e-3
                for e in np.eye(2)
            ]
        )
        assert second == pytest.approx(change, rel=2e-2, abs=2e-2)


@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize(("radius", "binds"), [(0.3, False), (0.17, True)])
def test_kkt_from_ipopts_multipliers(light, radius, binds):
    """Stationarity, complementarity and signs, with derivatives from numpy alone."""
    program = program_for(light, cameras=((0.3, 0.1, 0.05),), ring_radius=radius)
    start = np.array([-0.03, 0.02])
    if not binds:
        program = replace(program, held=program.points[:1])
    pairs = np.column_stack([np.arange(40), np.zeros(40, dtype=int)])
    held = np.arange(len(program.held))
    outcome = run_ipopt(program, pairs, held, start, 2.0, 200)
    assert outcome.success
    x, y = outcome.x, outcome.multipliers
    n = len(held)
    # Slots repeat the first points: their prices add up.
    prices = np.bincount(np.resize(held, len(y)), weights=y, minlength=n)
    _, g = stated(program, pairs, x)
    of_f, of_g = slopes(program, pairs, x)
    assert of_f + of_g.T @ prices == pytest.approx(0.0, abs=2e-7)
    assert np.all(prices <= 1e-9)
    assert g.min() >= INSET - 1e-8
    assert prices * (g - INSET) == pytest.approx(0.0, abs=1e-7)
    assert (prices.min() < -1e-3) == binds


def on_the_blind_curve(light, axis, epipole, n=24):
    """Thales circle over ring axis and camera, in the device plane or the image z = 1.

    In diverging light a circle in the image about the *ring's* centre, so drawn in the
    ring frame and turned back.
    """
    angle = 2 * np.pi * (np.arange(n) + 0.5) / n
    circle = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(n)])
    if light == "parallel":
        middle, radius = 0.5 * (axis + epipole), 0.5 * np.linalg.norm(epipole - axis)
        return np.append(middle, 1.0) + radius * circle
    z = axis_direction(axis)
    x = unit(np.cross([0.0, 1.0, 0.0], z))
    turn = np.column_stack([x, np.cross(z, x), z])
    seen = turn.T @ np.append(epipole, 1.0)
    half = 0.5 * seen[:2] / seen[2]
    return (np.append(half, 1.0) + np.linalg.norm(half) * circle) @ turn.T


def one_camera(light, points, camera, start, **changes):
    """Conditioning alone counts: no noise, no pitch."""
    n = len(points)
    rays = unit(points - camera)[:, None]
    return AxisProgram(
        light=light,
        points=points,
        rays=rays,
        slopes=np.zeros((n, 1, 2, 3)),
        seen=np.ones((n, 1), dtype=bool),
        noise=np.zeros((n, 1)),
        placement_m=np.zeros((n, 1)),
        facing=np.ones((n, 1)),
        others=np.zeros(n),
        held=points,
        start=start,
        **{"ring_radius": 0.4, "gap": 1e-5, "min_conditioning": 0.1} | changes,
    )


@pytest.mark.parametrize("light", LIGHTS)
def test_the_program_moves_the_blind_curve_off_a_plane(light):
    """One camera, a plate: the curve in closed form crosses it before, not after."""
    camera = np.array([0.35, 0.0, 0.5])
    epipole = camera[:2] if light == "parallel" else camera[:2] / camera[2]
    start = np.array([-0.02, 0.01])
    curve = on_the_blind_curve(light, start, epipole)
    blind = one_camera(light, curve, camera, start)
    away = np.linalg.norm(curve - [*start, 1.0], axis=1) > 0.02
    assert pair_scores(blind, start)[away] == pytest.approx(0.0, abs=1e-12)

    side = np.linspace(-0.08, 0.08, 9)
    plate = np.column_stack(
        [*(a.ravel() for a in np.meshgrid(side, side)), np.ones(81)]
    )

    def crosses(axis):
        drawn = on_the_blind_curve(light, axis, epipole, 2000)
        return np.any(np.abs(drawn[:, :2] / drawn[:, 2:]) < 0.08, axis=None) and np.any(
            np.all(np.abs(drawn[:, :2] / drawn[:, 2:]) < 0.08, axis=1)
        )

    program = one_camera(light, plate, camera, start)
    assert crosses(start)
    # At |r.m| = c_0 the score is a half.
    assert np.mean(axis_scores(program, start) < 0.5) > 0.1
    solution = solve_axis(replace(program, start=better_starts(program)[0]))
    assert solution.status is SolveStatus.LOCALLY_OPTIMAL
    assert not crosses(solution.axis)
    assert np.all(axis_scores(program, solution.axis) > 0.5)
    assert solution.slack >= 0.0


@pytest.mark.parametrize("light", LIGHTS)
def test_no_axis_of_a_fine_grid_is_better(light):
    program = program_for(light, seed=3)
    solution = solve_axis(replace(program, start=better_starts(program)[0]))
    assert solution.status is SolveStatus.LOCALLY_OPTIMAL
    side = np.linspace(-0.3, 0.3, 41)
    values = [
        axis_scores(program, axis).mean()
        for axis in np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
        if axis_slack(program, axis).min() >= 0.0
    ]
    assert len(values) > 100
    assert max(values) <= solution.value + 1e-9
    assert solution.value == pytest.approx(axis_scores(program, solution.axis).mean())
    assert solution.value > axis_scores(program, program.start).mean() + 0.01


def test_rounds_hand_samples_to_the_camera_that_sees_them_better():
    """From an axis that favours one camera: the value never falls, and both serve."""
    program = program_for("parallel", start=np.array([0.1, -0.1]))
    solution = solve_axis(program)
    assert solution.value >= axis_scores(program, program.start).mean()
    for axis in (program.start, solution.axis):
        cameras = np.argmax(pair_scores(program, axis), axis=1)
        assert set(cameras) == {0, 1}
    assert solution.status is SolveStatus.LOCALLY_OPTIMAL


def test_samples_that_another_projector_serves_better_do_not_pull():
    program = program_for("parallel", seed=2)
    ours = np.flatnonzero(program.points[:, 0] > 0.0)
    others = np.full(40, 0.999)
    others[ours] = 0.0
    found = solve_axis(replace(program, others=others))
    names = ("points", "rays", "slopes", "seen", "noise", "placement_m", "facing")
    part = replace(
        program,
        others=np.zeros(len(ours)),
        **{name: getattr(program, name)[ours] for name in names},
    )
    assert found.axis == pytest.approx(solve_axis(part).axis, abs=1e-6)
    assert np.linalg.norm(found.axis - solve_axis(program).axis) > 1e-4


@pytest.mark.parametrize("light", LIGHTS)
def test_rings_too_small_for_what_is_lit_leave_the_axis_where_it_is(light):
    program = program_for(light, ring_radius=0.09)
    assert axis_slack(program, np.zeros(2)).min() < 0.0
    solution = solve_axis(program)
    assert solution.status is SolveStatus.UNKNOWN
    assert not solution.moved
    assert better_starts(program) == []


@pytest.mark.parametrize("light", LIGHTS)
def test_slack_is_zero_on_the_largest_ring(light):
    axis, angle = np.array([0.1, 0.05]), np.linspace(0, 6, 7)
    ring = 0.3 * np.column_stack([np.cos(angle), np.sin(angle)])
    if light == "parallel":
        held = np.column_stack([ring + axis, np.full(7, 0.7)])
    else:
        z = axis_direction(axis)
        x = unit(np.cross([0.0, 1.0, 0.0], z))
        held = np.column_stack([ring, np.ones(7)]) @ [x, np.cross(z, x), z]
    program = program_for(light, held=held)
    assert axis_slack(program, axis) == pytest.approx(0.0, abs=1e-12)
    assert axis_slack(replace(program, ring_radius=0.31), axis).min() > 0.0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"points": np.zeros((3, 3))}, r"points must be finite and \(40, 3\)"),
        ({"start": np.array([np.nan, 0.0])}, "start must be finite"),
        ({"light": "slanted"}, "light is 'slanted'"),
        ({"gap": 0.0}, "gap is 0.0, must be positive"),
        ({"ring_radius": np.inf}, "ring_radius is inf"),
        ({"min_conditioning": np.nan}, "min_conditioning is nan"),
        ({"max_sigma_m": 0.0}, "max_sigma_m is 0.0"),
        ({"min_pitch_px": -1.0}, "min_pitch_px is -1.0"),
    ],
)
def test_impossible_programs_are_refused(changes, message):
    program = program_for("parallel")
    with pytest.raises(ValueError, match=message):
        replace(program, **changes)
