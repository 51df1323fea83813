"""The check's own optics: closed forms, and the round trip through the lens."""

import numpy as np
import pytest

from geometry.shapes.primitives import sphere
from planning.verify.reconstruction.calibration import (
    calibrate_camera,
    calibrate_projector,
)

LENS = (-0.12, 0.05, 8e-4, -6e-4, -0.01)


@pytest.fixture(scope="module")
def plan(rigs):
    return rigs.plan_of(
        sphere(0.05, subdivisions=2),
        [
            rigs.diverging("P1", rigs.direction(20.0, 10.0), 0.06, 4e-3),
            rigs.parallel("P2", rigs.direction(-20.0, 10.0), 0.06, 4e-3),
        ],
        [
            rigs.camera("C1", rigs.direction(0.0, 0.0)),
            rigs.camera(
                "C2", rigs.direction(50.0, 20.0), focal=1400.0, distortion=LENS
            ),
        ],
    )


def test_a_camera_images_its_axes_as_opencv_does(plan):
    """From -y, z up: world +x is to the right, world +z upwards, so v shrinks."""
    one = calibrate_camera(plan.cameras[0])
    pixels = one.project(np.array([[0, 0, 0], [0.1, 0, 0], [0, 0, 0.1]], float))
    expected = [[1023.5, 767.5], [1023.5 + 347.8, 767.5], [1023.5, 767.5 - 347.8]]
    np.testing.assert_allclose(pixels, expected, atol=1e-9)


def test_lens_formula_at_one_point(plan):
    """Brown-Conrady worked by hand for p = (0.2, -0.1)."""
    one = calibrate_camera(plan.cameras[1])
    x, y, s = 0.2, -0.1, 0.05
    k1, k2, p1, p2, k3 = LENS
    radial = 1 + k1 * s + k2 * s * s + k3 * s**3
    u = x * radial + 2 * p1 * x * y + p2 * (s + 2 * x * x)
    v = y * radial + p1 * (s + 2 * y * y) + 2 * p2 * x * y
    turn = one.world_from_device[:3, :3]
    point = one.centre + turn @ np.array([0.4, -0.2, 2.0])
    expected = [1400.0 * u + 1023.5, 1400.0 * v + 767.5]
    np.testing.assert_allclose(one.project(point[None])[0], expected, atol=1e-9)


def test_rays_invert_the_projection(plan):
    rng = np.random.default_rng(2)
    for one in map(calibrate_camera, plan.cameras):
        pixels = rng.uniform([-0.5, -0.5], [2047.5, 1535.5], (500, 2))
        rays = one.rays(pixels)
        np.testing.assert_allclose(np.linalg.norm(rays, axis=1), 1.0)
        reach = rng.uniform(0.5, 2.0, (500, 1))
        back = one.project(one.centre + reach * rays)
        assert np.abs(back - pixels).max() < 1e-7


def test_points_behind_a_device_have_no_pixel(plan):
    one = calibrate_camera(plan.cameras[0])
    behind = one.centre - 0.5 * one.world_from_device[:3, 2]
    assert np.all(np.isnan(one.project(behind[None])))
    for projector in map(calibrate_projector, plan.projectors):
        behind = projector.centre - 0.1 * projector.axis
        pixels, _ = projector.panel(behind[None])
        assert not projector.in_panel(pixels)[0]


def test_ring_plane_of_a_pixel_is_where_its_light_is_in_the_ring_frame(plan):
    rng = np.random.default_rng(4)
    points = rng.uniform(-0.05, 0.05, (300, 3))
    for projector in map(calibrate_projector, plan.projectors):
        pixels, depth = projector.panel(points)
        ring = projector.to_ring(points)
        flat = ring[:, :2]
        if projector.light.name == "diverging":
            flat = flat / ring[:, 2:]
        np.testing.assert_allclose(projector.ring_plane(pixels), flat, atol=1e-12)
        away = np.linalg.norm(points - projector.centre, axis=1)
        assert np.all((depth > 0.9) & (depth <= away))


def test_panel_ends_at_its_edges_and_its_beam(plan):
    wide, beam = map(calibrate_projector, plan.projectors)
    inside = wide.in_panel(np.array([[-0.5, 0.0], [1279.5, 799.5], [1279.6, 0.0]]))
    assert inside.tolist() == [True, True, False]
    # 0.2 mm pixels, beam radius 200 mm about the centre of 2000 x 2000 pixels.
    inside = beam.in_panel(np.array([[999.5, 0.0], [100.0, 100.0], [np.nan, 0.0]]))
    assert inside.tolist() == [True, False, False]
    middle = beam.panel_coordinates(np.array([[999.5, 999.5], [1000.5, 999.5]]))
    np.testing.assert_allclose(middle, [[0.0, 0.0], [0.2e-3, 0.0]], atol=1e-15)
