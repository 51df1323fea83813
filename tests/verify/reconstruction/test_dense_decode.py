"""Codes and points of rendered frames, against shapes known in closed form."""

from dataclasses import replace

import numpy as np
import pytest
from support.dense_rigs import BENT, camera_at, frames_of, projector_at, square

from geometry.mesh.mesh import TriangleMesh
from geometry.shapes.primitives import sphere
from planning.model.light.dense_code import DenseCode
from planning.verify.reconstruction.calibration import PairCalibration
from planning.verify.reconstruction.decode.dense.camera_pairs import between_cameras
from planning.verify.reconstruction.decode.dense.coded_pixels import read_codes
from planning.verify.reconstruction.decode.dense.dense_decode import decode_dense
from planning.verify.reconstruction.decode.dense.dense_limits import DenseLimits
from planning.verify.reconstruction.decode.dense.gray_bits import read_stripes
from planning.verify.reconstruction.decode.dense.phase import Phases
from planning.verify.reconstruction.decode.dense.two_rays import meet_rays
from planning.verify.reconstruction.decode.grey_noise import GreyNoise
from planning.verify.reconstruction.render.line_light import gathered_lines
from planning.verify.reconstruction.render.photometry import Photometry

NOISELESS = Photometry(noisy=False)
EVEN = Photometry(noisy=False, albedo_variation=0.0)
LIMITS = DenseLimits()


def test_blurred_lines_are_integrals_of_a_gaussian():
    rng = np.random.default_rng(3)
    lines = rng.random((20, 3)).astype(np.float32)
    places = np.array([2.3, 9.5, 18.7])
    spread = np.array([0.2, 1.1, 2.0])
    found = gathered_lines(lines, places, spread)
    fine = np.linspace(-12.0, 12.0, 48_001)
    for place, s, light in zip(places, spread, found, strict=True):
        pixel = np.rint(place + s * fine).astype(int)
        inside = (pixel >= 0) & (pixel < 20)
        weight = np.exp(-0.5 * fine**2) * inside
        mean = weight @ lines[np.clip(pixel, 0, 19)] / np.exp(-0.5 * fine**2).sum()
        assert np.allclose(light, mean, atol=6e-3)


@pytest.mark.parametrize("light", ["diverging", "parallel"])
def test_rays_meet_where_the_light_came_from(light):
    # Both lenses bend; codes are exact, so that points are.
    lens = BENT if light == "diverging" else (0.0,) * 5
    projector = projector_at("P1", (0.2, -0.6, 0.1), light=light, lens=lens)
    camera = camera_at("C1", (-0.1, -0.6, 0.05), lens=BENT)
    points = np.random.default_rng(0).uniform(-0.04, 0.04, (50, 3))
    rays = camera.rays(camera.project(points))
    codes, _ = projector.panel(points)
    met = meet_rays(camera.centre, rays, codes, np.ones_like(codes), projector)
    assert np.abs(met.points - points).max() < 1e-9
    assert met.residual_px.max() < 1e-6
    # By differences: what a pixel along the epipolar line moves a point by.
    moved = meet_rays(
        camera.centre,
        rays,
        projector.panel(points + 1e-5 * rays)[0],
        np.ones_like(codes),
        projector,
    )
    pixels = np.linalg.norm(projector.panel(points + 1e-5 * rays)[0] - codes, axis=1)
    assert np.allclose(1e-5 / pixels, met.per_px, rtol=0.05 if any(lens) else 1e-3)
    assert np.allclose(moved.distances - met.distances, 1e-5, rtol=1e-3)


def test_the_direction_that_tells_no_depth_counts_for_nothing():
    # Devices side by side: rows tell nothing, whatever they are off.
    projector = projector_at("P1", (0.15, -0.6, 0.0))
    camera = camera_at("C1", (-0.15, -0.6, 0.0))
    points = np.array([[0.01, 0.0, 0.0], [-0.02, 0.01, 0.0]])
    codes, _ = projector.panel(points)
    off = codes + np.array([0.0, 3.0])
    rays = camera.rays(camera.project(points))
    met = meet_rays(camera.centre, rays, off, np.ones_like(codes), projector)
    assert np.linalg.norm(met.points - points, axis=1).max() < 2e-4
    assert np.allclose(met.residual_px, 3.0, atol=0.05)
    # What rays behind the projector would meet is nothing.
    behind = meet_rays(camera.centre, -rays, codes, np.ones_like(codes), projector)
    assert np.isnan(behind.distances).all()


@pytest.mark.parametrize("light", ["diverging", "parallel"])
@pytest.mark.parametrize("tilt", [0.0, 0.6])
def test_a_plane_is_measured_as_surely_as_it_is_said(light, tilt):
    mesh = square(0.12, tilt=tilt)
    projector = projector_at("P1", (0.2, -0.6, 0.1), light=light, lens=BENT)
    if light == "parallel":
        projector = replace(projector, distortion=(0.0,) * 5)
    camera = camera_at("C1", (-0.1, -0.6, 0.05), lens=BENT)
    pair = PairCalibration(projector, camera)
    frames = frames_of(mesh, projector, camera)
    decoded = decode_dense(frames, projector.dense, pair, LIMITS)
    normal = mesh.face_normals[0]
    normal = normal * -np.sign(normal @ camera.axis)
    off = decoded.cloud.points @ normal
    sigma = decoded.cloud.sigma(np.broadcast_to(normal, decoded.cloud.points.shape))
    assert len(off) > 0.8 * decoded.n_edges > 4000
    assert np.sqrt(np.mean((off / sigma) ** 2)) == pytest.approx(1.0, abs=0.12)
    assert abs(off.mean()) < 0.1 * np.sqrt(np.mean(off**2))
    assert decoded.n_edges == len(off) + sum(decoded.rejected.values())
    # Poses are right, so that rays meet within what noise explains.
    assert decoded.residual_px < 0.2


def test_the_noise_of_phases_is_that_of_the_formula():
    projector = projector_at("P1", (0.2, -0.6, 0.1), code=DenseCode(shifts=6))
    camera = camera_at("C1", (-0.1, -0.6, 0.05))
    sharp = read_codes(
        frames_of(square(0.12), projector, camera, EVEN), projector.dense
    )
    noisy = replace(EVEN, noisy=True)
    told = read_codes(
        frames_of(square(0.12), projector, camera, noisy), projector.dense
    )
    off = (told.map.codes - sharp.map.codes) / told.map.sigma
    known = np.isfinite(off[:, :, 0])
    assert np.count_nonzero(known) > 5000
    for axis in (0, 1):
        assert np.std(off[known][:, axis]) == pytest.approx(1.0, abs=0.05)
    # sqrt(2 / N) s_I / B at the mean level A, in pixels of the panel.
    at = np.flatnonzero(known)[::97]
    stack = frames_of(square(0.12), projector, camera, EVEN).stack
    shifts = stack[projector.dense.first_shift(0) :][:6].reshape(6, -1)[:, at]
    level, swing = shifts.mean(axis=0), np.fft.fft(shifts, axis=0)[1]
    noise = np.sqrt(255.0 * level / 10_000.0 + 1.0 + 1.0 / 12.0)
    wanted = np.sqrt(2.0 / 6.0) * noise / (np.abs(swing) / 3.0) * 16.0 / (2.0 * np.pi)
    found = told.map.sigma[:, :, 0].ravel()[at]
    assert np.median(found / wanted) == pytest.approx(1.0, abs=0.05)


def test_no_code_is_off_by_a_period_or_a_stripe():
    # Noise of a dim image makes bits unsure beside borders, and errors of bits there.
    projector = projector_at("P1", (0.2, -0.6, 0.1))
    camera = camera_at("C1", (-0.1, -0.6, 0.05))
    dim = Photometry(exposure=0.2, read_noise=2.0)
    read = read_codes(frames_of(square(0.12), projector, camera, dim), projector.dense)
    told = read.map.told
    rays = camera.rays(read.map.pixels(told))
    reach = -camera.centre[1] / rays[:, 1]
    truth, _ = projector.panel(camera.centre + reach[:, None] * rays)
    codes = read.map.codes.reshape(-1, 2)[told]
    borders = np.abs((truth + 0.5) / 8.0 - np.rint((truth + 0.5) / 8.0)) * 8.0
    assert np.count_nonzero(borders < 0.3) > 100
    assert np.abs(codes - truth).max() < 3.0
    assert len(told) > 0.9 * len(read.lit)


def test_gray_code_alone_is_true_to_a_pixel():
    projector = projector_at("P1", (0.2, -0.6, 0.1), code=DenseCode(shifts=0))
    camera = camera_at("C1", (-0.1, -0.6, 0.05), focal=2400.0, size=(640, 480))
    read = read_codes(frames_of(square(0.12), projector, camera), projector.dense)
    told = read.map.told
    rays = camera.rays(read.map.pixels(told))
    reach = -camera.centre[1] / rays[:, 1]
    truth, _ = projector.panel(camera.centre + reach[:, None] * rays)
    off = read.map.codes.reshape(-1, 2)[told] - truth
    assert len(told) > 0.6 * len(read.lit)
    assert np.abs(off).max() < 1.0
    assert np.std(off) < 1.05 / np.sqrt(12.0)
    assert all(stripes.dropped == 0 for stripes in read.stripes)


def test_bits_finer_than_the_camera_resolves_are_left_aside():
    # A camera whose pixels cover three of the projector's.
    projector = projector_at(
        "P1", (0.2, -0.6, 0.1), code=DenseCode(shifts=0), size=(1280, 800)
    )
    camera = camera_at("C1", (-0.1, -0.6, 0.05), focal=600.0)
    read = read_codes(frames_of(square(0.12), projector, camera), projector.dense)
    assert all(stripes.dropped >= 1 for stripes in read.stripes)
    told = read.map.told
    rays = camera.rays(read.map.pixels(told))
    reach = -camera.centre[1] / rays[:, 1]
    truth, _ = projector.panel(camera.centre + reach[:, None] * rays)
    off = np.abs(read.map.codes.reshape(-1, 2)[told] - truth)
    widths = [stripes.width_px for stripes in read.stripes]
    assert len(told) > 0.3 * len(read.lit)
    assert np.all(np.quantile(off, 0.99, axis=0) < widths)
    assert np.all(read.map.sigma.reshape(-1, 2)[told] >= 0.28 * np.array(widths))


def test_a_sphere_has_its_radius():
    mesh = sphere(0.05, subdivisions=6)
    projector = projector_at("P1", (0.2, -0.6, 0.1))
    camera = camera_at("C1", (-0.1, -0.6, 0.05))
    pair = PairCalibration(projector, camera)
    frames = frames_of(mesh, projector, camera, NOISELESS)
    cloud = decode_dense(frames, projector.dense, pair, LIMITS).cloud
    away = np.linalg.norm(cloud.points, axis=1) - 0.05
    assert len(cloud) > 10_000
    # The mesh itself lies up to 8 um inside the sphere.
    assert np.sqrt(np.mean(away**2)) < 3e-5
    assert abs(away.mean()) < 1.5e-5
    assert np.abs(away).max() < 3e-4


def test_no_point_hangs_between_the_sides_of_a_step():
    near, far = square(0.06), square(0.16)
    front = TriangleMesh(near.vertices - np.array([0.0, 0.03, 0.0]), near.faces)
    mesh = TriangleMesh.joined([front, far])
    projector = projector_at("P1", (0.15, -0.6, 0.1))
    camera = camera_at("C1", (-0.1, -0.6, 0.05))
    pair = PairCalibration(projector, camera)
    frames = frames_of(mesh, projector, camera)
    decoded = decode_dense(frames, projector.dense, pair, LIMITS)
    y = decoded.cloud.points[:, 1]
    off = np.minimum(np.abs(y), np.abs(y + 0.03))
    assert decoded.rejected["depth_step"] > 0
    assert np.count_nonzero(y < -0.015) > 1000 < np.count_nonzero(y > -0.015)
    assert np.mean(off > 1.5e-3) < 2e-3
    # Without the test of steps there would be some.
    steep = decode_dense(frames, projector.dense, pair, replace(LIMITS, max_slant=1e3))
    y = steep.cloud.points[:, 1]
    loose = np.minimum(np.abs(y), np.abs(y + 0.03))
    assert np.mean(loose > 1.5e-3) > 2.0 * np.mean(off > 1.5e-3)


def test_two_cameras_measure_by_each_other_without_the_projector():
    mesh = square(0.12, tilt=0.3)
    projector = projector_at("P1", (0.05, -0.6, 0.15))
    one = camera_at("C1", (-0.15, -0.6, 0.0))
    two = camera_at("C2", (0.15, -0.6, 0.05), lens=BENT)
    maps = []
    for camera in (one, two):
        frames = frames_of(mesh, projector, camera)
        pair = PairCalibration(projector, camera)
        maps.append(decode_dense(frames, projector.dense, pair, LIMITS).codes)
    cloud, n_asked = between_cameras((one, maps[0]), (two, maps[1]), LIMITS)
    normal = mesh.face_normals[0]
    off = cloud.points @ normal
    sigma = cloud.sigma(np.broadcast_to(normal, cloud.points.shape))
    assert 4000 < len(cloud) <= n_asked
    assert np.sqrt(np.mean((off / sigma) ** 2)) == pytest.approx(1.0, abs=0.15)
    assert abs(off.mean()) < 0.1 * off.std()
    # Its angle is the cameras': 28 degrees.
    narrow = replace(LIMITS, max_angle=np.deg2rad(20.0))
    assert len(between_cameras((one, maps[0]), (two, maps[1]), narrow)[0]) == 0
    wide = replace(LIMITS, min_angle=np.deg2rad(35.0))
    assert len(between_cameras((one, maps[0]), (two, maps[1]), wide)[0]) == 0


def test_angles_and_noise_beyond_the_limits_are_counted():
    mesh = square(0.12)
    projector = projector_at("P1", (0.2, -0.6, 0.1))
    camera = camera_at("C1", (-0.1, -0.6, 0.05))
    pair = PairCalibration(projector, camera)
    frames = frames_of(mesh, projector, camera)
    for limits, cause in (
        (DenseLimits(min_angle=1.0), "angle"),
        (DenseLimits(max_angle=0.1), "angle"),
        (DenseLimits(max_sigma_m=1e-7), "unsure"),
    ):
        decoded = decode_dense(frames, projector.dense, pair, limits)
        assert len(decoded.cloud) == 0
        assert decoded.rejected[cause] > 0.8 * decoded.n_edges
    turned = replace(camera, world_from_device=camera.world_from_device.copy())
    turned.world_from_device[2, 3] += 0.01
    decoded = decode_dense(
        frames, projector.dense, PairCalibration(projector, turned), LIMITS
    )
    assert decoded.rejected["residual"] > 0.8 * decoded.n_edges


def test_points_are_thinned_to_a_spacing():
    mesh = square(0.12)
    projector = projector_at("P1", (0.2, -0.6, 0.1))
    camera = camera_at("C1", (-0.1, -0.6, 0.05))
    pair = PairCalibration(projector, camera)
    frames = frames_of(mesh, projector, camera)
    every = decode_dense(frames, projector.dense, pair, LIMITS)
    few = decode_dense(frames, projector.dense, pair, replace(LIMITS, spacing_m=2.2e-3))
    # A pixel is 0.7 mm wide there.
    assert few.codes.step == 3
    assert len(few.cloud) == pytest.approx(len(every.cloud) / 9, rel=0.05)
    assert few.n_edges == len(few.cloud) + sum(few.rejected.values())


def test_stripes_of_one_unsure_bit_lie_on_their_border():
    bits = DenseCode(shifts=0).bits(16)
    stripe = np.array([5, 5, 5])
    gray = stripe ^ (stripe >> 1)
    lit = (gray[None] >> np.arange(bits)[::-1, None]) & 1
    frames = np.empty((2 * bits, 3), dtype=np.uint8)
    frames[0::2], frames[1::2] = 200 * lit, 200 * (1 - lit)
    # Between 5 and 6 two bits don't differ but the second lowest; the highest can't.
    frames[2 * (bits - 2) : 2 * (bits - 2) + 2, 1] = 100
    frames[0:2, 2] = 100
    contrast, noise = np.full(3, 200.0, np.float32), np.full(3, 1.0)
    read = read_stripes(frames, contrast, noise, 4)
    assert read.middle[:2].tolist() == [21.5, 23.5]
    assert read.on_border.tolist() == [False, True, False]
    assert read.mixed.tolist() == [False, False, True]


def test_phases_take_the_period_next_to_their_stripe():
    turns = np.linspace(0.0, 1.0, 64, endpoint=False)
    k = np.arange(4)[:, None]
    frames = 100.0 + 80.0 * np.cos(2.0 * np.pi * (turns - k / 4))
    phases = Phases.of(frames, GreyNoise(1.0, 0.0))
    assert np.allclose((phases.turns - turns + 0.5) % 1.0, 0.5)
    assert np.allclose(phases.modulation, 80.0)
    assert np.allclose(phases.sigma, np.sqrt(0.5) / 80.0 / (2.0 * np.pi))


def test_frames_must_be_as_many_as_the_pattern_asks():
    projector = projector_at("P1", (0.2, -0.6, 0.1))
    camera = camera_at("C1", (-0.1, -0.6, 0.05))
    frames = frames_of(square(0.12), projector, camera)
    short = replace(frames, stack=frames.stack[:-1])
    with pytest.raises(ValueError, match=r"35 frames, but 640 x 400 px .* in 36"):
        read_codes(short, projector.dense)
