"""Poses with closed forms, derivatives, and limits that are derived again."""

import dataclasses

import casadi as ca
import numpy as np
import pytest

from solvers.poses.pose_nlp import (
    build_pose_nlp,
    pose_of,
    pose_parameters,
    variables_of,
)
from solvers.poses.pose_problem import PoseProgram, light_directions, pose_margins
from solvers.poses.pose_program import pose_slack, solve_pose
from solvers.status import SolveStatus

# Parallel light has a global optimum where only incidence binds.
REACHED = {
    "diverging": SolveStatus.LOCALLY_OPTIMAL,
    "parallel": SolveStatus.OPTIMAL,
}
K = np.array([[1400.0, 0.0, 639.5], [0.0, 1400.0, 399.5], [0.0, 0.0, 1.0]])


def unit(v):
    v = np.asarray(v, dtype=float)
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def look_at(position, target=(0.0, 0.0, 0.0), up=(0.0, 0.0, 1.0)):
    z = unit(np.asarray(target) - position)
    x = unit(np.cross(z, up))
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([x, np.cross(z, x), z])
    pose[:3, 3] = position
    return pose


def margin_of(solution):
    return pose_margins(solution.program, solution.world_from_device).min()


def program_of(
    points,
    normals,
    *,
    steep=None,
    light="diverging",
    at,
    half_panel=(0.2, 0.2),
    **changes,
):
    """A program of an image of 1280 x 800, or of a panel."""
    image = (np.array([[0.0, 0.0], [1279.0, 799.0]]) - K[:2, 2]) / 1400.0
    points = np.atleast_2d(points).astype(float)
    arguments = {
        "points": points,
        "normals": np.broadcast_to(unit(normals), points.shape).copy(),
        "steep": np.zeros(points.shape) if steep is None else steep,
        "light": light,
        "world_from_device": look_at(np.asarray(at, dtype=float)),
        "max_incidence": np.deg2rad(60),
        "min_tangent_angle": np.deg2rad(40),
        "range_m": (0.5, 1.5),
        "shell_m": (0.8, 1.2),
        "centre": np.zeros(3),
        "axis": unit(np.array(at, dtype=float)),
        "sides": image if light == "diverging" else np.outer([-1, 1], half_panel),
    }
    return PoseProgram(**(arguments | changes))


def patch(rng, n=40, size=0.02):
    return np.column_stack([rng.uniform(-size, size, (n, 2)), np.zeros(n)])


def cap(rng, n, half_angle, axis=(0.0, -1.0, 0.0)):
    """Normals within a cone, evenly thrown; samples on a sphere of 50 mm."""
    axis = unit(axis)
    v = unit(rng.normal(size=(40 * n, 3)))
    v = v[v @ axis > np.cos(half_angle)][:n]
    return 0.05 * v, v


@pytest.mark.parametrize("light", ["diverging", "parallel"])
def test_one_planar_patch_is_lit_along_its_normal(light):
    points = patch(np.random.default_rng(0))
    program = program_of(
        points, [0.0, 0.0, 1.0], light=light, at=[0.3, -0.4, 0.85], up=np.eye(3)[2]
    )
    solution = solve_pose(program)
    assert solution.status is REACHED[light]
    if light == "parallel":
        assert -solution.world_from_device[2, 2] == pytest.approx(1.0, abs=1e-5)
        assert margin_of(solution) == pytest.approx(np.deg2rad(60), abs=2e-3)
    else:
        # The farthest corner decides: above the centre, as far as the shell lets it.
        reach = np.max(np.linalg.norm(points[:, :2], axis=1))
        best = np.deg2rad(60) - np.arctan(reach / 1.2)
        assert margin_of(solution) == pytest.approx(best, abs=5e-4)


@pytest.mark.parametrize("light", ["diverging", "parallel"])
def test_two_patches_are_lit_along_the_bisector(light):
    normals = unit([[0.6, -1.0, 0.2], [-0.5, -1.0, 0.3]])
    program = program_of(np.zeros((2, 3)), normals, light=light, at=[0.2, -1.0, -0.1])
    solution = solve_pose(program)
    direction = light_directions(program, solution.world_from_device)[0]
    assert -direction == pytest.approx(unit(normals.sum(axis=0)), abs=1e-4)
    half = 0.5 * np.arccos(normals[0] @ normals[1])
    assert margin_of(solution) == pytest.approx(np.deg2rad(60) - half, abs=1e-6)


@pytest.mark.parametrize("light", ["diverging", "parallel"])
def test_tangent_limit_turns_the_light_to_the_steep_sample(light):
    """Normals 50 degrees apart, light d from the first, T in their plane there:

    margins 90 - 60 - d (tangent) and 60 - (50 - d) (incidence) meet at d = 10.
    """
    a = np.deg2rad(25)
    normals = np.array([[np.sin(a), -np.cos(a), 0], [-np.sin(a), -np.cos(a), 0]])
    steep = np.array([[np.cos(a), np.sin(a), 0.0], [0.0, 0.0, 0.0]])
    program = program_of(
        np.zeros((2, 3)),
        normals,
        steep=steep,
        light=light,
        at=[-0.2, -1.0, 0.2],
        min_tangent_angle=np.deg2rad(60),
    )
    solution = solve_pose(program)
    assert np.rad2deg(margin_of(solution)) == pytest.approx(20.0, abs=1e-4)
    away = -light_directions(program, solution.world_from_device)[0]
    assert np.rad2deg(np.arccos(away @ normals[0])) == pytest.approx(10.0, abs=1e-3)


@pytest.mark.parametrize("light", ["diverging", "parallel"])
def test_statement_equals_the_numpy_figures(light):
    """g of CasADi and the margins in numpy agree in sign at random poses."""
    rng = np.random.default_rng(5)
    points, normals = cap(rng, 16, 0.9)
    steep = unit(np.cross(normals, rng.normal(size=(16, 3))))
    steep[::3] = 0.0
    frame = look_at(np.array([0.002, 0.01, 0.001]), target=[0.002, 0.011, 1.0])
    program = program_of(
        points,
        normals,
        steep=steep,
        light=light,
        at=[0.1, -1.0, 0.1],
        half_angle=0.5,
        up=np.eye(3)[2],
        floor=-0.1,
        ring_from_device=frame,
        ring_radius=0.06 if light == "diverging" else 0.07,
        beam_radius_m=0.08,
        half_panel=(0.06, 0.05),
        range_m=(0.95, 1.1),
        shell_m=(0.95, 1.1),
    )
    nlp = build_pose_nlp(light, 16)
    g = ca.Function("g", [nlp.x, nlp.p], [nlp.g])
    p, lower = pose_parameters(program, np.arange(16))
    seen = set()
    for _ in range(400):
        x = np.array([*rng.normal(0, 0.05, 3), *rng.normal(0, 0.02, 3), 0.0])
        x[6] = rng.uniform(-0.5, 0.5)
        pose = pose_of(program, x)
        values = np.asarray(g(x, p)).ravel()
        held = np.where(np.isfinite(lower), values, np.inf)
        margins = pose_margins(program, pose)
        assert np.array_equal(
            np.min(held[:48].reshape(3, 16), axis=0) >= 0, margins >= x[6]
        )
        slack = pose_slack(program, pose)
        assert np.array_equal(
            np.min(held[48:-4].reshape(-1, 16), axis=0) >= 0, slack[:-1] >= 0
        )
        assert (np.min(held[-4:]) >= 0) == (slack[-1] >= 0)
        seen |= {(bool(slack[:-1].min() >= 0), bool(slack[-1] >= 0))}
    assert len(seen) >= 3


@pytest.mark.parametrize("light", ["diverging", "parallel"])
def test_derivatives_against_finite_differences(light):
    rng = np.random.default_rng(6)
    points, normals = cap(rng, 16, 0.8)
    steep = unit(np.cross(normals, rng.normal(size=(16, 3))))
    program = program_of(points, normals, steep=steep, light=light, at=[0.2, -1.0, 0.1])
    nlp = build_pose_nlp(light, 16)
    both = ca.vertcat(nlp.f, nlp.g)
    value = ca.Function("v", [nlp.x, nlp.p], [both])
    slope = ca.Function("j", [nlp.x, nlp.p], [ca.jacobian(both, nlp.x)])
    p, _ = pose_parameters(program, np.arange(16))
    x = np.array([0.02, -0.03, 0.01, 0.05, -0.02, 0.1, 0.2])
    step = 1e-6
    for i, e in enumerate(np.eye(7)):
        change = np.asarray(value(x + step * e, p) - value(x - step * e, p)).ravel()
        exact = np.asarray(slope(x, p))[:, i]
        assert change / (2 * step) == pytest.approx(exact, abs=1e-7)


def test_variables_and_pose_are_inverse():
    program = program_of(np.zeros((3, 3)), [0.0, -1.0, 0.0], at=[0.1, -1.0, 0.2])
    x = np.array([0.1, -0.05, 0.02, 0.2, -0.1, 0.05, 0.0])
    pose = pose_of(program, x)
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1.0, abs=1e-12)
    assert pose[:3, :3] @ pose[:3, :3].T == pytest.approx(np.eye(3), abs=1e-12)
    assert variables_of(program, pose)[:6] == pytest.approx(x[:6], abs=1e-12)


@pytest.mark.parametrize("light", ["diverging", "parallel"])
def test_active_set_reaches_the_optimum_of_all_samples(light):
    rng = np.random.default_rng(7)
    points, normals = cap(rng, 800, 0.7, axis=[0.3, -1.0, 0.2])
    program = program_of(points, normals, light=light, at=[-0.1, -1.0, 0.1])
    few = solve_pose(program, max_points=24)
    everything = solve_pose(program, max_points=1600)
    assert few.status is REACHED[light]
    assert margin_of(few) == pytest.approx(margin_of(everything), abs=1e-5)
    assert margin_of(few) > pose_margins(program, program.world_from_device).min()


@pytest.mark.parametrize("light", ["diverging", "parallel"])
def test_limits_hold_in_the_answer(light):
    """Every limit derived again from the pose; the field and the cone bind."""
    rng = np.random.default_rng(8)
    points, normals = cap(rng, 300, 0.6, axis=[0.7, -1.0, 0.4])
    program = program_of(
        points,
        normals,
        light=light,
        at=[0.0, -1.0, 0.0],
        half_angle=np.deg2rad(10),
        half_panel=(0.06, 0.055),
        beam_radius_m=0.07,
        up=np.eye(3)[2],
        floor=-0.01,
    )
    solution = solve_pose(program)
    pose = solution.world_from_device
    assert solution.moved
    assert solution.slack >= 0.0
    local = (program.points - pose[:3, 3]) @ pose[:3, :3]
    radius = np.linalg.norm(pose[:3, 3])
    assert 0.8 <= radius <= 1.2
    off = np.arccos(pose[:3, 3] @ program.axis / radius)
    assert off <= np.deg2rad(10)
    assert off == pytest.approx(np.deg2rad(10), abs=1e-3)
    assert pose[2, 3] >= -0.01
    if light == "diverging":
        pixels = local[:, :2] / local[:, 2:] * 1400.0 + K[:2, 2]
        assert np.all((pixels >= 0.0) & (pixels <= np.array([1279.0, 799.0])))
        distance = np.linalg.norm(local, axis=1)
        assert np.all((distance >= 0.5) & (distance <= 1.5))
    else:
        assert np.all(np.abs(local[:, 0]) <= 0.06)
        assert np.all(np.abs(local[:, 1]) <= 0.055)
        assert np.all(np.hypot(local[:, 0], local[:, 1]) <= 0.07)
        assert np.all((local[:, 2] >= 0.5) & (local[:, 2] <= 1.5))


def test_start_that_breaks_a_limit_is_repaired():
    rng = np.random.default_rng(9)
    points, normals = cap(rng, 100, 0.5)
    program = program_of(points, normals, at=[0.0, -1.3, 0.0])
    assert pose_slack(program, program.world_from_device).min() < 0
    solution = solve_pose(program)
    assert solution.status is SolveStatus.LOCALLY_OPTIMAL
    assert solution.slack >= 0.0


def test_impossible_limits_are_unknown_and_keep_the_start():
    rng = np.random.default_rng(10)
    points, normals = cap(rng, 50, 0.5)
    program = program_of(points, normals, at=[0.0, -1.0, 0.0], range_m=(2.0, 3.0))
    solution = solve_pose(program)
    assert solution.status is SolveStatus.UNKNOWN
    assert not solution.moved


def test_never_worse_than_the_start():
    rng = np.random.default_rng(11)
    for _ in range(10):
        points, normals = cap(rng, 60, 0.9)
        at = unit(np.array([0.0, -1.0, 0.0]) + rng.normal(0, 0.3, 3))
        program = program_of(points, normals, at=at)
        solution = solve_pose(program, max_iterations=int(rng.integers(1, 30)))
        before = pose_margins(program, program.world_from_device).min()
        assert margin_of(solution) >= before


def test_start_at_the_optimum_is_known_to_be_one():
    rng = np.random.default_rng(13)
    points, normals = cap(rng, 200, 0.8)
    program = program_of(points, normals, at=[0.1, -1.0, 0.0])
    first = solve_pose(program)
    again = solve_pose(
        dataclasses.replace(program, world_from_device=first.world_from_device)
    )
    assert again.status is SolveStatus.LOCALLY_OPTIMAL
    assert margin_of(again) == pytest.approx(margin_of(first), abs=1e-6)


def test_small_moves_stay_small():
    program = program_of(
        np.zeros((1, 3)), [0.0, -1.0, 0.0], at=unit([0.5, -1, 0]), max_move_m=0.01
    )
    solution = solve_pose(program)
    change = solution.world_from_device[:3, 3] - program.world_from_device[:3, 3]
    assert np.max(np.abs(change)) == pytest.approx(0.01, rel=1e-3)


def test_same_answer_twice():
    rng = np.random.default_rng(12)
    points, normals = cap(rng, 200, 0.8)
    program = program_of(points, normals, at=[0.1, -1.0, 0.0])
    once, again = (solve_pose(program).world_from_device for _ in range(2))
    assert np.array_equal(once, again)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"points": np.zeros((0, 3))}, "points is empty"),
        ({"normals": np.zeros((1, 2))}, r"normals must be finite and \(1, 3\)"),
        ({"steep": np.full((1, 3), np.nan)}, "steep must be finite"),
        ({"light": "candle"}, "light is 'candle'"),
        ({"range_m": (1.0, 0.5)}, "range_m is 1.0 to 0.5"),
        ({"shell_m": (np.nan, 1.0)}, "shell_m is nan"),
        ({"max_incidence": np.nan}, "max_incidence must lie"),
        ({"sides": np.zeros(4)}, r"sides must be finite and \(2, 2\)"),
    ],
)
def test_bad_programs_are_refused(changes, message):
    program = program_of(np.zeros((1, 3)), [0.0, -1.0, 0.0], at=[0.0, -1.0, 0.0])
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(program, **changes)


@pytest.mark.parametrize("n_planes", [1, 9])
@pytest.mark.parametrize("light", ["diverging", "parallel"])
def test_half_spaces_hold_the_device(light, n_planes):
    """A patch seen from the side is best lit from over it: as far as may be."""
    at = np.array([0.0, -0.6, 0.8])
    limit = np.array([0.0, -1.0, 0.0, 0.4])  # y <= -0.4
    spare = np.tile([0.0, 0.0, 1.0, -5.0], (n_planes - 1, 1))
    program = program_of(
        patch(np.random.default_rng(0), size=0.001),
        (0, 0, 1),
        light=light,
        at=at,
        axis=np.array([0.0, 0.0, 1.0]),
        half_spaces=np.vstack([limit, spare]),
    )
    assert pose_slack(program, program.world_from_device)[-1] <= 0.2 + 1e-9
    solution = solve_pose(program)
    position = solution.world_from_device[:3, 3]
    assert solution.slack >= 0.0
    assert position[1] <= -0.4
    if light == "diverging":
        # Least incidence at the border, as high as the shell allows.
        assert position == pytest.approx(
            [0.0, -0.4, np.sqrt(1.2**2 - 0.4**2)], abs=2e-3
        )
    free = solve_pose(dataclasses.replace(program, half_spaces=np.empty((0, 4))))
    assert margin_of(free) > np.deg2rad(59)


def test_half_spaces_of_the_wrong_shape_are_refused():
    with pytest.raises(ValueError, match=r"half_spaces must be finite, \(k, 4\)"):
        program_of([[0, 0, 0]], (0, 0, 1), at=(0, 1, 1), half_spaces=np.zeros((2, 3)))
