"""Seams, neighbours and the rows of eqs. (9)-(10), on surfaces of known answer."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.closed_forms import flat_limit

from geometry.devices import PinholeModel
from geometry.poses import look_at
from planning.cameras.baselines.baseline_rows import (
    baseline_rows,
    check_seam,
    half_field,
)
from planning.cameras.baselines.seams import (
    SampledSurface,
    Seam,
    both_orders,
    find_seam,
    neighbouring_pairs,
    overlap_components,
)
from planning.model.devices.planned import PlannedCamera

K = np.array([[800.0, 0.0, 319.5], [0.0, 800.0, 239.5], [0.0, 0.0, 1.0]])
RESOLUTION = (640, 480)
RANGE = (0.3, 3.0)
UP = np.array([0.0, 1.0, 0.0])
THETA = np.radians(70.0)

POINT = SampledSurface(np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]))


def _device(**changes):
    values = {"camera_matrix": K, "resolution": RESOLUTION, "range_m": RANGE, **changes}
    return PinholeModel(**values)


def _camera(name, position, aim, device=None):
    pose = look_at(np.array(position, float), np.array(aim, float), UP)
    return PlannedCamera(name, pose, device or _device())


def _wall(n=6000, seed=0):
    """Samples of the wall z = 0, seen from z > 0."""
    rng = np.random.default_rng(seed)
    points = np.column_stack(
        [rng.uniform(-0.9, 0.9, n), rng.uniform(-0.2, 0.2, n), np.zeros(n)]
    )
    return points, np.tile([0.0, 0.0, 1.0], (n, 1))


def _in_image(camera, points):
    pose = camera.world_from_device
    return camera.device.contains(
        camera.device.project((points - pose[:3, 3]) @ pose[:3, :3])
    )


def _facing(separation, z=(1.0, 1.0)):
    x = 0.5 * separation
    return (
        _camera("C1", (-x, 0.0, z[0]), (-x, 0.0, 0.0)),
        _camera("C2", (x, 0.0, z[1]), (x, 0.0, 0.0)),
    )


def _rows(cameras, points, normals):
    measured = np.stack([_in_image(camera, points) for camera in cameras], axis=1)
    rows = baseline_rows(cameras, SampledSurface(points, normals), measured, THETA)
    return [row.to_document() for row in rows]


def test_a_row_can_be_recomputed_from_the_poses_and_itself():
    cameras = _facing(0.6, z=(1.0, 1.2))
    points, normals = _wall()
    rows = json.loads(json.dumps(_rows(cameras, points, normals)))
    assert [row["cameras"] for row in rows] == [["C1", "C2"], ["C2", "C1"]]
    poses = {camera.id: camera.world_from_device for camera in cameras}
    for row in rows:
        one, two = (poses[name] for name in row["cameras"])
        e = np.array(row["E"])
        to1, to2 = one[:3, 3] - e, two[:3, 3] - e
        d1, d2 = np.linalg.norm(to1), np.linalg.norm(to2)
        d = np.linalg.norm(one[:3, 3] - two[:3, 3])
        assert row["D1"] == pytest.approx(d1)
        assert row["D2"] == pytest.approx(d2)
        assert row["d"] == pytest.approx(d)
        assert row["phi"] == pytest.approx(np.arccos(to1 @ to2 / (d1 * d2)))
        # Two axes square to the wall: the axial part is the difference of standoffs.
        assert row["d_axial"] == pytest.approx(0.2)
        assert row["d_lateral"] == pytest.approx(0.6)
        assert row["d_lateral"] ** 2 + row["d_axial"] ** 2 == pytest.approx(d**2)
        limit = np.sqrt(d1**2 + d2**2 - 2 * d1 * d2 * np.cos(row["phi_max"]))
        assert row["d_max"] == pytest.approx(limit)
        assert row["slack"] == pytest.approx(row["phi_max"] - row["phi"])
        assert row["covered"] is (row["phi"] < row["phi_max"]) is True
        assert row["limit"] == "camera_field"
        for i, pose in ((0, one), (1, two)):
            standoff = (e - pose[:3, 3]) @ pose[:3, 2]
            assert row[f"standoff{i + 1}"] == pytest.approx(standoff)
            extent = standoff * np.tan(row["half_field"][i])
            assert row[f"C{i + 1}"] == pytest.approx(extent)


def test_slack_of_a_row_is_what_the_wall_says():
    separation = 0.6
    points, normals = _wall(20000)
    row = _rows(_facing(separation), points, normals)[0]
    # E is the end of camera 1's field, at x = -0.3 + tan(b).
    half = np.arctan(320.0 / 800.0)
    at = -0.3 + np.tan(half) - 0.3
    assert row["E"][0] == pytest.approx(-0.3 + np.tan(half), abs=0.02)
    # Least where E lies above the axes: b in the plane O1, E, O2 is smaller there.
    assert 0.9 * (half + np.arctan(at)) < row["slack"] < half + np.arctan(at) + 0.02


@pytest.mark.parametrize("z", [(1.0, 1.0), (1.0, 1.3)])
@pytest.mark.parametrize("beyond", [-1e-6, 1e-6])
def test_flat_wall_parts_at_the_sum_of_half_extents(z, beyond):
    c1, c2 = (0.4 * height for height in z)
    limit = flat_limit(c1, c2)
    one = _camera("C1", (-c1, 0.0, z[0]), (-c1, 0.0, 0.0))
    two = _camera("C2", (limit - c1 + beyond, 0.0, z[1]), (limit - c1 + beyond, 0, 0))
    seam = Seam((0, 1), np.array([0]), np.array([0]), np.array([1.0, 0.0, 0.0]), True)
    test = check_seam((one, two), POINT, seam, THETA)
    assert test.half_field1[0] == pytest.approx(test.angles.beta1[0])
    assert (test.slack[0] > 0) == (beyond < 0)
    assert test.slack[0] == pytest.approx(0.0, abs=1e-5)


@pytest.mark.parametrize("beyond", [-1e-6, 1e-6])
def test_each_camera_counts_the_side_of_its_field_that_faces_the_other(beyond):
    matrix = K.copy()
    matrix[0, 2] = 99.5  # 100 px to the left of the axis, 540 to the right.
    device = _device(camera_matrix=matrix)
    x = (-540 / 800, 100 / 800 + beyond)
    cameras = [
        _camera(f"C{i}", (at, 0.0, 1.0), (at, 0.0, 0.0), device)
        for i, at in enumerate(x, 1)
    ]
    seam = Seam((0, 1), np.array([0]), np.array([0]), np.array([1.0, 0.0, 0.0]), True)
    test = check_seam(cameras, POINT, seam, THETA)
    assert np.tan(test.half_field1[0]) == pytest.approx(540 / 800)
    assert np.tan(test.half_field2[0]) == pytest.approx(100 / 800)
    assert (test.slack[0] > 0) == (beyond < 0)


def test_parts_that_touch_are_neighbours_and_parts_apart_are_none():
    points, normals = _wall()
    for separation, rows in ((0.79, 2), (0.80, 2), (0.86, 0)):
        assert len(_rows(_facing(separation), points, normals)) == rows, separation
    assert all(row["covered"] for row in _rows(_facing(0.76), points, normals))


def test_the_field_beyond_an_edge_of_a_box():
    """Camera 1 over the top (normal +z), camera 2 before the side (normal +x)."""
    one = _camera("C1", (-0.3, 0.0, 1.0), (-0.3, 0.0, 0.0))
    two = _camera("C2", (1.0, 0.0, -0.3), (0.0, 0.0, -0.3))
    points = np.array([[-1e-3, 0.0, 0.0], [0.0, 0.0, -1e-3]])
    normals = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    seam = Seam((0, 1), np.array([0]), np.array([1]), points[1] - points[0], True)
    test = check_seam((one, two), SampledSurface(points, normals), seam, THETA)
    assert test.angles.delta_surface[0] == pytest.approx(np.pi / 2)
    iota = np.arctan(0.3)
    assert test.angles.iota1[0] == pytest.approx(iota, abs=2e-3)
    assert test.angles.iota2[0] == pytest.approx(iota, abs=2e-3)
    assert test.angles.phi[0] == pytest.approx(np.pi / 2 + 2 * iota, abs=2e-3)
    assert test.phi_max[0] == pytest.approx(np.pi / 2 + iota + np.arctan(0.4), abs=4e-3)


def test_half_field_of_an_off_centre_image():
    matrix = K.copy()
    matrix[0, 2] = 99.5
    camera = _camera(
        "C", (0.0, 0.0, 1.0), (0.0, 0.0, 0.0), _device(camera_matrix=matrix)
    )
    pose = camera.world_from_device
    along = np.tile(pose[:3, 2], (4, 1))
    towards = np.stack([pose[:3, 0], -pose[:3, 0], pose[:3, 1], -pose[:3, 1]])
    np.testing.assert_allclose(
        np.tan(half_field(camera, along, towards, np.zeros(4))),
        [540 / 800, 100 / 800, 240 / 800, 240 / 800],
    )


@pytest.mark.parametrize("k1", [1e-12, -0.15, 0.2])
def test_half_field_under_distortion_ends_at_the_image_border(k1):
    device = _device(
        distortion=(k1, 0.0, 0.002, -0.001, 0.0) if abs(k1) > 1e-6 else (k1, 0, 0, 0, 0)
    )
    camera = _camera("C", (0.2, 0.1, 1.0), (0.0, 0.0, 0.0), device)
    pose = camera.world_from_device
    rng = np.random.default_rng(4)
    turn = rng.uniform(0.0, 2 * np.pi, 40)
    side = np.cos(turn)[:, None] * pose[:3, 0] + np.sin(turn)[:, None] * pose[:3, 1]
    # Planes that miss the axis: lean `along` to the other side by up to 8 degrees.
    lean = np.cross(side, pose[:3, 2]) * np.tan(rng.uniform(-0.14, 0.14, 40))[:, None]
    along = pose[:3, 2] + lean
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    half = half_field(camera, along, side, np.zeros(40))
    rays = np.cos(half)[:, None] * along + np.sin(half)[:, None] * side
    pixels = device.project(rays @ pose[:3, :3])
    outside = np.maximum(-0.5 - pixels, pixels - (np.array(RESOLUTION) - 0.5))
    np.testing.assert_allclose(outside.max(axis=1), 0.0, atol=1e-6)
    if abs(k1) < 1e-6:
        straight = _camera("C", (0.2, 0.1, 1.0), (0.0, 0.0, 0.0))
        np.testing.assert_allclose(
            half, half_field(straight, along, side, np.zeros(40)), atol=1e-9
        )


def test_half_field_of_a_point_outside_a_distorted_image_is_where_it_begins():
    device = _device(distortion=(-0.1, 0.0, 0.0, 0.0, 0.0))
    camera = _camera("C", (0.0, 0.0, 1.0), (0.0, 0.0, 0.0), device)
    along = camera.world_from_device[None, :3, 2]
    towards = camera.world_from_device[None, :3, 0]
    inside = half_field(camera, along, towards, np.array([0.1]))
    assert half_field(camera, along, towards, np.array([0.6])) == pytest.approx(inside)


def test_a_rigid_motion_keeps_every_length_and_angle_of_a_row():
    points, normals = _wall()
    cameras = _facing(0.6, z=(1.0, 1.2))
    measured = np.stack([_in_image(camera, points) for camera in cameras], axis=1)
    turn = Rotation.random(rng=2).as_matrix()
    motion = np.eye(4)
    motion[:3, :3], motion[:3, 3] = turn, (0.3, -1.0, 2.0)
    moved = [
        PlannedCamera(c.id, motion @ c.world_from_device, c.device) for c in cameras
    ]
    still = baseline_rows(cameras, SampledSurface(points, normals), measured, THETA)
    surface = SampledSurface(points @ turn.T + motion[:3, 3], normals @ turn.T)
    there = baseline_rows(moved, surface, measured, THETA)
    for a, b in zip(still, there, strict=True):
        for key in ("standoff1", "C2", "D1", "phi", "phi_max", "d_lateral", "d_axial"):
            expected = pytest.approx(getattr(a, key), abs=1e-9)
            assert getattr(b, key) == expected, key


def test_seam_samples_are_shared_and_border_on_the_other_stretch():
    points, normals = _wall()
    cameras = _facing(0.6)
    measured = np.stack([_in_image(camera, points) for camera in cameras], axis=1)
    seam = find_seam((0, 1), SampledSurface(points, normals), measured)
    assert seam.shares_border
    assert np.all(measured[seam.points])
    assert np.all(~measured[seam.beyond, 0] & measured[seam.beyond, 1])
    # Camera 1's field ends at x = -0.3 + 0.4: within a few sample distances of that.
    assert np.all(np.abs(points[seam.points, 0] - 0.1) < 0.05)
    assert seam.onward[0] > 0.9 * np.linalg.norm(seam.onward)


def test_seam_samples_are_in_camera_2s_reach_unless_the_parts_only_touch():
    points, normals = _wall(1500)
    surface = SampledSurface(points, normals)
    for separation, shared in ((0.785, True), (0.8, False)):
        measured = np.stack(
            [_in_image(camera, points) for camera in _facing(separation)], axis=1
        )
        seam = find_seam((0, 1), surface, measured)
        assert np.all(measured[seam.points, 0])
        assert np.all(measured[seam.points, 1] == shared)


def test_every_pair_has_a_seam_in_both_orders_whatever_is_measured():
    rng = np.random.default_rng(1)
    for trial in range(40):
        n = int(rng.integers(2, 120))
        points = rng.uniform(0, 1, (n, 3)) * [1.0, 1.0, 0.0]
        normals = np.tile([0.0, 0.0, 1.0], (n, 1))
        measured = rng.random((n, 3)) < rng.uniform(0.05, 0.9)
        surface = SampledSurface(points, normals)
        for order in both_orders(neighbouring_pairs(measured, surface)):
            assert len(find_seam(order, surface, measured).points), trial


def test_a_part_inside_another_is_tested_where_both_measure():
    points, normals = _wall(500)
    measured = np.ones((500, 2), dtype=bool)
    measured[:, 1] = np.abs(points[:, 0]) < 0.2
    seam = find_seam((0, 1), SampledSurface(points, normals), measured)
    assert not seam.shares_border
    np.testing.assert_array_equal(seam.points, np.flatnonzero(measured[:, 1]))


def test_two_sides_of_a_thin_wall_are_not_beside_each_other():
    points, normals = _wall(800)
    both = np.concatenate([points, points - [0.0, 0.0, 1e-4]])
    normals = np.concatenate([normals, -normals])
    measured = np.zeros((1600, 2), dtype=bool)
    measured[:800, 0] = measured[800:, 1] = True
    assert not neighbouring_pairs(measured, SampledSurface(both, normals))
    edge = SampledSurface(points, normals[:800])
    assert neighbouring_pairs(
        np.stack([points[:, 0] < 0, points[:, 0] >= 0], axis=1), edge
    ) == [(0, 1)]


def test_one_percent_of_the_target_makes_neighbours_where_no_border_is_shared(
    monkeypatch,
):
    """Two patches far apart: both cameras measure one, each its own rest."""
    rng = np.random.default_rng(0)
    shared = np.column_stack([rng.uniform(0, 0.1, (20, 2)), np.zeros(20)])
    rests = [
        np.column_stack([rng.uniform(x, x + 1, (490, 2)), np.zeros(490)])
        for x in (5.0, 10.0)
    ]
    points = np.concatenate([shared, *rests])
    normals = np.tile([0.0, 0.0, 1.0], (1000, 1))
    measured = np.zeros((1000, 2), dtype=bool)
    measured[:20] = measured[20:510, :1] = True
    measured[510:, 1] = True
    surface = SampledSurface(points, normals)
    assert neighbouring_pairs(measured, surface) == [(0, 1)]
    for share, pairs in ((0.02, [(0, 1)]), (0.0201, [])):
        monkeypatch.setattr("planning.cameras.baselines.seams.MIN_OVERLAP_SHARE", share)
        assert neighbouring_pairs(measured, surface) == pairs


def test_groups_of_parts_that_can_be_registered():
    measured = np.zeros((1000, 4), dtype=bool)
    measured[:300, 0] = measured[280:600, 1] = True
    measured[600:800, 2] = True
    measured[791:, 3] = True  # 9 samples shared: 0.9 % of the target.
    assert overlap_components(measured) == [[0, 1], [2], [3]]
    measured[570:620, 2] = measured[785:, 3] = True
    assert overlap_components(measured) == [[0, 1, 2, 3]]
    assert overlap_components(measured[:, :1]) == [[0]]


def test_two_cameras_at_one_place_have_no_baseline():
    points, normals = _wall()
    pair = [_camera(name, (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)) for name in ("C1", "C2")]
    pair += [_camera("C3", (0.1, 0.0, 1.0), (0.1, 0.0, 0.0))]
    seen = np.stack([_in_image(camera, points) for camera in pair], axis=1)
    rows = baseline_rows(pair, SampledSurface(points, normals), seen, THETA)
    named = {frozenset(row.cameras) for row in rows}
    assert named == {frozenset(("C1", "C3")), frozenset(("C2", "C3"))}


def test_nothing_measured_gives_no_rows():
    points, normals = _wall(50)
    cameras = _facing(0.6)
    nothing = np.zeros((50, 2), dtype=bool)
    surface = SampledSurface(points, normals)
    assert baseline_rows(cameras, surface, nothing, THETA) == []
    none = SampledSurface(np.zeros((0, 3)), np.zeros((0, 3)))
    assert baseline_rows(cameras, none, nothing[:0], THETA) == []
    single = SampledSurface(points[:1], normals[:1])
    rows = baseline_rows(cameras, single, np.ones((1, 2), bool), THETA)
    assert len(rows) == 2
