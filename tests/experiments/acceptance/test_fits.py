"""Free spheres and planes against exact ones, and what may be left out of a span."""

import numpy as np
import pytest

from planning.experiments.acceptance.fits import fit_sphere, flatness, spread


def cap(n=4000, radius=0.0125, half_angle_deg=60.0):
    """Points of a sphere as one side of it is seen, and the directions to them."""
    rng = np.random.default_rng(3)
    z = rng.uniform(np.cos(np.radians(half_angle_deg)), 1.0, n)
    turn = rng.uniform(0.0, 2.0 * np.pi, n)
    side = np.sqrt(1.0 - z * z)
    outward = np.column_stack([side * np.cos(turn), z, side * np.sin(turn)])
    return np.array([0.3, -0.2, 0.9]) + radius * outward, outward


def test_a_cap_without_noise_gives_centre_and_radius():
    points, _ = cap()
    found = fit_sphere(points)
    np.testing.assert_allclose(found.centre, [0.3, -0.2, 0.9], atol=1e-12)
    assert found.radius == pytest.approx(0.0125, abs=1e-12)
    assert found.form < 1e-11


def test_the_form_is_the_span_about_the_free_sphere():
    """Bumps of degree four, which neither centre nor radius takes up, on a ball."""
    rng = np.random.default_rng(5)
    outward = rng.normal(size=(20000, 3))
    outward /= np.linalg.norm(outward, axis=1)[:, None]
    z = outward[:, 2]
    # A zonal harmonic: no mean, and no dipole.
    bump = 1e-5 * (35.0 * z**4 - 30.0 * z**2 + 3.0) / 8.0
    found = fit_sphere((0.02 + bump)[:, None] * outward)
    assert found.radius == pytest.approx(0.02, abs=2e-7)
    # From -3/7 to 1, the poles' few points but for three in a thousand of all.
    assert found.form == pytest.approx(1e-5 * (1.0 + 3.0 / 7.0), rel=0.05)


@pytest.mark.parametrize(("outliers", "told"), [(3, False), (4, True)])
def test_three_points_in_a_thousand_may_be_left_out(outliers, told):
    distances = np.linspace(-1e-5, 1e-5, 1000)
    distances[:outliers] = 5e-4
    assert (spread(distances) > 1e-4) is told


def test_a_tilted_plane_is_flat_but_for_its_waves():
    grid = np.linspace(-0.05, 0.05, 101)
    x, y = (part.ravel() for part in np.meshgrid(grid, grid))
    normal = np.array([1.0, 2.0, 2.0]) / 3.0
    across = np.array([2.0, -2.0, 1.0]) / 3.0
    frame = np.stack([across, np.cross(normal, across), normal])
    waves = 2e-5 * np.cos(2.0 * np.pi * 5.0 * x / 0.1)
    points = np.column_stack([x, y, waves]) @ frame + [1.0, 2.0, 3.0]
    assert flatness(points) == pytest.approx(4e-5, rel=0.02)
