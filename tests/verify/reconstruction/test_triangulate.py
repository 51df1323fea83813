"""Ray meets ring surface: exact points from exact labels, for any pose."""

from dataclasses import replace

import numpy as np
import pytest

from planning.verify.reconstruction.calibration import (
    CameraCalibration,
    ProjectorCalibration,
)
from planning.verify.reconstruction.decode.triangulate import intersect_rings
from planning.verify.reconstruction.light_laws import LIGHTS
from planning.verify.reconstruction.patterns.ring_patterns import (
    DrawnRings,
    RingsForCamera,
)


def random_turn(rng: np.random.Generator) -> np.ndarray:
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return q * np.linalg.det(q)


def random_pose(rng: np.random.Generator, reach: float) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, :3] = random_turn(rng)
    pose[:3, 3] = rng.uniform(-reach, reach, 3)
    return pose


def projector_of(light: str, world_from_ring: np.ndarray) -> ProjectorCalibration:
    frame, none = world_from_ring, DrawnRings(LIGHTS[light], np.zeros(0))
    return ProjectorCalibration("P1", frame, np.eye(3), (9, 9), frame, None, none)


def scene(rng: np.random.Generator, light: str, n: int):
    """Points about 1 m before a projector, seen from a camera anywhere about them."""
    projector = projector_of(light, random_pose(rng, 2.0))
    flat = rng.uniform(-0.25, 0.25, (n, 2))
    local = np.column_stack([flat, rng.uniform(0.7, 1.3, n)])
    points = local @ projector.world_from_ring[:3, :3].T + projector.centre
    # In the ring frame, from 1.5 m behind the projector to 1.5 m before it.
    eye = rng.uniform([-1.0, -1.0, -1.5], [1.0, 1.0, 1.5])
    eye = projector.world_from_ring[:3, :3] @ eye + projector.centre
    across = np.hypot(local[:, 0], local[:, 1])
    radii = across / local[:, 2] if light == "diverging" else across
    return projector, points, local, eye, radii


def drawn_root(projector, local, eye) -> np.ndarray:
    """The root bit as it is drawn in the projector and lands on each point."""
    flat = local[:, :2]
    plane = flat / local[:, 2:] if projector.light.name == "diverging" else flat
    patterns = RingsForCamera(
        projector.light, np.array([0.1, 0.2]), projector.to_ring(eye[None])[0]
    )
    return np.where(patterns.root_side(plane) > 0.0, 1, -1).astype(np.int8)


@pytest.mark.parametrize("light", ["diverging", "parallel"])
def test_points_come_back_exactly_with_no_wrong_root(light):
    rng = np.random.default_rng(7)
    tried = 0
    for _ in range(60):
        projector, points, local, eye, radii = scene(rng, light, 2000)
        rays = points - eye
        reach = np.linalg.norm(rays, axis=1)
        rays /= reach[:, None]
        roots = drawn_root(projector, local, eye)
        hits = intersect_rings(eye, rays, radii, roots, projector)
        sound = np.abs(hits.conditioning) >= 0.1
        # A wrong root would also change r.m, so sound is judged from the truth too.
        m = np.column_stack(
            [local[:, :2] / np.hypot(*local[:, :2].T)[:, None], 0 * radii]
        )
        if light == "diverging":
            m[:, 2] = -radii
            m /= np.sqrt(1.0 + radii**2)[:, None]
        true = np.einsum("ij,ij->i", rays @ projector.world_from_ring[:3, :3], m)
        good = np.abs(true) >= 0.1
        assert np.array_equal(sound, good)
        assert np.abs(hits.points - points)[good].max() < 1e-9
        assert np.abs(hits.distances - reach)[good].max() < 1e-9
        np.testing.assert_allclose(hits.conditioning[good], true[good], atol=1e-9)
        tried += int(good.sum())
    assert tried > 60_000


@pytest.mark.parametrize("light", ["diverging", "parallel"])
def test_points_come_back_through_optics_that_the_rings_were_not_drawn_for(light):
    """Rings about an axis aside of the device's; a focal length and centre off."""
    rng = np.random.default_rng(3)
    drawn, points, _, eye, _ = scene(rng, light, 2000)
    ring = drawn.world_from_ring.copy()
    ring[:3, :3] = ring[:3, :3] @ rotation_about_x(8.0)
    if light == "diverging":
        drawn = replace(drawn, world_from_ring=ring)
    matrix = np.array([[1.02, 0.0, 0.004], [0.0, 1.01, -0.003], [0.0, 0.0, 1.0]])
    projector = replace(drawn, matrix=matrix, drawn_for=drawn.matrix)
    pixels, _ = projector.panel(points)
    radii = np.hypot(*projector.ring_plane(pixels).T)
    np.testing.assert_allclose(projector.ring_coordinate(points), radii, rtol=1e-12)
    rays = points - eye
    reach = np.linalg.norm(rays, axis=1)
    rays /= reach[:, None]
    steps = [projector.ring_coordinate(points + s * 1e-7 * rays) for s in (-1, 1)]
    roots = np.sign(steps[1] - steps[0]).astype(np.int8)
    hits = intersect_rings(eye, rays, radii, roots, projector)
    good = np.abs(hits.conditioning) >= 0.1
    assert good.sum() > 500
    assert np.abs(hits.points - points)[good].max() < 1e-8
    np.testing.assert_allclose(np.linalg.norm(hits.normals[good], axis=1), 1.0)
    side = np.cross(hits.normals[good], rng.normal(size=3))
    along = 1e-6 * side / np.linalg.norm(side, axis=1, keepdims=True)
    near = projector.ring_coordinate(points[good] + along) - radii[good]
    assert np.abs(near).max() < 1e-10


def rotation_about_x(degrees: float) -> np.ndarray:
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


@pytest.mark.parametrize("light", ["diverging", "parallel"])
def test_the_other_root_is_elsewhere(light):
    rng = np.random.default_rng(11)
    projector, points, local, eye, radii = scene(rng, light, 500)
    rays = points - eye
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    roots = drawn_root(projector, local, eye)
    hits = intersect_rings(eye, rays, radii, -roots, projector)
    other = np.isfinite(hits.distances)
    assert np.linalg.norm(hits.points - points, axis=1)[other].min() > 1e-4


def test_coaxial_parallel_light_is_equation_4():
    """z = f R / sqrt(u^2 + v^2), the camera on the axis of the rings."""
    rng = np.random.default_rng(3)
    focal = 3000.0
    pixels = rng.uniform(-700.0, 700.0, (400, 2))
    pixels = pixels[np.linalg.norm(pixels, axis=1) > 50.0]
    rays = np.column_stack([pixels / focal, np.ones(len(pixels))])
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    radii = rng.uniform(0.01, 0.2, len(pixels))
    projector = projector_of("parallel", np.eye(4))
    hits = intersect_rings(
        np.zeros(3), rays, radii, np.ones(len(rays), np.int8), projector
    )
    depth = focal * radii / np.linalg.norm(pixels, axis=1)
    np.testing.assert_allclose(hits.points[:, 2], depth, rtol=1e-12)
    np.testing.assert_allclose(hits.points[:, :2], pixels * (depth / focal)[:, None])


def test_a_ray_beside_the_cylinder_gives_nothing():
    rays = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    projector = projector_of("parallel", np.eye(4))
    origin = np.array([-1.0, 0.5, 0.0])
    hits = intersect_rings(
        origin, rays, np.array([0.2, 0.2]), np.array([1, 1], np.int8), projector
    )
    assert np.all(np.isnan(hits.points))


def test_no_point_lies_behind_the_camera_or_on_the_mirrored_cone():
    rng = np.random.default_rng(5)
    projector = projector_of("diverging", np.eye(4))
    rays = rng.normal(size=(4000, 3))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    for root in (1, -1):
        hits = intersect_rings(
            np.array([0.4, 0.1, 0.3]),
            rays,
            rng.uniform(0.05, 0.4, 4000),
            np.full(4000, root, np.int8),
            projector,
        )
        seen = np.isfinite(hits.distances)
        assert 50 < seen.sum() < 4000
        assert np.all(hits.distances[seen] > 0.0)
        assert np.all(hits.points[seen, 2] > 0.0)
        assert np.all(np.sign(hits.conditioning[seen]) == root)


def test_root_disc_is_a_distance_in_the_ring_plane():
    """One step of the returned length towards the border ends on it."""
    rng = np.random.default_rng(1)
    camera = CameraCalibration("C1", np.eye(4), np.eye(3), (10, 10), (0.0,) * 5)
    for light in ("diverging", "parallel"):
        projector = projector_of(light, random_pose(rng, 1.0))
        patterns = projector.pattern_for(camera)
        p = rng.uniform(-0.3, 0.3, (200, 2))
        side = patterns.root_side(p)
        step = 1e-7
        slope = np.column_stack(
            [
                (patterns.root_side(p + step * e) - side) / step
                for e in (np.array([1.0, 0.0]), np.array([0.0, 1.0]))
            ]
        )
        near = np.abs(side) < 0.02
        length = np.linalg.norm(slope[near], axis=1)
        assert near.sum() > 3
        np.testing.assert_allclose(length, 1.0, atol=0.2)
