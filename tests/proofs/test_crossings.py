"""What coded pixels offer to cameras in a cell, against cameras that stand in it."""

from dataclasses import replace

import numpy as np
import pytest
from proofs.test_camera_bound import FREE, LENSES, _rotations, _turned_by, scene_of

from geometry.shapes.primitives import sphere
from planning.model.devices.calibration_errors import CalibrationErrors
from planning.model.light.dense_code import DenseCode
from planning.proofs.cells.crossings import Cone, farthest_cos
from planning.proofs.cells.measurable_cells import MeasurableCells
from planning.scene.codes.surfaces import CodedPixels, PanelLight, PanelRays
from planning.scene.draws import Draw
from planning.scene.limits.camera_limits import SEEN, ViewedSamples
from planning.scene.measuring.measurability import pair_quality
from planning.scene.measuring.measured import LitSamples
from planning.scene.samples import LightOnSamples

N, TRIES = 200, 100


def coded_rows(rng):
    """Samples of a sphere in light from anywhere before them, with uneven pixels."""
    target = scene_of(sphere(0.1, subdivisions=3)).target_samples(Draw(N, 3))
    normals = target.samples.normals
    away = np.radians(rng.uniform(0.0, 60.0, N))
    beams = -_turned_by(normals, away, rng)
    side = np.cross(beams, rng.normal(size=(N, 3)))
    side /= np.linalg.norm(side, axis=1)[:, None]
    other = np.cross(beams, side) + 0.3 * side
    per_px = 5e-4 * np.stack([side, rng.uniform(0.5, 1.5, (N, 1)) * other], axis=2)
    distance, one = rng.uniform(0.8, 1.2, N), np.ones(N)
    off_centre = rng.uniform(-400.0, 400.0, (N, 2))
    panel = PanelRays(beams * distance[:, None], per_px, off_centre)
    light = PanelLight(distance, 5e-4 * one, one, one)
    falls = LightOnSamples(np.cos(away), 0.0 * one, panel.offsets)
    pixels = CodedPixels(DenseCode(), beams, panel, light)
    return LitSamples(target, np.ones((N, 1), dtype=bool), (falls,), (pixels,), ("",))


@pytest.mark.parametrize("name", ["plain", "bent"])
@pytest.mark.parametrize(
    ("limits", "off"),
    [
        ({"min_angle": 0.5}, None),
        ({"max_angle": 0.6}, None),
        ({"max_sigma_m": 1.5e-4}, None),
        ({"max_sigma_m": 3e-4}, CalibrationErrors(2e-4, 5e-5, 1e-4, 0.3)),
        ({"min_angle": 0.2, "max_angle": 0.9, "max_sigma_m": 1.5e-4}, None),
    ],
)
def test_what_any_place_and_aim_measures_is_admitted(limits, off, name):
    device, rng = LENSES[name], np.random.default_rng(7)
    rows = coded_rows(rng)
    given = FREE | limits | {"calibration": off}
    required = scene_of(sphere(0.1), limits=given).requirements
    normals = rows.target.samples.normals
    towards = _turned_by(normals, np.radians(rng.uniform(0, 85, N)), rng)
    psi, far = rng.uniform(0.0, 0.35, N), rng.uniform(0.95, 1.4, N)
    nearest = far - rng.uniform(0.0, 0.2, N)
    cells = MeasurableCells(rows, required, (device,))
    admitted = cells.admits(np.arange(N), towards, nearest, psi)
    lean = psi[:, None] * rng.choice([0.0, 0.5, 1.0], (N, TRIES))
    u = _turned_by(np.repeat(towards[:, None], TRIES, axis=1), lean, rng)
    t = nearest[:, None] + (far - nearest)[:, None] * rng.integers(0, 2, (N, TRIES))
    pixel = rng.uniform(-0.5, 1.0, (N, TRIES, 2)).clip(0, 1) * [2047.0, 1535.0]
    local = device.rays(pixel)
    turn = _rotations(local, -u, rng)
    jacobian = device.ray_jacobian(local.reshape(-1, 3)).reshape(N, TRIES, 3, 2)
    jacobian = turn @ jacobian
    measured = np.zeros(N, dtype=bool)
    pair = replace(required.triangulation, light=None)
    for k in range(TRIES):
        facing = np.einsum("ij,ij->i", normals, u[:, k])
        off_centre = pixel[:, k] - device.camera_matrix[:2, 2]
        first = np.full(N, SEEN, dtype=np.int8)
        seen = ViewedSamples(
            *(first, -u[:, k], t[:, k], facing, jacobian[:, k], off_centre)
        )
        quality = pair_quality(normals, rows.lights[0], rows.surfaces[0], seen, pair)
        low, high = pair.angles
        good = (quality.light_cos <= np.cos(low)) & (quality.light_cos >= np.cos(high))
        good &= quality.sigma <= (pair.max_sigma_m or np.inf)
        measured |= good & (facing >= np.cos(required.camera.max_incidence))
    assert not np.any(measured & ~admitted)
    assert np.count_nonzero(measured) > 5
    # It does forbid; of a lens model that folds back, little is known.
    assert np.count_nonzero(admitted) < (0.97 if name == "plain" else 1.0) * N


def test_seen_as_a_point_little_is_left_to_chance():
    """Each limit forbids what misses it by a fifth."""
    rng = np.random.default_rng(3)
    rows, device = coded_rows(rng), LENSES["plain"]
    normals = rows.target.samples.normals
    towards = _turned_by(normals, np.radians(rng.uniform(0, 60, N)), rng)
    met = np.arccos(-np.einsum("ij,ij->i", rows.surfaces[0].beams, towards))
    every, psi, away = np.arange(N), np.full(N, 1e-3), np.ones(N)
    for limits, expected in (
        ({"min_angle": 0.5}, met >= 0.5),
        ({"max_angle": 0.6}, met <= 0.6),
    ):
        required = scene_of(sphere(0.1), limits=FREE | limits).requirements
        cells = MeasurableCells(rows, required, (device,))
        admitted = cells.admits(every, towards, away, psi)
        sure = np.abs(met - next(iter(limits.values()))) > 2e-3
        assert np.array_equal(admitted[sure], expected[sure])
        assert 20 < admitted.sum() < N - 20


def test_the_least_cosine_is_no_larger_where_the_cosine_rounds_to_one():
    """Of a line 1e-8 off the middle of the cone, a cosine in float64 is 1."""
    off = np.linspace(0.0, 2e-8, 41)[:, None]
    psi = np.linspace(0.01, 1.57, 60)[None, :]
    cone = Cone(off, psi, np.cos(psi), np.sin(psi))
    least, exact = farthest_cos(np.cos(off), cone), np.cos(psi + off)
    assert np.any(np.cos(off[1:]) == 1.0)
    assert np.all(least <= exact * (1.0 + 1e-12))
    np.testing.assert_allclose(least, exact, atol=2e-7)
