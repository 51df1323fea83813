"""The paper's route to the cameras on bodies whose fewest have a closed form."""

from dataclasses import replace

import numpy as np
import pytest
from support.closed_forms import cylinder_limit, round_body_limit, sphere_band_limit
from support.factories import make_workspace

from geometry.devices import PinholeModel
from geometry.poses import look_at
from planning.cameras.baselines.baseline_limits import BaselineLimits
from planning.cameras.baselines.baseline_rows import check_seam
from planning.cameras.baselines.hole_program import HoleTerms
from planning.cameras.baselines.seams import SampledSurface, find_seams
from planning.cameras.baselines.widest_baselines import BaselineSearch
from planning.cameras.paper import hole_closing
from planning.cameras.paper.paper_route import paper_route
from planning.cameras.paper.route_problem import CameraSet, RouteProblem
from planning.model.devices.planned import PlannedCamera
from planning.proofs.quotas import Quotas, RegionFloors

THETA = np.radians(60.0)
RADIUS, RING = 0.1, 1.0
UP = np.array([0.0, 0.0, 1.0])
# So wide that incidence alone decides.
DEVICE = PinholeModel(
    np.array([[30.0, 0, 319.5], [0, 30.0, 239.5], [0, 0, 1]]), (640, 480), (0.1, 3.0)
)
ETA = round_body_limit(RADIUS, RING, THETA).half_angle


def workspace(**changes):
    return make_workspace(RADIUS, RING, **changes)


def camera_at(direction):
    pose = look_at(RING * np.asarray(direction, dtype=np.float64), np.zeros(3), UP)
    return PlannedCamera("", pose, DEVICE)


def at(azimuth):
    return camera_at([np.cos(azimuth), np.sin(azimuth), 0.0])


def azimuths(cameras):
    centres = np.stack([camera.world_from_device[:3, 3] for camera in cameras])
    return np.sort(np.arctan2(centres[:, 1], centres[:, 0]))


def ring(n):
    """So many cameras about the vertical, evenly spaced."""
    return tuple(at(azimuth) for azimuth in 2.0 * np.pi * np.arange(n) / n)


@pytest.fixture(autouse=True)
def _few_tries(monkeypatch):
    """Cameras that can go do so at the first try; most of the time goes to the last."""
    monkeypatch.setattr(hole_closing, "_DROPPED", 2)
    monkeypatch.setattr(hole_closing, "_PURSUED", 1)


class Body:
    """Samples of a convex body: nothing hides behind anything else."""

    def __init__(self, points, normals):
        self.points, self.normals = points, normals
        self.surface = SampledSurface(points, normals)

    def measure(self, cameras):
        found = np.zeros((len(self.points), len(cameras)), dtype=bool)
        for column, camera in enumerate(cameras):
            ray = self.points - camera.world_from_device[:3, 3]
            facing = -np.einsum("ij,ij->i", ray, self.normals)
            found[:, column] = facing >= np.cos(THETA) * np.linalg.norm(ray, axis=1)
        return found

    def problem(self, share=1.0, *, fixed=(), offered=None, more=0, least=lambda _: 0):
        offered = ring(5) if offered is None else offered
        limits = BaselineLimits(THETA, 0.0, workspace())

        def widen(cameras):
            return BaselineSearch(
                cameras,
                lambda poses: self.measure(
                    [
                        replace(c, world_from_device=p)
                        for c, p in zip(cameras, poses, strict=True)
                    ]
                ),
                self.surface,
                limits,
                max_evaluations=12,
                max_programs=3,
            ).run()

        required = int(np.ceil(share * len(self.points))) + more
        offered = (*fixed, *offered)
        return RouteProblem(
            self.surface,
            limits,
            offered,
            self.measure(offered),
            self.measure,
            widen,
            Quotas(required, RegionFloors.none(len(self.points)), np.zeros(1, int)),
            np.arange,
            least,
            len(fixed),
        )


def around(z, n=72, span=np.pi):
    """Azimuths and heights of a grid about the vertical, both (n * len(z),)."""
    azimuth = np.linspace(-span, span, n, endpoint=span < np.pi)
    return (a.ravel() for a in np.meshgrid(azimuth, z))


def band(latitude, *, n=72, span=np.pi):
    azimuth, lift = around(np.linspace(-latitude, latitude, 5), n, span)
    flat = np.cos(lift)
    normals = np.column_stack(
        [flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(lift)]
    )
    return Body(RADIUS * normals, normals)


def side(half_height):
    azimuth, z = around(np.linspace(-half_height, half_height, 5))
    normals = np.column_stack([np.cos(azimuth), np.sin(azimuth), np.zeros(len(z))])
    return Body(RADIUS * normals + z[:, None] * UP, normals)


def test_programs_that_failed_are_counted_and_not_solved_again(monkeypatch):
    body = band(np.radians(2.0), n=61)
    pair = (at(-1.1 * ETA), at(1.1 * ETA))
    begun = hole_closing.Closing.of(
        body.problem(offered=ring(7)), CameraSet(pair, body.measure(pair))
    )
    seen = []

    def fails(problem, placed, lost, reach):
        seen.append((len(lost), reach))
        return placed, np.arange(len(lost) + 1)

    monkeypatch.setattr(hole_closing, "_taken_over", fails)
    problem = body.problem(offered=ring(7))
    once = hole_closing.closed(problem, begun, 1)
    again = hole_closing.closed(problem, once, 3)
    in_turn = seen.copy()
    seen.clear()
    hole_closing.closed(problem, begun, 3)
    assert in_turn == seen
    assert (again.failed, len(seen)) == (3, 3)


def test_a_hole_is_where_a_part_ends_and_10_is_violated_until_it_is_closed():
    """Two cameras 2.2 eta apart; each is to go on from where the other's part ends."""
    body = band(np.radians(2.0), n=301, span=np.radians(60.0))
    pair = (at(-1.1 * ETA), at(1.1 * ETA))
    measured = body.measure(pair)
    hole = ~measured.any(axis=1)
    azimuth = np.arctan2(body.points[:, 1], body.points[:, 0])
    limits = BaselineLimits(THETA, 0.0, workspace())
    terms = HoleTerms(pair, measured, body.surface, hole, limits)
    problem = body.problem(offered=ring(7))
    begun = hole_closing.Closing.of(problem, CameraSet(pair, measured))
    closed = hole_closing.closed(problem, begun, 4).placed
    assert problem.short(closed) == 0
    ends = list(terms.ends(np.zeros_like(measured, dtype=np.float64)))
    assert {seam.cameras for seam in ends} == {(0, 1), (1, 0)}
    for seam in ends:
        one, two = seam.cameras
        assert measured[seam.points, one].all()
        sign = 2 * one - 1
        np.testing.assert_allclose(
            sign * azimuth[seam.points], 0.1 * ETA, atol=np.radians(0.8)
        )
        test = check_seam([pair[one], pair[two]], body.surface, seam, THETA)
        assert np.all(test.slack < -0.15 * ETA)
    seams = list(find_seams([(0, 1), (1, 0)], body.surface, closed.measured))
    assert len(seams) == 2
    for seam in seams:
        both = [closed.cameras[c] for c in seam.cameras]
        assert np.all(check_seam(both, body.surface, seam, THETA).slack > 0.0)
    first, last = azimuths(closed.cameras)
    assert last - first < 2.0 * ETA + np.radians(0.4)


@pytest.mark.parametrize(("latitude", "count"), [(10.0, 4)])
def test_a_sphere_band_takes_as_many_as_its_closed_form_says(latitude, count):
    latitude = np.radians(latitude)
    assert sphere_band_limit(RADIUS, RING, THETA, latitude).n_min == count
    body = band(latitude)
    problem = body.problem()
    route = paper_route(problem)
    assert problem.short(route.cameras) == 0
    assert len(route.cameras.cameras) == count
    assert body.measure(route.cameras.cameras).any(axis=1).all()
    assert 0 < route.best_without_one < len(body.points)
    assert not route.bounded


@pytest.mark.parametrize(("half_height", "count"), [(0.02, 4)])
def test_an_upright_cylinder_takes_as_many_as_its_closed_form_says(half_height, count):
    assert cylinder_limit(RADIUS, RING, THETA, half_height).n_min == count
    # Stopped by the closed form before it tries fewer, and not a camera earlier.
    problem = side(half_height).problem(least=lambda n: min(n, count))
    route = paper_route(problem)
    assert problem.short(route.cameras) == 0
    assert len(route.cameras.cameras) == count
    assert route.bounded
    assert route.best_without_one == 0


def test_a_part_of_the_turn_lets_cameras_go_and_the_rest_slide_to_the_limit():
    """Two of the ring's four do for 200 degrees, at most 2 eta = 110 degrees apart."""
    body = band(np.radians(5.0), n=150, span=np.radians(100.0))
    problem = body.problem()
    route = paper_route(problem)
    assert problem.short(route.cameras) == 0
    first, last = azimuths(route.cameras.cameras)
    # Between samples nothing is asked.
    between = np.radians(200.0 / 149)
    assert 2.0 * (np.radians(100.0) - ETA) < last - first < 2.0 * ETA + between
    assert 2.0 * np.sin((last - first) / 2) == pytest.approx(
        round_body_limit(RADIUS, RING, THETA).d_max, rel=0.07
    )
    # On the way it passed others, and one alone measures what one can.
    assert set(route.by_count) >= {1, 2}
    one = body.measure(route.by_count[1]).any(axis=1).mean()
    assert one == pytest.approx(np.degrees(2 * ETA) / 200.0, abs=0.06)


def test_half_of_the_turn_takes_half_of_the_ring():
    """A share of the requirement is what must be measured, no more."""
    problem = band(np.radians(5.0)).problem(share=0.58)
    route = paper_route(problem)
    assert problem.short(route.cameras) == 0
    assert len(route.cameras.cameras) == 2


@pytest.mark.long
def test_what_no_camera_can_measure_ends_the_route_short():
    body = band(np.radians(5.0), n=36)
    route = paper_route(body.problem(more=1))
    assert route.cameras.count == len(body.points)
    nothing = body.problem(offered=())
    assert paper_route(nothing).by_count == {}


def test_cameras_that_stand_already_stay_and_count():
    body = band(np.radians(5.0))
    given = replace(at(0.3), existing="old")
    problem = body.problem(fixed=(given,), least=lambda n: min(n, 4))
    route = paper_route(problem)
    assert problem.short(route.cameras) == 0
    assert len(route.cameras.cameras) == 4
    np.testing.assert_array_equal(
        route.cameras.cameras[0].world_from_device, given.world_from_device
    )
