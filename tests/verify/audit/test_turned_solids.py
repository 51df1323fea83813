"""The audit's pictures of what turns, against closed forms."""

import numpy as np
import pytest
import trimesh

from planning.verify.audit.predicates.turned_solids import (
    depth_of_turn,
    lowest_of_turn,
)

_AXES = [(0.0, 0.0, 1.0), (0.6, 0.0, 0.8), (0.0, -1.0, 0.0)]


def _box(centre, size):
    solid = trimesh.creation.box(extents=size)
    return solid.triangles + np.array(centre)


def _depth(turning, still, point=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0)):
    return depth_of_turn(turning, still, np.array(point), np.array(axis))


@pytest.mark.long
@pytest.mark.parametrize("axis", _AXES)
def test_a_ball_that_turns_meets_one_in_its_ring_and_none_beside_it(axis):
    point, axis = np.array([0.3, -0.2, 0.1]), np.array(axis)
    side = np.cross(axis, [0.48, 0.6, -0.64])
    side /= np.linalg.norm(side)
    other = np.cross(axis, side)
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.03).triangles
    turning = ball + point + 0.1 * side
    for far, met in ((0.065, True), (0.055, False), (0.135, True), (0.145, False)):
        still = ball / 3.0 + point + far * other
        assert (_depth(turning, still, point, axis) > 0.0) is met
    above = ball / 3.0 + point + 0.1 * other + 0.045 * axis
    assert _depth(turning, above, point, axis) == 0.0


def test_what_touches_doesnt_meet_and_what_holds_the_other_does():
    part = _box((0.0, 0.0, 0.0), (0.2, 0.2, 0.1))
    assert _depth(part, _box((0.0, 0.0, -0.1), (0.5, 0.5, 0.1))) == 0.0
    assert _depth(part, _box((0.0, 0.0, -0.097), (0.5, 0.5, 0.1))) > 1e-3
    small, shell = _box((0.0,) * 3, (0.02,) * 3), _box((0.0,) * 3, (0.3,) * 3)
    for pair in ((small, shell), (shell, small)):
        assert _depth(*pair) > 1e-3
    hollow = np.concatenate([shell, _box((0.0,) * 3, (0.2,) * 3)])
    assert _depth(small, hollow) == 0.0


def test_a_bar_meets_a_post_that_its_corners_alone_reach():
    bar = _box((0.0, 0.0, 0.0), (0.2, 0.04, 0.03))
    reach = np.hypot(0.1, 0.02)
    for gap, met in ((-1.5e-3, True), (1e-3, False)):
        post = _box((0.0, reach + gap + 0.01, 0.0), (1e-4, 0.02, 0.1))
        assert (_depth(bar, post) > 0.0) is met


def test_an_open_surface_holds_nothing_behind_it():
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.1).triangles
    cap = ball[ball[:, :, 0].min(axis=1) > 0.02]
    assert _depth(cap, _box((0.0,) * 3, (0.01,) * 3)) == 0.0
    assert _depth(ball, _box((0.0,) * 3, (0.01,) * 3)) > 0.0


@pytest.mark.parametrize("axis", _AXES)
def test_the_lowest_place_of_a_turn_is_that_of_many_angles(axis):
    rng = np.random.default_rng(4)
    points, point, axis = rng.normal(size=(20, 3)), rng.normal(size=3), np.array(axis)
    normal = np.array([0.36, 0.48, 0.8])
    least = np.inf
    for angle in np.linspace(0.0, 2.0 * np.pi, 1000):
        turn = trimesh.transformations.rotation_matrix(angle, axis)[:3, :3]
        least = min(least, float(((points - point) @ turn.T @ normal).min()))
    assert lowest_of_turn(points, normal, point, axis) == pytest.approx(least, abs=1e-4)
