"""One image of rings: lines to sub-pixel, labels by a prior mesh, points."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ndtr
from support.reconstruction_rigs import ringed

from geometry.mesh.mesh import TriangleMesh
from geometry.poses import look_at
from geometry.shapes.primitives import sphere
from planning.verify.reconstruction.calibration import (
    CameraCalibration,
    PairCalibration,
    ProjectorCalibration,
)
from planning.verify.reconstruction.decode.edges import ImageEdges
from planning.verify.reconstruction.decode.triangulate import intersect_rings
from planning.verify.reconstruction.light_laws import LIGHTS
from planning.verify.reconstruction.patterns.ring_patterns import (
    DrawnRings,
    Frames,
    RingsForCamera,
)
from planning.verify.reconstruction.single_shot.prior_labels import label_by_prior
from planning.verify.reconstruction.single_shot.ring_lines import find_lines

UP = np.array([0.0, 0.0, 1.0])
BALL = 0.06
RADII = {"parallel": np.arange(1, 6) * 0.01, "diverging": np.arange(1, 6) * 0.01}
CENTRE, CIRCLE, WIDTH = (83.3, 61.8), 40.0, 4.0


def circle(width: float = WIDTH, blur: float = 1.0) -> np.ndarray:
    """A bright blurred circle on black, as an image (128, 160) of grey levels."""
    v, u = np.mgrid[:128, :160].astype(float)
    rho = np.hypot(u - CENTRE[0], v - CENTRE[1])
    inner, outer = CIRCLE - 0.5 * width, CIRCLE + 0.5 * width
    return 180.0 * (ndtr((rho - inner) / blur) - ndtr((rho - outer) / blur)) + 10.0


def found_lines(image: np.ndarray, corner: tuple[int, int] = (0, 0)):
    return find_lines(Frames(image[None], corner), WIDTH)


def test_the_middle_of_a_line_is_found_to_a_hundredth_of_a_pixel():
    lines = found_lines(circle(), corner=(100, 200))
    away = lines.pixels - np.array(CENTRE) - np.array([100, 200])
    rho = np.linalg.norm(away, axis=1)
    # A circle's middle lies a little inwards of where a straight line's would.
    assert abs(np.median(rho) - CIRCLE) < 0.05
    assert np.std(rho) < 0.015
    assert np.abs(rho - np.median(rho)).max() < 0.05
    assert len(lines) == pytest.approx(2.0 * np.pi * CIRCLE * 1.15, rel=0.15)
    radial = np.abs(np.einsum("ij,ij->i", away / rho[:, None], lines.across))
    assert radial.min() > 0.999


def test_the_noise_of_a_line_is_what_noise_moves_it_by():
    rng = np.random.default_rng(5)
    image = circle()
    noisy = found_lines(image + rng.normal(0.0, 3.0, image.shape))
    away = noisy.pixels - np.array(CENTRE)
    moved = np.linalg.norm(away, axis=1)
    ratio = np.std(moved) / np.median(noisy.noise_px)
    assert 0.6 < ratio < 1.4


def test_what_is_faint_or_an_edge_is_no_line():
    assert len(found_lines(10.0 + 0.05 * circle())) == 0
    v, u = np.mgrid[:128, :160].astype(float)
    edge = 180.0 * ndtr((np.hypot(u - 80.0, v - 64.0) - 40.0) / 1.0)
    assert len(found_lines(edge)) < 20


def test_lines_alternate_with_gaps_and_must_fit_between_rings():
    patterns = RingsForCamera(LIGHTS["parallel"], np.array([0.02, 0.05]), np.zeros(3))
    lines = patterns.lines(0.002)
    np.testing.assert_allclose(lines.radii, [0.019, 0.021, 0.049, 0.051])


def rig(light: str) -> PairCalibration:
    """A projector of 1000 x 1000 px before a ball, a camera 35 degrees to its side."""
    pose = look_at(np.array([0.0, -1.0, 0.0]), np.zeros(3), UP)
    scale = 5000.0 if light == "parallel" else 2500.0
    matrix = np.array([[scale, 0, 499.5], [0, scale, 499.5], [0, 0, 1.0]])
    rings = DrawnRings(LIGHTS[light], RADII[light])
    projector = ProjectorCalibration(
        "P1", pose, matrix, (1000, 1000), pose, None, rings
    )
    a = np.deg2rad(35.0)
    eye = np.array([np.sin(a), -np.cos(a) * 0.95, np.cos(a) * 0.3])
    lens = np.array([[3000.0, 0, 639.5], [0, 3000.0, 359.5], [0, 0, 1.0]])
    camera = CameraCalibration(
        "C1", look_at(eye, np.zeros(3), UP), lens, (1280, 720), (0.0,) * 5
    )
    return PairCalibration(projector, camera)


def ring_points(light: str):
    """Pixels of exact ring points on the ball, seen by the camera; ring and root."""
    pair, radii = rig(light), RADII[light]
    turn = np.arange(400) * (2.0 * np.pi / 400)
    starts, rings = [], []
    for k, radius in enumerate(radii):
        flat = radius * np.column_stack([np.cos(turn), np.sin(turn)])
        starts.append(flat)
        rings.append(np.full(len(turn), k))
    flat, ring = np.concatenate(starts), np.concatenate(rings)
    # Device axes of look_at from -y: x is +x, y is -z, z is +y.
    if light == "parallel":
        across = np.column_stack([flat[:, 0], -flat[:, 1]])
        depth = np.sqrt(BALL**2 - np.sum(across**2, axis=1))
        points = np.column_stack([across[:, 0], -depth, across[:, 1]])
    else:
        beams = np.column_stack([flat[:, 0], np.ones(len(flat)), -flat[:, 1]])
        beams /= np.linalg.norm(beams, axis=1, keepdims=True)
        b = -beams[:, 1]
        t = -b - np.sqrt(b * b - (1.0 - BALL**2))
        points = np.array([0.0, -1.0, 0.0]) + t[:, None] * beams
    rays = points - pair.camera.centre
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    seen = np.einsum("ij,ij->i", rays, points) < -0.3 * BALL
    points, ring, rays = points[seen], ring[seen], rays[seen]
    patterns = ringed(pair.projector, radii).pattern_for(pair.camera)
    local = pair.projector.to_ring(points)
    plane = local[:, :2] / (local[:, 2:] if light == "diverging" else 1.0)
    root = np.where(patterns.root_side(plane) > 0.0, 1, -1)
    return pair, pair.camera.project(points), ring, root, points


def labelled(pixels: np.ndarray, *rig, tolerance_m: float):
    n = len(pixels)
    lines = ImageEdges(
        pixels, np.full(n, -1), np.zeros(n, np.int8), pixels, *np.zeros((3, n))
    )
    return label_by_prior(lines, *rig, tolerance_m=tolerance_m)


@pytest.fixture(scope="module")
def ball() -> TriangleMesh:
    return sphere(BALL, subdivisions=4)


@pytest.mark.parametrize("light", ["parallel", "diverging"])
@pytest.mark.parametrize("off_mm", [0.0, 2.0, -3.0])
def test_no_label_is_wrong_while_the_object_is_within_the_tolerance(
    ball, light, off_mm
):
    pair, pixels, ring, root, _ = ring_points(light)
    move = 1e-3 * off_mm * np.array([0.0, 0.8, 0.6])
    prior = TriangleMesh(ball.vertices + move, ball.faces)
    # The ball's faces lie up to 0.2 mm inside it.
    tolerance = 1e-3 * (abs(off_mm) + 0.3)
    found, rejected = labelled(pixels, pair, prior, tolerance_m=tolerance)
    sure = found.rings >= 0
    assert np.mean(sure) > 0.7
    np.testing.assert_array_equal(found.rings[sure], ring[sure])
    np.testing.assert_array_equal(found.roots[sure], root[sure])
    assert np.all(found.roots[~sure] == 0)
    assert sum(rejected.values()) == np.count_nonzero(~sure)


def test_labels_are_left_out_where_two_candidates_are_within_the_tolerance(ball):
    """By hand: one candidate or more of all rings and roots, tried one by one."""
    pair, pixels, _, _, _ = ring_points("parallel")
    tolerance = 6e-3
    count = np.zeros(len(pixels), dtype=int)
    rays = pair.camera.rays(pixels)
    for radius in RADII["parallel"]:
        for side in (1, -1):
            hits = intersect_rings(
                pair.camera.centre,
                rays,
                np.full(len(rays), radius),
                np.full(len(rays), side, np.int8),
                pair.projector,
            )
            p = hits.points
            away = np.abs(np.linalg.norm(p, axis=1) - BALL)
            # What runs deeper than the tolerance through the ball is hidden from the
            # camera, or from the beam along +y.
            beyond = np.einsum("ij,ij->i", p, rays)
            foot = p - np.maximum(beyond, 0.0)[:, None] * rays
            seen = (beyond < 0.0) | (np.linalg.norm(foot, axis=1) > BALL - tolerance)
            lit = (p[:, 1] < 0.0) | (np.hypot(p[:, 0], p[:, 2]) > BALL - tolerance)
            count += (away < tolerance) & seen & lit
    found, rejected = labelled(pixels, pair, ball, tolerance_m=tolerance)
    same = np.mean((count > 1) == (found.rings < 0))
    assert 0.05 < np.mean(count > 1) < 0.95
    assert same > 0.99
    assert rejected["off_prior"] == 0


def test_a_ring_outside_the_panel_is_no_candidate(ball):
    pair, pixels, ring, _, _ = ring_points("parallel")
    # The outermost ring has a radius of 50 mm.
    small = replace(pair.projector, beam_radius=0.045)
    less = PairCalibration(small, pair.camera)
    wide, narrow = (
        labelled(pixels, one, ball, tolerance_m=1e-3)[0].rings for one in (pair, less)
    )
    assert np.mean(wide[ring == 4] == 4) > 0.5
    assert not np.any(narrow == 4)
    np.testing.assert_array_equal(narrow[ring < 3], wide[ring < 3])


def test_a_prior_that_is_farther_off_than_the_tolerance_labels_nothing_right(ball):
    pair, pixels, ring, root, _ = ring_points("parallel")
    prior = TriangleMesh(ball.vertices + [0.0, 0.02, 0.0], ball.faces)
    found, rejected = labelled(pixels, pair, prior, tolerance_m=1e-3)
    assert rejected["off_prior"] > 0.8 * len(pixels)
    right = (found.rings == ring) & (found.roots == root)
    assert np.mean(right) < 0.02
    with pytest.raises(ValueError, match="tolerance_m must be positive"):
        labelled(pixels, pair, prior, tolerance_m=0.0)
