"""Images of cameras alone: the texture, planes of windows, matches, and the check."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.dense_rigs import BENT, camera_at
from support.view_rigs import view_scanner

from geometry.mesh.sampling import sample_surface
from geometry.rays.rays import RayCaster
from geometry.shapes.primitives import sphere
from planning.verify.reconstruction.check.accuracy import Expected
from planning.verify.reconstruction.check.view_check import (
    Ball,
    matched_pairs,
    reconstruct_views,
)
from planning.verify.reconstruction.decode.views.level_image import (
    between_pixels,
    halved_images,
)
from planning.verify.reconstruction.decode.views.two_views import (
    TwoViews,
    homogeneous,
    plane_normals,
)
from planning.verify.reconstruction.render.photometry import Photometry
from planning.verify.reconstruction.render.textured import (
    CONTRAST,
    SolidTexture,
    render_textured,
)

BALL = Ball(np.zeros(3), 0.05)
PLACES = ((-0.17, -0.68, 0.05), (0.17, -0.68, 0.12), (0.0, -0.66, -0.25))


@pytest.fixture(scope="module")
def scanner():
    lenses = (BENT, BENT, (0.0,) * 5)
    cameras = [
        camera_at(f"C{k + 1}", PLACES[k], focal=1100.0, size=(280, 240), lens=lens)
        for k, lens in enumerate(lenses)
    ]
    return view_scanner(sphere(0.05, subdivisions=5), cameras)


@pytest.fixture(scope="module")
def expected(scanner):
    """Samples that face two cameras: what any pair of them should measure."""
    samples = sample_surface(scanner.mesh, 3000, seed=3)
    cosines = [
        np.einsum("ij,ij->i", samples.normals, camera.centre - samples.points)
        / np.linalg.norm(camera.centre - samples.points, axis=1)
        for camera in scanner.cameras
    ]
    facing = np.sum(np.array(cosines) > np.cos(np.deg2rad(60.0)), axis=0) >= 2
    return Expected(samples, facing)


@pytest.fixture(scope="module")
def result(scanner, expected):
    return reconstruct_views(scanner, BALL, seed=1, threads=1, expected=expected)


def test_the_check_passes(result):
    assert result.passed, result.failures
    assert result.accuracy.rms_m < 1.5e-4
    assert result.completeness.predicted_missing < 0.01
    assert 0.2 < result.redundant_fraction < 0.9
    names = {(pair.camera, pair.projector) for pair in result.pairs}
    assert names == {("C1", "C2"), ("C1", "C3"), ("C2", "C3")}
    for pair in result.pairs:
        assert pair.n_edges == pair.n_points + sum(pair.rejected.values())


def test_points_are_as_unsure_as_they_say(result):
    """Their distances from the mesh against what each says, in the median."""
    known = np.isfinite(result.merged.sigma)
    off = np.abs(result.accuracy.distances[known]) / result.merged.sigma[known]
    assert 0.6 < np.median(off) / 0.6745 < 1.5


def test_points_name_both_cameras_and_lie_on_both_rays(result, scanner):
    cloud = result.everything
    assert np.all(cloud.projector == 0)
    for k, camera in enumerate(scanner.cameras):
        own = cloud.camera == k
        at = camera.project(cloud.points[own])
        np.testing.assert_allclose(at, cloud.pixels[own], atol=1e-6)
        other = cloud.by_camera == k
        along = cloud.points[other] - camera.centre
        along /= np.linalg.norm(along, axis=1)[:, None]
        np.testing.assert_allclose(along, cloud.beams[other], atol=1e-12)


@pytest.mark.long
def test_the_same_seed_gives_the_same_points_whatever_the_threads(scanner):
    few = replace(scanner, cameras=scanner.cameras[:2])
    one, two = (reconstruct_views(few, BALL, seed=1, threads=n) for n in (1, 2))
    np.testing.assert_array_equal(one.everything.points, two.everything.points)


def test_a_camera_that_stands_elsewhere_fails_the_check(scanner, expected):
    """Turned by 0.2 degrees: three quarters of a pixel at 1100 px of focal length."""
    turned = scanner.cameras[1].world_from_device.copy()
    turned[:3, :3] @= Rotation.from_rotvec(np.deg2rad([0.0, 0.2, 0.0])).as_matrix()
    moved = replace(scanner.cameras[1], world_from_device=turned)
    few = replace(scanner, cameras=scanner.cameras[:2])
    truth = replace(few, cameras=(few.cameras[0], moved))
    wrong = reconstruct_views(
        few, BALL, seed=1, threads=1, truth=truth, expected=expected
    )
    assert not wrong.passed


def test_a_camera_that_isnt_there_measures_nothing(scanner):
    few = replace(scanner, cameras=scanner.cameras[:2])
    gone = replace(few, cameras=few.cameras[:1])
    lost = reconstruct_views(few, BALL, seed=1, threads=1, truth=gone)
    assert lost.failures == ("no point was measured: no images matched",)


def test_only_pairs_at_fit_angles_are_matched(scanner):
    limits = replace(scanner.limits, max_angle=np.deg2rad(29.5))
    narrow = replace(scanner, limits=limits)
    assert matched_pairs(narrow, BALL) == [(0, 1), (0, 2)]
    assert matched_pairs(scanner, BALL) == [(0, 1), (0, 2), (1, 2)]


def test_the_texture_is_the_objects_and_as_strong_as_stated():
    texture = SolidTexture.drawn(3e-4, seed=0)
    points = np.random.default_rng(0).uniform(-0.05, 0.05, (20_000, 3))
    albedo = texture.albedo(points)
    assert albedo.mean() == pytest.approx(1.0, abs=0.02)
    assert albedo.std() == pytest.approx(CONTRAST, rel=0.1)
    lengths = 2.0 * np.pi / np.linalg.norm(texture.vectors, axis=1) / 3e-4
    assert 6.0 <= lengths.min() < 7.0
    assert 80.0 < lengths.max() <= 96.0


def test_both_images_show_the_same_albedo_at_a_point(scanner):
    """Grey levels where spots of the surface appear agree, but for a gain and noise."""
    texture = SolidTexture.drawn(6e-4, seed=0)
    caster = RayCaster(scanner.mesh, threads=1)
    points = sample_surface(scanner.mesh, 4000, seed=1).points
    normals = points / np.linalg.norm(points, axis=1)[:, None]
    greys, facing = [], np.ones(len(points), dtype=bool)
    for camera in scanner.cameras[:2]:
        image = render_textured(
            scanner, camera, caster, texture, Photometry(noisy=False), (0,)
        )
        level = halved_images(image.grey, image.corner, 1)[0]
        greys.append(level.at(*camera.project(points).T))
        facing &= normals @ camera.centre / np.linalg.norm(camera.centre) > 0.75
    one, other = (grey[facing] for grey in greys)
    assert facing.sum() > 200
    assert np.corrcoef(one, other)[0, 1] > 0.97


def test_a_window_on_a_plane_is_seen_where_its_points_are(scanner):
    first, second = scanner.cameras[0], scanner.cameras[2]
    pixel = np.array([[150.0, 110.0]])
    normal = np.array([0.2, -0.9, 0.3])
    offsets = np.array([[0.0, 0.0], [4.0, 0.0], [0.0, -5.0], [3.0, 3.0]])
    rays = first.rays(pixel + offsets)
    plane_at = first.centre + 0.66 * rays[0]
    t = ((plane_at - first.centre) @ normal) / (rays @ normal)
    points = first.centre + t[:, None] * rays
    depth = (points - first.centre) @ first.axis
    slopes = np.linalg.lstsq(offsets, 1.0 / depth - 1.0 / depth[0], rcond=None)[0]
    planes = np.array([[1.0 / depth[0], *slopes]])
    u, v, du, dv = TwoViews.of(first, second, pixel).seen_at(
        planes, offsets, with_slope=True
    )
    np.testing.assert_allclose(
        np.column_stack([u[0], v[0]]), second.project(points), atol=0.02
    )
    step = 1e-5
    near = first.centre + homogeneous(first, pixel) @ first.world_from_device[
        :3, :3
    ].T / (planes[0, 0] + step)
    moved = (second.project(near) - second.project(points[:1])) / step
    np.testing.assert_allclose([du[0, 0], dv[0, 0]], moved[0], rtol=0.02)
    found = plane_normals(first, pixel, planes)[0]
    unit = normal / np.linalg.norm(normal)
    assert abs(found @ unit) > np.cos(np.deg2rad(2.0))


def test_between_pixels_is_linear_and_nothing_outside():
    rows, columns = np.mgrid[:6, :8].astype(np.float32)
    image = 2.0 * rows + 3.0 * columns
    row, column = np.array([0.0, 2.25, 4.9, 5.5, -0.1]), np.array([0.0, 3.5, 6.9, 2, 2])
    expected = np.where([1, 1, 1, 0, 0], 2.0 * row + 3.0 * column, 0.0)
    np.testing.assert_allclose(between_pixels(image, row, column), expected, rtol=1e-6)


def test_halved_images_keep_their_places():
    image = np.mgrid[:16, :16][1].astype(np.float32)
    for level in halved_images(image + 5.0, (5, 9), 3):
        u = np.array([10.3, 12.0])
        np.testing.assert_allclose(level.at(u, np.full(2, 15.0)), u, rtol=1e-6)
