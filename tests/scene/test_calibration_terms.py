"""What errors of a calibration do to a point, against rigs that are off by each."""

from dataclasses import replace

import numpy as np
import pytest
from scene.test_measurability import CAMERA, SETUPS, UP, one_sample, projector
from support.simulated_rigs import ONE_EACH, off_by, scales, triangulated

from geometry.poses import look_at
from planning.model.devices.calibration_errors import PERFECT, CalibrationErrors
from planning.model.devices.planned import PlannedCamera
from planning.model.requirements import CameraLimits, TriangulationLimits
from planning.scene import lighting
from planning.scene.codes.patterns import pattern_of
from planning.scene.measuring import measurability
from planning.verify.audit.audit_samples import AuditSamples
from planning.verify.audit.predicates.audit_devices import AuditCamera, AuditProjector
from planning.verify.audit.predicates.error_terms import PairGeometry, error_terms
from planning.verify.reconstruction.calibration import (
    calibrate_camera,
    calibrate_projector,
)
from planning.verify.reconstruction.check.calibration_sigma import calibration_sigma
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.scanner import Scanner

BLANK = Scanner((), (), None, None, None, None)
# Of the first order alone, differences are exact to a share of about this.
SMALL = 1e-2
ERRORS = CalibrationErrors(np.radians(0.02), 5e-5, 2e-4, 0.3)


def by_rigs(source, camera, target, errors):
    """Root of the sum of squares of what each error alone does along the normal."""
    points, normals = target.samples.points, target.samples.normals
    right = (source, np.zeros(3)), (camera, np.zeros(3))
    deviations = []
    for which, device in enumerate((source, camera)):
        square = np.zeros(len(points))
        for one in SMALL * ONE_EACH * scales(errors):
            pair = list(right)
            pair[which] = off_by(device, one)
            there = triangulated(points, source, camera, *pair)
            square += np.sum((there - points) * normals, axis=1) ** 2 / SMALL**2
        deviations.append(np.sqrt(square))
    return deviations


@pytest.mark.parametrize(("light", "point", "normal", "position"), SETUPS)
@pytest.mark.parametrize(
    "errors",
    [
        CalibrationErrors(angle=ERRORS.angle),
        CalibrationErrors(position_m=ERRORS.position_m),
        CalibrationErrors(focal=ERRORS.focal),
        CalibrationErrors(principal_px=ERRORS.principal_px),
        ERRORS,
    ],
)
def test_each_term_is_what_rigs_that_are_off_do(light, point, normal, position, errors):
    source = projector(light, (0.3, -0.9, 0.1))
    camera = PlannedCamera("C1", look_at(np.array(position), np.zeros(3), UP), CAMERA)
    target = one_sample(point, normal)
    limits = TriangulationLimits(0.1, 0.1, 1.0, calibration=errors)
    seen = measurability.view(camera, target, CameraLimits(np.radians(80)), None)
    falls = lighting.light_on(source, target)
    rings = pattern_of(source).surfaces(target.samples.points)
    quality = measurability.pair_quality(
        target.samples.normals, falls, rings, seen, limits
    )
    truth = by_rigs(source, camera, target, errors)
    for name, deviation in zip(("projector", "camera"), truth, strict=True):
        assert quality.terms[name] == pytest.approx(deviation, rel=1e-3)
    whole = [np.hypot(*truth)[0], quality.terms["edges"][0]]
    assert quality.sigma[0] == pytest.approx(np.hypot(*whole), rel=1e-3)

    pair = PairGeometry.of(
        AuditProjector(
            source.device,
            source.world_from_device,
            source.world_from_ring,
            source.ring_radii,
        ),
        AuditCamera(camera.device, camera.world_from_device),
        AuditSamples(
            *(target.samples.points, target.samples.normals),
            *(target.samples.faces, target.steep, np.zeros(1, dtype=int)),
            *(np.ones(1, dtype=bool), np.ones(1)),
        ),
    )
    cloud = _seen_by(source, camera, target)
    scanner = replace(
        BLANK,
        projectors=(calibrate_projector(source),),
        cameras=(calibrate_camera(camera),),
        calibration=errors,
    )
    sigma = calibration_sigma(cloud, target.samples.normals, scanner)
    assert sigma == pytest.approx(np.hypot(*truth), rel=1e-3)

    for name, term in error_terms(pair, limits).items():
        assert term == pytest.approx(quality.terms[name], rel=1e-5)


def _seen_by(source, camera, target):
    """The point as a cloud; the checker reads of it where it is and was seen."""
    eye, points = calibrate_camera(camera), target.samples.points
    rays = points - eye.centre
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    index, one = np.zeros(1, dtype=np.int16), np.ones(1)
    where = points, rays, rays, eye.project(points)
    return Cloud(*where, index, index, index, one, rays, one, one, one)


def test_noise_alone_is_limited_where_that_is_asked():
    light, point, normal, position = SETUPS[0]
    source = projector(light, (0.3, -0.9, 0.1))
    camera = PlannedCamera("C1", look_at(np.array(position), np.zeros(3), UP), CAMERA)
    target = one_sample(point, normal)
    seen = measurability.view(camera, target, CameraLimits(np.radians(80)), None)
    falls = lighting.light_on(source, target)
    rings = pattern_of(source).surfaces(target.samples.points)
    limits = TriangulationLimits(0.1, 0.1, 1.0, calibration=ERRORS)

    def sigma(limits):
        args = target.samples.normals, falls, rings, seen, limits
        return measurability.pair_quality(*args).sigma[0]

    alone = sigma(replace(limits, accuracy_of="noise"))
    assert alone == sigma(replace(limits, calibration=None))
    assert alone == pytest.approx(sigma(replace(limits, calibration=PERFECT)))
    assert sigma(limits) > 1.5 * alone
