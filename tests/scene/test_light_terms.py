"""Light from a projector to grey levels and noise, against closed forms."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scene.test_measurability import CAMERA, LIMITS, SETUPS, UP, one_sample, pair
from scene.test_measurability import projector as measured_from
from scipy.special import ndtr

from geometry.devices import ParallelModel, PinholeModel
from geometry.poses import look_at
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.light.light_budget import SATURATED, LightBudget
from planning.scene.codes.patterns import panel_light
from planning.scene.limits.light_terms import (
    edge_noise_px,
    electrons,
    grey_levels,
)
from planning.scene.limits.limit import RigFacts
from planning.scene.limits.pair_limits import CAUSES, Clipped, TooDark
from planning.scene.measuring import measurability
from planning.verify.audit.predicates.audit_devices import AuditCamera, AuditProjector
from planning.verify.audit.predicates.light_levels import LightLevels

LIGHT = LightBudget(
    lumens=1000.0,
    contrast=400.0,
    albedo=(0.3, 0.6),
    room_lux=0.0,
    lumens_per_watt=300.0,
    f_number=8.0,
    focal_px=3000.0,
    transmission=0.9,
    pixel_m=3.45e-6,
    quantum_efficiency=0.6,
    full_well_e=10_000.0,
    read_noise_e=3.0,
    gain=1.0,
    bits=12,
    min_contrast=10.0,
    max_exposure_s=0.1,
    period_s=1.0 / 60.0,
)
MATRIX = np.array([[1000.0, 0.0, 399.5], [0.0, 1000.0, 299.5], [0.0, 0.0, 1.0]])
PINHOLE = PinholeModel(MATRIX, (800, 600), (0.3, 3.0))
BEAM = ParallelModel((800, 600), 1e-3, (0.3, 3.0))


def projector(device, light="diverging"):
    """At the origin, towards +z."""
    return PlannedProjector(
        "P1", light, np.eye(4), np.eye(4), device, np.array([1.0]), exposure_s=0.02
    )


@pytest.mark.parametrize("depth", [0.5, 1.0, 2.0])
def test_a_plane_that_faces_the_projector_gets_its_lumens_over_the_image(depth):
    """Everywhere alike, as ANSI lumens are measured: corners as well as the middle."""
    across = np.array([[0.0, 0.0], [0.3, 0.25], [-0.35, 0.1]]) * depth
    points = np.column_stack([across, np.full(3, depth)])
    along = points / np.linalg.norm(points, axis=1)[:, None]
    *_, lux = panel_light(projector(PINHOLE), points)
    area = 0.8 * depth * 0.6 * depth
    assert lux * along[:, 2] == pytest.approx(1.0 / area)


def test_parallel_light_is_as_bright_at_any_depth():
    points = np.array([[0.0, 0.0, 0.5], [0.1, 0.2, 2.0]])
    *_, lux = panel_light(projector(BEAM, "parallel"), points)
    assert lux == pytest.approx(1.0 / (0.8 * 0.6))


def test_electrons_are_those_of_a_radiometers_arithmetic():
    """100 lux on white for 10 ms: 100/300 W/m2, 1/(4 N^2) of it on the sensor."""
    lit, dark = electrons(LIGHT, np.array([0.1]), 0.01)
    on_sensor = 0.9 * (100.0 / 300.0) / (4.0 * 64.0)
    joules = on_sensor * (3.45e-6) ** 2 * 0.01
    photons = joules / (6.62607015e-34 * 299792458.0 / 555e-9)
    assert lit[0] == pytest.approx(0.6 * photons, rel=1e-6)
    assert dark[0] == pytest.approx(lit[0] / 400.0)


def _greys(light, lux=0.1, time=0.01):
    lit, dark = electrons(light, np.array([lux]), time)
    return grey_levels(light, lit, dark, np.ones(1))


def test_twice_the_stop_is_a_quarter_and_twice_the_time_twice():
    one = _greys(LIGHT)
    assert _greys(replace(LIGHT, f_number=16.0)).white == pytest.approx(one.white / 4.0)
    assert _greys(LIGHT, time=0.02).white == pytest.approx(2.0 * one.white)
    assert _greys(replace(LIGHT, lumens=500.0)).contrast == pytest.approx(
        one.contrast / 2.0
    )
    # The brightest counts where it clips, the darkest where it must be told apart.
    assert one.contrast == pytest.approx(0.5 * one.white * (1.0 - 1.0 / 400.0))
    off = grey_levels(LIGHT, *electrons(LIGHT, np.array([0.1]), 0.01), 0.9)
    assert off.white == pytest.approx(0.9**4 * one.white)


def test_noise_falls_with_the_root_of_the_light_where_photons_make_it():
    quiet = replace(LIGHT, read_noise_e=0.0, bits=16)
    ratio = _greys(quiet).noise / _greys(quiet, time=0.04).noise
    assert ratio == pytest.approx(2.0, rel=1e-3)
    # And with the light itself where the sensor's own noise does.
    loud = replace(LIGHT, read_noise_e=1e4)
    ratio = _greys(loud).noise / _greys(loud, time=0.04).noise
    assert ratio == pytest.approx(4.0, rel=1e-3)


def test_room_light_adds_noise_and_no_signal():
    bright = replace(LIGHT, room_lux=200.0)
    assert _greys(bright).contrast == pytest.approx(_greys(LIGHT).contrast)
    assert _greys(bright).white > 2.9 * _greys(LIGHT).white
    assert _greys(bright).noise > 1.5 * _greys(LIGHT).noise


def test_edges_drawn_with_that_noise_are_found_with_that_deviation():
    """Frame and inverse of a blurred edge, by the electron; where they cross."""
    rng, width, n = np.random.default_rng(3), 2.0, 6000
    lit, dark = electrons(LIGHT, np.array([0.4]), 0.01)
    low = LIGHT.albedo[0]
    at = np.arange(-6, 7)
    off = rng.uniform(-0.5, 0.5, n)
    share = ndtr((at - off[:, None]) / width)
    frames = []
    for part in (share, 1.0 - share):
        mean = low * (dark + (lit - dark) * part)
        noise = np.sqrt(mean + LIGHT.own_variance)
        frames.append(mean + noise * rng.standard_normal(mean.shape))
    difference = frames[0] - frames[1]
    # A line through the two pixels about the crossing.
    after = np.argmax(difference > 0.0, axis=1)
    each = np.arange(n)
    before, beyond = difference[each, after - 1], difference[each, after]
    found = at[after] - beyond / (beyond - before)
    middle = (after > 4) & (after < 9)
    spread = np.std((found - off)[middle])
    predicted = edge_noise_px(_greys(LIGHT, lux=0.4), np.array([width]))[0]
    assert spread == pytest.approx(predicted, rel=0.04)


def test_an_exposure_is_whole_refreshes_that_do_not_clip():
    assert LIGHT.exposure_s(242.0 / 0.05) == pytest.approx(3.0 / 60.0)
    assert LIGHT.exposure_s(243.0 / 0.05) == pytest.approx(2.0 / 60.0)
    assert LIGHT.exposure_s(0.0) == pytest.approx(6.0 / 60.0)
    assert LIGHT.exposure_s(1e9) == pytest.approx(1.0 / 60.0)
    free = replace(LIGHT, period_s=None)
    assert free.exposure_s(255.0 / 0.05) == pytest.approx(0.95 * 0.05)


@pytest.mark.parametrize(
    ("device", "light"), [(PINHOLE, "diverging"), (BEAM, "parallel")]
)
def test_the_audit_finds_the_same_greys(device, light):
    source = projector(device, light)
    points = np.array([[0.1, 0.05, 1.0], [-0.2, 0.1, 1.3]])
    normals = np.array([[0.0, 0.0, -1.0], [0.6, 0.0, -0.8]])
    pose = look_at(np.array([0.5, 0.2, 0.1]), np.array([0.0, 0.1, 1.0]), (0, 1, 0))
    camera = PinholeModel(MATRIX * [[3.0], [3.0], [1.0]], (2400, 1800), (0.1, 5.0))
    lamp = AuditProjector(
        *(device, source.world_from_device, source.world_from_ring),
        source.ring_radii,
        exposure_s=0.02,
    )
    shone = replace(LIGHT, room_lux=50.0)
    levels = LightLevels.of(shone, lamp, points, normals)
    levels = levels.seen(AuditCamera(camera, pose), points)

    *_, lux = panel_light(source, points)
    along = points / np.linalg.norm(points, axis=1)[:, None]
    along = along if light == "diverging" else np.tile([0.0, 0.0, 1.0], (2, 1))
    facing = -np.sum(along * normals, axis=1)
    local = (points - pose[:3, 3]) @ pose[:3, :3]
    axis = local[:, 2] / np.linalg.norm(local, axis=1)
    width = np.array([1.0, 2.0])
    greys = grey_levels(shone, *electrons(shone, lux * facing, 0.02), axis)
    assert levels.brightest == pytest.approx(greys.white)
    assert levels.contrast == pytest.approx(greys.contrast)
    assert levels.noise_px(width) == pytest.approx(edge_noise_px(greys, width))


def _seen(light, lumens):
    """A pair under so many lumens: quality, limits and causes of its one sample."""
    kind, point, normal, position = SETUPS[0]
    source = replace(measured_from(kind, [0.05, -1.1, 0.1]), exposure_s=light.period_s)
    camera = PlannedCamera("C1", look_at(np.array(position), np.zeros(3), UP), CAMERA)
    target = one_sample(point, normal)
    plain, rings, falls = pair(source, camera, target)
    limits = replace(LIMITS, light=replace(light, lumens=lumens))
    quality = measurability.pair_quality(
        target.samples.normals, falls, rings, plain.view, limits
    )
    stage = measurability.first_pair_failure(quality, limits)[0]
    return plain, quality, limits, (*CAUSES, "measured")[stage]


def test_too_dark_and_clipped_are_causes_with_their_remedies():
    *_, quality, _, cause = _seen(LIGHT, 1000.0)
    assert cause == "measured"
    least = 1000.0 * LIGHT.min_contrast / quality.grey.contrast[0]
    for share, expected in ((0.99, "too_dark"), (1.01, "measured")):
        assert _seen(LIGHT, share * least)[-1] == expected
    most = 1000.0 * SATURATED / quality.grey.white[0]
    for share, expected in ((1.01, "clipped"), (0.99, "measured")):
        assert _seen(LIGHT, share * most)[-1] == expected

    _, dim, limits, _ = _seen(LIGHT, 0.5 * least)
    facts = RigFacts(SimpleNamespace(triangulation=limits), None)
    (more,) = TooDark().relaxations(facts)
    times = more.rounded(more.ask(dim))[0]
    assert times == pytest.approx(2.0, rel=1e-2)
    assert f"photometry.lumens = {times * 0.5 * least:.4g}" in more.say(times)
    assert "photometry.max_exposure_ms = 200 (now 100)" in more.say(times)
    assert "photometry.max_exposure_ms = 216.7 (now 100)" in more.say(2.1)
    assert _seen(LIGHT, 1.001 * times * 0.5 * least)[-1] == "measured"
    _, glaring, limits, _ = _seen(LIGHT, 4.0 * most)
    facts = RigFacts(SimpleNamespace(triangulation=limits), None)
    (less,) = Clipped().relaxations(facts)
    assert less.rounded(less.ask(glaring))[0] == pytest.approx(4.0, rel=1e-2)
    assert "camera.focus.f_number = 16" in less.say(4.0)


def test_noise_of_the_light_stands_beside_the_allowance_and_alone_where_it_is_0():
    plain, quality, *_ = _seen(LIGHT, 1000.0)
    both = np.hypot(plain.terms["edges"], quality.terms["light"])
    assert quality.sigma == pytest.approx(both)
    assert quality.edge_px * plain.terms["edges"] == pytest.approx(plain.edge_px * both)
    assert quality.terms["edges"] == pytest.approx(plain.terms["edges"])


def test_programs_expect_the_noise_that_a_camera_on_the_axis_has():
    kind, point, normal, position = SETUPS[0]
    source = replace(measured_from(kind, [0.05, -1.1, 0.1]), exposure_s=0.01)
    camera = PlannedCamera("C1", look_at(np.array(position), point, UP), CAMERA)
    target = one_sample(point, normal)
    plain, rings, falls = pair(source, camera, target)
    limits = replace(LIMITS, light=LIGHT)
    quality = measurability.pair_quality(
        target.samples.normals, falls, rings, plain.view, limits
    )
    # As far away as makes a pixel as large there as in this view.
    away = LIGHT.focal_px * float((rings.spacing / quality.pitch)[0])
    expected = measurability.expected_noise_px(limits, falls, rings, away)
    assert expected == pytest.approx(quality.edge_px, rel=1e-6)
    assert measurability.expected_noise_px(LIMITS, falls, rings, away) == (
        pytest.approx(plain.edge_px)
    )
