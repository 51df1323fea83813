"""Pairs that measure by coded pixels, against two lines that come nearest."""

from dataclasses import replace

import numpy as np
import pytest
from scene.test_measurability import CAMERA, SETUPS, UP, one_sample, projector

from geometry.devices import ParallelModel
from geometry.poses import look_at
from planning.model.devices.calibration_errors import CalibrationErrors
from planning.model.devices.planned import PlannedCamera
from planning.model.light.dense_code import DenseCode
from planning.model.light.drawn_edges import DrawnEdges
from planning.model.light.light_budget import LightBudget
from planning.model.requirements import CameraLimits, TriangulationLimits
from planning.report.tolerance.retriangulation import retriangulated
from planning.scene import lighting
from planning.scene.codes.patterns import pattern_of
from planning.scene.limits import pair_limits
from planning.scene.measuring import measurability
from planning.verify.audit.audit_samples import AuditSamples
from planning.verify.audit.predicates.audit_devices import AuditCamera, AuditProjector
from planning.verify.audit.predicates.error_terms import PairGeometry, error_terms
from planning.verify.audit.predicates.predicates import pair_figures, pair_holds

CODE = DenseCode()
LIMITS = TriangulationLimits(0.0, 0.1, min_angle=np.radians(10.0), max_angle=1.5)
DRAWN = DrawnEdges(focus_m=1.0, aperture_m=0.02)
LIGHT = LightBudget(
    *(3000.0, 300.0, (0.3, 0.9), 100.0, 250.0, 8.0, 2000.0, 0.9, 3.45e-6),
    *(0.6, 10_000.0, 3.0, 1.0, 12, 10.0, 0.1),
)


def coded(light, code=CODE, exposure_s=None):
    ringed = projector(light, [0.3, -0.9, 0.1])
    return replace(
        ringed,
        world_from_ring=ringed.world_from_device,
        ring_radii=np.zeros(0),
        pattern="dense",
        code=code,
        exposure_s=exposure_s,
    )


def camera_at(position):
    return PlannedCamera("C1", look_at(np.array(position), np.zeros(3), UP), CAMERA)


def quality_of(source, camera, target, limits):
    falls = lighting.light_on(source, target)
    pixels = pattern_of(source).surfaces(target.samples.points)
    seen = measurability.view(camera, target, CameraLimits(np.radians(80)), None)
    return measurability.pair_quality(
        target.samples.normals, falls, pixels, seen, limits
    )


def audited(source, camera, target):
    samples = AuditSamples(
        *(target.samples.points, target.samples.normals),
        *(target.samples.faces, target.steep, np.zeros(1, dtype=int)),
        *(np.ones(1, dtype=bool), np.ones(1)),
    )
    lamp = AuditProjector(
        source.device,
        source.world_from_device,
        source.world_from_ring,
        source.ring_radii,
        exposure_s=source.exposure_s,
        code=source.code,
    )
    return PairGeometry.of(
        lamp, AuditCamera(camera.device, camera.world_from_device), samples
    )


def beam(source, point, shift_px=(0.0, 0.0)):
    """A point of the light of a panel's pixel beside that of a point, and its way."""
    pose, device = source.world_from_device, source.device
    local = (point - pose[:3, 3]) @ pose[:3, :3]
    if isinstance(device, ParallelModel):
        moved = local + device.pixel_pitch_m * np.array([*shift_px, 0.0])
        return pose[:3, 3] + pose[:3, :3] @ moved, pose[:3, 2]
    ray = device.rays(device.project(local[None]) + shift_px)[0]
    way = pose[:3, :3] @ ray
    return pose[:3, 3] + way * np.linalg.norm(local), way


def nearest_on_ray(origin, ray, place, way):
    """Where a ray comes nearest to a line, by the normal equations of both."""
    sides = np.array([[ray @ ray, -ray @ way], [ray @ way, -way @ way]])
    right = np.array([(place - origin) @ ray, (place - origin) @ way])
    return origin + np.linalg.solve(sides, right)[0] * ray


def moved_by(source, camera, point, *, seen_px=(0.0, 0.0), shown_px=(0.0, 0.0)):
    pose, device = camera.world_from_device, camera.device
    local = (point - pose[:3, 3]) @ pose[:3, :3]
    ray = pose[:3, :3] @ device.rays(device.project(local[None]) + seen_px)[0]
    return nearest_on_ray(pose[:3, 3], ray, *beam(source, point, shown_px)) - point


def slope(normal, move):
    """Root of the sum of squares of what a pixel along u and along v do to N.P."""
    step, each = 1e-3, []
    for way in np.eye(2):
        there, back = (normal @ move(sign * step * way) for sign in (1.0, -1.0))
        each.append((there - back) / (2.0 * step))
    return float(np.hypot(*each))


@pytest.mark.parametrize(("light", "point", "normal", "position"), SETUPS)
def test_noise_moves_the_meeting_of_both_rays_as_terms_say(
    light, point, normal, position
):
    source, camera = coded(light), camera_at(position)
    target = one_sample(point, normal)
    quality = quality_of(source, camera, target, LIMITS)
    squarely = lighting.light_on(source, target).incidence_cos[0]
    seen = slope(normal, lambda px: moved_by(source, camera, point, seen_px=px))
    assert quality.terms["edges"][0] == pytest.approx(0.1 / squarely * seen, rel=1e-4)
    shown = slope(normal, lambda px: moved_by(source, camera, point, shown_px=px))
    blur = DrawnEdges().in_focus_m
    pixel = pattern_of(source).surfaces(point[None]).light.pixel_m[0]
    assert quality.terms["phase"][0] > CODE.phase_noise * 16 / (2 * np.pi) * shown
    # A blur of a sixteenth of a period takes little, and just so much.
    exact = replace(LIMITS, drawn_edges=DrawnEdges(blur, 0.0))
    left = np.exp(-2.0 * (np.pi * blur / pixel / 16) ** 2)
    told = CODE.phase_noise / squarely / left * 16 / (2 * np.pi)
    of_phase = quality_of(source, camera, target, exact).terms["phase"][0]
    assert of_phase == pytest.approx(told * shown, rel=1e-4)


@pytest.mark.parametrize(("light", "point", "normal", "position"), SETUPS)
def test_what_a_calibration_leaves_moves_it_as_terms_say(
    light, point, normal, position
):
    """Each kind of error alone, by rigs that are off by a little of it."""
    source, camera = coded(light), camera_at(position)
    target = one_sample(point, normal)
    errors = CalibrationErrors(np.radians(0.02), 5e-5, 2e-4, 0.3)
    limits = replace(LIMITS, calibration=errors)
    terms = quality_of(source, camera, target, limits).terms
    turn, place = errors.angle / np.sqrt(3), errors.position_m / np.sqrt(3)
    pixel = errors.principal_px / np.sqrt(2)
    sizes = np.diag([place] * 3 + [turn] * 3 + [errors.focal] + [pixel] * 2)
    for k, name in enumerate(("projector", "camera")):
        square = 0.0
        for one in 1e-2 * sizes:
            off = [np.zeros(9), np.zeros(9)]
            off[k] = one
            there = retriangulated(point[None], source, camera, tuple(off))[0]
            square += (normal @ (there - point) / 1e-2) ** 2
        # Of a panel's point the line of it that counts most is taken, not both.
        slack = 1e-3 if name == "camera" else 0.02
        assert terms[name][0] == pytest.approx(np.sqrt(square), rel=slack)


@pytest.mark.parametrize(("light", "point", "normal", "position"), SETUPS)
@pytest.mark.parametrize("shifts", [0, 3, 8])
@pytest.mark.parametrize("lit", [None, LIGHT])
def test_the_audit_finds_the_same_terms(light, point, normal, position, shifts, lit):
    code = replace(CODE, shifts=shifts, period_px=32)
    source, camera = coded(light, code, 0.05), camera_at(position)
    target = one_sample(point, normal)
    errors = CalibrationErrors(np.radians(0.02), 5e-5, 2e-4, 0.3)
    limits = replace(LIMITS, calibration=errors, drawn_edges=DRAWN, light=lit)
    quality = quality_of(source, camera, target, limits)
    pair = audited(source, camera, target)
    terms = error_terms(pair, limits)
    assert set(terms) == set(quality.terms)
    for name, term in terms.items():
        assert term == pytest.approx(quality.terms[name], rel=1e-5)
    assert pair.conditioning == pytest.approx(quality.conditioning)
    holds = pair_holds(pair_figures(pair, terms, limits), limits)[:, 0]
    first = measurability.first_pair_failure(quality, limits)[0]
    causes = pair_limits.CAUSES
    failing = np.flatnonzero(~holds)
    seen = len(causes) - len(holds)
    assert first == (seen + failing[0] if len(failing) else pair_limits.MEASURED)


def test_more_shifts_and_more_light_leave_less_noise():
    light, point, normal, position = SETUPS[0]
    target, camera = one_sample(point, normal), camera_at(position)

    def phase(shifts, exposure_s):
        source = coded(light, replace(CODE, shifts=shifts), exposure_s)
        limits = replace(LIMITS, light=replace(LIGHT, read_noise_e=0.0, bits=20))
        return quality_of(source, camera, target, limits).terms["phase"][0]

    assert phase(4, 0.01) == pytest.approx(2.0 * phase(16, 0.01))
    assert phase(4, 0.01) == pytest.approx(2.0 * phase(4, 0.04), rel=1e-3)


@pytest.mark.parametrize(
    ("degrees", "cause"), [(9.9, "angle"), (10.1, None), (85.8, None), (86.1, "angle")]
)
def test_both_ends_of_the_angle_are_limits(degrees, cause):
    source = coded("diverging")
    origin = source.world_from_device[:3, 3]
    turn = np.radians(degrees)
    c, s = np.cos(turn), np.sin(turn)
    position = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ origin
    flat = np.array([origin[0], origin[1], 0.0])
    middle = flat + position * [1.0, 1.0, 0.0]
    target = one_sample(np.zeros(3), middle / np.linalg.norm(middle))
    met = np.degrees(np.arccos(origin @ position / np.linalg.norm(origin) ** 2))
    limits = replace(LIMITS, max_angle=np.radians(met + (86.0 - degrees)))
    limits = replace(limits, min_angle=np.radians(met + (10.0 - degrees)))
    quality = quality_of(source, camera_at(position), target, limits)
    first = measurability.first_pair_failure(quality, limits)[0]
    told = None if first == pair_limits.MEASURED else pair_limits.CAUSES[first]
    assert told == cause


def test_a_code_counts_its_frames_and_refuses_what_tells_nothing():
    plain = DenseCode(shifts=0)
    # OpenCV's GrayCodePattern of 1024 x 768 has 40 images, and two for the mask.
    assert plain.n_frames((1024, 768)) == 42
    assert plain.n_frames((1025, 769)) == 44
    # Stripes of eight pixels: 128 and 96 of them.
    assert CODE.n_frames((1024, 768)) == 2 * (7 + 7) + 2 + 8
    with pytest.raises(ValueError, match="shifts = 2"):
        DenseCode(shifts=2)
    with pytest.raises(ValueError, match="period_px = 12"):
        DenseCode(period_px=12)
