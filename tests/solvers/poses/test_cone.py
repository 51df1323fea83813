"""The best direction of parallel light: closed forms, optimality, IPOPT beside it."""

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from solvers.poses.cone import max_margin_direction
from solvers.poses.pose_nlp import pose_of, run_ipopt
from solvers.poses.pose_problem import PoseProgram, pose_margins
from solvers.poses.pose_program import pose_slack, solve_pose
from solvers.status import SolveStatus


def unit(v):
    v = np.asarray(v, dtype=float)
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def cap(seed, n, half_angle, axis=None):
    rng = np.random.default_rng(seed)
    axis = unit(rng.normal(size=3) if axis is None else axis)
    tangent = rng.normal(size=(n, 3))
    tangent = unit(tangent - (tangent @ axis)[:, None] * axis)
    angle = half_angle * np.sqrt(rng.random(n))[:, None]
    return np.cos(angle) * axis + np.sin(angle) * tangent


def test_one_patch_is_lit_along_its_normal():
    normal = unit([0.3, -0.5, 0.8])
    solution = max_margin_direction(np.tile(normal, (5, 1)))
    assert solution.status is SolveStatus.OPTIMAL
    assert solution.light == pytest.approx(-normal, abs=1e-6)
    assert solution.value == pytest.approx(1.0, abs=1e-8)


def test_two_patches_are_lit_along_the_bisector():
    normals = unit([[1.0, 0.2, 0.0], [0.1, 1.0, 0.5]])
    solution = max_margin_direction(normals)
    assert solution.light == pytest.approx(-unit(normals.sum(axis=0)), abs=1e-6)
    half = 0.5 * np.arccos(normals[0] @ normals[1])
    assert solution.max_incidence == pytest.approx(half, abs=1e-7)


def test_a_corner_of_a_box_is_lit_along_its_diagonal():
    solution = max_margin_direction(np.eye(3))
    assert solution.light == pytest.approx(-unit(np.ones(3)), abs=1e-6)
    assert solution.value == pytest.approx(1 / np.sqrt(3), abs=1e-8)


@pytest.mark.parametrize(
    "normals",
    [
        np.array([[1.0, 0, 0], [-1, 0, 0]]),
        np.vstack([np.eye(3), -np.eye(3)]),
        unit([[1, 0, 0.0], [-0.5, 0.9, 0], [-0.5, -0.9, 0]]),
    ],
)
def test_normals_without_a_common_half_space_have_no_direction(normals):
    solution = max_margin_direction(normals)
    assert solution.status is SolveStatus.INFEASIBLE
    assert solution.light is None
    assert np.isnan(solution.max_incidence)


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    n=st.integers(1, 300),
    half_angle=st.sampled_from([0.05, 0.6, 1.2, 1.5]),
)
# The solver calls its answer inaccurate, and it isn't.
@example(seed=1984409, n=257, half_angle=0.05)
def test_multipliers_prove_that_no_direction_is_better(seed, n, half_angle):
    """With a >= 0 of sum 1, min_i -N_i.L <= -(sum a_i N_i).L <= |sum a_i N_i|."""
    normals = cap(seed, n, half_angle)
    solution = max_margin_direction(normals)
    assert solution.status is SolveStatus.OPTIMAL
    assert np.linalg.norm(solution.light) == pytest.approx(1.0, abs=1e-12)
    value = (-normals @ solution.light).min()
    assert solution.value == pytest.approx(value, abs=1e-15)
    a = solution.multipliers
    assert a.shape == (n,)
    assert a.min() >= 0.0
    assert a.sum() == pytest.approx(1.0, abs=1e-12)
    bound = np.linalg.norm(a @ normals)
    assert value <= bound + 1e-12
    assert bound - value <= 1e-7


def test_answer_does_not_depend_on_the_programs_before():
    normals = cap(1, 40, 0.7)
    first = max_margin_direction(normals).light
    max_margin_direction(cap(2, 50, 1.3))
    assert np.array_equal(first, max_margin_direction(normals).light)


def parallel_program(normals, **changes):
    start = np.eye(4)
    start[:3, :3] = np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]])
    start[:3, 3] = [0.0, -1.0, 0.0]
    arguments = {
        "points": 0.05 * normals,
        "normals": normals,
        "steep": np.zeros_like(normals),
        "light": "parallel",
        "world_from_device": start,
        "max_incidence": np.deg2rad(80),
        "min_tangent_angle": 0.0,
        "range_m": (0.3, 2.0),
        "shell_m": (0.5, 1.5),
        "centre": np.zeros(3),
        "axis": np.array([0.0, -1.0, 0.0]),
        "sides": np.array([[-0.2, -0.2], [0.2, 0.2]]),
    }
    return PoseProgram(**(arguments | changes))


@pytest.mark.long
@pytest.mark.parametrize("seed", range(5))
def test_pose_program_is_globally_optimal_and_ipopt_does_no_better(seed):
    normals = cap(seed, 300, 0.5 + 0.08 * seed, axis=[0.2, -1.0, 0.3])
    program = parallel_program(normals)
    solution = solve_pose(program)
    assert solution.status is SolveStatus.OPTIMAL
    assert solution.slack >= 0.0
    margin = pose_margins(program, solution.world_from_device).min()
    best = max_margin_direction(normals).max_incidence
    assert margin == pytest.approx(np.deg2rad(80) - best, abs=1e-6)
    start = program.world_from_device
    outcome = run_ipopt(program, np.arange(300), start, max_iterations=300)
    local = pose_margins(program, pose_of(program, outcome.x)).min()
    assert outcome.success
    assert local == pytest.approx(margin, abs=1e-5)
    assert local <= margin + 1e-6


def test_start_that_is_globally_optimal_stays():
    program = parallel_program(cap(3, 100, 0.6, axis=[0.2, -1.0, 0.3]))
    best = solve_pose(program)
    again = solve_pose(
        parallel_program(program.normals, world_from_device=best.world_from_device)
    )
    assert best.moved
    assert again.status is SolveStatus.OPTIMAL
    assert not again.moved


@pytest.mark.parametrize("limit", ["tangent", "cone", "panel", "none faces all"])
def test_no_global_claim_where_another_limit_binds(limit):
    """What the cone program leaves out is IPOPT's, and its answer is a local one."""
    normals = cap(4, 80, 0.6, axis=[0.5, -1.0, 0.3])
    changes = {
        # T lies along the best light, so that it may not be taken.
        "tangent": {
            "steep": np.tile(max_margin_direction(normals).light, (80, 1)),
            "min_tangent_angle": np.deg2rad(10),
        },
        "cone": {"half_angle": np.deg2rad(5)},
        "panel": {
            "sides": np.array([[-0.045, -0.045], [0.045, 0.045]]),
            "points": 0.1 * normals,
        },
        "none faces all": {},
    }[limit]
    if limit == "none faces all":
        normals = unit([[1.0, -0.1, 0], [-1, -0.1, 0], [0.1, 1.0, 0.0]])
    program = parallel_program(normals, **changes)
    solution = solve_pose(program)
    assert solution.status is not SolveStatus.OPTIMAL
    if solution.status is SolveStatus.LOCALLY_OPTIMAL:
        slack = pose_slack(program, solution.world_from_device)
        assert slack.min() >= 0.0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((np.zeros((0, 3)),), r"\(n, 3\) with n >= 1"),
        ((np.ones((2, 3)),), "unit vectors"),
        ((np.full((2, 3), np.nan),), "unit vectors"),
    ],
)
def test_bad_arrays_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        max_margin_direction(*arguments)


@pytest.mark.long
@pytest.mark.parametrize("module", ["cvxpy", "casadi"])
def test_neither_cvxpy_nor_casadi_is_imported_before_it_is_used(module):
    code = (
        "import sys; sys.path[:0] = ['.']; import planning.pipeline; "
        f"import solvers.poses.cone; print('{module}' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "False"
