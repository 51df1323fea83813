"""How many cameras, and how far apart, on shapes with a closed form of (9)-(10).

Candidates stand on a fine lattice of the poses that the closed form speaks of; what
each sees is the planner's own view of exact samples, and the fewest are the proved
optimum of its cover. Counts stand well away from where they change.
"""

from dataclasses import dataclass

import numpy as np
import pytest
from support.closed_forms import (
    bent_limit,
    cylinder_limit,
    flat_limit,
    round_body_limit,
    sphere_band_limit,
)

from geometry.devices import PinholeModel
from geometry.mesh.sampling import SurfaceSamples
from geometry.poses import look_at
from planning.cameras.baselines.baseline_rows import baseline_rows
from planning.cameras.baselines.seams import SampledSurface
from planning.model.devices.planned import PlannedCamera
from planning.model.requirements import CameraLimits
from planning.scene.measuring.measurability import view
from planning.scene.samples import Target
from solvers import CoverProblem, solve_cover

UP = np.array([0.0, 0.0, 1.0])
RING = 1.0


def lens(half_field_deg):
    """A camera whose image ends so far off its axis to either side, and high above."""
    focal = 500.0 / np.tan(np.radians(half_field_deg))
    matrix = np.array([[focal, 0.0, 499.5], [0.0, focal, 1999.5], [0.0, 0.0, 1.0]])
    return PinholeModel(matrix, (1000, 4000), (0.1, 5.0))


@dataclass(frozen=True, eq=False)
class Shape:
    """Exact samples, and the incidence that cameras accept [rad]."""

    points: np.ndarray
    normals: np.ndarray
    theta: float

    def seen(self, cameras):
        """Which camera sees which sample, by the planner's view, (n, k)."""
        samples = SurfaceSamples(
            self.points, self.normals, np.zeros(len(self.points), np.int64), 1.0
        )
        target = Target(samples, np.zeros(self.points.shape))
        limits = CameraLimits(self.theta)
        views = [view(camera, target, limits, None) for camera in cameras]
        return np.stack([view.seen for view in views], axis=1)

    def rows(self, cameras):
        """The plan's rows of `baselines` for these cameras."""
        seen = self.seen(cameras)
        surface = SampledSurface(self.points, self.normals)
        return baseline_rows(cameras, surface, seen, self.theta)


def camera(name, position, aim, device):
    pose = look_at(np.array(position), np.array(aim), UP)
    return PlannedCamera(name, pose, device)


def fewest(shape, cameras):
    """The proved least number of cameras that see every sample."""
    found = solve_cover(CoverProblem(shape.seen(cameras), min_coverage=1.0), seed=0)
    assert found.lower_bound == len(found.selected), "nothing is proved"
    return len(found.selected)


def on_ring(azimuths, device):
    return [
        camera(f"C{k}", [RING * np.cos(a), RING * np.sin(a), 0.0], np.zeros(3), device)
        for k, a in enumerate(azimuths, 1)
    ]


def about(*, radius, theta_deg, heights=(0.0,), latitudes=(0.0,), around=720):
    """A cylinder's rings at heights, or a sphere's parallels; never across a border."""
    turn = (np.arange(around) + 0.5) * (2.0 * np.pi / around)
    points, normals = [], []
    for z in heights:
        for latitude in latitudes:
            outward = np.column_stack(
                [
                    np.cos(latitude) * np.cos(turn),
                    np.cos(latitude) * np.sin(turn),
                    np.full(around, np.sin(latitude)),
                ]
            )
            normals.append(outward)
            points.append(radius * outward + [0.0, 0.0, z])
    return Shape(np.concatenate(points), np.concatenate(normals), np.radians(theta_deg))


ROUND = {
    "circle by incidence": (
        {"radius": 0.4, "theta_deg": 60.0},
        30.0,
        round_body_limit(0.4, RING, np.radians(60.0), np.radians(30.0)),
    ),
    "circle by the field": (
        {"radius": 0.5, "theta_deg": 85.0},
        16.0,
        round_body_limit(0.5, RING, np.radians(85.0), np.radians(16.0)),
    ),
    "cylinder": (
        {"radius": 0.25, "theta_deg": 55.0, "heights": np.linspace(-0.4, 0.4, 9)},
        30.0,
        cylinder_limit(0.25, RING, np.radians(55.0), 0.4),
    ),
    "sphere band": (
        {
            "radius": 0.15,
            "theta_deg": 65.0,
            "latitudes": np.radians(np.linspace(-35.0, 35.0, 9)),
        },
        30.0,
        sphere_band_limit(0.15, RING, np.radians(65.0), np.radians(35.0)),
    ),
}


@pytest.mark.parametrize("name", ROUND)
def test_fewest_cameras_round_a_body(name):
    body, half_field, limit = ROUND[name]
    shape = about(**body)
    share = np.pi / limit.half_angle % 1.0
    assert 0.1 < share < 0.95, "too near to where the count changes"
    azimuths = np.arange(360) * (2.0 * np.pi / 360)
    assert fewest(shape, on_ring(azimuths, lens(half_field))) == limit.n_min


@pytest.mark.parametrize("name", ROUND)
def test_neighbours_round_a_body_part_at_d_max(name):
    """Half a per cent inside the seam holds and the row says so; outside it is open.

    Off the plane of the axes, at the ends of a cylinder or band, the row's inequality
    is necessary only: its d_max is the larger one.
    """
    body, half_field, limit = ROUND[name]
    shape = about(**body, around=7200)
    azimuth = np.arctan2(shape.points[:, 1], shape.points[:, 0])
    near = np.abs(azimuth) < np.radians(40.0)
    shape = Shape(shape.points[near], shape.normals[near], shape.theta)
    between = np.abs(azimuth[near]) < np.radians(0.04)
    for share, closed in ((0.995, True), (1.005, False)):
        half = share * limit.half_angle
        cameras = on_ring([-half, half], lens(half_field))
        apart = np.linalg.norm(
            cameras[0].world_from_device[:3, 3] - cameras[1].world_from_device[:3, 3]
        )
        assert (apart < limit.d_max) == closed
        assert shape.seen(cameras).any(axis=1)[between].all() == closed
        for row in shape.rows(cameras) if closed else ():
            assert row.d == pytest.approx(apart)
            assert row.d < row.d_max
            # E lies up to a sample inside camera 1's part.
            assert row.d_max > 0.994 * limit.d_max
            if name.startswith("circle"):
                assert row.d_max == pytest.approx(limit.d_max, rel=0.006)


def wall(length, theta_deg=80.0, n=801):
    """A flat wall along x, its normal -y."""
    x = (np.arange(n) + 0.5) / n * length
    points = np.column_stack([x, np.zeros(n), np.zeros(n)])
    normals = np.tile([0.0, -1.0, 0.0], (n, 1))
    return Shape(points, normals, np.radians(theta_deg))


def before_wall(places, standoff, device):
    return [
        camera(f"C{k}", [x, -standoff, 0.0], [x, 0.0, 0.0], device)
        for k, x in enumerate(places, 1)
    ]


@pytest.mark.parametrize(("length", "count"), [(0.9, 1), (1.3, 2), (2.5, 3), (3.9, 4)])
def test_fewest_cameras_before_a_wall(length, count):
    """Each covers 2 C = 2 s tan b: floor(L / 2C) + 1 cameras."""
    extent = 0.5
    device = lens(np.degrees(np.arctan(extent)))
    assert int(length // (2.0 * extent)) + 1 == count
    places = np.arange(0.0, length, 0.01)
    assert fewest(wall(length), before_wall(places, 1.0, device)) == count


@pytest.mark.parametrize("step", [-0.006, 0.006])
def test_a_wall_parts_at_the_sum_of_half_extents(step):
    """d' < C1 + C2 of unequal standoffs, d'' = s1 - s2."""
    device, s1, s2 = lens(20.0), 1.0, 0.8
    tan = np.tan(np.radians(20.0))
    limit = flat_limit(s1 * tan, s2 * tan)
    first = 0.4
    one = camera("C1", [first, -s1, 0.0], [first, 0.0, 0.0], device)
    second = first + limit + step
    two = camera("C2", [second, -s2, 0.0], [second, 0.0, 0.0], device)
    shape = wall(1.4, n=2801)
    x = shape.points[:, 0]
    between = (x > first) & (x < second)
    assert shape.seen([one, two]).any(axis=1)[between].all() == (step < 0.0)
    if step < 0.0:
        for row in shape.rows([one, two]):
            assert row.d_axial == pytest.approx(s1 - s2)
            assert row.d_lateral == pytest.approx(limit + step)
            assert row.covered is True
            d_lateral_max = np.sqrt(row.d_max**2 - row.d_axial**2)
            assert d_lateral_max == pytest.approx(limit, abs=2e-3)


def box_edge(length, n=600):
    """Two faces of a box: normal -y for x < 0, normal +x for y > 0."""
    s = (np.arange(n) + 0.5) / n * length
    zero = np.zeros(n)
    points = np.concatenate(
        [np.column_stack([-s, zero, zero]), np.column_stack([zero, s, zero])]
    )
    normals = np.repeat([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0]], n, axis=0)
    return Shape(points, normals, np.radians(80.0))


def round_edge(near1, near2, device, s1=1.0, s2=0.8):
    """A camera square to each face, so far from the edge."""
    return [
        camera("C1", [-near1, -s1, 0.0], [-near1, 0.0, 0.0], device),
        camera("C2", [s2, near2, 0.0], [0.0, near2, 0.0], device),
    ]


def test_a_box_edge_parts_at_the_bent_limit():
    device, s1, s2 = lens(20.0), 1.0, 0.8
    tan = np.tan(np.radians(20.0))
    c1, c2 = s1 * tan, s2 * tan
    limit = bent_limit(s1, c1, s2, c2, np.pi / 2.0)
    shape = box_edge(0.5)
    for step, closed in ((-0.004, True), (0.004, False)):
        cameras = round_edge(c1, c2 + step, device)
        apart = np.linalg.norm(
            cameras[0].world_from_device[:3, 3] - cameras[1].world_from_device[:3, 3]
        )
        assert (apart < limit) == closed
        near = np.linalg.norm(shape.points, axis=1) < 0.01
        assert shape.seen(cameras).any(axis=1)[near].all() == closed
        if closed:
            rows = shape.rows(cameras)
            assert rows
            for row in rows:
                assert row.covered is True
                assert row.delta_surface == pytest.approx(np.pi / 2.0)
                assert row.d_max == pytest.approx(limit, abs=4e-3)


def test_fewest_cameras_round_a_box_edge():
    """Face by face: a camera square to one face doesn't see the other."""
    device, length = lens(np.degrees(np.arctan(0.25))), 0.7
    places = np.arange(0.0, length, 0.01)
    cameras = [
        round_edge(x, x, device, 1.0, 1.0)[side] for x in places for side in (0, 1)
    ]
    per_face = int(length // 0.5) + 1
    assert fewest(box_edge(length), cameras) == 2 * per_face
