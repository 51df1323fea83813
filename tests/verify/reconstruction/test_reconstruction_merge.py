"""Clouds of plates merged: what stays, what goes at a step, and how sure it is."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import KDTree
from support import reconstruction_rigs as rigs

from geometry.mesh.mesh import TriangleMesh
from planning.model.devices.calibration_errors import CalibrationErrors
from planning.verify.reconstruction.check.calibration_sigma import (
    _SHARE,
    _deviations,
    _off,
    camera_px,
)
from planning.verify.reconstruction.check.merge import Merged, merge
from planning.verify.reconstruction.check.overlaps import compare_overlaps
from planning.verify.reconstruction.check.rings.ring_fit import Lines
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.decode.decode import Pairs
from planning.verify.reconstruction.decode.lit_image import LitImage
from planning.verify.reconstruction.render.photometry import Photometry
from planning.verify.reconstruction.render.rendered import Spent, decode_rendered
from planning.verify.reconstruction.scanner import Scanner

WIDE, TALL, HEIGHT = 0.035, 0.030, 0.02
GAP, WIDER = 12e-3, 1.13
PITCH_PX = GAP * 3478.0


def plates(*edges: tuple[float, float, float]) -> TriangleMesh:
    """Rectangles from x to x at y, that face the rig."""
    corners = [
        [[a, y, -TALL], [b, y, -TALL], [b, y, TALL], [a, y, TALL]] for a, b, y in edges
    ]
    faces = [[[4 * k, 4 * k + 1, 4 * k + 2], [4 * k, 4 * k + 2, 4 * k + 3]]
             for k in range(len(edges))]  # fmt: skip
    return TriangleMesh(np.concatenate(corners), np.concatenate(faces))


FLAT = plates((-WIDE, WIDE, 0.0))
STEP = plates((-WIDE, 0.0, -HEIGHT), (-WIDE, WIDE, 0.0))


def scanner_of(mesh: TriangleMesh, second: float = 1.0) -> Scanner:
    """Two parallel projectors of few rings, and two small cameras.

    Their rings coincide on the plane unless those of the second are farther apart.
    """
    cameras = rigs.two_small_cameras()
    for entry in cameras:
        entry["K"] = [[3478.0, 0.0, 159.5], [0.0, 3478.0, 119.5], [0.0, 0.0, 1.0]]
    projectors = [
        rigs.parallel(name, rigs.direction(azimuth, 5.0), 1.05 * mesh.radius, gap)
        for name, azimuth, gap in (("P1", -20.0, GAP), ("P2", 20.0, second * GAP))
    ]
    return Scanner.of(rigs.plan_of(mesh, projectors, cameras))


def decoded(mesh: TriangleMesh, albedo: float, second: float = 1.0) -> Pairs:
    plan = scanner_of(mesh, second)
    light = Photometry(albedo_variation=albedo)
    return decode_rendered(plan, plan, light, seed=0, threads=1, spent=Spent())


def joined(pairs: Pairs) -> Cloud:
    return Cloud.join([pair.cloud.of_devices(*key) for key, pair in pairs])


def merged(pairs: Pairs, mesh: TriangleMesh, second: float = 1.0) -> Merged:
    lit = {key: pair.lit for key, pair in pairs}
    cloud = joined(pairs)
    return merge(cloud, scanner_of(mesh, second), lit, pitch_px=PITCH_PX)


def off_step(cloud: Cloud) -> np.ndarray:
    """Distance from the nearer plate; the face of the step itself isn't there."""
    x, y, _ = cloud.points.T
    high = np.where(x < 0.5e-3, np.abs(y + HEIGHT), np.inf)
    return np.minimum(np.abs(y), high)


@pytest.fixture(scope="module")
def flat() -> Pairs:
    return decoded(FLAT, 0.0)


@pytest.fixture(scope="module")
def sparse() -> Pairs:
    """Two ring sets that fell on different places."""
    return decoded(FLAT, 0.0, WIDER)


@pytest.fixture(scope="module")
def stepped() -> Pairs:
    return decoded(STEP, 0.0)


def test_false_points_at_a_step_go_or_are_known_to_be_unsure(stepped):
    found = merged(stepped, STEP)
    before, after = off_step(joined(stepped)), off_step(found.cloud)
    assert np.count_nonzero(before > 0.3e-3) > 300
    wrong = after > 0.3e-3
    assert np.count_nonzero(wrong) < 80
    assert np.mean(after[wrong] < 4.0 * found.sigma[wrong]) > 0.9
    # The right ones aren't taken for wrong, whatever false ones contradict them.
    assert not found.steps[before < 0.1e-3].any()
    assert np.mean(found.sigma[~wrong] < 0.1e-3) > 0.95
    assert np.sqrt(np.mean(after**2)) < 0.5 * np.sqrt(np.mean(before**2))


def test_the_mesh_is_not_looked_at(stepped):
    """Merged about another object it is the same cloud."""
    one, other = merged(stepped, STEP), merged(stepped, FLAT)
    np.testing.assert_array_equal(one.cloud.points, other.cloud.points)


def test_a_merged_plane_is_better_than_any_of_its_parts(flat):
    cloud, found = joined(flat), merged(flat, FLAT)
    error = np.abs(cloud.points[:, 1])
    parts = [
        np.sqrt(np.mean(error[(cloud.projector == p) & (cloud.camera == c)] ** 2))
        for p in (0, 1)
        for c in (0, 1)
    ]
    after = np.abs(found.cloud.points[:, 1])
    assert np.sqrt(np.mean(after**2)) < 0.75 * min(parts)
    known = np.isfinite(found.sigma)
    assert known.mean() > 0.9
    assert 0.4 < np.sqrt(np.mean((after / found.sigma)[known] ** 2)) < 1.6
    np.testing.assert_allclose(found.normals[known, 1], -1.0, atol=0.02)
    assert not found.steps.any()


@pytest.mark.parametrize("second", [1.0, WIDER])
def test_two_ring_sets_on_a_plane_lose_nothing_of_completeness(flat, sparse, second):
    """At half a gap, one and two, on a lattice finer than the merging."""
    pairs = flat if second == 1.0 else sparse
    cloud, found = joined(pairs), merged(pairs, FLAT, second)
    assert 0.01 < np.mean(~found.stays) < 0.6
    x, z = np.meshgrid(np.linspace(-WIDE, WIDE, 141), np.linspace(-TALL, TALL, 121))
    lattice = np.column_stack([x.ravel(), np.zeros(x.size), z.ravel()])
    before, after = (
        KDTree(points).query(lattice)[0]
        for points in (cloud.points, found.cloud.points)
    )
    for gaps in (0.5, 1.0, 2.0):
        near = before <= gaps * GAP
        # Copies of a point lie up to a pixel and a half beside each other.
        assert np.all(after[near] <= gaps * GAP + 0.3e-3)
        # Points move onto their lines, too: 27 of 17,061 places at half a gap.
        assert np.mean(near) - np.mean(after <= gaps * GAP) < 1.6e-3
    gone = cloud.points[~found.stays]
    assert KDTree(found.cloud.points).query(gone)[0].max() < 0.9e-3
    kept = np.bincount(found.cloud.projector) / np.bincount(cloud.projector)
    assert kept.min() > (0.3 if second == 1.0 else 0.9)


def test_texture_does_not_change_which_pixels_overlap(flat):
    textured = decoded(FLAT, 0.5)
    for pairs in (flat, textured):
        assert merged(pairs, FLAT).shared.mean() > 0.99
    for c in (0, 1):
        plain, rough = (
            np.minimum(*(pair.lit.shown > 0 for (_, k), pair in pairs if k == c))
            for pairs in (flat, textured)
        )
        assert plain.mean() > 0.3
        assert np.mean(plain == rough) > 0.995


def test_light_of_one_projector_is_no_overlap(flat):
    """Without the other's images a point is judged by its own ring alone."""
    alone = [(key, pair) for key, pair in flat if key[0] == 0]
    assert not merged(alone, FLAT).shared.any()


def test_light_of_the_other_projector_says_where_a_point_can_be(sparse):
    """In its annulus anywhere; where its ring crosses the pixel, on that ring."""
    cloud = joined(sparse)
    lit = {key: pair.lit for key, pair in sparse}

    def moved(gaps: float) -> tuple[np.ndarray, np.ndarray]:
        there = replace(cloud, points=cloud.points + gaps * GAP * cloud.rays)
        return compare_overlaps(there, scanner_of(FLAT, WIDER), lit)[1:]

    crossed, differs = moved(0.0)
    assert np.count_nonzero(crossed) > 20
    assert not differs.any()
    assert moved(6.0)[1].mean() > 0.7
    # Still in one of both annuli, but off the ring between them.
    little = moved(0.6)[1]
    assert little[crossed].mean() > 0.9 > 0.2 > little[~crossed].mean()


def test_of_two_copies_the_surer_one_stays(flat):
    for noisy in (0, 1):
        worse = [
            (key, replace(pair, cloud=noisier(pair.cloud)) if key[0] == noisy else pair)
            for key, pair in flat
        ]
        cloud, found = joined(worse), merged(worse, FLAT)
        gone = np.bincount(cloud.projector[~found.stays], minlength=2)
        assert gone[noisy] > 3 * gone[1 - noisy]


def test_what_one_camera_measures_much_worse_gives_way_to_another(flat):
    """Under one projector, too; but not what is nearly as sure."""
    for more_px, least, most in ((0.05, 0.0, 0.2), (0.5, 0.6, 1.0)):
        alone = [
            (key, replace(pair, cloud=noisier(pair.cloud, more_px * key[1])))
            for key, pair in flat
            if key[0] == 0
        ]
        cloud, found = joined(alone), merged(alone, FLAT)
        gone = [np.mean(~found.stays[cloud.camera == c]) for c in (0, 1)]
        assert gone[0] < 0.05
        assert least <= gone[1] < most


def test_what_a_calibration_leaves_decides_between_cameras(flat):
    """Over the plan's limit one gives way; where no limit is stated both stay."""
    alone = [(key, pair) for key, pair in flat if key[0] == 0]
    cloud = joined(alone)
    lit = {key: pair.lit for key, pair in alone}
    plan = scanner_of(FLAT)
    plan = replace(plan, calibration=CalibrationErrors(np.radians(0.02), 5e-5))

    def merged_at(most):
        limits = replace(plan.limits, max_sigma_m=most)
        return merge(cloud, replace(plan, limits=limits), lit, pitch_px=PITCH_PX)

    every = merged_at(np.inf)
    total = np.hypot(every.sigma, every.calibration)
    medians = [np.median(total[every.cloud.camera == c]) for c in (0, 1)]
    worse = int(np.argmax(medians))
    assert medians[worse] > 1.2 * medians[1 - worse]
    found = merged_at(float(np.mean(medians)))
    for camera, least, most in ((worse, 0.7, 1.0), (1 - worse, 0.0, 0.05)):
        lost = np.mean(~found.stays[every.stays & (cloud.camera == camera)])
        assert least <= lost <= most


def test_an_edge_is_as_unsure_as_its_camera(flat):
    """Against the pixels of cameras that are off by one thing each, on their axes."""
    plan = scanner_of(FLAT)
    errors = CalibrationErrors(np.radians(0.02), 5e-5, 2e-4, 0.3)
    plan = replace(plan, calibration=errors)
    (cloud, *_) = [pair.cloud.take(np.arange(40)) for _, pair in flat]
    camera = plan.cameras[int(cloud.camera[0])]
    known = camera.project(cloud.points)
    square = np.zeros(len(cloud))
    for off in _off(camera, _SHARE * _deviations(errors)):
        # Of both directions in the image the mean, and errors a share of theirs.
        square += np.square(off.project(cloud.points) - known).sum(axis=1) / 2.0
    cloud = replace(cloud, pixels=known)
    assert camera_px(cloud, plan) == pytest.approx(np.sqrt(square) / _SHARE, rel=0.02)


def noisier(cloud: Cloud, more_px: float = 0.1) -> Cloud:
    return replace(cloud, noise_px=cloud.noise_px + more_px)


def test_doubt_of_a_pair_is_not_averaged_away(flat):
    def unsure(cloud: Cloud) -> Cloud:
        return replace(cloud, noise_px=np.full(len(cloud), 0.8))

    doubted = [(key, replace(pair, cloud=unsure(pair.cloud))) for key, pair in flat]
    assert np.all(merged(doubted, FLAT).cloud.noise_px == 0.8)


def test_lines_turn_towards_the_slope_along_which_noise_moves_points():
    """Errors in variables: by the share of the places' spread that is noise."""
    rng, noise, shape, slide = np.random.default_rng(0), 0.1, 2.0, -1.0
    one, other = np.triu_indices(60, 1)
    slopes, shares = [], []
    for _ in range(200):
        true, slid = rng.uniform(0.0, 1.0, 60), noise * rng.standard_normal(60)
        places, values = true + slid, shape * true + slide * slid
        lines = Lines.of(one, other, places[other] - places[one], np.ones(60))
        slopes.append(lines.through(values)[0].mean())
        shares.append(lines.astray(np.full(60, noise)).mean())
    share = np.mean(shares)
    assert share == pytest.approx(noise**2 / (1.0 / 12.0 + noise**2), rel=0.05)
    assert np.mean(slopes) == pytest.approx(
        (1.0 - share) * shape + share * slide, rel=0.01
    )


def test_annuli_about_a_pixel():
    index = np.full((6, 8), 3, np.int16)
    index[:, 4:] = 4
    index[0] = -1
    lit = LitImage.of(index, (10, 20))
    places = np.array([[12, 23], [13, 23], [14.4, 23.0], [13, 21], [13, 20], [30, 3.0]])
    low, high = lit.around(places)
    assert low.tolist() == [3, 3, 3, 3, -1, -1]
    assert high.tolist() == [3, 4, 4, 4, -1, -1]
    assert LitImage.of(np.full((4, 4), 300, np.int16), (0, 0)).shown.max() == 301


def test_nothing_merges_to_nothing():
    found = merge(Cloud.empty(), scanner_of(FLAT), {}, pitch_px=1.0)
    assert len(found.cloud) == len(found.sigma) == len(found.stays) == 0
