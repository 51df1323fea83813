"""What two cameras measure by each other: closed forms, Monte Carlo, and the audit."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares
from support.factories import make_rig
from support.view_rigs import camera_towards

from geometry.devices import PinholeModel
from geometry.mesh.sampling import SurfaceSamples
from planning.cameras.photogrammetry.view_pairs import Sightings
from planning.model.devices.calibration_errors import CalibrationErrors
from planning.model.requirements import CameraLimits, TriangulationLimits
from planning.scene.measuring import measurability
from planning.scene.measuring.camera_views import CameraView
from planning.scene.samples import Target
from planning.verify.audit.audit_samples import AuditSamples
from planning.verify.audit.predicates.audit_devices import AuditCamera
from planning.verify.audit.predicates.view_pairs import Sighted, met_angle, view_terms

LIMITS = TriangulationLimits(0.0, 0.1, 1.0, min_angle=0.01, max_angle=2.0)
ERRORS = CalibrationErrors(angle=2e-4, position_m=5e-5, focal=3e-4, principal_px=0.2)
LENS = (-0.1, 0.04, 0.001, -0.0008, 0.01)


def quality_of(cameras, points, normals, limits):
    n = len(points)
    samples = SurfaceSamples(points, normals, np.zeros(n, dtype=np.int64), 1.0)
    target = Target(samples, np.zeros((n, 3)))
    seen = CameraLimits(np.deg2rad(85.0))
    views = [
        CameraView(np.arange(n), measurability.view(camera, target, seen, None))
        for camera in cameras
    ]
    sightings = Sightings.of(views, normals)
    second, first = sightings.partners(sightings.rows_of(1), slice(0, n))
    return sightings.quality(first, second, limits)


def audited(cameras, points, normals, limits):
    n = len(points)
    zeros = np.zeros(n, dtype=np.int64)
    samples = AuditSamples(
        points, normals, zeros, np.zeros((n, 3)), zeros, zeros == 0, np.ones(n)
    )
    views = [
        Sighted.of(AuditCamera(c.device, c.world_from_device, ()), samples)
        for c in cameras
    ]
    return met_angle(*views), view_terms(*views, normals, limits)


@pytest.fixture(scope="module")
def bent_pair():
    """Two cameras with lenses that bend, 25 degrees apart."""
    device = make_rig().camera_device()
    bent = PinholeModel(device.camera_matrix, device.resolution, device.range_m, LENS)
    return [
        replace(camera_towards(place, (0.02, -0.01, 0.03)), device=bent)
        for place in ((1.0, 0.2, 0.3), (1.1, -0.25, 0.1))
    ]


@pytest.fixture(scope="module")
def spots():
    rng = np.random.default_rng(0)
    points = rng.uniform(-0.08, 0.08, (12, 3))
    normals = np.array([1.0, 0.0, 0.2]) + rng.normal(0.0, 0.2, (12, 3))
    return points, normals / np.linalg.norm(normals, axis=1)[:, None]


def test_two_cameras_side_by_side_are_as_exact_as_stereo():
    """s_N = sqrt(2) s_0 z^2 / (f b) before a plane, b << z."""
    z, b = 1.0, 0.02
    cameras = [
        camera_towards((z, s * b / 2, 0.0), (0.0, s * b / 2, 0.0)) for s in (-1, 1)
    ]
    normals = np.array([[1.0, 0.0, 0.0]])
    found = quality_of(cameras, np.zeros((1, 3)), normals, LIMITS)
    focal = cameras[0].device.focal_px
    stereo = np.sqrt(2.0) * LIMITS.noise_px * z**2 / (focal * b)
    assert found.terms["matches"][0] == pytest.approx(stereo, rel=1e-3)
    assert np.arccos(found.cosine[0]) == pytest.approx(2 * np.arctan(b / 2 / z))


def test_square_rays_move_the_point_as_far_as_a_pixel_is_wide():
    """At 90 degrees, N between both: each camera's pixel counts by its half."""
    cameras = [camera_towards((1.0, s, 0.0)) for s in (-1.0, 1.0)]
    found = quality_of(cameras, np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0]]), LIMITS)
    pixel = np.sqrt(2.0) / cameras[0].device.focal_px
    # Either moves it across its own ray, 45 degrees off N; both are independent.
    expected = LIMITS.noise_px * pixel * np.sqrt(2 * 0.5)
    assert found.terms["matches"][0] == pytest.approx(expected, rel=1e-9)


def test_deviations_are_those_of_many_noisy_triangulations(bent_pair, spots):
    points, normals = spots
    limits = replace(LIMITS, noise_px=0.5)
    predicted = quality_of(bent_pair, points, normals, limits).terms["matches"]
    rng, n_drawn = np.random.default_rng(1), 400
    for k in (5,):
        errors = []
        truth = [project(c, points[k]) for c in bent_pair]
        for _ in range(n_drawn):
            noisy = [pixel + rng.normal(0.0, 0.5, 2) for pixel in truth]

            def off(point, noisy=noisy):
                pairs = zip(bent_pair, noisy, strict=True)
                return np.concatenate([project(c, point) - pixel for c, pixel in pairs])

            found = least_squares(off, points[k], method="lm").x
            errors.append((found - points[k]) @ normals[k])
        # The standard error of a deviation of 400 draws is 3.5 %.
        assert np.std(errors) == pytest.approx(predicted[k], rel=0.12)


def project(camera, point):
    pose = camera.world_from_device
    return camera.device.project(((point - pose[:3, 3]) @ pose[:3, :3])[None])[0]


def test_the_audit_finds_the_same_by_its_own_formulas(bent_pair, spots):
    points, normals = spots
    limits = replace(LIMITS, calibration=ERRORS)
    found = quality_of(bent_pair, points, normals, limits)
    met, terms = audited(bent_pair, points, normals, limits)
    np.testing.assert_allclose(found.cosine, np.cos(met), atol=1e-12)
    for name in ("matches", "camera"):
        np.testing.assert_allclose(found.terms[name], terms[name], rtol=1e-4)
    np.testing.assert_allclose(found.sigma, np.hypot(*terms.values()), rtol=1e-4)


def test_noise_alone_is_limited_where_that_is_asked(bent_pair, spots):
    limits = replace(LIMITS, calibration=ERRORS, accuracy_of="noise")
    found = quality_of(bent_pair, *spots, limits)
    np.testing.assert_array_equal(found.sigma, found.terms["matches"])
    assert np.all(found.total > found.sigma)


def test_rays_along_one_line_measure_nothing():
    cameras = [camera_towards((away, 0.0, 0.0)) for away in (1.0, 1.1)]
    found = quality_of(cameras, np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0]]), LIMITS)
    assert found.terms["matches"][0] == np.inf
