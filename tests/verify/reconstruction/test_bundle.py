"""Edges off their rings: in metres, by every unknown, and brought back onto them."""

from dataclasses import replace

import numpy as np
import pytest
from support.simulated_edges import simulated_edges

from geometry.mesh.mesh import TriangleMesh
from geometry.rays.rays import RayCaster
from planning.model.devices.calibration_errors import CalibrationErrors
from planning.verify.reconstruction.faults.adjustment import adjust, expected_of
from planning.verify.reconstruction.faults.bundle import TURN, Bundle
from planning.verify.reconstruction.faults.supposed import (
    Evidence,
    Supposed,
    mismatches,
    places,
)
from planning.verify.reconstruction.scanner import Scanner

RNG = np.random.default_rng(0)
# What the devices of a calibrated rig are off by, and where its object stands.
ERRORS = CalibrationErrors(5e-4, 5e-4, 2e-3, 1.0)
PLACED = (1e-3, 1e-3, 2e-3)


@pytest.fixture(scope="module", params=["diverging", "parallel"])
def bundle(rigs, request) -> Bundle:
    plan = rigs.small_rig(rigs.bumpy_sphere(0.05, subdivisions=4), request.param)
    rig = Supposed.of(Scanner.of(plan))
    return Bundle(simulated_edges(rig, noise_px=0.02, seed=1), rig)


def test_slopes_are_the_derivatives_by_every_unknown(bundle):
    """Central differences, about a rig whose every unknown changed already."""
    x = 1e-3 * RNG.normal(size=bundle.n_unknowns)
    slopes, step = bundle.slopes(x), 1e-6
    assert slopes.shape == (len(bundle.evidence), bundle.n_unknowns)
    for column in range(bundle.n_unknowns):
        change = step * (np.arange(len(x)) == column)
        by_step = bundle.offsets(x + change) - bundle.offsets(x - change)
        off = np.abs(by_step / (2.0 * step) - slopes[:, column])
        size = np.nanmax(np.abs(slopes[:, column]))
        # Rays that pass from facet to facet, or off the object, have no derivative.
        assert size > 0.0
        assert np.nanquantile(off, 0.9) < 2e-3 * size, column


def test_an_adjustment_finds_what_a_rig_is_off_by_within_its_covariance(bundle):
    """All unknowns drawn as expected, outliers among the edges: chi squared fits."""
    expected = expected_of(bundle, ERRORS)
    expected[bundle.columns("objects", 0)] = np.repeat(PLACED, (3, 3, 1))
    rng = np.random.default_rng(5)
    true = expected * rng.normal(size=len(expected))
    seen = simulated_edges(
        bundle.supposed, bundle.moved(true), noise_px=0.02, outliers=0.03, seed=2
    )
    found = adjust(Bundle(seen, bundle.supposed), expected)
    off = (found.x - true) / expected
    inverse = np.linalg.inv(found.covariance / np.outer(expected, expected))
    chi = float(off @ inverse @ off) / len(off)
    assert 0.3 < chi < 2.5
    # A third of what may be off together the edges tell ten times as surely.
    assert np.quantile(np.linalg.eigvalsh(inverse), 2.0 / 3.0) > 1e2
    assert np.nanmedian(np.abs(found.offsets)) < 1.0


def test_edges_of_pairs_tell_against_each_other_where_the_object_is_not_the_mesh(rigs):
    """Waves of 0.4 mm that the mesh lacks; a camera turned by 0.05 degrees."""
    plan = rigs.small_rig(rigs.bumpy_sphere(0.05, subdivisions=4))
    scanner = Scanner.of(plan)
    check = replace(scanner.limits.check, tau_m=2e-3)
    scanner = replace(scanner, limits=replace(scanner.limits, check=check))
    rig = Supposed.of(scanner)
    (body,) = rig.objects
    x, _, z = body.mesh.vertices.T
    wave = 1.0 + 0.008 * np.sin(60.0 * x) * np.cos(60.0 * z)
    other = TriangleMesh(wave[:, None] * body.mesh.vertices, body.mesh.faces)
    there = replace(body, mesh=other, caster=RayCaster(other, threads=1))
    bundle = Bundle(simulated_edges(rig, noise_px=0.02, most=1), rig)
    turn = bundle.columns("cameras", 1, TURN)
    true = np.zeros(bundle.n_unknowns)
    true[turn] = np.deg2rad(0.05) * np.array([0.6, -0.8, 0.0])
    stands = replace(bundle.moved(true), objects=(there,))
    edges = simulated_edges(rig, stands, noise_px=0.02, most=600, seed=3)
    expected = np.zeros(bundle.n_unknowns)
    expected[turn] = 2e-3
    off = [
        np.linalg.norm(adjust(one, expected).x[turn] - true[turn])
        for one in (Bundle(edges, rig), Bundle(edges, rig, 4e-4))
    ]
    assert off[1] < 0.5 * off[0]
    assert off[1] < 0.3 * np.linalg.norm(true)
    mended = replace(stands, objects=rig.objects)
    raised = Bundle(edges, mended).offsets(np.zeros(len(true)))
    asked = Bundle(edges, mended, 1e-3).relief(raised)
    assert 5e-5 < asked < 4e-4


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
    _, off = mismatches(replace(evidence, radii=radii), supposed, at)
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
