"""Rendered images to labelled edges: where they are, and what doesn't get through."""

from dataclasses import replace

import numpy as np
import pytest
from support.plain_shapes import grid

from geometry.mesh.mesh import TriangleMesh
from geometry.rays.rays import RayCaster
from planning.verify.reconstruction.calibration import (
    PairCalibration,
    calibrate_camera,
    calibrate_projector,
)
from planning.verify.reconstruction.decode.decode import decode
from planning.verify.reconstruction.decode.edges import find_edges
from planning.verify.reconstruction.light_laws import LIGHTS
from planning.verify.reconstruction.patterns.ring_patterns import Frames, RingsForCamera
from planning.verify.reconstruction.render.photometry import Photometry
from planning.verify.reconstruction.render.render import render_pair
from planning.verify.reconstruction.render.rendered_light import Shown
from planning.verify.reconstruction.render.view import view

CLEAN = Photometry(noisy=False, albedo_variation=0.0)


def plate(rigs, width: float, height: float, y: float = 0.0) -> TriangleMesh:
    """A rectangle in the plane of a given y, its normal along -y."""
    flat = grid(width, height, divisions=(6, 5))
    turned = flat.vertices @ rigs.turn(0, 90.0)[:3, :3].T
    return TriangleMesh(turned + np.array([0.0, y, 0.0]), flat.faces)


def shot(
    rigs,
    light: str,
    focal: float,
    photometry: Photometry,
    *,
    distortion=(0.0,) * 5,
    mesh: TriangleMesh | None = None,
):
    """Frames of a plate 120 mm wide before one projector and one camera."""
    mesh = mesh or plate(rigs, 0.12, 0.10)
    assert mesh.face_normals[0] @ rigs.direction(0.0, 0.0) == pytest.approx(1.0)
    make = rigs.diverging if light == "diverging" else rigs.parallel
    plan = rigs.plan_of(
        mesh,
        [make("P1", rigs.direction(-25.0, 5.0), 0.09, 3.5e-3)],
        [
            rigs.camera(
                "C1", rigs.direction(20.0, 12.0), focal=focal, distortion=distortion
            )
        ],
    )
    camera = calibrate_camera(plan.cameras[0])
    projector = calibrate_projector(plan.projectors[0])
    patterns = projector.pattern_for(camera)
    caster = RayCaster(mesh, threads=1)
    seen = view(camera, mesh, caster, photometry)
    frames = render_pair(
        seen, Shown(projector, projector, patterns, caster), photometry, (0,)
    )
    return frames, patterns, PairCalibration(projector, camera)


def ring_coordinate(calibration: PairCalibration, pixels: np.ndarray) -> np.ndarray:
    """Ring coordinate of the plate y = 0 at pixels, in closed form."""
    camera, projector = calibration.camera, calibration.projector
    rays = camera.rays(pixels)
    points = camera.centre - rays * (camera.centre[1] / rays[:, 1])[:, None]
    local = projector.to_ring(points)
    across = np.hypot(local[:, 0], local[:, 1])
    return across / local[:, 2] if projector.light.name == "diverging" else across


def edge_error_px(edges, patterns, calibration) -> np.ndarray:
    """Distance of each edge from its ring in the image, across it [px]."""
    here = ring_coordinate(calibration, edges.pixels) - patterns.radii[edges.rings]
    ahead, behind = (
        ring_coordinate(calibration, edges.pixels + side * 0.05 * edges.across)
        for side in (1.0, -1.0)
    )
    return here / ((ahead - behind) / 0.1)


@pytest.mark.parametrize("light", ["diverging", "parallel"])
@pytest.mark.parametrize("focal", [1400.0, 3478.0])
def test_edges_on_a_plane_are_where_the_rings_are(rigs, light, focal):
    frames, patterns, calibration = shot(rigs, light, focal, CLEAN)
    edges, *_ = find_edges(frames, patterns)
    error = edge_error_px(edges, patterns, calibration)
    assert len(edges) > 3000
    assert len(np.unique(edges.rings)) > 25
    assert abs(error.mean()) < 0.005
    # The lattice of the projector's pixels leaves 0.005 of one.
    seen = calibration.projector.pixel_m(np.zeros((1, 3)))[0] * focal
    assert np.sqrt(np.mean(error**2)) < np.hypot(0.003, 0.005 * seen)
    assert np.abs(error).max() < 0.1


def test_a_distorting_lens_moves_edges_and_is_undone(rigs):
    lens = (-0.2, 0.05, 1e-3, -1e-3, 0.0)
    frames, patterns, calibration = shot(
        rigs, "diverging", 3478.0, CLEAN, distortion=lens
    )
    decoded = decode(frames, patterns, calibration)
    assert len(decoded.cloud) > 3000
    assert np.abs(decoded.cloud.points[:, 1]).max() < 8e-5
    straight = replace(calibration.camera, distortion=(0.0,) * 5)
    wrong = decode(frames, patterns, PairCalibration(calibration.projector, straight))
    assert np.abs(wrong.cloud.points[:, 1]).max() > 1.5e-4


def test_noise_of_edges_is_what_the_decoder_says_it_is(rigs):
    frames, patterns, calibration = shot(
        rigs, "diverging", 3478.0, Photometry(albedo_variation=0.0)
    )
    edges, _, lit, _ = find_edges(frames, patterns)
    error = edge_error_px(edges, patterns, calibration)
    assert frames.stack.dtype == np.uint8
    assert lit > 0.5 * frames.stack[0].size
    assert 0.005 < np.sqrt(np.mean(error**2)) < 0.05
    assert 0.8 < np.sqrt(np.mean((error / edges.noise_px) ** 2)) < 1.25


def test_every_label_is_the_ring_that_is_there(rigs):
    frames, patterns, calibration = shot(rigs, "parallel", 3478.0, Photometry())
    edges, *_ = find_edges(frames, patterns)
    there = ring_coordinate(calibration, edges.pixels)
    nearest = np.abs(there[:, None] - patterns.radii[None]).argmin(axis=1)
    assert np.array_equal(nearest, edges.rings)


def step(rigs, degrees: float) -> tuple[TriangleMesh, np.ndarray]:
    """A plate turned in its plane, 30 mm before a larger one; and the turn."""
    far, near = plate(rigs, 0.12, 0.10), plate(rigs, 0.05, 0.04, -0.03)
    turn = rigs.turn(1, degrees)[:3, :3]
    both = TriangleMesh(
        np.concatenate([far.vertices, near.vertices @ turn.T]),
        np.concatenate([far.faces, near.faces + len(far.vertices)]),
    )
    return both, turn


@pytest.mark.parametrize("light", ["diverging", "parallel"])
def test_a_plate_hides_and_shades_the_one_behind_it(rigs, light):
    """No point hangs in the air, none lies in the shadow, and the rest is measured."""
    both, turn = step(rigs, 45.0)
    decoded = decode(*shot(rigs, light, 3478.0, Photometry(), mesh=both))
    x, y, z = (decoded.cloud.points @ turn).T
    on_near, on_far = np.abs(y + 0.03) < 6e-4, np.abs(y) < 6e-4
    assert on_near.sum() > 300
    assert on_far.sum() > 1500
    assert np.mean(~on_near & ~on_far) < 2e-3
    assert np.all((np.abs(x[on_near]) < 0.0255) & (np.abs(z[on_near]) < 0.0205))
    # Where the light that reached the far plate crossed the plane of the near one.
    beams = decoded.cloud.beams
    back = decoded.cloud.points - beams * ((y + 0.03) / beams[:, 1])[:, None]
    back = np.abs(back @ turn)
    shaded = (back[:, 0] < 0.0245) & (back[:, 2] < 0.0195)
    assert not np.any(shaded & on_far)


@pytest.mark.parametrize(("degrees", "left"), [(45.0, 0.1), (5.0, 0.2)])
def test_false_edges_in_a_step_of_depth_are_found(rigs, degrees, left):
    """Across the rings few are left; nearly along them the next rings must tell."""
    taken = shot(rigs, "diverging", 3478.0, Photometry(), mesh=step(rigs, degrees)[0])
    hanging = []
    for max_slant in (2.14, 1e6):
        y = decode(*taken, max_slant=max_slant).cloud.points[:, 1]
        hanging.append(np.count_nonzero((y < -6e-4) & (np.abs(y + 0.03) > 6e-4)))
    # Light of both plates gives more of them away at once.
    assert hanging[1] > 30
    assert hanging[0] < left * hanging[1]


def test_points_outside_the_projectors_image_are_left_out(rigs):
    frames, patterns, calibration = shot(rigs, "diverging", 3478.0, Photometry())
    narrow = replace(calibration.projector, resolution=(640, 800))
    whole = decode(frames, patterns, calibration)
    half = decode(frames, patterns, PairCalibration(narrow, calibration.camera))
    assert whole.rejected["outside_panel"] == 0
    assert half.rejected["outside_panel"] > 0.2 * len(whole.cloud)
    pixels, _ = calibration.projector.panel(half.cloud.points)
    assert pixels[:, 0].max() <= 640.5


def test_light_from_behind_stays_behind(rigs):
    """A plate whose back is lit looks the same under white and black."""
    mesh = plate(rigs, 0.12, 0.10)
    plan = rigs.plan_of(
        mesh,
        [rigs.diverging("P1", rigs.direction(160.0, 5.0), 0.09, 3.5e-3)],
        [rigs.camera("C1", rigs.direction(20.0, 12.0))],
    )
    projector = calibrate_projector(plan.projectors[0])
    camera = calibrate_camera(plan.cameras[0])
    patterns = projector.pattern_for(camera)
    caster = RayCaster(mesh, threads=1)
    seen = view(camera, mesh, caster, CLEAN)
    frames = render_pair(
        seen, Shown(projector, projector, patterns, caster), CLEAN, (0,)
    )
    assert frames.stack[0].max() > 0.0
    assert np.array_equal(frames.stack[0], frames.stack[1])


def test_noise_is_shot_and_read_noise_of_its_own_key():
    sensor = Photometry(full_well=10_000.0, read_noise=1.0)
    grey = np.full((300, 300), 0.5, dtype=np.float32)
    one, again, other, third = (
        sensor.capture(grey, key, 255.0).astype(float)
        for key in ((0, 0, 1), (0, 0, 1), (0, 1, 1), (1, 0, 1))
    )
    assert np.array_equal(one, again)
    assert not np.array_equal(one, other)
    assert not np.array_equal(one, third)
    assert one.mean() == pytest.approx(127.5, abs=0.1)
    # 255 * 127.5 / 10^4 + 1, and 1/12 of the rounding.
    assert one.var() == pytest.approx(3.25 + 1.0 + 1.0 / 12.0, rel=0.03)
    assert sensor.pixel_noise == pytest.approx(np.sqrt(4.25125))


def test_scrambled_bits_give_no_wrong_points(rigs):
    """Where two frames are exchanged in part of the image, edges are left out there."""
    frames, patterns, calibration = shot(rigs, "diverging", 3478.0, Photometry())
    good = decode(frames, patterns, calibration)
    stack = frames.stack.copy()
    middle = stack.shape[2] // 2
    one, other = 2 + 2 * 2, 2 + 2 * 4
    stack[[one, one + 1, other, other + 1], :, :middle] = stack[
        [other, other + 1, one, one + 1], :, :middle
    ]
    bad = decode(Frames(stack, frames.corner), patterns, calibration)
    off = np.abs(bad.cloud.points[:, 1]) > 1e-3
    assert np.abs(good.cloud.points[:, 1]).max() < 3e-4
    assert len(bad.cloud) < 0.85 * len(good.cloud)
    # A label survives only where code and flipping bit still agree: in isolated rings.
    left = bad.cloud.pixels[:, 0] - frames.corner[0] < middle + 2
    assert not np.any(off & ~left)


def test_frames_in_the_wrong_order_give_no_cloud(rigs):
    frames, patterns, calibration = shot(rigs, "diverging", 3478.0, Photometry())
    good = decode(frames, patterns, calibration)
    for order in (np.roll(np.arange(len(frames.stack)), 2), slice(None, None, -1)):
        shuffled = decode(
            Frames(frames.stack[order], frames.corner), patterns, calibration
        )
        assert len(good.cloud) > 3000
        assert len(shuffled.cloud) == 0
        assert shuffled.rejected["labels"] == shuffled.n_edges


@pytest.mark.parametrize("light", ["diverging", "parallel"])
def test_no_exchange_of_two_bits_gives_a_wrong_point(rigs, light):
    frames, patterns, calibration = shot(rigs, light, 3478.0, Photometry())
    n_refused = 0
    exchanges = [(a, b) for b in range(patterns.n_bits) for a in range(b)]
    for one, other in exchanges:
        order = np.arange(len(frames.stack)).reshape(-1, 2)
        order[[1 + one, 1 + other]] = order[[1 + other, 1 + one]]
        stack = frames.stack[order.ravel()]
        decoded = decode(Frames(stack, frames.corner), patterns, calibration)
        n_refused += decoded.rejected.get("labels") == decoded.n_edges
        assert np.all(np.abs(decoded.cloud.points[:, 1]) < 6e-4), (one, other)
    assert n_refused >= len(exchanges) - 1


def test_surface_too_dim_to_read_costs_no_point_elsewhere(rigs):
    """Half the plate flickers about the least contrast; the other half is measured."""
    frames, patterns, calibration = shot(rigs, "diverging", 3478.0, Photometry())
    good = decode(frames, patterns, calibration)
    stack = frames.stack.astype(np.float64)
    middle = stack.shape[2] // 2
    black, contrast = stack[1], stack[0] - stack[1]
    share = (stack - black) / np.maximum(contrast, 1.0)
    noise = np.random.default_rng(2).normal(0.0, 1.0, stack.shape)
    dim = np.where(contrast > 10.0, black + 9.0 * share + noise, stack)
    stack[:, :, :middle] = np.rint(dim)[:, :, :middle].clip(0, 255)
    mixed = Frames(stack.astype(np.uint8), frames.corner)
    half = decode(mixed, patterns, calibration)
    right = good.cloud.pixels[:, 0] - frames.corner[0] > middle + 4
    kept = half.cloud.pixels[:, 0] - frames.corner[0] > middle + 4
    assert "labels" not in half.rejected
    assert kept.sum() > 0.98 * right.sum() > 1000


def test_black_and_saturated_images_give_nothing(rigs):
    _, patterns, calibration = shot(rigs, "diverging", 1400.0, CLEAN)
    for level in (0, 128, 255):
        stack = np.full((patterns.n_frames, 60, 80), level, dtype=np.uint8)
        decoded = decode(Frames(stack, (900, 700)), patterns, calibration)
        assert len(decoded.cloud) == decoded.n_edges == decoded.lit_pixels == 0
    stack[1::2] = 0
    blown = decode(Frames(stack, (900, 700)), patterns, calibration)
    assert blown.n_edges == blown.lit_pixels == 0
    stack[0] = 250
    assert decode(Frames(stack, (900, 700)), patterns, calibration).lit_pixels == 4800


def test_a_missing_frame_is_refused(rigs):
    frames, patterns, calibration = shot(rigs, "diverging", 1400.0, CLEAN)
    with pytest.raises(ValueError, match=r"frames, but .* rings are coded in"):
        decode(Frames(frames.stack[:-1], frames.corner), patterns, calibration)


@pytest.mark.parametrize("n_rings", [2, 3, 4, 63, 64, 100])
def test_neighbouring_annuli_differ_in_one_bit(n_rings):
    radii = np.arange(1.0, n_rings + 1.0)
    patterns = RingsForCamera(LIGHTS["parallel"], radii, np.zeros(3))
    codes = patterns.codes
    changed = codes[1:] ^ codes[:-1]
    assert patterns.outer_radius == n_rings + 1.0
    assert patterns.n_annuli == n_rings + 1 <= 2**patterns.n_bits < 2 * (n_rings + 1)
    assert patterns.n_frames == 2 * int(np.ceil(np.log2(n_rings + 1))) + 2 + 2
    assert len(np.unique(codes)) == n_rings + 1
    assert np.array_equal(changed, 1 << patterns.flipping_bit)
    assert np.array_equal(patterns.index_of_code[codes], np.arange(n_rings + 1))
    for bit in range(patterns.n_bits):
        assert np.array_equal(patterns.bit(bit), (codes >> bit) & 1)
