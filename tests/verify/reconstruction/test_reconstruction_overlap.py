"""Where two projectors' light falls: thresholds, both tests, light that adds up."""

import numpy as np
import pytest
from support.image_overlap import (
    overlap_by_frames,
    overlap_by_intensity,
    three_classes,
)
from support.reconstruction_rigs import ringed
from support.white_frames import balanced_accuracy, best_threshold, render_whites

from geometry.mesh.mesh import TriangleMesh
from geometry.rays.rays import RayCaster
from geometry.shapes.primitives import sphere
from planning.verify.reconstruction.calibration import (
    calibrate_camera,
    calibrate_projector,
)
from planning.verify.reconstruction.faults.missing import light_falls, lit_twice
from planning.verify.reconstruction.faults.supposed import Supposed
from planning.verify.reconstruction.render.photometry import Photometry
from planning.verify.reconstruction.render.rendered_light import Shown
from planning.verify.reconstruction.render.view import view
from planning.verify.reconstruction.scanner import Scanner

# Rings whose last annulus ends at 1.
HALF = np.array([0.25, 0.625])


@pytest.fixture(scope="module")
def plan(rigs):
    return rigs.small_rig(sphere(0.04, subdivisions=4), focal=700.0)


def whites_of(plan, photometry):
    mesh = plan.surface.mesh
    caster = RayCaster(mesh, threads=1)
    camera = calibrate_camera(plan.cameras[0])
    seen = view(camera, mesh, caster, photometry)
    shown = tuple(
        Shown(device, device, device.pattern_for(camera), caster)
        for p in plan.projectors
        for device in (calibrate_projector(p),)
    )
    return camera, seen, render_whites(seen, shown, photometry, (0,))


def test_three_heaps_of_grey_are_parted_between_them():
    rng = np.random.default_rng(0)
    light = np.concatenate(
        [rng.normal(m, 3.0, n) for m, n in ((5, 4000), (80, 900), (150, 300))]
    ).astype(np.float32)
    low, high = three_classes(light)
    assert low == pytest.approx(42.5, abs=4.0)
    assert high == pytest.approx(115.0, abs=4.0)


def test_balanced_accuracy_is_the_mean_of_both_kinds():
    lit = np.array([[2, 2, 2, 1], [1, 0, 0, 3]])
    double = np.array([[True, True, False, True], [False, True, True, False]])
    assert balanced_accuracy(double, lit) == pytest.approx(0.5 * (2 / 4 + 1 / 2))
    assert np.isnan(balanced_accuracy(double, np.ones((2, 4), int)))


def test_best_threshold_parts_what_can_be_parted():
    dark = np.full((1, 6), 10, np.uint8)
    together = np.array([[10, 50, 60, 70, 90, 100]], np.uint8)
    lit = np.array([[0, 1, 1, 1, 2, 2]])
    threshold = best_threshold(together, dark, lit)
    assert 60.0 <= threshold < 80.0
    assert balanced_accuracy(overlap_by_intensity(together, dark, threshold), lit) == 1


def test_light_of_two_projectors_adds_up_and_saturates(plan):
    clean = Photometry(noisy=False, albedo_variation=0.0)
    _, _, whites = whites_of(plan, clean)
    light = [one - whites.dark for one in whites.alone]
    np.testing.assert_allclose(
        whites.together - whites.dark, light[0] + light[1], atol=1e-3
    )
    # The exposure suits one projector; two are more than the sensor holds.
    assert whites.alone.max() < 255.0 < whites.together.max()
    _, _, noisy = whites_of(plan, Photometry(albedo_variation=0.0))
    assert noisy.together.dtype == np.uint8
    assert np.count_nonzero(noisy.together == 255) > 50
    assert np.count_nonzero(noisy.alone == 255) < 5


def test_frames_of_each_projector_beat_the_brightness_of_one_image(plan):
    """On a textured sphere, where dark skin lit twice is as bright as light skin."""
    textured = Photometry(albedo_variation=0.5)
    camera, _, whites = whites_of(plan, textured)
    rows, columns = whites.dark.shape
    grid = np.indices((rows, columns)).reshape(2, -1)[::-1].T + whites.corner
    caster = RayCaster(plan.surface.mesh, threads=1)
    rays = camera.rays(grid.astype(float))
    faces, distances = caster.first_hits(camera.centre, rays)
    hit = faces >= 0
    points = camera.centre + distances[hit, None] * rays[hit]
    lit = np.zeros(len(grid), int)
    for p in plan.projectors:
        # On a sphere about the origin: what faces the projector is lit by it.
        to = points - p.world_from_device[:3, 3]
        lit[hit] += np.einsum("ij,ij->i", to, points) < 0.0
    lit = lit.reshape(rows, columns)
    frames = overlap_by_frames(whites.alone, whites.dark)
    paper = overlap_by_intensity(whites.together, whites.dark)
    assert balanced_accuracy(frames, lit) > 0.95
    assert balanced_accuracy(paper, lit) < 0.90


def test_light_falls_where_a_sphere_faces_it(plan):
    """Inside the rings, at less than 89 degrees; nothing else shadows a sphere."""
    rng = np.random.default_rng(3)
    normals = rng.normal(size=(2000, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    points = 0.0401 * normals
    caster = RayCaster(plan.surface.mesh, threads=1)
    for p in plan.projectors:
        device = calibrate_projector(p)
        to = device.centre - points
        to /= np.linalg.norm(to, axis=1, keepdims=True)
        cosine = np.einsum("ij,ij->i", to, normals)
        lit = light_falls(device, caster, points, normals)
        # Just above the facets the light may still graze one.
        assert np.all(lit[cosine > 0.1])
        assert not np.any(lit[cosine < np.cos(np.deg2rad(89.0))])
        none = light_falls(ringed(device, 1e-6 * HALF), caster, points, normals)
        assert not none.any()


def test_pixels_in_both_beams_are_said_to_be(plan):
    camera = calibrate_camera(plan.cameras[0])
    supposed = Supposed.of(Scanner.of(plan))
    middle = camera.project(np.array([[0.0, -0.04, -0.005]]))
    assert lit_twice(supposed, np.repeat(middle, 3, axis=0), 0, 0) == ("P2",)
    side = camera.project(np.array([[-0.0385, -0.010, 0.0]]))
    assert lit_twice(supposed, side, 0, 0) == ()
    nowhere = np.array([[0.0, 0.0]])
    assert lit_twice(supposed, nowhere, 0, 0) == ()


def test_light_does_not_fall_behind_a_sphere(rigs):
    """Two spheres in a row, as seen from the projector."""
    front, back = sphere(0.02, subdivisions=3), sphere(0.02, subdivisions=3)
    towards = rigs.direction(-35.0, 5.0)
    vertices = np.vstack([front.vertices + 0.06 * towards, back.vertices])
    faces = np.vstack([front.faces, back.faces + len(front.vertices)])
    two = rigs.small_rig(TriangleMesh(vertices, faces))
    device = calibrate_projector(two.projectors[0])
    caster = RayCaster(two.surface.mesh, threads=1)
    normals = np.array([towards, towards, rigs.direction(35.0, 5.0)])
    points = np.array([0.06, 0.0, 0.0])[:, None] * towards + 0.02 * normals
    lit = light_falls(ringed(device, HALF), caster, points, normals)
    assert lit.tolist() == [True, False, False]
