"""Robust fits on functions with known minima, and the mismatch of an edge in metres."""

from dataclasses import replace

import numpy as np
import pytest

from planning.verify.reconstruction.faults.fits import fit
from planning.verify.reconstruction.faults.supposed import (
    Evidence,
    Supposed,
    mismatches,
    places,
)
from planning.verify.reconstruction.scanner import Scanner

RNG = np.random.default_rng(0)
SLOPES = RNG.normal(size=(300, 3))
TRUE = np.array([2e-3, -1e-3, 5e-4])


def linear(x):
    error = SLOPES @ (x - TRUE) + 5e-6 * np.random.default_rng(1).normal(size=300)
    error[::10] += 3e-3
    error[5::50] = np.nan
    return error


def test_outliers_and_misses_do_not_pull():
    np.testing.assert_allclose(fit(linear, np.zeros(3)), TRUE, atol=3e-6)


def test_a_start_without_any_hit_is_returned():
    start = np.array([1.0, 2.0])
    assert fit(lambda x: np.full(5, np.nan), start) is start


def test_what_leaves_no_trace_is_taken_out_again():
    def blind(x):
        return linear(np.array([x[0], x[1], TRUE[2]]))

    fitted = fit(blind, np.array([0.0, 0.0, 0.02]))
    np.testing.assert_allclose(fitted[:2], TRUE[:2], atol=3e-6)
    assert abs(fitted[2]) < 1e-9


@pytest.mark.parametrize("light", ["diverging", "parallel"])
def test_mismatch_is_the_distance_from_the_cone_or_cylinder(rigs, light):
    """Two metres away, so that metres aren't tangents; rings about the optical axis."""
    entry = getattr(rigs, light)("P1", 2.0 * rigs.direction(30.0, 5.0), 0.06, 3e-3)
    if light == "diverging":
        entry["world_from_ring"] = entry["world_from_device"]
    mesh = rigs.bumpy_sphere(0.05, subdivisions=3)
    viewer = rigs.camera("C1", rigs.direction(0.0, 10.0))
    plan = rigs.plan_of(mesh, [entry], [viewer])
    camera, projector = plan.cameras[0], plan.projectors[0]
    supposed = Supposed.of(Scanner.of(plan))
    middle = np.array(camera.device.resolution) / 2.0
    pixels = middle + RNG.uniform(-80.0, 80.0, (200, 2))
    evidence = Evidence.at(pixels, 0, 0)
    at = places(evidence, supposed)
    design = supposed.projectors[0]
    rho = np.hypot(*design.ring_plane(design.panel(at[0])[0]).T)
    radii = rho + RNG.uniform(-3e-3, 3e-3, 200)
    off = mismatches(replace(evidence, radii=radii), supposed, at)
    local = design.to_ring(at[0])
    across, along = np.hypot(local[:, 0], local[:, 1]), local[:, 2]
    if light == "diverging":
        # The nearest point of the line rho = R z in the plane through the axis.
        nearest = (along + radii * across) / (1.0 + radii**2)
        distance = np.hypot(across - radii * nearest, along - nearest)
    else:
        distance = np.abs(across - radii)
    known = np.isfinite(off)
    assert known.sum() > 100
    np.testing.assert_allclose(np.abs(off[known]), distance[known], rtol=1e-9)
    assert np.array_equal(off[known] > 0.0, (rho > radii)[known])
    assert projector.light == light
