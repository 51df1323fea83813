"""Solids that turn about an axis, against ones that stand: closed forms."""

import numpy as np
import pytest
import trimesh

from geometry.shapes.primitives import box, cylinder
from geometry.shapes.swept import deepest_meeting, in_frame, lowest

_STEP = 1e-4


def _box(centre, size):
    return box(tuple(size)).corners + np.array(centre)


def _met(turning, still, point=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0)):
    faces = [in_frame(f, np.array(point), np.array(axis)) for f in (turning, still)]
    return deepest_meeting(*faces, _STEP)


@pytest.mark.parametrize("gap", [-5e-3, -3e-4, 0.0, 1e-3])
def test_a_bar_reaches_as_far_as_its_corners(gap):
    """Of a bar 200 x 40 mm the corners turn on a radius of 102 mm."""
    bar = _box((0.0, 0.0, 0.0), (0.2, 0.04, 0.03))
    radius = np.hypot(0.1, 0.02)
    post = _box((0.0, radius + gap + 0.05, 0.0), (1e-6, 0.1, 0.5))
    met = _met(bar, post)
    if gap >= 0.0:
        assert met is None
        return
    assert met.depth == pytest.approx(-gap, abs=1e-6)
    corners = np.arctan2(0.02, 0.1) * np.array([[1.0], [-1.0]]) + [[0.0, np.pi]]
    apart = 0.5 * np.pi - corners - met.angle
    assert np.abs(np.exp(1j * apart) - 1.0).min() < 1e-3


@pytest.mark.parametrize("axis", [(0.0, 0.0, 1.0), (0.6, 0.0, 0.8), (-1.0, 0.0, 0.0)])
def test_it_is_the_same_about_any_axis_through_any_point(axis):
    """A ball off the axis sweeps a ring; a small ball reaches into it, or doesn't."""
    point, axis = np.array([0.3, -0.2, 0.1]), np.array(axis)
    side = np.cross(axis, [0.0, 1.0, 0.0])
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.03).triangles
    turning = ball + point + 0.1 * np.array([0.0, 1.0, 0.0])
    inside = ball / 3.0 + point + 0.065 * side + 0.01 * axis
    assert _met(turning, inside, point, axis).depth == pytest.approx(4e-3, abs=1e-3)
    assert _met(turning, inside - 8e-3 * side, point, axis) is None
    assert _met(turning, inside + 0.05 * axis, point, axis) is None


def test_surfaces_that_lie_on_each_other_dont_meet():
    part = _box((0.0, 0.0, 0.0), (0.2, 0.2, 0.1))
    assert _met(part, _box((0.0, 0.0, -0.1), (0.5, 0.5, 0.1))) is None
    assert _met(part, _box((0.0, 0.0, -0.0997), (0.5, 0.5, 0.1))).depth < 5e-4
    washer = trimesh.creation.annulus(0.01, 0.1, 0.05).triangles
    assert _met(washer, cylinder(0.0099, 0.4).corners) is None
    assert _met(washer, cylinder(0.0105, 0.4).corners) is not None


def test_one_that_holds_the_other_meets_it():
    inner, outer = _box((0.0,) * 3, (0.02,) * 3), _box((0.0,) * 3, (0.3,) * 3)
    hollow = np.concatenate([outer, _box((0.0,) * 3, (0.2,) * 3)])
    for pair in ((inner, outer), (outer, inner)):
        assert _met(*pair).depth > 0.01
    assert _met(inner, hollow) is None
    aside = inner + [0.02, 0.0, 0.0]
    assert _met(aside, outer).depth > 0.01


def test_sheets_square_to_the_axis_meet_what_goes_through_them():
    sheet = np.array([[[0.2, 0.2, 0.0], [-0.2, 0.2, 0.0], [0.0, -0.3, 0.0]]])
    pin = _box((0.0, 0.15, 0.0), (0.01, 0.01, 0.1))
    assert _met(sheet, pin) is not None
    assert _met(pin, sheet) is not None
    assert _met(sheet, _box((0.0, 0.0, 0.0), (1e-3, 1e-3, 0.1))) is not None
    assert _met(sheet, pin + [0.0, 0.3, 0.0]) is None
    assert _met(sheet, pin + [0.0, 0.0, 0.05]) is None


def test_an_open_surface_holds_nothing_behind_it():
    """Half of a ball's surface, as a scan is: what stands behind it isn't inside."""
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.1).triangles
    cap = ball[ball[:, :, 0].min(axis=1) > 0.02]
    assert _met(cap, _box((0.0, 0.0, 0.0), (0.01,) * 3)) is None
    assert _met(ball, _box((0.0, 0.0, 0.0), (0.01,) * 3)) is not None


def test_the_lowest_place_of_a_turn_is_that_of_trying_every_angle():
    rng = np.random.default_rng(3)
    points = rng.normal(size=(20, 3))
    normal = np.array([0.36, 0.48, 0.8])
    least, angle = lowest(points, normal)

    def turned(by):
        c, s = np.cos(by), np.sin(by)
        return (
            points @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        ) @ normal

    tried = [turned(by).min() for by in np.linspace(0.0, 2.0 * np.pi, 2000)]
    assert least == pytest.approx(min(tried), abs=1e-4)
    assert turned(angle).min() == pytest.approx(least, abs=1e-12)
