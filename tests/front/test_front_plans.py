"""A whole front of a small head, and points that are planned from it."""

import io
from dataclasses import replace

import numpy as np
import pytest

from geometry.shapes.primitives import sphere
from geometry.shapes.sample_head.sample_head import sample_head
from planning.cameras import camera_cover
from planning.model.errors import InputError
from planning.model.progress import Stopwatch
from planning.pipeline import plan_rig
from planning.projectors.candidate_set import CandidateSource
from planning.report.entries.device_entries import rounded_camera, rounded_projector
from planning.rig.wishes import Wishes
from planning.scene.draws import DRAWS
from planning.scene.measuring.measured import lit_samples, measured_by
from planning.scene.placed_bodies import Obstruction
from planning.steps.asked.request import request_of
from planning.steps.front import front_matrix, taken_point
from planning.steps.front import plan_front as fronts
from planning.steps.front.choices import Choice
from planning.steps.front.fresh_figures import FreshFigures
from planning.steps.front.kept_front import FRONT_FILE, read_front
from planning.steps.front.plan_front import plan_front
from planning.steps.front.taken_point import TakenPoint
from planning.steps.prepare import prepared
from planning.verify.audit.audit import audit_plan

P, C = 2, 3
# Less than two projectors light: what a point has must be kept all the same.
SHARES = {"dominant_coverage": 0.4, "coverage": 0.6}
WISHES = Wishes(max_projectors=P, max_cameras=C, **SHARES)


@pytest.fixture(scope="module", autouse=True)
def _few(with_little_work):
    with with_little_work(every_pose=True):
        yield


@pytest.fixture(scope="module")
def mesh():
    return sample_head(n_faces=3000)


@pytest.fixture(scope="module")
def kept(mesh, rig):
    return plan_front(mesh, rig, WISHES, threads=1)


@pytest.fixture(scope="module")
def folder(kept, tmp_path_factory):
    folder = tmp_path_factory.mktemp("front")
    with (folder / FRONT_FILE).open("wb") as file:
        kept.write(file)
    return folder


def share(point, front):
    return point.measured_m2 / front.area_m2


def error(share, n):
    return np.sqrt(share * (1.0 - share) / n)


def test_every_number_is_there_and_more_devices_measure_no_less(kept):
    front = kept.front
    counts = [(p, c) for p in range(1, P + 1) for c in range(1, C + 1)]
    assert [one.count for one in front.points] == counts
    for one in front.points:
        assert (len(one.lights), len(one.views)) == one.count
        for fewer in front.points:
            if fewer.projectors <= one.projectors and fewer.cameras <= one.cameras:
                assert fewer.measured_m2 <= one.measured_m2
        assert one.measured_m2 <= one.reachable_by_cameras_m2 <= one.lit_m2 + 1e-12
        assert one.lit_m2 <= front.reachable_by_projectors_m2 <= front.area_m2 + 1e-12
        assert share(one, front) <= front.at_most_share(one)
    # Two projectors and three cameras of this head measure more than one and one.
    assert front.points[-1].measured_m2 > 1.2 * front.points[0].measured_m2


@pytest.mark.long
def test_no_pair_of_candidates_measures_more_than_the_bound_of_one_and_one(
    kept, mesh, rig
):
    """Nor more than is found by much: all cameras beside the brightest projectors."""
    ready = ready_for(mesh, rig)
    matrix = kept.matrix(ready)
    n = len(matrix.target)
    best = 0
    brightest = np.argsort(-matrix.candidates.lit.sum(axis=0))[:12]
    for projector in matrix.candidates.of(brightest):
        lit = lit_samples(matrix.scene, [projector], matrix.target)
        measured = measured_by(matrix.scene, matrix.cameras, lit)
        best = max(best, int(measured.sum(axis=0).max()))
    one = kept.front.point(1, 1)
    assert best / n <= one.at_most_m2 / kept.front.area_m2 + 1e-12
    assert best / n <= share(one, kept.front) + 2 * error(share(one, kept.front), n)


def test_what_is_kept_is_what_candidates_light_and_see(kept, folder, mesh, rig):
    ready = ready_for(mesh, rig)
    again = read_front(folder).matrix(ready)
    anew = front_matrix.matrix_of(ready, Stopwatch())
    np.testing.assert_array_equal(again.candidates.stages, anew.candidates.stages)
    np.testing.assert_array_equal(again.seen, anew.seen)
    # Views are made again by arithmetic: every number is the same.
    scene, target = anew.scene, anew.target
    offer = camera_cover.camera_candidate_views(
        scene, ready.cameras, rig.n_camera_poses
    )
    fresh = offer.on(target)
    for one, other in zip(again.views.on(target), fresh, strict=True):
        np.testing.assert_array_equal(one.samples, other.samples)
        np.testing.assert_array_equal(one.view.jacobian, other.view.jacobian)
        np.testing.assert_array_equal(one.view.rays, other.view.rays)
    assert again.seen.any()


@pytest.mark.long
@pytest.mark.parametrize("count", [(1, 2), (2, 3)])
def test_a_taken_point_claims_what_the_front_said_without_a_matrix(
    count, folder, mesh, rig, monkeypatch
):
    def forbidden(*_, **__):
        raise AssertionError("candidates are looked at again")

    monkeypatch.setattr(CandidateSource, "lattice", forbidden)
    monkeypatch.setattr(camera_cover, "camera_candidate_views", forbidden)
    monkeypatch.setattr(front_matrix, "camera_candidate_views", forbidden)
    monkeypatch.setattr(fronts, "matrix_of", forbidden)
    front = read_front(folder)
    point = front.front.point(*count)
    plan = plan_rig(
        mesh,
        rig,
        take=TakenPoint(front, point),
        check=False,
        on_miss="return",
        threads=1,
        **SHARES,
    )
    assert (len(plan.projectors), len(plan.cameras)) == count
    assert (plan.requirements.max_projectors, plan.requirements.max_cameras) == count
    areas, said = plan.coverage.target, share(point, front.front)
    claimed = areas.measured_m2 / areas.area_m2
    draws = 1.0 / front.front.fresh_samples + 1.0 / plan.coverage.samples
    assert claimed >= said - 3.0 * np.sqrt(said * (1.0 - said) * draws)
    assert audit_plan(plan).failures == ()
    # Margins widen, and nothing that the point lights is given up for them.
    matrix = front.matrix(ready_for(mesh, rig))
    lit = lit_samples(matrix.scene, plan.projectors, matrix.target)
    before = matrix.candidates.lit[:, list(point.lights)].any(axis=1)
    assert len(lit.target) >= before.sum() - 0.001 * len(before)
    projectors = plan.document.certificates.projectors
    assert projectors.count == count[0]
    assert projectors.n_samples == front.front.samples


def test_wider_margins_are_not_taken_where_less_is_measured(
    kept, mesh, rig, monkeypatch
):
    """Here they let one candidate in the place of all light what they can."""
    matrix = kept.matrix(ready_for(mesh, rig))
    lit = matrix.candidates.lit.sum(axis=0)
    (dim,) = matrix.candidates.of(np.flatnonzero(lit == lit[lit > 0].min())[:1])

    def moved(_, stage):
        pose = dim.world_from_device
        return tuple(replace(p, world_from_device=pose) for p in stage.projectors)

    monkeypatch.setattr(taken_point, "widen_margins", moved)
    point = kept.front.point(1, 2)
    request = ready_for(mesh, rig, max_projectors=1).request
    search = TakenPoint(kept, point)._sought(request, Stopwatch())
    partial, _ = next(search)
    candidates = matrix.candidates.of(np.array(point.lights))
    for mine, its in zip(partial.projectors, candidates, strict=True):
        np.testing.assert_array_equal(mine.world_from_device, its.world_from_device)
    for mine, place in zip(partial.cameras, point.views, strict=True):
        its = matrix.cameras[place]
        np.testing.assert_array_equal(mine.world_from_device, its.world_from_device)
    measured = partial.camera_stage.cover.selection.n_covered / len(matrix.target)
    said = share(point, kept.front)
    assert measured >= said - 2 * error(said, len(matrix.target))


def test_a_changed_mesh_rig_seed_or_requirement_is_refused_by_name(folder, mesh, rig):
    front = read_front(folder)
    moved = replace_vertices(mesh)
    other = rig.replace(placement={"n_candidate_projectors": 700})
    ready = ready_for(mesh, rig)
    arm = Obstruction("arm", sphere(0.05, subdivisions=1), 1e-4)
    among = replace(ready, scene=replace(ready.scene, obstructions=(arm,)))
    for words, ready in (
        ("another set of obstacles:", among),
        ("another mesh:", ready_for(moved, rig)),
        ("another rig:", ready_for(mesh, other)),
        ("another seed:", ready_for(mesh, rig, seed=1)),
        ("another target:", ready_for(mesh, rig, target="surface")),
        ("another set of requirements:", ready_for(mesh, rig, coverage=0.5)),
    ):
        with pytest.raises(InputError, match=words) as caught:
            front.matrix(ready)
        assert "\n" not in str(caught.value)
    # How many devices there may be is no matter of the matrix.
    assert front.matrix(ready_for(mesh, rig, max_cameras=9)).seen.any()


@pytest.mark.long
def test_the_same_front_with_any_number_of_threads(kept, mesh, rig):
    again = plan_front(mesh, rig, WISHES, threads=2)
    files = [io.BytesIO(), io.BytesIO()]
    for one, file in zip((kept, again), files, strict=True):
        one.write(file)
    assert files[0].getvalue() == files[1].getvalue()


def test_figures_are_of_poses_as_they_are_written(kept, mesh, rig):
    matrix, point = kept.matrix(ready_for(mesh, rig)), kept.front.point(1, 1)
    (projector,) = matrix.candidates.of(np.array(point.lights))
    camera = matrix.cameras[point.views[0]]
    written = rounded_projector(projector, ""), rounded_camera(camera, "")
    assert not np.array_equal(camera.world_from_device, written[1].world_from_device)
    fresh = FreshFigures(matrix)
    sigmas = [
        fresh.of(Choice((p,), (c,), point.lights, point.views, None, 0, None)).sigma
        for p, c in ((projector, camera), written)
    ]
    np.testing.assert_array_equal(*sigmas)
    assert np.isfinite(sigmas[0]).any()
    assert len(sigmas[0]) == DRAWS.front.count


def test_ring_frames_are_those_of_each_point(kept):
    points = kept.front.points
    total = sum(one.projectors for one in points)
    assert kept.arrays["point_rings"].shape == (total, 4, 4)
    last = kept.rings_of(points[-1])
    np.testing.assert_array_equal(last, kept.arrays["point_rings"][-P:])
    np.testing.assert_array_equal(
        kept.rings_of(points[0]), kept.arrays["point_rings"][:1]
    )


def ready_for(mesh, rig, seed=0, **wishes):
    asked = replace(WISHES, **wishes)
    clock = Stopwatch()
    request = request_of(mesh, rig, asked, clock, select=None, weight=None)
    return prepared(replace(request, seed=seed, threads=1), clock)


def replace_vertices(mesh):
    vertices = mesh.vertices.copy()
    vertices[0] *= 1.001
    return replace(mesh, vertices=vertices)
