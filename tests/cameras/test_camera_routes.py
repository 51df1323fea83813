"""Which route's cameras stand, what the certificate says of both, and who believes it.

A ball that three projectors light: three cameras measure what is lit, if they stand at
the right places. Forty candidates don't, so a cover of them takes four.
"""

import copy
import re
from dataclasses import replace

import numpy as np
import pytest
from support.factories import make_camera, make_requirements, make_scene
from support.little_work import draw_fewer
from support.plain_shapes import box

from geometry.shapes.primitives import sphere
from planning import RigPlan
from planning.cameras.baselines.widest_baselines import WidestBaselines
from planning.cameras.camera_baselines import baseline_samples, held_to_candidates
from planning.cameras.camera_cover import (
    camera_candidate_views,
    candidate_cover,
    denial,
    measured_of,
)
from planning.cameras.camera_routes import (
    _clearly_wider,
    _loses,
    better_route,
    cheapest,
    cover_by_cover,
    widest_routes,
)
from planning.cameras.paper.paper_cameras import (
    RouteCameras,
    cover_by_paper,
    cover_of,
    route_among,
)
from planning.cameras.proved_cameras import camera_stage
from planning.model.devices.bodies import Body
from planning.model.devices.planned import PlannedProjector
from planning.model.document.certificates import Certificate, RouteCounts
from planning.model.errors import InfeasibleLimitsError
from planning.projectors.projector_stage import plan_projectors
from planning.proofs.all_poses import Effort
from planning.proofs.quotas import required_samples
from planning.report.claims.reach import measured_by_any
from planning.report.summary.proof_lines import route_lines
from planning.rig.rig import load_rig
from planning.rings.ring_radii import uniform_radii
from planning.scene.draws import DRAWS, Draw
from planning.scene.lights import ring_frame
from planning.scene.measuring.measured import lit_samples, measured_by
from planning.verify.audit.audit import audit_plan
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.counts.route_claims import audit_routes

RADIUS = 0.1


@pytest.fixture(scope="module", autouse=True)
def _few_rows():
    """Fewer samples than a plan rests on: the questions here aren't of exactness."""
    with pytest.MonkeyPatch.context() as patch:
        draw_fewer(patch, cameras=800, fresh_cameras=1500)
        yield


@pytest.fixture(scope="module")
def ball():
    mesh, rig = sphere(RADIUS, subdivisions=4), load_rig("default")
    required = make_requirements(mesh, rig, max_projectors=6, dominant_coverage=0.6)
    eye = np.eye(4)
    scene = make_scene(mesh, required)
    lens, radii = rig.projector_device(), uniform_radii(0.3, 0.0035)
    ring = ring_frame(eye, lens, rig.ring_offset, -np.pi / 2)
    template = PlannedProjector("", rig.light, eye, ring, lens, radii)
    stage = plan_projectors(scene, (template,), 120, rounds=1)
    camera = make_camera(rig)
    return scene, stage.projectors, camera


@pytest.fixture(scope="module")
def coarse(ball):
    """A cover of forty candidates, and what the default makes of it."""
    scene, projectors, camera = ball
    offered = camera_candidate_views(scene, (camera,), 40)
    cover = cover_by_cover(scene, projectors, offered)
    return cover, *better_route(scene, projectors, cover, "both")


@pytest.fixture(scope="module")
def fine(ball):
    """The same of 160 candidates, which hold as small a cover."""
    scene, projectors, camera = ball
    cover = cover_by_cover(
        scene, projectors, camera_candidate_views(scene, (camera,), 160)
    )
    return cover, *better_route(scene, projectors, cover, "both")


def test_fewer_by_the_paper_join_the_candidates_and_the_proof(ball, coarse):
    scene, projectors, _ = ball
    cover, better, routes, _ = coarse
    assert cover.selection.needed == cover.selection.lower_bound > 3
    assert (routes.cover, routes.paper, routes.taken) == (
        cover.selection.needed,
        3,
        "paper",
    )
    proof = camera_stage(scene, better).certificate.to_document()
    assert proof["count"] == proof["needed"]["count"] == 3
    assert proof["candidates"]["lower_bound"] <= 3
    assert proof["candidates"]["n_candidates"] == len(better.candidates.cameras) > 40
    # The three are among what was proved over, and measure what is asked of all of it.
    rows = lit_samples(scene, projectors, scene.target_samples(Draw(6000, 901)))
    held = measured_by(scene, better.candidates.cameras, rows)
    share = held[:, better.selection.chosen].any(axis=1).sum() / held.any(axis=1).sum()
    assert share >= 0.94
    ids = {id(camera) for camera in better.candidates.cameras}
    assert all(id(camera) in ids for camera in better.cameras)


def test_a_cover_that_is_as_small_stays_as_it_was(fine):
    cover, better, routes, rival = fine
    assert better is cover
    assert (routes.cover, routes.paper, routes.taken) == (3, 3, "cover")
    assert len(rival) == 3


def test_the_route_is_the_same_on_every_run_and_with_two_threads(ball, coarse):
    scene, projectors, _ = ball
    cover = coarse[0]
    found = [
        route_among(one, projectors, cover.candidates, cover.samples, cover.measured)
        for one in (scene, replace(scene, threads=2))
    ]
    poses = [
        np.stack([c.world_from_device for c in one.candidates.cameras]) for one in found
    ]
    np.testing.assert_array_equal(*poses)


def test_the_route_alone_is_bounded_over_candidates_and_itself(ball):
    scene, projectors, camera = ball
    offered = camera_candidate_views(scene, (camera,), 40)
    cover = cover_by_paper(scene, projectors, offered)
    found = cover.selection
    assert found.needed == 3
    assert found.lower_bound <= 3
    assert found.n_covered <= found.n_covered_bound
    assert found.n_covered >= found.required
    assert found.required == required_samples(cover.measured.any(axis=1), 0.95)
    assert np.all(found.chosen >= 40)
    stage = camera_stage(scene, cover)
    assert stage.cameras == stage.by_count[3]
    for row in stage.certificate.by_count:
        assert row.value_m2 <= row.upper_bound_m2 * (1 + 1e-9)
    fewer = stage.certificate.one_fewer.upper_bound_m2
    assert fewer > 0.0


def test_too_few_allowed_are_the_best_of_the_route_and_say_what_is_needed(ball):
    scene, projectors, camera = ball
    few = replace(scene, requirements=replace(scene.requirements, max_cameras=2))
    cover = cover_by_paper(few, projectors, camera_candidate_views(few, (camera,), 40))
    assert cover.selection.status == "infeasible"
    assert (len(cover.cameras), cover.selection.needed) == (2, 3)
    _, routes, _ = better_route(few, projectors, cover, "paper")
    assert (routes.paper, routes.taken) == (3, "paper")


def test_a_route_that_ends_short_is_not_proved_to_be_the_fewest(ball, fine):
    """Nothing bounds how many are allowed, and all that it has aren't enough."""
    scene, projectors, _ = ball
    cover = fine[0]
    short = replace(cover, selection=replace(cover.selection, status="infeasible"))
    _, routes, _ = better_route(scene, projectors, short, "paper")
    assert (routes.paper, routes.why) == (None, "it ended with less than is asked")


def test_as_many_as_are_said_to_suffice_do_where_the_route_ended_short(ball, fine):
    """One camera is allowed; two of the route aren't enough, three candidates are."""
    scene, projectors, _ = ball
    cover = fine[0]
    few = replace(scene, requirements=replace(scene.requirements, max_cameras=1))
    passed = {n: cover.selection.chosen[:n] for n in (1, 2)}
    route = RouteCameras(cover.candidates, cover.measured, passed, None, 0.9)
    short = cover_of(few, projectors, cover.samples, route)
    assert len(short.cameras) == 1
    required = candidate_cover(
        few, cover.measured, cover.samples, cover.candidates.cameras
    )
    assert required.enough(short.selection.smallest)
    proof = camera_stage(few, short).certificate
    assert proof.needed.count == len(short.selection.smallest) == 3
    _, routes, _ = better_route(few, projectors, short, "paper")
    assert routes.paper is None


def test_where_the_bound_stops_the_route_is_said_of_its_own_samples(fine):
    cover = fine[0]
    route = RouteCameras(cover.candidates, cover.measured, {}, 3, 0.0, bounded_on=400)
    assert "of its 400 samples" in route.stopped


def test_bodies_of_the_routes_cameras_keep_off_each_other(ball):
    """Bodies so deep that cameras less than 1 m apart collide before the ball."""
    scene, projectors, camera = ball
    bulky = replace(camera, body=Body((0.0, 0.0, -0.2), (0.2, 0.2, 0.2)))
    cover = cover_by_paper(
        scene, projectors, camera_candidate_views(scene, (bulky,), 40)
    )
    assert cover.interference is not None
    chosen = cover.selection.chosen.tolist()
    assert cover.interference.stand_together(chosen)
    rows = cover.interference.covers(chosen, chosen).any(axis=1).sum()
    assert rows >= cover.selection.required
    assert camera_stage(scene, cover).certificate.bounds_leave_out


def test_what_no_camera_sees_is_refused(ball):
    scene, projectors, camera = ball
    blind = replace(camera.device, range_m=(5.0, 6.0))
    far = replace(camera, device=blind)
    with pytest.raises(InfeasibleLimitsError, match="no camera of 40 poses"):
        cover_by_paper(scene, projectors, camera_candidate_views(scene, (far,), 40))


def test_the_papers_cameras_are_taken_where_they_stand_clearly_farther_apart(
    ball, fine, monkeypatch
):
    draw_fewer(monkeypatch, baselines=600)
    scene, projectors, _ = ball
    cover, _, routes, _ = fine
    stage = camera_stage(scene, cover)
    # As if they stood already: they can't slide back.
    fixed = tuple(replace(c, existing="old") for c in _beside(stage.cameras))
    close = replace(stage, cameras=fixed)
    rivals = replace(close, routes=routes, rival=stage.cameras)
    (taken, slid), (other, _) = widest_routes(scene, projectors, rivals)
    assert other is rivals
    assert taken.routes.taken == "paper"
    assert "instead of" in taken.routes.why
    assert slid.cameras is taken.cameras
    assert [c.world_from_device.tolist() for c in taken.cameras] == [
        c.world_from_device.tolist() for c in stage.cameras
    ]
    # Other numbers than the cover's are no rivals.
    fewer = replace(rivals, rival=stage.cameras[:2])
    ((alone, _),) = widest_routes(scene, projectors, fewer)
    assert alone is fewer
    # As many, and the second has fewer frames; of equals the first stays.
    assert cheapest([(taken, 660), (rivals, 660)]) == (0, taken)
    best, cheaper = cheapest([(taken, 660), (rivals, 600)])
    assert (best, cheaper.cameras) == (1, rivals.cameras)
    assert cheaper.routes.why == "as many, and 9.1% fewer pixels to read"


def test_cameras_slide_no_farther_than_candidates_reach(ball, monkeypatch):
    """Twelve candidates with 30 mm of depth of field; proofs speak of what they reach.

    Cameras that slid to where more is measured would owe 95 % of that, too.
    """
    draw_fewer(monkeypatch, baselines=1500)
    scene, projectors, camera = ball
    short = replace(camera, device=replace(camera.device, range_m=(1.0, 1.03)))
    cover = cover_by_cover(
        scene, projectors, camera_candidate_views(scene, (short,), 12)
    )
    stage = camera_stage(scene, cover)
    samples = baseline_samples(scene.among(projectors), projectors)
    held = held_to_candidates(samples, stage.reference, cover.samples, cover.measured)
    covered = held.covered
    assert covered.mean() < 0.95 * samples.lit.lit.any(axis=1).mean()
    ((_, slid),) = widest_routes(scene, projectors, stage)
    beyond = slid.measured_by.any(axis=1) & ~covered
    assert beyond.sum() <= 0.002 * covered.sum()
    assert any(
        not np.array_equal(a.world_from_device, b.world_from_device)
        for a, b in zip(slid.cameras, stage.cameras, strict=True)
    )


def _beside(cameras):
    """The same cameras, the second by the first, where it is of no use."""
    near = cameras[0].world_from_device.copy()
    c, s = np.cos(0.05), np.sin(0.05)
    near[:3] = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ near[:3]
    return (cameras[0], replace(cameras[1], world_from_device=near), *cameras[2:])


def _slid(apart_m, parts):
    """Two cameras of which each measures those of ten samples that are named."""
    measured = np.zeros((10, 2), dtype=bool)
    for column, part in enumerate(parts):
        measured[list(part), column] = True
    return WidestBaselines((), measured, apart_m, apart_m)


@pytest.mark.parametrize(
    ("rival", "better"),
    [
        (_slid(1.10, (range(6), range(5, 10))), True),
        (_slid(1.09, (range(6), range(5, 10))), False),
        (_slid(1.5, (range(6), range(5, 9))), False),
        (_slid(1.5, (range(5), range(5, 10))), False),
        (_slid(None, (range(6), range(5, 10))), False),
    ],
)
def test_clearly_farther_apart_is_a_tenth_and_loses_neither_area_nor_overlap(
    rival, better
):
    widest = _slid(1.0, (range(6), range(5, 10)))
    taken = _clearly_wider(rival, widest) and not _loses(rival, widest)
    assert taken == better


@pytest.fixture(scope="module")
def planned(small_job, tmp_path_factory, with_little_work):
    """A plan of a block by the paper's route, from the command line."""
    folder, block = (
        tmp_path_factory.mktemp("paper"),
        box((100.0, 60.0, 30.0), divisions=4),
    )
    lines = [f"v {x} {y} {z}" for x, y, z in block.vertices]
    lines += [f"f {a} {b} {c}" for a, b, c in block.faces + 1]
    (folder / "block.obj").write_text("\n".join(lines))
    words = ["--cameras-by", "paper", "--max-projectors", "2", "--target", "surface"]
    words += ["--dominant-coverage", "0.6"]
    with with_little_work(), pytest.MonkeyPatch.context() as patch:
        # What is proved of the projectors isn't the question.
        weak = Effort(finest=3, budget=1e6, shadows=0.0, most_samples=200)
        patch.setattr("planning.proofs.projector_bound.DEFAULT", weak)
        ended = small_job.run(folder / "block.obj", folder, words)
    assert ended.code == 0, ended.message
    return ended.plan, RigPlan.load(folder / "plan" / "plan.json")


def test_a_plan_by_the_papers_route_alone_bears_the_audit(planned):
    document, plan = planned
    routes = document["certificates"]["cameras"]["routes"]
    assert (routes["asked"], routes["taken"]) == ("paper", "paper")
    assert routes["cover"] is None
    assert audit_plan(plan).failures == ()
    proof = document["certificates"]["cameras"]
    assert routes["paper"] == proof["needed"]["count"] == len(plan.cameras)
    areas = plan.to_document()["coverage"]["target"]
    assert areas["measured_m2"] >= 0.95 * areas["reachable_by_cameras_m2"]


def test_the_summary_tells_both_counts_and_why(handmade):
    told = RouteCounts(asked="both", cover=3, paper=4, taken="cover", why="fewer; so")
    proof = handmade.build_plan().document.certificates.cameras
    (line,) = route_lines(proof.changed(routes=told))
    assert re.search(
        r"3 by the cover, 4 by the paper.*taken the cover.*fewer; so", line
    )
    told = RouteCounts(asked="paper", cover=None, paper=4, taken="paper", why="so many")
    (alone,) = route_lines(proof.changed(routes=told))
    assert alone.endswith("4 by the paper's largest baselines; so many")
    assert route_lines(proof) == []


def _failures(routes, **proof):
    needed = {"count": 3, "lower_bound": 3}
    table = {
        "count": 3,
        "status": "optimal",
        "required_m2": 0.1,
        "n_samples": 2000,
        "candidates": {"lower_bound": 3, "n_candidates": 480},
        "continuous": None,
        "greedy_count": 3,
        "needed": needed,
        "best_area": {"value_m2": 0.1, "upper_bound_m2": 0.1},
        "one_fewer": None,
        "routes": routes,
        **proof,
    }
    findings = AuditFindings()
    audit_routes(Certificate.model_validate(table), findings)
    return findings.failures


TRUE = {"asked": "both", "cover": 3, "paper": 4, "taken": "cover", "why": "fewer"}


def test_true_claims_of_the_routes_pass():
    assert _failures(TRUE) == ()
    assert _failures(TRUE | {"paper": None}) == ()
    assert _failures(TRUE | {"cover": 4, "paper": 3, "taken": "paper"}) == ()
    alone = TRUE | {"asked": "paper", "cover": None, "paper": 3, "taken": "paper"}
    assert _failures(alone) == ()
    # Fresh samples may ask for one more than the route needs.
    more = {"status": "feasible", "needed": {"count": 4, "lower_bound": 3}}
    assert _failures(TRUE, **more) == ()
    assert _failures(None) == ()


@pytest.mark.parametrize(
    ("change", "proof", "said"),
    [
        ({"paper": 2}, {}, "a route needs 2 cameras, but at least 3"),
        ({"taken": "paper"}, {}, "4 cameras are taken instead of 3"),
        ({"cover": 4}, {}, "needs 4, the certificate says 3"),
        ({"cover": 0}, {}, "must be a number of cameras"),
        ({"asked": "cover"}, {}, "null where 'cover' was asked"),
        ({"asked": "paper"}, {}, "'cover' is taken where 'paper' was asked for"),
        ({"cover": None}, {}, "has no count"),
        ({}, {"needed": {"count": 4, "lower_bound": 3}}, "needs 3, the certificate"),
    ],
)
def test_a_false_claim_of_the_routes_is_found(change, proof, said):
    routes = copy.deepcopy(TRUE) | change
    assert said in " ".join(_failures(routes, **proof))


@pytest.mark.parametrize(
    "change", [{"cover": 2.5}, {"paper": np.nan}, {"taken": "luck"}]
)
def test_routes_that_are_no_claim_break_the_plan(change):
    with pytest.raises(ValueError, match=next(iter(change))):
        _failures(TRUE | change)


def test_what_any_of_many_cameras_measures_is_asked_in_batches(ball, coarse):
    scene, cover = ball[0], coarse[0]
    cameras = cover.candidates.cameras
    assert len(cameras) > 7
    found = measured_by_any(scene, cameras, cover.samples)
    assert np.array_equal(found, cover.measured.any(axis=1))
    # The last one alone measures what it measures, wherever its batch ends.
    last = measured_by_any(scene, (cameras[0], *cameras[-1:]), cover.samples)
    assert np.array_equal(last, cover.measured[:, [0, -1]].any(axis=1))


def test_fresh_samples_deny_what_all_candidates_would(ball, coarse):
    """Whether chosen ones are enough is asked of few, and is what all would tell."""
    (scene, projectors, _), cover = ball, coarse[0]
    fresh = scene.target_samples(DRAWS.fresh_cameras)
    lit, measured = measured_of(scene, projectors, cover.candidates, fresh)
    reached, told = measured.any(axis=1).mean(), set[tuple[bool, bool]]()
    for k in range(1, 1 + len(cover.cameras)):
        chosen = cover.selection.chosen[:k]
        share = measured[:, chosen].any(axis=1).mean()
        # Enough of all, of what is reached alone, and of neither.
        for part in (0.99 * share, share * (1.0 + 1.0 / reached) / 2.0, 1.01 * share):
            part = min(part, 1.0)
            required = replace(scene.requirements, coverage=part)
            other = replace(scene, requirements=required)
            seen = denial(other, projectors, cover.candidates, chosen, fresh)
            among = candidate_cover(other, measured, lit, cover.candidates.cameras)
            assert (seen is None) == among.enough(chosen)
            assert seen is None or np.array_equal(seen, measured)
            told.add((share >= part, seen is None))
    assert {(True, True), (False, False)} <= told
    assert (False, True) in told or reached == 1.0
