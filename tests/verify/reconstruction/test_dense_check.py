"""The check of dense scanners: merged clouds, causes, captures, and what it refuses."""

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation
from support.dense_rigs import camera_at, dense_scanner, projector_at
from support.reconstruction_rigs import changed, small_rig

from geometry.mesh.sampling import sample_surface
from geometry.shapes.primitives import sphere
from planning.model.devices.calibration_errors import CalibrationErrors
from planning.model.errors import CapturesError, InputError
from planning.verify.reconstruction.captures.captured import (
    reconstruct_captured,
    reconstruct_rendered,
)
from planning.verify.reconstruction.captures.captures import CaptureFolder
from planning.verify.reconstruction.check.accuracy import Expected
from planning.verify.reconstruction.check.calibration_sigma import calibration_sigma
from planning.verify.reconstruction.decode.decode import Decoded
from planning.verify.reconstruction.reconstruct import (
    conclude,
    reconstruct,
    reconstruct_twice,
)
from planning.verify.reconstruction.scanner import Scanner

ANGLES = {"min_angle": np.deg2rad(8.0), "max_angle": np.deg2rad(60.0)}


@pytest.fixture(scope="module")
def ball():
    return sphere(0.05, subdivisions=5)


@pytest.fixture(scope="module")
def scanner(ball):
    return dense_scanner(
        ball,
        [projector_at("P1", (0.2, -0.6, 0.1)), projector_at("P2", (-0.3, -0.5, 0.2))],
        [camera_at("C1", (-0.05, -0.7, 0.05)), camera_at("C2", (0.1, -0.65, 0.25))],
        **ANGLES,
    )


@pytest.fixture(scope="module")
def expected(scanner):
    """Samples that face all devices, so that every pair measures them."""
    samples = sample_surface(scanner.mesh, 4000, seed=3)
    devices = [*scanner.projectors, *scanner.cameras]
    cosines = [
        np.einsum("ij,ij->i", samples.normals, one.centre - samples.points)
        / np.linalg.norm(one.centre - samples.points, axis=1)
        for one in devices
    ]
    facing = np.min(cosines, axis=0) > np.cos(np.deg2rad(60.0))
    return Expected(samples, facing, np.full((2, 2), facing.mean()))


@pytest.fixture(scope="module")
def result(scanner, expected):
    return reconstruct(scanner, seed=1, threads=1, expected=expected)


def test_a_dense_scanner_passes_its_check(result, scanner):
    assert result.passed, result.failures
    assert result.accuracy.rms_m < 1.5e-4
    assert abs(result.accuracy.bias_m) < 1e-5
    assert result.completeness.fractions[0] > 0.99
    assert result.completeness.predicted_missing == 0.0
    # Cells of the spacing hold a point each: no denser, and hardly sparser.
    spacing = scanner.limits.dense.spacing_m
    assert spacing == pytest.approx(0.25 * scanner.limits.check.tau_m)
    assert 0.4 < result.redundant_fraction < 0.9
    for pair in result.pairs:
        assert pair.n_edges == pair.n_points + sum(pair.rejected.values())
    document = result.record().to_document()
    assert document["passed"]
    assert document["n_merged"] == result.n_merged


def test_merged_points_are_as_sure_as_they_are_said(result):
    merged = result.merged
    # The mesh lies up to 30 um inside the sphere.
    off = np.linalg.norm(merged.cloud.points, axis=1) - 0.05 + 1.2e-5
    assert np.sqrt(np.mean((off / merged.sigma) ** 2)) == pytest.approx(1.0, abs=0.25)
    several = result.merged.shared[merged.stays]
    one = result.everything.take(merged.stays)
    noise = merged.cloud.noise_px / one.noise_px
    assert np.median(noise[several]) < 0.85
    assert np.all(noise <= 1.0 + 1e-9)
    assert np.median(merged.sigma[several]) < np.median(merged.sigma[~several])


def test_two_cameras_add_points_by_each_other(result, scanner):
    second = result.everything.by_camera
    assert set(np.unique(second)) == {-1, 1}
    by_two = result.everything.take(second == 1)
    to_second = by_two.points - scanner.cameras[1].centre
    to_second /= np.linalg.norm(to_second, axis=1)[:, None]
    assert np.quantile(np.abs(to_second - by_two.beams), 0.95) < 1e-3


def test_nothing_depends_on_threads(result, scanner, expected):
    again = reconstruct(scanner, seed=1, threads=2, expected=expected)
    assert np.array_equal(again.merged.cloud.points, result.merged.cloud.points)
    assert again.failures == result.failures


@pytest.mark.long
@pytest.mark.parametrize(("device", "kind"), [("P1", "turn"), ("C2", "shift")])
def test_a_wrong_pose_fails_and_is_named(scanner, expected, device, kind):
    error = np.eye(4)
    if kind == "turn":
        error[:3, :3] = Rotation.from_rotvec([0.003, 0.004, 0.0]).as_matrix()
    else:
        error[:3, 3] = 0.004, 0.002, 0.0
    moved = {
        role: tuple(
            replace(one, world_from_device=one.world_from_device @ error)
            if one.id == device
            else one
            for one in getattr(scanner, role)
        )
        for role in ("projectors", "cameras")
    }
    truth = replace(scanner, **moved)
    found = reconstruct(scanner, seed=1, expected=expected, truth=truth)
    words = "turned" if kind == "turn" else "stood"
    assert not found.passed
    assert f"{device} looks as if it" in " ".join(found.failures)
    assert words in " ".join(found.failures)


def test_a_dark_rig_says_so(scanner, expected):
    pairs = [(pair, Decoded.nothing()) for pair, _ in scanner.pairs()]
    found = conclude(scanner, pairs, seed=1, expected=expected)
    assert found.n_merged == 0
    assert "no point was measured: nothing was decoded" in found.failures[0]


def test_calibration_moves_coded_points_as_it_is_said_to(scanner, result):
    # By Monte Carlo, with where a ray passes a plane of the second one's beams.
    stated = replace(scanner, calibration=CalibrationErrors(2e-4, 1e-4, 0.0, 0.0))
    every, rng = result.everything, np.random.default_rng(5)
    for kind in (-1, 1):
        cloud = every.take(
            np.flatnonzero((every.by_camera == kind) & (every.camera == 0))
        )
        cloud = cloud.take(np.flatnonzero(cloud.projector == 0)[::100])
        second = scanner.projectors[0] if kind < 0 else scanner.cameras[1]
        normals = cloud.points / np.linalg.norm(cloud.points, axis=1)[:, None]
        moved = np.array(
            [
                np.einsum("ij,ij->i", _off(stated, second, cloud, rng), normals)
                for _ in range(500)
            ]
        )
        spread = np.sqrt(np.mean(moved**2, axis=0))
        sigma = calibration_sigma(cloud, normals, stated)
        assert len(cloud) > 20
        assert np.median(spread / sigma) == pytest.approx(1.0, abs=0.05)


def _off(scanner, second, cloud, rng):
    """By how much points are off whose devices are off by chance, (n, 3)."""
    rays, camera, left = [], scanner.cameras[0], scanner.calibration
    for device, along in ((camera, cloud.rays), (second, cloud.beams)):
        error = np.eye(4)
        error[:3, :3] = Rotation.from_rotvec(
            rng.normal(0.0, left.about_axis, 3)
        ).as_matrix()
        error[:3, 3] = rng.normal(0.0, left.along_axis_m, 3)
        pose = device.world_from_device @ error
        turn = device.world_from_device[:3, :3] @ pose[:3, :3].T
        rays.append((pose[:3, 3], along @ turn))
    (o, r), (q, b) = rays
    # The camera's ray stays; of the second's what lies along its epipolar line counts.
    away = np.cross(b, np.cross(r, b))
    t = away @ (q - o) / np.einsum("ij,ij->i", away, r)
    start = (
        camera.centre
        + np.linalg.norm(cloud.points - camera.centre, axis=1)[:, None] * cloud.rays
    )
    return o + t[:, None] * r - start


def test_a_plan_with_a_code_is_checked(ball, tmp_path):
    plan = small_rig(ball, focal=1200.0)

    def code(document):
        document["requirements"]["triangulation"] |= {
            "min_angle": 0.1,
            "max_angle": 1.2,
        }
        document["requirements"]["check"]["max_rms_m"] = 4e-4
        document["requirements"]["check"]["max_p95_m"] = 8e-4
        for projector in document["projectors"][:1]:
            projector["ring_radii"] = []
            projector["code"] = {"shifts": 4, "period_px": 16, "phase_noise": 0.02}
            projector["world_from_ring"] = projector["world_from_device"]
        del document["projectors"][1:], document["cameras"][2:]
        for camera in document["cameras"]:
            camera["K"] = [[500.0, 0.0, 159.5], [0.0, 500.0, 119.5], [0.0, 0.0, 1.0]]
            camera["resolution"] = [320, 240]

    scanner = Scanner.of(changed(plan, code))
    assert scanner.is_dense
    assert scanner.limits.min_angle == 0.1
    assert scanner.frame_names(0, 0)[0] == "00-column-bit7"
    samples = sample_surface(ball, 500, seed=1)
    expected = Expected(samples, np.zeros(500, dtype=bool), np.full((1, 2), 0.5))
    folder = CaptureFolder(tmp_path, scanner)
    rendered = reconstruct_rendered(scanner, expected, seed=2, save=folder)
    assert rendered.n_merged > 500
    assert rendered.accuracy.rms_m < 4e-4
    read = reconstruct_captured(folder, expected)
    assert np.array_equal(read.merged.cloud.points, rendered.merged.cloud.points)
    # Two bits exchanged are told, and so is a missing frame.
    place = tmp_path / scanner.cameras[0].id / scanner.projectors[0].id
    names = [place / f"{name}.png" for name in scanner.frame_names(0, 0)]
    one, other = names[6], names[10]
    kept = [path.read_bytes() for path in (one, other, names[7], names[11])]
    for path, content in zip((other, one, names[11], names[7]), kept, strict=True):
        path.write_bytes(content)
    again = reconstruct_captured(folder, expected)
    told = " ".join(again.failures)
    assert "P1 with C1: left out: " in told
    assert "can't be the bit" in told
    names[3].unlink()
    assert "lacks 03-column-bit6-inverse" in " ".join(
        reconstruct_captured(folder, expected).failures
    )
    for path in tmp_path.rglob("*.png"):
        Image.new("L", (320, 240)).save(path)
    with pytest.raises(CapturesError):
        reconstruct_captured(folder, expected)


def test_what_is_for_rings_alone_refuses_dense(scanner, expected):
    with pytest.raises(InputError, match=r"a second sequence is of ring patterns"):
        reconstruct_twice(scanner, seed=1)
    with pytest.raises(InputError, match=r"--refine is of ring patterns"):
        reconstruct_rendered(scanner, expected, seed=1, mend=True)
