"""Cameras that prices ask for find what few candidates miss."""

from dataclasses import replace

import numpy as np
import pytest
from support.factories import make_requirements, make_scene
from support.little_work import work_little

from geometry.poses import look_at
from geometry.shapes.primitives import sphere
from planning import pipeline, plan_rig
from planning.cameras import priced_cameras
from planning.cameras.camera_cover import (
    camera_candidate_views,
    denial,
    measured_of,
    plan_cameras,
)
from planning.cameras.priced_cameras import (
    fewer_by_prices,
    fewer_cameras,
    has_room,
    priced_poses,
)
from planning.cameras.proved_cameras import bound_stage, camera_stage
from planning.model.devices.bodies import Body, Existing
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.proofs import camera_bound
from planning.proofs.all_poses import Effort
from planning.rig.rig import Rig, load_rig
from planning.scene.draws import DRAWS
from planning.scene.lights import ring_frame
from planning.scene.measuring.measured import lit_samples, measured_by
from planning.scene.workspace.candidates import aimed_poses
from planning.steps import stages
from planning.verify.audit.audit import audit_plan

UP = np.array([0.0, 0.0, 1.0])
BALL = sphere(0.1, subdivisions=3)
EFFORT = Effort(finest=6, aims=4, maps=5, budget=1e9, shadows=np.inf)


def projector_at(position, tilt):
    device = load_rig("default").projector_device()
    pose = aimed_poses(np.array([position]), np.zeros(3), UP, device)[0]
    ring, radii = ring_frame(pose, device, 0.14, tilt), np.linspace(0.002, 0.4, 200)
    return PlannedProjector("", "diverging", pose, ring, device, radii)


PROJECTORS = (
    projector_at((0.3, -1.0, 0.4), 1.0),
    projector_at((-0.6, 0.2, 0.9), 3.0),
)


def staged(n_candidates, *, existing=(), share=0.97, most=None):
    """The fewest of so few candidates for two projectors, and their bound."""
    required = make_requirements(
        BALL, load_rig("default"), max_projectors=9, coverage=share
    )
    required = replace(required, max_cameras=most)
    limits = replace(required.triangulation, min_ring_pitch_px=None)
    required = replace(required, triangulation=limits, existing=tuple(existing))
    scene = make_scene(BALL, required)
    camera = PlannedCamera("", np.eye(4), load_rig("default").camera_device())
    views = camera_candidate_views(scene, (camera,), n_candidates)
    stage = camera_stage(scene, plan_cameras(scene, PROJECTORS, views))
    return scene, bound_stage(scene, stage, (camera.device,), EFFORT)


def test_two_cameras_measure_what_takes_three_of_forty_candidates():
    """Two projectors light less than two cameras see: they must stand in between."""
    scene, stage = staged(40)
    assert stage.certificate.needed.count == 3
    assert stage.certificate.continuous.lower_bound == 2
    fewer = fewer_cameras(scene, PROJECTORS, stage, 2)
    needed = fewer.certificate.needed
    assert (needed.count, needed.lower_bound) == (2, 2)
    assert fewer.certificate.status == "optimal"
    # Samples that neither the search nor what confirmed it has seen.
    fresh = lit_samples(
        scene, PROJECTORS, scene.target_samples(DRAWS.fresh_cameras.later(90))
    )
    measured = measured_by(scene, fewer.cameras, fresh).any(axis=1)
    assert measured.mean() > 0.96
    again = fewer_cameras(scene, PROJECTORS, stage, 2)
    for one, other in zip(fewer.cameras, again.cameras, strict=True):
        np.testing.assert_array_equal(one.world_from_device, other.world_from_device)


def test_as_many_as_are_allowed_are_found_where_candidates_need_more():
    scene, stage = staged(40, most=2)
    assert stage.certificate.status == "infeasible"
    assert stage.certificate.needed.count == 3
    assert has_room(stage)
    fewer = fewer_cameras(scene, PROJECTORS, stage, 1).certificate
    assert (fewer.count, fewer.needed.count, fewer.status) == (2, 2, "optimal")
    scene, stage = staged(40, most=1)
    assert fewer_cameras(scene, PROJECTORS, stage, 1) is None


def test_what_prices_refute_is_not_sought():
    """One camera sees less than half of a ball, and so does each projector light."""
    scene, stage = staged(40)
    assert priced_poses(scene, stage.cover, 1) == ()
    assert len(priced_poses(scene, stage.cover, 2)) > 0
    assert fewer_cameras(scene, PROJECTORS, stage, 0) is None


def test_the_last_poses_offered_count_too(monkeypatch):
    """Whether prices refute two cameras is asked again once they are known."""
    scene, stage = staged(40)
    monkeypatch.setattr(priced_cameras, "_SCALES", priced_cameras._SCALES[:1])
    assert len(priced_poses(scene, stage.cover, 2)) > 0


def test_fewer_of_which_there_are_too_few_are_no_gain(monkeypatch):
    """Of a stock that isn't enough, `needed` counts devices that aren't there."""
    scene, stage = staged(40)
    again = priced_cameras.cover_by_cover

    def out_of_stock(*given):
        cover = again(*given)
        short = replace(cover.selection, status="infeasible")
        return replace(cover, selection=short)

    given = scene, PROJECTORS, stage.cover, 1
    assert fewer_by_prices(*given).selection.needed == 2
    monkeypatch.setattr(priced_cameras, "cover_by_cover", out_of_stock)
    assert fewer_by_prices(*given) is None


def test_where_the_bound_is_the_count_no_camera_is_looked_for():
    _, stage = staged(40)
    assert has_room(stage)
    proof = stage.certificate
    bound = proof.continuous.changed(lower_bound=proof.needed.count)
    assert not has_room(replace(stage, certificate=proof.changed(continuous=bound)))
    assert not has_room(replace(stage, certificate=proof.changed(continuous=None)))


def test_cameras_that_stand_already_stay():
    pose = look_at(np.array((0.2, -0.9, 0.6)), np.zeros(3), UP)
    old = Existing("old", "camera", tuple(tuple(row) for row in pose.tolist()))
    scene, stage = staged(12, existing=[old])
    count = stage.certificate.needed.count
    assert has_room(stage)
    fewer = fewer_cameras(scene, PROJECTORS, stage, 2)
    assert fewer.certificate.needed.count < count
    assert fewer.certificate.given == 1
    np.testing.assert_array_equal(fewer.cameras[0].world_from_device, pose)


def test_what_is_offered_has_no_body_of_a_camera_that_stands_already():
    """Its own `[existing.body]`, where the rig's cameras have none."""
    pose = look_at(np.array((0.2, -0.9, 0.6)), np.zeros(3), UP)
    rows = tuple(tuple(row) for row in pose.tolist())
    body = Body((0.0, 0.0, -0.06), (0.03, 0.03, 0.06))
    scene, stage = staged(12, existing=[Existing("old", "camera", rows, body)])
    assert has_room(stage)
    fewer = fewer_cameras(scene, PROJECTORS, stage, 2)
    assert [camera.body for camera in fewer.reference] == [
        body,
        *[None] * (len(fewer.reference) - 1),
    ]


@pytest.fixture(scope="module")
def firsts():
    return []


@pytest.fixture
def _few_poses(monkeypatch, firsts):
    """So few cameras are offered that others save some; all begin from the same."""
    work_little(monkeypatch, every_pose=True)
    monkeypatch.setattr(Rig, "n_projector_poses", 160)
    monkeypatch.setattr(Rig, "n_camera_poses", 14)
    choose = pipeline._first_plan

    def first(request, clock):
        if not firsts:
            firsts.append(choose(request, clock))
        return firsts[0]

    monkeypatch.setattr(pipeline, "_first_plan", first)


def planned():
    """A ball, lit by as many projectors as it takes."""
    return plan_rig(
        sphere(0.1, subdivisions=2),
        load_rig("default"),
        max_projectors=8,
        target="surface",
        dominant_coverage=0.6,
        region_coverage=0.0,
        cameras_by="cover",
        check=False,
        on_miss="return",
        ring_axis="free",
    )


@pytest.mark.long
@pytest.mark.usefixtures("_few_poses")
def test_a_plan_takes_fewer_cameras_than_its_candidates_need(monkeypatch):
    """Its poses join the candidates, over which the count is proved and audited."""
    effort, proofs = camera_bound.DEFAULT, []
    for starts in (0, 2):
        monkeypatch.setattr(camera_bound, "DEFAULT", replace(effort, starts=starts))
        plan = planned()
        proof = plan.document.certificates.cameras
        assert len(plan.cameras) == proof.needed.count == proof.candidates.lower_bound
        assert audit_plan(plan).failures == ()
        proofs.append(proof)
    without, with_ = proofs
    assert with_.needed.count < without.needed.count
    assert with_.candidates.n_candidates > without.candidates.n_candidates == 14
    assert "prices" in with_.routes.why


@pytest.mark.long
@pytest.mark.usefixtures("_few_poses")
def test_fewer_cameras_are_sought_once_also_where_a_plan_denies_them(monkeypatch):
    """One more is taken then, which fewer were found beside, over and over."""
    seek, counts, sought = pipeline.with_fewer_cameras, [], []

    def fewer(partial, clock):
        sought.append(len(partial.cameras))
        assert len(sought) == 1, "sought again"
        return seek(partial, clock)

    def short(draft):
        """Of samples that no search has seen too few are measured, the first time."""
        counts.append(len(draft.partial.cameras))
        return False, counts[-1] == counts[0]

    monkeypatch.setattr(pipeline, "with_fewer_cameras", fewer)
    monkeypatch.setattr(stages, "short_of", short)
    plan = planned()
    fewest = counts[0]
    assert fewest < sought[0]
    assert len(plan.cameras) == fewest + 1


def test_fresh_samples_deny_cameras_that_measure_too_little_of_them():
    scene, stage = staged(40)
    candidates, chosen = stage.cover.candidates, stage.cover.selection.chosen
    fresh = scene.target_samples(DRAWS.fresh_cameras.later(91))
    given = scene, PROJECTORS, candidates
    assert denial(*given, chosen, fresh) is None
    seen = denial(*given, chosen[:1], fresh)
    np.testing.assert_array_equal(seen, measured_of(*given, fresh)[1])
