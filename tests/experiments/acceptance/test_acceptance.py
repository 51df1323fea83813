"""Rigs that are off, and what is read from artefacts that they measure."""

from dataclasses import replace

import numpy as np
import pytest
from scene.test_calibration_terms import BLANK, ERRORS, _seen_by
from scene.test_measurability import CAMERA, SETUPS, UP, one_sample, projector
from support.reconstruction_rigs import bumpy_sphere, small_rig
from support.simulated_rigs import ONE_EACH, off_by, scales, triangulated

from geometry.poses import look_at
from planning.experiments.acceptance.acceptance import Measured, accept
from planning.experiments.acceptance.artefacts import bars, plates
from planning.experiments.acceptance.rigs_off import displaced, drawn
from planning.model.devices.calibration_errors import CalibrationErrors
from planning.model.devices.planned import PlannedCamera
from planning.verify.reconstruction.calibration import (
    calibrate_camera,
    calibrate_projector,
)
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.scanner import Scanner


@pytest.mark.parametrize(("light", "point", "normal", "position"), SETUPS)
@pytest.mark.parametrize("error", range(9))
@pytest.mark.parametrize("which", ["projector", "camera"])
def test_a_point_moves_as_its_rays_and_rings_do(
    light, point, normal, position, error, which
):
    """Against another triangulation, by Newton's method, for each error of each."""
    source = projector(light, (0.3, -0.9, 0.1))
    camera = PlannedCamera("C1", look_at(np.array(position), np.zeros(3), UP), CAMERA)
    target = one_sample(point, normal)
    right = {"projector": (source, np.zeros(3)), "camera": (camera, np.zeros(3))}
    planned = {"projector": source, "camera": camera}
    stands = right | {which: off_by(planned[which], (ONE_EACH * scales(ERRORS))[error])}
    truth = triangulated(
        target.samples.points, source, camera, stands["projector"], stands["camera"]
    )

    def rig(one, other):
        # Rings are fixed to the device.
        turned = one.world_from_device @ np.linalg.inv(source.world_from_device)
        rings = turned @ source.world_from_ring
        light = replace(calibrate_projector(one), world_from_ring=rings)
        return replace(BLANK, projectors=(light,), cameras=(calibrate_camera(other),))

    known, taken = (
        rig(stands["projector"][0], stands["camera"][0]),
        rig(source, camera),
    )
    if light == "parallel" and which == "projector":
        # A panel's scale and middle are no figures of a planned parallel projector.
        (one,) = known.projectors
        matrix = one.matrix.copy()
        longer, *shift = stands["projector"][1]
        matrix[[0, 1], [0, 1]] /= 1.0 + longer
        matrix[:2, 2] -= np.array(shift) / (1.0 + longer)
        known = replace(known, projectors=(replace(one, matrix=matrix),))
    cloud = _seen_by(source, stands["camera"][0], target)
    hits = np.einsum(
        "ij,ij->i", cloud.rays, _outward(taken.projectors[0], cloud.points)
    )
    cloud = replace(cloud, conditioning=hits)
    moved = displaced(cloud, known, taken)
    expected = truth - target.samples.points
    assert moved == pytest.approx(expected, abs=2e-3 * np.linalg.norm(expected) + 1e-9)
    assert error != 0 or np.linalg.norm(expected) > 1e-6


def _outward(projector, points):
    """Normals of the ring surfaces through points, by differences."""
    step, ring = 1e-6, projector.ring_coordinate
    slopes = [ring(points + step * a) - ring(points - step * a) for a in np.eye(3)]
    slopes = np.stack(slopes, axis=1)
    return slopes / np.linalg.norm(slopes, axis=1, keepdims=True)


@pytest.fixture(scope="module")
def scanner():
    """Two projectors and three cameras of few pixels about a ball of 80 mm."""
    plan = small_rig(bumpy_sphere(0.08, subdivisions=3), focal=2000.0)
    errors = CalibrationErrors(np.radians(0.02), 5e-5)
    return replace(Scanner.of(plan), calibration=errors)


def test_artefacts_lie_in_the_ball_and_have_the_sizes_they_are_said_to(scanner):
    ball, centre = scanner.mesh.radius, scanner.mesh.centre
    found = list(bars(scanner))
    assert len(found) == 7
    for bar in found:
        assert bar.length == pytest.approx(0.6 * ball)
        assert bar.radius == pytest.approx(0.1 * ball)
        assert np.linalg.norm(bar.centres - centre, axis=1).max() + bar.radius < ball
    area = found[0].mesh().area
    assert area == pytest.approx(8 * np.pi * found[0].radius ** 2, rel=1e-3)
    ways = np.array([np.diff(bar.centres, axis=0)[0] for bar in found]) / (0.6 * ball)
    assert np.abs(ways @ ways.T - np.eye(7)).max() < 0.9
    for plate in plates(scanner):
        assert max(plate.size) == pytest.approx(ball)
        # Its face, up to z = 0, looks at devices.
        before = plate.mesh().vertices - plate.pose[:3, 3]
        assert (before @ plate.pose[:3, 2]).max() == pytest.approx(0.0, abs=1e-12)
        towards = scanner.cameras[0].centre - plate.pose[:3, 3]
        assert towards @ plate.pose[:3, 2] > 0.0


def test_a_whole_rig_that_is_off_alike_measures_everything_alike(scanner):
    """All devices turned and moved as one: no span, size or distance changes."""
    (bar, *_) = bars(scanner)
    cloud = seen_from_before(scanner, bar.mesh())
    pose = look_at(np.array([1e-3, 2e-3, 0.0]), np.array([0.01, 1.0, 0.02]), UP)
    moved = replace(
        scanner,
        cameras=tuple(carried(one, pose) for one in scanner.cameras),
        projectors=tuple(
            replace(carried(one, pose), world_from_ring=pose @ one.world_from_ring)
            for one in scanner.projectors
        ),
    )
    shift = displaced(cloud, scanner, moved)
    there = cloud.points @ pose[:3, :3].T + pose[:3, 3]
    assert cloud.points + shift == pytest.approx(there, abs=1e-9)
    one = Measured(bar, cloud)
    still, carried_along = (one.deviations(by) for by in (0.0 * shift, shift))
    for name, values in still.items():
        assert carried_along[name] == pytest.approx(values, abs=1e-9), name
        assert np.abs(values).max() < 1e-6


def carried(device, pose):
    return replace(device, world_from_device=pose @ device.world_from_device)


def seen_from_before(scanner, mesh):
    """Vertices of a mesh as the first pair would have them, occlusion aside."""
    camera, projector = scanner.cameras[0], scanner.projectors[0]
    points = mesh.vertices[::40]
    rays = points - camera.centre
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    index, ones = np.zeros(len(points), np.int16), np.ones(len(points))
    cloud = Cloud(
        *(points, rays, rays, camera.project(points)),
        *(index, index, index, ones, rays, ones, ones, ones),
    )
    along = np.einsum("ij,ij->i", rays, _outward(projector, points))
    chosen = np.abs(along) > 0.05
    return replace(cloud, conditioning=along).take(chosen)


def test_a_longer_lens_makes_a_bar_longer_by_what_it_says(scanner):
    """One device of each kind far away, parallel to it: lengths scale as 1 / f."""
    errors = CalibrationErrors(focal=1e-3)
    rng = np.random.default_rng(1)
    rig = drawn(scanner, errors, rng)
    longer = [
        one.matrix[0, 0] / two.matrix[0, 0] - 1.0
        for one, two in zip(
            rig.cameras + rig.projectors,
            scanner.cameras + scanner.projectors,
            strict=True,
        )
    ]
    assert 2e-4 < np.std(longer) < 3e-3
    for one, two in zip(rig.cameras, scanner.cameras, strict=True):
        np.testing.assert_array_equal(one.world_from_device, two.world_from_device)


def test_what_a_maker_states_of_a_small_rig(scanner, monkeypatch):
    """One bar and one plate of all places: noise in form, calibration in lengths."""
    monkeypatch.setattr(
        "planning.experiments.acceptance.acceptance.bars", first_of(bars)
    )
    monkeypatch.setattr(
        "planning.experiments.acceptance.acceptance.plates", first_of(plates)
    )
    found = accept(scanner, seed=0, draws=20, threads=1)
    assert not found.unmeasured
    assert {name: len(v) for name, v in found.perfect.items()} == {
        "PF": 2,
        "PS": 2,
        "SD": 1,
        "F": 1,
    }
    for name in ("PF", "F"):
        assert 1e-5 < found.largest(name) < 1e-3
    # What is off alike over an artefact bends little of it, and moves it whole.
    assert found.largest("SD") < 3e-5 < found.quantiles("SD")[0] < 1e-3


def first_of(places):
    return lambda scanner: [next(iter(places(scanner)))]
