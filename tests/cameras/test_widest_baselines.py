"""Cameras slide apart only as far as what they measure allows."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from support.closed_forms import round_body_limit
from support.factories import make_workspace

from geometry.devices import PinholeModel
from geometry.poses import fibonacci_cap, look_at
from planning.cameras import camera_baselines
from planning.cameras.baselines.baseline_limits import (
    BaselineLimits,
    RingsOnSurface,
    best_rings,
)
from planning.cameras.baselines.baseline_terms import BaselineTerms
from planning.cameras.baselines.camera_moves import Looks
from planning.cameras.baselines.seams import SampledSurface
from planning.cameras.baselines.widest_baselines import BaselineSearch
from planning.model.devices.bodies import Box
from planning.model.devices.planned import PlannedCamera
from planning.model.requirements import TriangulationLimits
from planning.scene.codes.surfaces import CodeSurfaces
from planning.scene.limits.camera_limits import ViewedSamples
from planning.scene.limits.pair_limits import MEASURED
from planning.scene.measuring.measurability import first_pair_failure, pair_quality

THETA = np.radians(60.0)
RADIUS, RING = 0.1, 1.0
UP = np.array([0.0, 0.0, 1.0])
DEVICE = PinholeModel(
    np.array([[2000.0, 0, 319.5], [0, 2000.0, 239.5], [0, 0, 1]]),
    (640, 480),
    (0.3, 3.0),
)


def _workspace(**changes):
    return make_workspace(RADIUS, RING, **changes)


def _cameras(*directions, roll=0.3):
    poses = look_at(RING * np.array(directions), np.zeros(3), UP, roll=roll)
    return [PlannedCamera(f"C{i}", pose, DEVICE) for i, pose in enumerate(poses, 1)]


def _at(azimuth, height=0.0):
    flat = np.sqrt(1.0 - height * height)
    return [flat * np.cos(azimuth), flat * np.sin(azimuth), height]


class _Ball:
    """Samples of a band or cap of a sphere; nothing hides behind anything else."""

    def __init__(self, normals):
        self.normals = normals
        self.points = RADIUS * normals
        self.calls = []

    def measure(self, poses):
        self.calls.append(poses)
        measured = np.zeros((len(self.points), len(poses)), dtype=bool)
        for c, pose in enumerate(poses):
            ray = self.points - pose[:3, 3]
            facing = -np.einsum("ij,ij->i", ray, self.normals)
            facing /= np.linalg.norm(ray, axis=1)
            within = DEVICE.contains(DEVICE.project(ray @ pose[:3, :3]))
            measured[:, c] = within & (facing >= np.cos(THETA))
        return measured

    def spread(self, cameras, **changes):
        values = {
            "surface": SampledSurface(self.points, self.normals),
            "limits": BaselineLimits(THETA, 0.1, _workspace()),
            "max_evaluations": 16,
            **changes,
        }
        return BaselineSearch(cameras, self.measure, **values).run()


def _front(half_angle, n=800):
    return _Ball(fibonacci_cap(n, np.array([1.0, 0.0, 0.0]), half_angle))


def _weight(ball, cameras):
    poses = np.stack([camera.world_from_device for camera in cameras])
    return ball.measure(poses).any(axis=1).mean()


@pytest.fixture(scope="module")
def pair():
    """Two cameras too close together for the cap of 70 degrees that they measure."""
    ball = _front(np.radians(70.0))
    cameras = _cameras(_at(-0.35), _at(0.3))
    return ball, cameras, ball.spread(cameras)


def test_a_pair_slides_apart_and_loses_nothing(pair):
    ball, cameras, spread = pair
    apart = np.linalg.norm(
        np.subtract(*(camera.world_from_device[:3, 3] for camera in spread.cameras))
    )
    assert spread.smallest_before_m == pytest.approx(2 * np.sin(0.325))
    assert spread.smallest_after_m == pytest.approx(apart)
    assert spread.smallest_after_m > 1.15 * spread.smallest_before_m
    assert spread.smallest_after_m < round_body_limit(RADIUS, RING, THETA).d_max
    assert spread.smallest_after_m > spread.smallest_before_m
    assert _weight(ball, spread.cameras) >= _weight(ball, cameras)
    poses = np.stack([camera.world_from_device for camera in spread.cameras])
    np.testing.assert_array_equal(spread.measured_by, ball.measure(poses))


def test_a_move_that_more_samples_deny_is_not_taken(pair):
    ball, cameras, freely = pair
    start = np.stack([camera.world_from_device for camera in cameras])

    def apart(poses):
        return float(np.linalg.norm(poses[0, :3, 3] - poses[1, :3, 3]))

    held = ball.spread(cameras, confirm=lambda poses: apart(poses) <= apart(start))
    assert held.smallest_after_m == held.smallest_before_m
    assert held.smallest_after_m == pytest.approx(apart(start))
    limit = 0.5 * (freely.smallest_before_m + freely.smallest_after_m)
    part = ball.spread(cameras, confirm=lambda poses: apart(poses) <= limit)
    assert part.smallest_after_m > part.smallest_before_m
    assert freely.smallest_before_m < part.smallest_after_m <= limit


def test_moved_cameras_stay_in_the_workspace_keep_their_aim_and_their_roll(pair):
    ball, cameras, spread = pair
    part = ball.measure(np.stack([camera.world_from_device for camera in cameras]))
    for c, (before, after) in enumerate(zip(cameras, spread.cameras, strict=True)):
        pose = after.world_from_device
        assert (after.id, after.device) == (before.id, before.device)
        assert np.linalg.norm(pose[:3, 3]) == pytest.approx(RING)
        level = look_at(pose[:3, 3], pose[:3, 3] + pose[:3, 2], UP, roll=0.3)
        np.testing.assert_allclose(pose, level, atol=1e-9)
        # The axes before and after meet in the point that the camera looks at.
        old = before.world_from_device
        across = np.cross(old[:3, 2], pose[:3, 2])
        gap = (pose[:3, 3] - old[:3, 3]) @ across / np.linalg.norm(across)
        assert gap == pytest.approx(0.0, abs=1e-9)
        # Which lies where the middle of its part projects onto the axis.
        depth = np.mean((ball.points[part[:, c]] - old[:3, 3]) @ old[:3, 2])
        aim = old[:3, 3] + depth * old[:3, 2]
        np.testing.assert_allclose(
            np.cross(aim - pose[:3, 3], pose[:3, 2]), 0.0, atol=1e-9
        )


def test_the_budget_counts_every_call_and_the_answer_repeats(pair):
    _, cameras, first = pair
    ball = _front(np.radians(70.0))
    again = ball.spread(cameras)
    assert 3 < len(ball.calls) <= 16
    for a, b in zip(first.cameras, again.cameras, strict=True):
        np.testing.assert_array_equal(a.world_from_device, b.world_from_device)
    short = _front(np.radians(70.0))
    short.spread(cameras, max_evaluations=3)
    assert len(short.calls) <= 3


def test_no_move_is_taken_that_loses_coverage():
    ball = _front(np.radians(70.0))
    cameras = _cameras(_at(-0.35), _at(0.3))
    start = np.stack([camera.world_from_device for camera in cameras])
    honest = ball.measure
    first = honest(start).any(axis=1)

    def jealous(poses):
        measured = honest(poses) & first[:, None]
        if not np.array_equal(poses, start):
            measured[np.flatnonzero(first)[0]] = False
        return measured

    ball.measure = jealous
    spread = ball.spread(cameras)
    assert spread.smallest_after_m == spread.smallest_before_m
    for before, after in zip(cameras, spread.cameras, strict=True):
        np.testing.assert_array_equal(before.world_from_device, after.world_from_device)


def test_three_cameras_raise_their_smallest_baseline():
    ball = _front(np.radians(80.0))
    cameras = _cameras(_at(-0.7, 0.1), _at(0.1, -0.3), _at(0.5, 0.4))
    spread = ball.spread(cameras)
    # As far as shell and plane go; without them in the program it ends at 0.8 m.
    assert spread.smallest_after_m > 1.3
    assert _weight(ball, spread.cameras) >= _weight(ball, cameras)


def test_parts_stay_registered(monkeypatch):
    """Coverage alone would let the overlap shrink below what registration needs."""
    ball = _front(np.radians(70.0))
    cameras = _cameras(_at(-0.35), _at(0.3))
    start = np.stack([camera.world_from_device for camera in cameras])
    least = 0.8 * np.mean(ball.measure(start).all(axis=1))
    free = ball.spread(cameras)
    assert np.mean(free.measured_by.all(axis=1)) < least
    monkeypatch.setattr("planning.cameras.baselines.seams.MIN_OVERLAP_SHARE", least)
    held = ball.spread(cameras)
    assert np.mean(held.measured_by.all(axis=1)) >= least
    assert held.smallest_after_m > held.smallest_before_m


def test_cone_and_floor_hold():
    ball = _front(np.radians(70.0))
    space = _workspace(
        axis=(1.0, 0.0, 0.0),
        half_angle=0.45,
        camera_radius_m=(0.95, 1.05),
        floor_m=-0.05,
    )
    cameras = _cameras(_at(-0.35), _at(0.3))
    spread = ball.spread(cameras, limits=BaselineLimits(THETA, 0.1, space))
    assert spread.smallest_after_m > spread.smallest_before_m
    for camera in spread.cameras:
        position = camera.world_from_device[:3, 3]
        distance = np.linalg.norm(position)
        assert 0.95 - 1e-6 <= distance <= 1.05 + 1e-6
        assert position[0] >= np.cos(0.45) * distance - 1e-6
        assert position[2] >= -0.05 - 1e-6


def test_rings_hold_the_conditioning_that_the_caller_demands():
    """Rings about +x: no camera may come so near its blind curve as to lose samples."""
    ball = _front(np.radians(60.0))
    m = ball.points * np.array([0.0, 1.0, 1.0])
    m /= np.maximum(np.linalg.norm(m, axis=1, keepdims=True), 1e-9)
    seen = ball.measure

    def conditioned(poses):
        measured = seen(poses)
        for c, pose in enumerate(poses):
            ray = ball.points - pose[:3, 3]
            ray /= np.linalg.norm(ray, axis=1, keepdims=True)
            measured[:, c] &= np.abs(np.einsum("ij,ij->i", ray, m)) >= 0.1
        return measured

    ball.measure = conditioned
    cameras = _cameras(_at(-0.35), _at(0.3, 0.2))
    before = _weight(ball, cameras)
    n = len(m)
    rings = RingsOnSurface(
        m[None], np.full((1, n), 4e-3), np.full((1, n), 0.1), np.ones((n, 1), bool)
    )
    spread = ball.spread(cameras, rings=rings)
    assert spread.smallest_after_m > spread.smallest_before_m
    assert _weight(ball, spread.cameras) >= before


def test_seams_keep_free_what_is_asked_of_the_half_fields(pair):
    ball, cameras, _ = pair
    poses = np.stack([camera.world_from_device for camera in cameras])
    surface = SampledSurface(ball.points, ball.normals)
    plain, spared = (
        BaselineTerms(
            cameras,
            ball.measure(poses),
            surface,
            BaselineLimits(THETA, 0.1, _workspace(), spare_field=spare),
        )
        .problem(
            Looks(np.zeros((2, 3)), np.tile([0.0, 0.0, 1.0], (2, 1)), np.zeros(2)),
            [(0, 1)],
            np.zeros((0, 2), dtype=np.int64),
            0.1,
        )
        .seams.half_fields
        for spare in (0.0, 0.02)
    )
    assert len(plain)
    np.testing.assert_allclose(plain - spared, 0.02 - np.radians(0.1))


def test_what_rings_ask_is_what_measurability_says():
    """q t |v| / m.r and p t |v| / -N.r are s_N and the pitch, each over its limit."""
    rng = np.random.default_rng(8)
    ball = _front(np.radians(50.0), n=200)
    camera = _cameras(_at(0.4, 0.3))[0]
    pose = camera.world_from_device
    ring = rng.normal(size=(2, 200, 3))
    ring /= np.linalg.norm(ring, axis=2, keepdims=True)
    spacing, light = rng.uniform(2e-3, 5e-3, (2, 200)), rng.uniform(0.5, 1.0, (2, 200))
    lit = rng.random((200, 2)) < 0.6
    rings = RingsOnSurface(ring, spacing, 0.1 / light, lit)
    surface = SampledSurface(ball.points, ball.normals)
    limits = BaselineLimits(THETA, 0.1, _workspace(), 6.0, 3e-4)
    rows = np.flatnonzero(lit.any(axis=1))
    m, q, p, spare = best_rings(camera, rows, surface, rings, limits)

    ray = ball.points[rows] - pose[:3, 3]
    t = np.linalg.norm(ray, axis=1)
    r, normal = ray / t[:, None], ball.normals[rows]
    jacobian = pose[:3, :3] @ DEVICE.ray_jacobian(ray @ pose[:3, :3])
    view = ViewedSamples(
        np.zeros(len(rows)), r, t, -np.sum(r * normal, axis=1), jacobian, 0.0 * r
    )
    asked = TriangulationLimits(0.1, 0.1, 3e-4, 6.0)
    measured = np.zeros((len(rows), 2), dtype=bool)
    for k in range(2):
        incidence = SimpleNamespace(incidence_cos=light[k, rows])
        drawn = CodeSurfaces(t, t, t, t, ring[k, rows], spacing[k, rows], 0.0 * r)
        quality = pair_quality(normal, incidence, drawn, view, asked)
        measured[:, k] = first_pair_failure(quality, asked) == MEASURED
        measured[:, k] &= lit[rows, k]
        mine = np.all(np.isclose(np.abs(m), np.abs(ring[k, rows])), axis=1)
        v = normal * np.sum(r * m, axis=1)[:, None] + m * view.facing[:, None]
        length = (t * np.linalg.norm(v, axis=1))[mine] / 1.002
        sigma = 3e-4 * q[mine] * length / np.sum(r * m, axis=1)[mine]
        np.testing.assert_allclose(sigma, quality.sigma[mine])
        pitch = 6.0 * view.facing[mine] / (p[mine] * length)
        np.testing.assert_allclose(pitch, quality.pitch[mine])
    assert np.all(np.sum(r * m, axis=1) > 0.0)
    assert 0.1 < measured.mean() < 0.9
    np.testing.assert_array_equal(spare >= 0.0, measured.any(axis=1))


def test_one_camera_or_strangers_have_no_baseline():
    ball = _front(np.radians(50.0))
    alone = ball.spread(_cameras(_at(0.0)))
    assert alone.smallest_before_m is None
    assert alone.smallest_after_m is None
    assert len(ball.calls) == 1
    sides = _Ball(
        np.concatenate(
            [
                fibonacci_cap(300, np.array([x, 0.0, 0.0]), np.radians(40.0))
                for x in (1.0, -1.0)
            ]
        )
    )
    apart = sides.spread(_cameras(_at(0.0), _at(np.pi)))
    assert apart.smallest_before_m is None
    assert len(sides.calls) == 1


def test_what_stands_already_stays_and_zones_hold_the_others():
    """Three cameras before a ball; the left one is given, a volume bars the right."""
    ball = _front(np.radians(70.0))
    axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    bar = Box("bar", (0.8, 0.8, 0.0), (1.0, 0.42, 1.0), axes)  # y from 0.38 to 1.22
    space = _workspace(camera_radius_m=(0.95, 1.05), keep_out=(bar,))
    cameras = _cameras(_at(-0.35), _at(0.3))
    cameras[0] = replace(cameras[0], existing="old")
    free = ball.spread(cameras, limits=BaselineLimits(THETA, 0.1, _workspace()))
    assert free.cameras[1].world_from_device[1, 3] > 0.39
    spread = ball.spread(cameras, limits=BaselineLimits(THETA, 0.1, space))
    assert spread.smallest_after_m > spread.smallest_before_m
    for found in (free, spread):
        moved, old = (s[0].world_from_device for s in (found.cameras, cameras))
        assert np.array_equal(moved, old)
    barred = spread.cameras[1].world_from_device[:3, 3]
    assert 0.3 < barred[1] <= 0.38 + 1e-6


def test_mounted_cameras_slide_along_their_plane():
    """The proposals themselves keep to it: a plane of 1 mm is never hit by chance."""
    ball = _front(np.radians(70.0))
    # Slanted, so that sliding straight apart would leave it.
    cosine, sine = np.cos(0.4), np.sin(0.4)
    axes = ((-sine, cosine, 0.0), (0.0, 0.0, 1.0), (cosine, sine, 0.0))
    plane = Box("wall", (1.05, 0.0, 0.0), (1.0, 0.2, 0.0005), axes)
    places = np.array(plane.centre_m) + np.outer([-0.25, 0.3], axes[0])
    space = _workspace(camera_radius_m=(0.95, 1.25), mounting=(plane,))
    poses = look_at(places, np.zeros(3), UP)
    cameras = [PlannedCamera(f"C{i}", pose, DEVICE) for i, pose in enumerate(poses, 1)]
    spread = ball.spread(cameras, limits=BaselineLimits(THETA, 0.1, space))
    # As far as shell and plane go; without them in the program it ends at 0.8 m.
    assert spread.smallest_after_m > 1.3
    for camera in spread.cameras:
        position = camera.world_from_device[:3, 3]
        off = (position - plane.centre_m) @ np.array(axes[2])
        assert abs(off) <= 0.0005 + 1e-6
        assert abs(position[2]) <= 0.2 + 1e-6


@pytest.mark.parametrize(("n_cameras", "most"), [(1, 180), (6, 30), (24, 7), (90, 4)])
def test_more_cameras_get_fewer_of_the_larger_programs(monkeypatch, n_cameras, most):
    given = []

    def search(*_, max_programs, **__):
        given.append(max_programs)
        return SimpleNamespace(run=lambda: None)

    monkeypatch.setattr(camera_baselines, "BaselineSearch", search)
    monkeypatch.setattr(camera_baselines, "baseline_limits", lambda *_: None)
    monkeypatch.setattr(camera_baselines, "_keeping_floors", lambda *_: [])
    scene = SimpleNamespace(requirements=SimpleNamespace(survival=None))
    samples = SimpleNamespace(
        scene=scene, surface=None, rings=None, count_lit=lambda cameras: 0
    )
    cameras = [None] * n_cameras
    camera_baselines.widen_baselines(samples, cameras)
    camera_baselines.widen_baselines(samples, cameras, max_programs=0)
    assert given == [most, 0]
