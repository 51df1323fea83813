"""Deviation maps: rigid motions recovered, signed distances by closed form."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.sampling import sample_surface
from geometry.poses import transform
from geometry.rays.proximity import closest_points
from geometry.shapes.primitives import sphere
from planning.cli.lines.deviation_table import deviation_lines
from planning.verify.reconstruction.check.cloud_file import CloudFile, LengthUnit
from planning.verify.reconstruction.check.deviation import (
    best_fit,
    measure_deviation,
)
from planning.verify.reconstruction.check.merge import Merged
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.scanner import Scanner

NOISE_M = 1e-4


@pytest.fixture(scope="module")
def waved(rigs) -> TriangleMesh:
    return rigs.bumpy_sphere(0.05, subdivisions=4)


def pose_of(shift_m, turn_deg) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, 3] = shift_m
    turn = np.radians(turn_deg) * np.array([0.0, 0.6, 0.8])
    pose[:3, :3] = Rotation.from_rotvec(turn).as_matrix()
    return pose


@pytest.mark.parametrize(
    ("shift_m", "turn_deg"),
    [((0, 0, 0), 0), ((1e-2, 0, 0), 0), ((-3e-3, 4e-3, 1e-3), 6)],
)
def test_a_rigid_motion_is_recovered(waved, shift_m, turn_deg):
    points = sample_surface(waved, 4000, seed=0).points
    moved = pose_of(shift_m, turn_deg)
    back = best_fit(waved, transform(moved, points), NOISE_M) @ moved
    assert np.abs(transform(back, points) - points).max() < 1e-6


def test_what_is_missing_or_was_added_hardly_moves_the_rest(waved):
    points = sample_surface(waved, 4000, seed=0).points
    points[:300] *= 1.3
    moved = transform(best_fit(waved, points, NOISE_M), points)
    assert np.abs(moved - points).max() < 3e-5


def test_a_ball_is_shifted_and_not_turned():
    ball = sphere(0.05, subdivisions=5)
    points = sample_surface(ball, 3000, seed=1).points + np.array([2e-3, 0, 0])
    pose = best_fit(ball, points, NOISE_M)
    assert pose[:3, 3] == pytest.approx([-2e-3, 0, 0], abs=2e-5)
    assert np.abs(pose[:3, :3] - np.eye(3)).max() < 1e-3


@pytest.mark.parametrize("times", [1, 5])
def test_a_single_point_is_shifted_and_not_turned(waved, times):
    point = np.repeat(1.02 * sample_surface(waved, 1, seed=0).points, times, axis=0)
    pose = best_fit(waved, point, NOISE_M)
    assert np.abs(closest_points(waved, transform(pose, point)).distances).max() < 1e-7
    assert np.abs(pose[:3, :3] - np.eye(3)).max() < 1e-6


def plate_map(limits_m=None, align="none"):
    """A cloud 0.3 mm above a plate's left half, its region, 0.1 mm under the rest."""
    corners = np.array([[-1, -1, 0], [0, -1, 0], [0, 1, 0], [-1, 1, 0]], float)
    vertices = 0.1 * np.concatenate([corners, corners + [1, 0, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    plate = TriangleMesh(vertices, faces)
    grid = np.stack(np.meshgrid(*2 * [np.linspace(-0.09, 0.09, 20)]), -1).reshape(-1, 2)
    left = grid[:, 0] < 0
    points = np.column_stack([grid, np.where(left, 3e-4, -1e-4)])
    n = len(points)
    cloud = replace(
        Cloud.empty(),
        points=points,
        noise_px=np.ones(n),
        bias_px=np.zeros(n),
        shift=np.zeros((n, 3)),
    )
    up = np.tile([0.0, 0.0, 1.0], (n, 1))
    merged = merged_as(cloud, up)
    scanner = replace(BLANK, mesh=plate, region=np.array([0, 0, -1, -1]))
    return measure_deviation(merged, scanner, align, limits_m)


def merged_as(cloud: Cloud, normals: np.ndarray) -> Merged:
    every, none = np.ones(len(cloud), dtype=bool), np.zeros(len(cloud), dtype=bool)
    even = np.full(len(cloud), 1e-5)
    return Merged(cloud, every, none, none, normals, even, 0.0 * even)


class _Limits:
    class check:
        max_rms_m = NOISE_M


BLANK = Scanner((), (), None, None, None, _Limits)


def test_distances_are_signed_and_told_by_region():
    found = plate_map((-2e-4, 2e-4))
    first, rest = found.by_region()
    assert (first.region, rest.region) == (0, -1)
    assert (first.n_points, rest.n_points) == (200, 200)
    assert first.mean_m == pytest.approx(3e-4)
    assert rest.mean_m == pytest.approx(-1e-4)
    assert (first.outside, rest.outside, found.whole().outside) == (1.0, 0.0, 0.5)
    assert found.whole().rms_m == pytest.approx(np.sqrt((9 + 1) / 2) * 1e-4)
    assert (found.shift_m, found.turn_rad) == (0.0, 0.0)
    lines = deviation_lines(found)
    assert lines[0].endswith("as measured, without a fit; limits -0.2 to 0.2 mm")
    assert lines[2].split() == [
        "0",
        "200",
        "0.300",
        "0.300",
        "0.300",
        "0.300",
        "100.0%",
    ]
    assert [line.split()[0] for line in lines[1:]] == ["region", "0", "none", "all"]
    assert plate_map((-5e-5, 4e-4)).whole().outside == 0.5
    assert "outside" not in deviation_lines(plate_map())[1]


def test_the_fit_is_told():
    found = plate_map(align="best-fit")
    assert "(--align none leaves them)" in deviation_lines(found)[0]
    assert abs(found.whole().mean_m) < 1e-4


def test_what_the_fit_did_is_told_and_points_and_normals_went_along(waved):
    found = sample_surface(waved, 2000, seed=0)
    moved = pose_of((-3e-3, 4e-3, 1e-3), 6)
    points = transform(moved, found.points)
    n = len(points)
    cloud = replace(
        Cloud.empty(),
        points=points,
        noise_px=np.ones(n),
        bias_px=np.zeros(n),
        shift=np.zeros((n, 3)),
    )
    normals = found.normals @ moved[:3, :3].T
    merged = merged_as(cloud, normals)
    scanner = replace(BLANK, mesh=waved, region=np.zeros(len(waved.faces), int))
    fit = measure_deviation(merged, scanner, "best-fit")
    back = found.points.mean(axis=0) - points.mean(axis=0)
    assert fit.shift_m == pytest.approx(np.linalg.norm(back), abs=1e-6)
    assert np.degrees(fit.turn_rad) == pytest.approx(6.0, abs=1e-3)
    assert np.abs(fit.normals - found.normals).max() < 1e-4
    rows = CloudFile.of_deviation(merged, fit, LengthUnit("mm", 1e-3)).rows
    written = 1e-3 * np.stack([rows[a] for a in "xyz"], axis=1)
    assert np.abs(written - found.points).max() < 1e-6
    assert "6.000 degrees" in deviation_lines(fit)[0]
