"""Eqs. (9)-(10) against brute force and closed forms."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.closed_forms import (
    bent_limit,
    cylinder_limit,
    flat_limit,
    round_body_limit,
    sphere_band_limit,
)

from planning.cameras.baselines.coverage_triangle import (
    baseline_parts,
    largest_baseline,
    seam_angles,
)


def _benchmark():
    folder = Path(__file__).resolve().parents[2] / "benchmarks" / "paper"
    path = folder / "coverage_triangle.py"
    spec = importlib.util.spec_from_file_location("_coverage_triangle_benchmark", path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their own module up.
    spec.loader.exec_module(module)
    return module


brute = _benchmark()


@pytest.mark.parametrize(("axes", "shape"), brute.MODES)
def test_verdicts_agree_with_brute_force_in_every_mode(axes, shape):
    ups, end, truth = brute.draw_set_ups(axes, shape, 150, np.random.default_rng(7))
    by_phi, by_d, _, slack = brute.predicted(ups, end)
    assert 0.2 < truth.mean() < 0.8  # Both answers are asked for.
    np.testing.assert_array_equal(by_phi, truth)
    np.testing.assert_array_equal(by_d, truth)
    assert np.all((slack > 0.0) == truth)


def test_the_shorthand_fails_where_the_signed_form_does_not():
    ups, end, truth = brute.draw_set_ups(
        "turned", "bent", 150, np.random.default_rng(7)
    )
    by_phi, _, shorthand, _ = brute.predicted(ups, end)
    assert np.all(by_phi == truth)
    assert np.mean(shorthand == truth) < 0.97
    assert np.all(shorthand[truth])  # Its errors are on the unsafe side.


def _planar_case():
    """Cameras 1 m above a wall at x = -0.3 and 0.2, E at the origin, normal +y."""
    return (
        np.zeros((1, 3)),
        np.array([[1.0, 0.0, 0.0]]),
        {
            "centres": (np.array([-0.3, 1.0, 0.0]), np.array([0.2, 1.0, 0.0])),
            "axes": (np.array([0.0, -1.0, 0.0]), np.array([0.0, -1.0, 0.0])),
            "normals": (np.array([[0.0, 1.0, 0.0]]), np.array([[0.0, 1.0, 0.0]])),
        },
    )


def test_signed_angles_over_a_flat_wall():
    point, onward, kind = _planar_case()
    angles = seam_angles(point, onward, **kind)
    assert angles.iota1 == pytest.approx(np.arctan(0.3))
    assert angles.iota2 == pytest.approx(np.arctan(0.2))
    assert angles.beta1 == pytest.approx(np.arctan(0.3))
    assert angles.beta2 == pytest.approx(np.arctan(0.2))
    assert angles.delta_surface == pytest.approx(0.0)
    assert angles.delta_axes == pytest.approx(0.0)
    assert angles.phi == pytest.approx(np.arctan(0.3) + np.arctan(0.2))
    np.testing.assert_allclose(angles.onward, [[1.0, 0.0, 0.0]], atol=1e-12)


def test_crossed_sight_lines_make_phi_negative():
    point, onward, kind = _planar_case()
    angles = seam_angles(point, -onward, **kind)
    assert angles.phi == pytest.approx(-np.arctan(0.3) - np.arctan(0.2))


def test_a_seam_along_the_baseline_takes_the_side_of_camera_2():
    point, _, kind = _planar_case()
    angles = seam_angles(point, np.array([[0.01, 0.0, -1.0]]), **kind)
    assert angles.phi == pytest.approx(np.arctan(0.3) + np.arctan(0.2))


@pytest.mark.parametrize("height", [0.5, -0.5])
def test_phi_of_one_line_of_sight_is_zero_and_defined(height):
    point, onward, kind = _planar_case()
    kind["centres"] = (np.array([0.1, 1.0, 0.0]), np.array([0.05, 0.5, 0.0]))
    angles = seam_angles(point, np.copysign(1.0, height) * onward, **kind)
    assert angles.phi == pytest.approx(0.0, abs=1e-12)
    assert abs(angles.iota1[0]) == pytest.approx(np.arctan(0.1))


def test_round_a_sharp_edge_phi_passes_pi():
    turn = np.radians(150.0)
    normal2 = np.array([[np.sin(turn), np.cos(turn), 0.0]])
    to2 = np.array([np.sin(turn + 0.5), np.cos(turn + 0.5), 0.0])
    angles = seam_angles(
        np.zeros((1, 3)),
        np.array([[1.0, -1.0, 0.0]]),
        centres=(np.array([-np.sin(0.4), np.cos(0.4), 0.0]), to2),
        axes=(np.array([0.0, -1.0, 0.0]), -to2),
        normals=(np.array([[0.0, 1.0, 0.0]]), normal2),
    )
    assert angles.phi == pytest.approx(turn + 0.9)
    assert angles.delta_surface == pytest.approx(turn)


def test_a_rigid_motion_changes_no_angle():
    ups, end, _ = brute.draw_set_ups("turned", "unequal", 50, np.random.default_rng(3))
    point, lift = ups.point(end), brute._lift
    turn, shift = Rotation.random(rng=5).as_matrix(), np.array([0.4, -2.0, 1.3])
    here, beyond = ups.normal(end < 0), ups.normal(end >= 0)
    onward = ups.point(end + 1e-3) - ups.point(end - 1e-3)

    centres = (ups.centre1, ups.centre2)

    def angles(rotation, move):
        return seam_angles(
            lift(point) @ rotation.T + move,
            lift(onward) @ rotation.T,
            centres=tuple(lift(c) @ rotation.T + move for c in centres),
            axes=tuple(lift(a) @ rotation.T for a in (ups.axis1, ups.axis2)),
            normals=tuple(lift(n) @ rotation.T for n in (here, beyond)),
        )

    still, moved = angles(np.eye(3), np.zeros(3)), angles(turn, shift)
    for name in ("phi", "beta1", "beta2", "iota1", "iota2", "delta_axes"):
        np.testing.assert_allclose(
            getattr(moved, name), getattr(still, name), atol=1e-9, err_msg=name
        )


def test_in_plane_incidence_never_exceeds_the_spatial_one():
    rng = np.random.default_rng(11)
    normal = rng.normal(size=(400, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    centres = tuple(rng.normal(size=(400, 3)) for _ in range(2))
    angles = seam_angles(
        np.zeros((400, 3)),
        rng.normal(size=(400, 3)),
        centres=centres,
        axes=tuple(-c / np.linalg.norm(c, axis=1, keepdims=True) for c in centres),
        normals=(normal, normal),
    )
    for centre, iota in zip(centres, (angles.iota1, angles.iota2), strict=True):
        cosine = np.sum(centre * normal, axis=1) / np.linalg.norm(centre, axis=1)
        front = cosine > 0.0
        assert np.all((np.abs(iota) <= np.arccos(cosine) + 1e-9)[front])
    opening = [np.sum(a * b) for a, b in zip(*centres, strict=True)]
    size = np.prod([np.linalg.norm(c, axis=1) for c in centres], axis=0)
    np.testing.assert_allclose(np.cos(angles.phi), opening / size, atol=1e-9)


def test_law_of_cosines_and_its_range():
    assert largest_baseline(3.0, 4.0, np.pi / 2) == pytest.approx(5.0)
    outside = np.array([-0.1, 0.0, np.pi, 3.5, np.nan])
    assert np.all(np.isnan(largest_baseline(1.0, 1.0, outside)))


def test_parts_of_a_baseline_are_the_legs_of_a_right_triangle():
    lateral, axial = baseline_parts(
        np.array([1.0, 1.0, 1.0]), np.array([0.0, 0.0, -1.0]), np.array([4.0, 5.0, 3.0])
    )
    assert lateral == pytest.approx(5.0)
    assert axial == pytest.approx(2.0)


def test_flat_and_bent_limits_are_eq_9_where_both_fields_end():
    c1, c2 = np.tan(0.3), 0.8 * np.tan(0.2)
    assert flat_limit(c1, c2) == pytest.approx(
        np.sqrt(bent_limit(1.0, c1, 0.8, c2, 0.0) ** 2 - 0.2**2)
    )
    turn = np.radians(90.0)
    # A box: camera 1 over the top looks down, camera 2 before the side looks at it.
    apart = np.hypot(-c1 - 0.8, 1.0 + c2)
    assert bent_limit(1.0, c1, 0.8, c2, turn) == pytest.approx(apart)
    d1, d2 = np.hypot(1.0, c1), np.hypot(0.8, c2)
    assert largest_baseline(d1, d2, 0.3 + turn + 0.2) == pytest.approx(apart)


def _covers_turn(n, sees):
    """Whether n cameras, equally spaced, see all of a circle; worst azimuth first."""
    azimuth = np.concatenate([[np.pi / n], np.linspace(0.0, 2.0 * np.pi, 721)])
    return all(any(sees(a - 2.0 * np.pi * k / n) for k in range(n)) for a in azimuth)


def _incidence(azimuth, radius, ring, height=0.0, latitude=0.0):
    normal = np.array(
        [
            np.cos(azimuth) * np.cos(latitude),
            np.sin(azimuth) * np.cos(latitude),
            np.sin(latitude),
        ]
    )
    point = radius * normal + np.array([0.0, 0.0, height])
    ray = np.array([ring, 0.0, 0.0]) - point
    off_axis = np.arccos(ray[0] / np.linalg.norm(ray))
    return np.arccos(ray @ normal / np.linalg.norm(ray)), off_axis


@pytest.mark.parametrize("seed", range(20))
def test_fewest_cameras_round_a_disc(seed):
    rng = np.random.default_rng(seed)
    radius, theta, alpha = (
        rng.uniform(0.05, 0.5),
        rng.uniform(0.5, 1.4),
        rng.uniform(0.02, 0.6),
    )
    limit = round_body_limit(radius, 1.0, theta, alpha)

    def sees(azimuth):
        incidence, off_axis = _incidence(azimuth, radius, 1.0)
        return incidence < theta and off_axis < alpha

    assert _covers_turn(limit.n_min, sees)
    assert not _covers_turn(limit.n_min - 1, sees)
    for spread, expected in ((0.5 - 1e-6, True), (0.5 + 1e-6, False)):
        half = 2.0 * limit.half_angle * spread
        assert sees(half) == expected
        assert (2.0 * np.sin(half) < limit.d_max) == expected


def test_parts_that_only_touch_do_not_cover():
    theta = np.radians(60.0)
    radius = np.sin(theta - np.pi / 4) / np.sin(theta)
    assert round_body_limit(radius, 1.0, theta).half_angle == pytest.approx(np.pi / 4)
    assert round_body_limit(radius, 1.0, theta).n_min == 5


def test_worked_example_of_the_study():
    limit = round_body_limit(0.10, 1.10, np.radians(60.0))
    assert np.degrees(limit.half_angle) == pytest.approx(55.5, abs=0.05)
    assert limit.n_min == 4
    assert limit.d_max == pytest.approx(1.81, abs=0.005)


def test_sphere_band_and_cylinder_end_where_the_incidence_ends():
    theta, radius, latitude, z = 1.1, 0.3, 0.4, 0.35
    band = sphere_band_limit(radius, 1.2, theta, latitude)
    seen, _ = _incidence(band.half_angle, radius, 1.2, latitude=latitude)
    assert seen == pytest.approx(theta)
    tube = cylinder_limit(radius, 1.2, theta, z)
    point = np.array(
        [radius * np.cos(tube.half_angle), radius * np.sin(tube.half_angle), z]
    )
    normal = np.array([point[0], point[1], 0.0]) / radius
    ray = np.array([1.2, 0.0, 0.0]) - point
    assert np.arccos(ray @ normal / np.linalg.norm(ray)) == pytest.approx(theta)
    flat = round_body_limit(radius, 1.2, theta)
    for limit in (
        sphere_band_limit(radius, 1.2, theta, 0.0),
        cylinder_limit(radius, 1.2, theta, 0.0),
    ):
        assert limit.half_angle == pytest.approx(flat.half_angle)
        assert limit.n_min == flat.n_min
