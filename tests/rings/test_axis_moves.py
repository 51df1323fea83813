"""Ring axes move only where the exact predicate agrees, and the proof follows them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from support.factories import make_camera, make_projector, make_requirements, make_scene

from geometry.poses import inverse
from geometry.shapes.primitives import sphere
from planning.cameras import axis_choice
from planning.cameras.axis_choice import (
    no_axes_need_fewer,
    other_axes,
    place_for_axes,
)
from planning.cameras.camera_cover import camera_candidate_views, plan_cameras
from planning.cameras.camera_stage import (
    cover_axes,
    follow_cameras,
    move_axes,
    proves_as_much,
    with_cameras,
)
from planning.cameras.proved_cameras import camera_stage
from planning.model.document.certificates import RouteCounts
from planning.rig.rig import load_rig
from planning.rings.axis_moves import (
    AxisJudge,
    axis_program,
    better,
    move_ring_axes,
    proposals,
)
from planning.rings.centred_axes import centred_axes
from planning.rings.ring_radii import uniform_radii
from planning.scene.codes.patterns import pattern_of
from planning.scene.draws import Draw
from planning.scene.lights import light_of, ring_frame
from planning.scene.measuring import measurability
from planning.scene.measuring.measured import lit_samples, measured_by
from planning.scene.workspace.candidates import Candidates
from solvers.poses.axis_program import axis_scores, axis_slack, pair_scores

RADIUS = 0.1
INF = np.inf


@pytest.fixture(scope="module", params=["diverging", "parallel"])
def ball(request):
    """A ball, two projectors beside each other, and cameras chosen for them."""
    mesh = sphere(RADIUS, subdivisions=3)
    rig = load_rig("default", light=request.param)
    required = make_requirements(mesh, rig, max_projectors=2, coverage=0.8)
    scene = make_scene(mesh, required)
    parallel = rig.light == "parallel"
    tilt = rig.ring_offset
    radii = uniform_radii(tilt + 0.15 if parallel else 0.3, 0.0035)
    template = make_projector(rig, radii, (tilt, -np.pi / 2))
    offered = Candidates(template, required.workspace).over(100)
    stands = np.stack([p.world_from_device[:3, 3] - mesh.centre for p in offered])
    wanted = np.array([[0.88, -0.46, 0.1], [0.92, 0.38, 0.1]])
    projectors = tuple(offered[i] for i in np.argmax(wanted @ stands.T, axis=1))
    camera = make_camera(rig)
    cover = plan_cameras(
        scene, projectors, camera_candidate_views(scene, (camera,), 60)
    )
    return scene, projectors, cover


def errors(scene, projectors, cameras, target):
    """Whether each is measured, and the rms of the least s_N."""
    rows = lit_samples(scene, projectors, target)
    sigma = AxisJudge.of(scene, cameras, rows).sigma.min(axis=0)
    measured = measured_by(scene, cameras, rows).any(axis=1)
    assert np.array_equal(np.isfinite(sigma), measured)
    return measured, np.sqrt(np.mean(sigma[measured] ** 2)), rows.lit


@pytest.fixture(scope="module")
def moved(ball):
    scene, projectors, cover = ball
    return move_ring_axes(scene, projectors, cover.cameras, cover.samples)


def test_errors_fall_and_nothing_is_lost(ball, moved):
    scene, projectors, cover = ball
    for target in (cover.samples.target, scene.target_samples(Draw(3000, 77))):
        (kept, before, lit), (now, after, still_lit) = (
            errors(scene, p, cover.cameras, target) for p in (projectors, moved)
        )
        assert np.array_equal(lit, still_lit)
        assert after < 0.97 * before
        assert np.count_nonzero(now) >= np.count_nonzero(kept) * 0.999
    assert now.sum() <= kept.size
    for old, new in zip(projectors, moved, strict=True):
        assert np.array_equal(old.world_from_device, new.world_from_device)
        assert np.array_equal(old.ring_radii, new.ring_radii)
    tilts = [
        np.linalg.norm(
            light_of(p.device).axis_of(inverse(p.world_from_device) @ p.world_from_ring)
        )
        for p in moved
    ]
    assert np.ptp(tilts) > 1e-4


def test_on_the_rows_no_fewer_are_measured(ball, moved):
    scene, projectors, cover = ball
    counts = [
        np.count_nonzero(errors(scene, p, cover.cameras, cover.samples.target)[0])
        for p in (projectors, moved)
    ]
    assert counts[1] >= counts[0]


def test_a_move_that_loses_a_sample_is_not_taken():
    """Whatever it wins elsewhere; one that measures more is, whatever it costs."""
    before = [np.array([[3.0, 3.0, INF], [INF, 9.0, INF]]), np.array([[3.0], [3.0]])]
    lost = [np.array([[1.0, INF, INF], [INF, INF, INF]]), np.array([[1.0], [1.0]])]
    assert not better(lost, before)
    traded = [np.array([[1.0, INF, 1.0], [INF, 9.0, INF]]), np.array([[INF], [INF]])]
    assert not better(traded, before)
    won = [np.array([[3.0, 3.0, 99.0], [INF, 9.0, INF]]), np.array([[3.0], [3.0]])]
    assert better(won, before)
    sharper = [np.array([[3.0, 3.0, INF], [INF, 2.0, INF]]), np.array([[3.0], [3.0]])]
    assert better(sharper, before)
    assert not better(before, before)


def test_no_axis_leaves_lit_samples_outside_the_last_ring(ball):
    """Rings that end just behind the farthest lit sample: any axis but theirs loses."""
    scene, projectors, cover = ball
    points = cover.samples.target.samples.points
    tight = [
        _with_last_ring(p, points[cover.samples.lit[:, i]])
        for i, p in enumerate(projectors)
    ]
    rows = lit_samples(scene, tight, cover.samples.target)
    assert np.array_equal(rows.lit, cover.samples.lit)
    views = AxisJudge.of(scene, cover.cameras, rows).views
    program = axis_program(scene, tight, 0, rows, views)
    coordinate = pattern_of(tight[0]).coordinate(points[rows.lit[:, 0]])
    inside = coordinate <= 0.99 * tight[0].ring_radii[-1]
    assert np.array_equal(axis_slack(program, program.start) >= 0.0, inside)
    assert not inside.all()
    after = move_ring_axes(scene, tight, cover.cameras, rows)
    assert any(new is not old for new, old in zip(after, tight, strict=True))
    assert np.array_equal(lit_samples(scene, after, rows.target).lit, rows.lit)


def test_fresh_samples_stay_inside_the_last_ring_too(ball):
    """A dozen rows reach less far than all that is lit: they would let the axis go."""
    scene, projectors, cover = ball
    few = cover.samples.target.take(np.arange(0, len(cover.samples.target), 150))
    every = scene.target_samples(Draw(4000, 250))
    lit = lit_samples(scene, projectors, every)
    points = lit.target.samples.points
    tight = [
        _with_last_ring(p, points[lit.lit[:, i]]) for i, p in enumerate(projectors)
    ]
    after = move_ring_axes(scene, tight, cover.cameras, lit_samples(scene, tight, few))
    assert np.array_equal(lit_samples(scene, after, lit.target).lit, lit.lit)


def test_what_is_lit_beside_the_target_stays_lit_too(ball):
    """The target is a cap; rings end just behind all else that is lit."""
    whole, projectors, cover = ball
    towards = whole.mesh.face_normals @ [0.8, 0.6, 0.0]
    required = replace(whole.requirements, target="dominant")
    region = np.where(towards > 0.9, 0, -1)
    scene = replace(whole, region=region, requirements=required)
    around = lit_samples(scene, projectors, scene.surface_samples(Draw(4000, 250)))
    points = around.target.samples.points
    tight = [
        _with_last_ring(p, points[around.lit[:, i]]) for i, p in enumerate(projectors)
    ]
    rows = lit_samples(scene, tight, scene.target_samples(Draw(500, 9)))
    after = move_ring_axes(scene, tight, cover.cameras, rows)
    assert any(new is not old for new, old in zip(after, tight, strict=True))
    assert np.array_equal(lit_samples(scene, after, around.target).lit, around.lit)


def test_the_best_proposal_is_tried_first(ball):
    """Near or far: from a start that blind curves close in, far is better."""
    scene, projectors, cover = ball
    views = AxisJudge.of(scene, cover.cameras, cover.samples).views
    offered = []
    for p in range(len(projectors)):
        program = axis_program(scene, projectors, p, cover.samples, views)
        for factor in (1.0, 0.0, -0.5):
            tried = replace(program, start=factor * program.start)
            axes = proposals(tried)
            values = [axis_scores(tried, axis).mean() for axis in axes]
            assert values[0] == max(values)
            assert values[0] > axis_scores(tried, tried.start).mean()
            offered.append(len(axes))
    assert max(offered) > 3


def _with_last_ring(projector, points):
    local = (points - projector.world_from_ring[:3, 3]) @ projector.world_from_ring[:3]
    reach = np.hypot(local[:, 0], local[:, 1])
    if projector.light == "diverging":
        reach = reach / local[:, 2]
    radii = uniform_radii(1.0001 * reach.max(), projector.ring_radii[0])
    return replace(projector, ring_radii=radii)


def test_the_program_scores_pairs_as_the_exact_predicate_does(ball):
    """Conditioning, s_N and pitch of `measurability`, as shares of their limits."""
    scene, projectors, cover = ball
    required = scene.requirements
    # What the panel's pixels leave hardly depends on the axis, and isn't stated.
    triangulation = replace(required.triangulation, ring_sigma_m=5e-5, drawn_edges=None)
    scene = replace(scene, requirements=replace(required, triangulation=triangulation))
    # Fine rings, which damp nothing, and a pitch limit as fine.
    fine = tuple(
        replace(p, ring_radii=uniform_radii(p.ring_radii[-1], 1e-4)) for p in projectors
    )
    limits = replace(triangulation, min_ring_pitch_px=0.17)
    scene = replace(
        scene, requirements=replace(scene.requirements, triangulation=limits)
    )
    rows = lit_samples(scene, fine, cover.samples.target)
    views = AxisJudge.of(scene, cover.cameras, rows).views
    program = axis_program(scene, fine, 1, rows, views)
    scores = pair_scores(program, program.start)
    lit = np.flatnonzero(rows.lit[:, 1])
    chosen = lit[:: -(-len(lit) // len(program.points))]
    seen = np.stack([v.seen[chosen] for v in views], axis=1)
    assert np.array_equal(scores > 0.0, seen)
    assert 100 < seen.sum() < seen.size
    samples = rows.target.samples.take(chosen)
    for k, view in enumerate(views):
        quality = measurability.pair_quality(
            samples.normals,
            rows.lights[1].take(chosen),
            pattern_of(fine[1]).surfaces(samples.points),
            view.take(chosen),
            limits,
        )
        e = (limits.min_conditioning / quality.conditioning) ** 2
        e = e + (quality.sigma / limits.max_sigma_m) ** 2
        e = e + (0.17 / quality.pitch) ** 8
        exact = 1.0 / (1.0 + e[seen[:, k]])
        assert scores[seen[:, k], k] == pytest.approx(exact, rel=1e-4)
    # What the other projector makes of a sample counts as given.
    assert program.others.max() > 0.3
    assert np.all(program.others[~rows.lit[chosen, 0]] == 0.0)


def test_an_axis_and_its_ring_frame_are_the_same(ball):
    _, projectors, _ = ball
    for p in projectors:
        for tilt, azimuth in ((0.05, 0.3), (0.12, 4.0)):
            frame = ring_frame(np.eye(4), p.device, tilt, azimuth)
            axis = light_of(p.device).axis_of(frame)
            again = light_of(p.device).ring_frame(axis)
            assert again == pytest.approx(frame, abs=1e-12)
            size = tilt if p.light == "parallel" else np.tan(tilt / 2)
            assert np.linalg.norm(axis) == pytest.approx(size)


def test_auto_takes_centred_axes_where_they_cost_no_camera(ball):
    """Two cameras measure 0.8 with centred axes; for 0.9 it takes free ones, or three.

    One coverage a light: both take the same way.
    """
    whole, projectors, cover = ball
    few = projectors[0].light == "parallel"
    required = replace(whole.requirements, coverage=0.8 if few else 0.9)
    scene, views = replace(whole, requirements=required), cover.candidates
    auto = place_for_axes(scene, projectors, views, "cover", axis="auto", margin=5e-3)
    assert (auto.axes, len(auto.stage.cameras)) == ("centred" if few else "free", 2)
    middle = centred_axes(scene, projectors, 5e-3)
    centred = cover_axes(scene, middle, views, "cover", "centred")
    assert len(centred.cover.cameras) == (2 if few else 3)
    assert centred.projectors == middle
    alike = [
        np.array_equal(a.world_from_ring, m.world_from_ring)
        for a, m in zip(auto.projectors, middle, strict=True)
    ]
    assert all(alike) if few else not any(alike)
    # The axes that weren't taken are there to compare, with rings that light the ball.
    others = other_axes(scene, auto, auto.stage.cameras, projectors[:1], 5e-3)
    apart = [
        np.abs(a.world_from_ring - o.world_from_ring).max()
        for a, o in zip(auto.projectors, others, strict=True)
    ]
    assert min(apart) > 0.01


@pytest.mark.long
def test_centred_axes_are_planned_whole_only_where_they_may_be_taken(ball, monkeypatch):
    """Free ones that save a camera end it; as many are held against centred ones.

    Centred ones that no others beat stand alone, unless fresh samples deny them.
    """
    whole, projectors, cover = ball
    asked, plain = [], cover_axes

    def told(*given):
        asked.append(given[-1])
        return plain(*given)

    def placed(coverage):
        asked.clear()
        required = replace(whole.requirements, coverage=coverage)
        scene, views = replace(whole, requirements=required), cover.candidates
        place_for_axes(scene, projectors, views, "cover", axis="auto", margin=5e-3)
        return asked

    monkeypatch.setattr(axis_choice, "cover_axes", told)
    few = projectors[0].light == "parallel"
    assert placed(0.85) == ["centred"]
    assert placed(0.9) == ["free"]
    assert placed(0.74 if few else 0.76) == ["free", "centred"]
    monkeypatch.setattr(axis_choice, "_needed_by_more", lambda *_: None)
    assert placed(0.9) == ["centred", "free"]


def test_what_cameras_see_bounds_what_any_axes_need(ball):
    """Three cameras where two see enough: no proof; two, which one can't replace."""
    scene, _, cover = ball
    chosen = cover.selection.chosen
    assert no_axes_need_fewer(scene, cover)
    spare = replace(cover.selection, chosen=np.append(chosen, [0]))
    assert not no_axes_need_fewer(scene, replace(cover, selection=spare))
    missed = replace(cover.selection, status="infeasible")
    assert not no_axes_need_fewer(scene, replace(cover, selection=missed))


def test_the_proof_is_of_the_axes_that_are_kept(ball, moved):
    scene, projectors, cover = ball
    stage = camera_stage(scene, cover)
    told = RouteCounts(asked="cover", cover=2, paper=None, taken="cover", why="so")
    stage = replace(stage, routes=told)
    followed = follow_cameras(scene, projectors, cover.cameras, stage)
    assert followed.stage.routes is told
    for new, expected in zip(followed.projectors, moved, strict=True):
        assert np.array_equal(new.world_from_ring, expected.world_from_ring)
    samples = followed.stage.cover.samples
    points = samples.target.samples.points
    for p, rings in zip(followed.projectors, samples.surfaces, strict=True):
        own = pattern_of(p).surfaces(points)
        assert np.array_equal(own.normals, rings.normals)
    count = len(cover.cameras)
    assert followed.stage.certificate.count == count
    # More are needed than under the axes before: what routes need isn't told anew.
    proof = stage.certificate
    other = proof.changed(needed=proof.needed.changed(count=proof.needed.count + 1))
    other = replace(stage, certificate=other)
    followed = follow_cameras(scene, projectors, cover.cameras, other)
    assert followed.stage is not other
    assert followed.stage.routes is None
    # One more than they need came in for fresh samples, and is the fewest now.
    fewer = replace(stage, routes=told.changed(cover=count - 1))
    followed = follow_cameras(scene, projectors, cover.cameras, fewer)
    assert followed.stage.certificate.candidates.lower_bound == count
    assert followed.stage.routes is None
    # Another number of cameras than is proved: axes and proof stay.
    more = follow_cameras(scene, projectors, (*cover.cameras, cover.cameras[0]), stage)
    assert more.stage is stage
    assert all(a is b for a, b in zip(more.projectors, projectors, strict=True))


@pytest.mark.parametrize(
    ("changes", "enough"),
    [
        ({}, True),
        ({"lower_bound": 2}, False),
        ({"status": "infeasible"}, False),
        ({"status": "feasible"}, True),
        ({"chosen": np.array([4, 5])}, False),
    ],
)
def test_axes_that_cost_the_proof_are_dropped(ball, changes, enough):
    _, _, cover = ball
    three = {"chosen": np.array([1, 2, 3]), "lower_bound": 3, "status": "optimal"}
    old = SimpleNamespace(status="feasible", candidates=SimpleNamespace(lower_bound=3))
    assert proves_as_much(replace(cover.selection, **three | changes), old, 3) == enough


def test_cameras_stay_with_the_axes_that_were_moved_for_them(ball, moved):
    scene, projectors, cover = ball
    axes, again = move_axes(scene, projectors, cover)
    assert len(again.cameras) <= len(cover.cameras)
    rows = int(again.measured[:, again.selection.chosen].any(axis=1).sum())
    assert again.selection.n_covered == rows
    assert rows >= again.selection.required
    if np.array_equal(again.selection.chosen, cover.selection.chosen):
        assert all(
            np.array_equal(a.world_from_ring, m.world_from_ring)
            for a, m in zip(axes, moved, strict=True)
        )
    # Under axes that had measured more, nothing changes.
    more = replace(cover, selection=replace(cover.selection, n_covered=10**6))
    axes, again = move_axes(scene, projectors, more)
    assert again is more
    assert all(a is b for a, b in zip(axes, projectors, strict=True))


@pytest.mark.parametrize(
    ("chosen", "required", "rows"),
    [([0, 2], 900, 999), ([0, 2], 1000, None), ([1, 2], 900, None), ([0], 100, None)],
)
def test_cameras_stay_if_others_measure_hardly_more(ball, chosen, required, rows):
    """Of 1000 samples the best two measure all, others 999 and 990."""
    measured = np.zeros((1000, 3), dtype=bool)
    measured[:600, 0] = measured[590:, 1] = measured[601:, 2] = True
    _, _, cover = ball
    selection = replace(
        cover.selection, chosen=np.array([0, 1]), required=required, n_covered=1000
    )
    best = replace(cover, measured=measured, selection=selection)
    before = replace(best, selection=replace(selection, chosen=np.array(chosen)))
    found = with_cameras(best, before)
    assert (found and found.selection.n_covered) == rows
    if found:
        assert np.array_equal(found.selection.chosen, chosen)
