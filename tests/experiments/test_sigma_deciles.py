"""s_N and pitch against rendered images, off the axis too; edge noise from a plane."""

import numpy as np
import pytest
from support.edge_noise import EdgeNoise

from geometry.shapes.primitives import sphere


@pytest.fixture(scope="module")
def table(benchmark_module):
    return benchmark_module("pixels.sigma_deciles")


@pytest.fixture(scope="module")
def found(table):
    """Errors on the plane, and on a sphere 27 degrees off the axes of two cameras."""
    source = table.projector("parallel")
    flat = table.measured(table.plane_before(source), source, table.cameras(0.0))
    views = table.cameras(27.3)
    ball = table.measured(sphere(0.06, subdivisions=6), source, views)
    return flat, ball


@pytest.mark.long
def test_errors_are_s_n_in_every_decile_of_conditioning(found):
    flat, ball = found
    assert np.degrees(ball.off_axis.max()) > 30.0
    assert np.ptp(ball.conditioning) > 0.4
    scale = flat.scale("by_blur")
    parts = ball.deciles("by_blur", scale)
    assert np.all(np.abs(parts / (ball.scale("by_blur") / scale) - 1.0) < 0.1)
    # What the plane said of the edge noise holds on the sphere.
    assert ball.scale("by_blur") == pytest.approx(scale, rel=0.1)


@pytest.mark.long
def test_the_law_of_planning_leaves_out_what_blur_does_and_stays_safe(found):
    flat, ball = found
    scale = flat.scale("plain")
    assert scale == pytest.approx(0.0172, rel=0.1)
    parts = ball.deciles("plain", scale)
    assert 0.1 < np.abs(parts / (ball.scale("plain") / scale) - 1.0).max() < 0.3
    assert np.all(ball.deciles("plain", 0.1) < 0.25)


@pytest.mark.long
def test_pitch_is_the_distance_of_rings_in_the_image(found):
    for errors in found:
        ratio = errors.seen_pitch / errors.pitch
        assert np.isfinite(ratio).mean() > 0.8
        low, middle, high = np.nanquantile(ratio, [0.05, 0.5, 0.95])
        assert middle == pytest.approx(1.0, abs=1e-3)
        assert 0.985 < low < high < 1.015
        assert errors.pitch.max() > 1.9 * errors.pitch.min()


def test_edge_noise_grows_with_blur_and_with_oblique_light():
    frontal, oblique = np.array([1.0]), np.array([0.5])
    sharp, wide = np.array([0.0]), np.array([4000.0])
    read, shot = EdgeNoise(0.6, 2.5e-4, 0.0), EdgeNoise(0.6, 2.5e-4, 1.0)
    width = np.sqrt(0.36 + 1.0 / 12.0)
    assert read.relative(frontal, sharp) == pytest.approx(width)
    assert read.relative(oblique, sharp) == pytest.approx(2.0 * width)
    assert shot.relative(oblique, sharp) == pytest.approx(np.sqrt(2.0) * width)
    assert read.relative(frontal, wide) == pytest.approx(np.hypot(width, 1.0))


@pytest.mark.parametrize(
    "values", [(-1.0, 0.0, 0.5), (np.nan, 0.0, 0.5), (0.5, np.inf, 0.5), (0, 0, 1.1)]
)
def test_what_is_no_blur_is_refused(values):
    with pytest.raises(ValueError, match="is"):
        EdgeNoise(*values)
