"""The best direction of parallel light: closed forms, optimality, two methods."""

import importlib
import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from solvers.poses.cone import max_margin_direction, smallest_cap
from solvers.poses.pose_problem import PoseProgram
from solvers.poses.pose_program import solve_pose
from solvers.status import SolveStatus

METHODS = [max_margin_direction, smallest_cap]


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


@pytest.mark.parametrize("method", METHODS)
def test_one_patch_is_lit_along_its_normal(method):
    normal = unit([0.3, -0.5, 0.8])
    solution = method(np.tile(normal, (5, 1)))
    assert solution.status is SolveStatus.OPTIMAL
    assert solution.light == pytest.approx(-normal, abs=1e-6)
    assert solution.value == pytest.approx(1.0, abs=1e-8)


@pytest.mark.parametrize("method", METHODS)
def test_two_patches_are_lit_along_the_bisector(method):
    normals = unit([[1.0, 0.2, 0.0], [0.1, 1.0, 0.5]])
    solution = method(normals)
    assert solution.light == pytest.approx(-unit(normals.sum(axis=0)), abs=1e-6)
    half = 0.5 * np.arccos(normals[0] @ normals[1])
    assert solution.max_incidence == pytest.approx(half, abs=1e-7)


@pytest.mark.parametrize("method", METHODS)
def test_a_corner_of_a_box_is_lit_along_its_diagonal(method):
    solution = method(np.eye(3))
    assert solution.light == pytest.approx(-unit(np.ones(3)), abs=1e-6)
    assert solution.value == pytest.approx(1 / np.sqrt(3), abs=1e-8)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    "normals",
    [
        np.array([[1.0, 0, 0], [-1, 0, 0]]),
        np.vstack([np.eye(3), -np.eye(3)]),
        unit([[1, 0, 0.0], [-0.5, 0.9, 0], [-0.5, -0.9, 0]]),
    ],
)
def test_normals_without_a_common_half_space_have_no_direction(method, normals):
    solution = method(normals)
    assert solution.status is SolveStatus.INFEASIBLE
    assert solution.light is None
    assert np.isnan(solution.max_incidence)


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    n=st.integers(1, 300),
    half_angle=st.sampled_from([0.05, 0.6, 1.2, 1.5]),
)
def test_optimality_conditions_of_the_active_set(seed, n, half_angle):
    """-L is a non-negative combination of the normals that bind: nothing is better."""
    normals = cap(seed, n, half_angle)
    solution = smallest_cap(normals)
    assert solution.status is SolveStatus.OPTIMAL
    facing = -normals @ solution.light
    assert facing.min() == pytest.approx(solution.value, abs=1e-12)
    tight = normals[facing < solution.value + 1e-9]
    shares = None
    for k in range(1, 4):
        for chosen in itertools.combinations(range(min(len(tight), 8)), k):
            x, *_ = np.linalg.lstsq(tight[list(chosen)].T, -solution.light, rcond=None)
            error = np.linalg.norm(tight[list(chosen)].T @ x + solution.light)
            if np.all(x >= -1e-9) and error < 1e-6:
                shares = x
    assert shares is not None


def test_both_methods_agree():
    for seed in range(12):
        normals = cap(seed, 400, 0.2 + 0.1 * seed)
        exact, stated = smallest_cap(normals), max_margin_direction(normals)
        assert exact.value == pytest.approx(stated.value, abs=1e-7)
        assert exact.light == pytest.approx(stated.light, abs=1e-4)


def test_steep_line_shortens_the_relaxation_by_a_known_amount():
    """Normals at +-50 degrees from z, T of the first in their plane, tau 60 degrees.

    A unit L may lean at most 30 degrees off the first normal: incidence 70 at the
    second. The relaxation stays on the bisector and shortens L until sin 50 |L| = 0.5.
    """
    a = np.deg2rad(50)
    normals = np.array([[np.sin(a), 0, np.cos(a)], [-np.sin(a), 0, np.cos(a)]])
    steep = np.array([[np.cos(a), 0, -np.sin(a)], [0.0, 0.0, 0.0]])
    solution = max_margin_direction(normals, steep, np.deg2rad(60))
    assert solution.value == pytest.approx(0.5 / np.tan(a), abs=1e-6)
    assert solution.value > np.cos(np.deg2rad(70))
    assert solution.status is SolveStatus.UNKNOWN
    assert solution.light is None


def test_steep_line_that_binds_at_unit_length_is_kept():
    """One normal, T tangent to another: the light turns until it stands off T."""
    normals = unit([[0.0, 0.0, 1.0], [0.0, 0.0, 1.0]])
    steep = np.array([unit([1.0, 0.0, 1.0]), np.zeros(3)])
    solution = max_margin_direction(normals, steep, np.deg2rad(60))
    # Unit L at 15 degrees from z; the relaxation may shorten instead, to 0.5 sqrt 2.
    assert solution.value == pytest.approx(np.cos(np.deg2rad(15)), abs=1e-6)
    assert solution.status is SolveStatus.OPTIMAL
    assert solution.min_tangent_angle == pytest.approx(np.deg2rad(60), abs=1e-5)
    assert solution.max_incidence == pytest.approx(np.deg2rad(15), abs=1e-5)


def test_relaxation_that_is_shorter_than_one_claims_no_direction():
    """A wide fan of steep lines shortens L, whatever its direction."""
    rng = np.random.default_rng(1)
    normals = cap(3, 60, 1.2, axis=[0, 0, 1.0])
    steep = unit(np.cross(normals, rng.normal(size=normals.shape)))
    solution = max_margin_direction(normals, steep, np.deg2rad(70))
    assert solution.status is SolveStatus.UNKNOWN
    assert solution.light is None
    assert 0 < solution.value < max_margin_direction(normals).value


def test_pose_program_reaches_the_cone_optimum_in_parallel_light():
    for seed in range(5):
        normals = cap(seed, 300, 0.5 + 0.08 * seed, axis=[0.2, -1.0, 0.3])
        start = np.eye(4)
        start[:3, :3] = np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]])
        start[:3, 3] = [0.0, -1.0, 0.0]
        program = PoseProgram(
            points=0.05 * normals,
            normals=normals,
            steep=np.zeros_like(normals),
            light="parallel",
            world_from_device=start,
            max_incidence=np.deg2rad(80),
            min_tangent_angle=0.0,
            range_m=(0.3, 2.0),
            shell_m=(0.5, 1.5),
            centre=np.zeros(3),
            axis=np.array([0.0, -1.0, 0.0]),
            half_panel_m=(0.2, 0.2),
        )
        reached = np.deg2rad(80) - solve_pose(program).margin_rad
        best = smallest_cap(normals).max_incidence
        assert np.rad2deg(reached) == pytest.approx(np.rad2deg(best), abs=0.01)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((np.zeros((0, 3)),), r"\(n, 3\) with n >= 1"),
        ((np.ones((2, 3)),), "unit vectors"),
        ((np.full((2, 3), np.nan),), "unit vectors"),
        ((np.eye(3), np.eye(2)), "steep must be finite"),
        ((np.eye(3), np.eye(3)), "need tau_min"),
        ((np.eye(3), np.eye(3), np.nan), "tau_min is nan"),
    ],
)
def test_bad_arrays_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        max_margin_direction(*arguments)


def test_modelling_library_is_imported_on_use_only():
    source = importlib.util.find_spec("solvers.poses.cone").loader.get_source(
        "solvers.poses.cone"
    )
    head = source.split("def ", maxsplit=1)[0]
    assert "import cvxpy" not in head
