"""Rings on a ball: finer where it bends, nothing measured lost; shares of rings."""

from dataclasses import replace

import numpy as np
import pytest
from support.factories import make_scene
from support.plain_shapes import box, joined, torus

from geometry.devices import PinholeModel
from geometry.mesh.mesh import TriangleMesh
from geometry.poses import look_at
from geometry.shapes.primitives import sphere
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.rig.rig import load_rig
from planning.rig.wishes import Wishes
from planning.rings import ring_pitch
from planning.rings.beam_profile import cast_beam
from planning.rings.centred_axes import centred_axes
from planning.rings.idle_rings import without_idle
from planning.rings.ring_creases import crease_errors, find_creases
from planning.rings.ring_limits import ring_beam
from planning.rings.ring_pitch import best_pitch, projector_gaps, widest_gap
from planning.rings.ring_radii import uniform_radii
from planning.rings.ring_shares import ring_shares
from planning.rings.ring_stage import space_rings
from planning.scene.codes.patterns import pattern_of
from planning.scene.draws import DRAWS, Draw
from planning.scene.lighting import lit_stages
from planning.scene.lights import ring_frame
from planning.scene.limits.projector_limits import LIT
from planning.scene.measuring import measurability
from planning.scene.measuring.measured import lit_samples, measured_by

RADIUS = 0.1
AWAY = 1.1
UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module", params=["diverging", "parallel"])
def bench(request):
    """A ball, a projector on -y whose ring axis stands aside, two cameras beside it."""
    return made(request.param, tilt_deg=8.0)


def made(light, *, tilt_deg=0.0, mesh=None):
    ball = sphere(RADIUS, subdivisions=5) if mesh is None else mesh
    rig = load_rig("default", light=light)
    required = rig.requirements(
        np.zeros(3), RADIUS, Wishes(max_projectors=1, target="surface"), tau_m=0.004
    )
    scene = make_scene(ball, required)
    device = rig.projector_device()
    pose = look_at(np.array([0.0, -AWAY, 0.0]), np.zeros(3), UP)
    tilt = np.deg2rad(tilt_deg)
    if light == "parallel":
        frame = ring_frame(pose, device, AWAY * np.tan(tilt), 0.0)
        outer, gap = AWAY * np.tan(tilt) + 1.2 * RADIUS, 0.004
    else:
        # Aimed by the middle of the image, which isn't on the optical axis.
        middle = device.rays(0.5 * (np.array(device.resolution) - 1.0))
        lift = np.arctan2(middle[1], middle[2])
        turn = np.eye(4)
        c, s = np.cos(lift), np.sin(lift)
        turn[1:3, 1:3] = [[c, s], [-s, c]]
        pose = pose @ np.linalg.inv(turn)
        frame = ring_frame(pose, device, tilt, 0.0)
        outer, gap = np.tan(tilt + np.arcsin(RADIUS / AWAY)) * 1.2, 0.004 / AWAY
    projector = PlannedProjector(
        "P1", light, pose, frame, device, uniform_radii(outer, gap)
    )
    cameras = tuple(
        PlannedCamera(f"C{i}", look_at(position, np.zeros(3), UP), rig.camera_device())
        for i, position in enumerate(
            [np.array([0.5, -0.95, 0.2]), np.array([-0.4, -0.95, 0.35])], 1
        )
    )
    return scene, projector, cameras


def measured(scene, projector, cameras, target):
    rows = lit_samples(scene, [projector], target)
    return measured_by(scene, cameras, rows).any(axis=1)


@pytest.fixture(scope="module")
def spaced(bench):
    scene, projector, cameras = bench
    return space_rings(scene, [projector], cameras, "curvature")


def test_the_light_meets_the_ball_where_the_closed_form_says():
    scene, projector, _ = made("parallel")
    c = np.array([0.01, 0.05, 0.08])
    profile = cast_beam(scene, projector, c, 36)
    truth = AWAY - np.sqrt(RADIUS**2 - c**2)
    assert profile.heights == pytest.approx(np.tile(truth[:, None], 36), abs=2e-4)
    assert profile.on_object.all()
    # Incidence is asin(c / a): the limit of 60 degrees lies between 0.08 and 0.09.
    assert profile.lit.all()
    assert not cast_beam(scene, projector, np.array([0.09]), 36).lit.any()


def test_what_even_rings_measure_stays_measured(bench, spaced):
    scene, even, cameras = bench
    final = spaced.projectors[0]
    assert spaced.records[0].spacing == "curvature"
    assert final.ring_radii[-1] == even.ring_radii[-1]
    target = scene.target_samples(Draw(4000, 77))
    before = measured(scene, even, cameras, target)
    after = measured(scene, final, cameras, target)
    assert before.sum() > 200
    assert np.count_nonzero(before & ~after) <= 0.002 * before.sum()
    # A finer gap passes nothing that a wider one didn't.
    assert not np.any(after & ~before)


def test_rings_to_spare_go_to_flat_surface_too():
    """A cube has no curvature between its creases; frames are paid for all the same."""
    scene, even, cameras = made("diverging", tilt_deg=8.0, mesh=box((0.1, 0.1, 0.1)))
    final = space_rings(scene, [even], cameras, "curvature").projectors[0]
    assert len(final.ring_radii) <= len(even.ring_radii)
    target = scene.target_samples(Draw(2000, 78))
    gap = {p: widest_gap(scene, [p], target) for p in (even, final)}
    assert gap[final] < 0.9 * gap[even]


def test_gaps_on_lit_samples_lie_between_their_limits(bench, spaced):
    scene, even, _ = bench
    final = spaced.projectors[0]
    rows = lit_samples(scene, [even], scene.target_samples(Draw(4000, 78)))
    points = rows.target.samples.points
    gap, before = (pattern_of(p).surfaces(points).spacing for p in (final, even))
    assert np.all(gap <= before * (1.0 + 1e-9))
    assert gap.min() < 0.8 * before.min()
    target = scene.target_samples(Draw(4000, 79))
    tau, tau_even = (widest_gap(scene, [p], target) for p in (final, even))
    assert tau <= tau_even * (1.0 + 1e-9)
    drawable = projector_gaps(even, final.ring_radii) / ring_pitch._ROOM
    gaps = np.diff(final.ring_radii, prepend=0.0)[1:]
    assert np.all(gaps >= drawable[1:] * (1.0 - 1e-9))


def test_three_projector_pixels_in_closed_form():
    """Rings about the optical axis: f a unit of the tangent, or one panel pixel."""
    _, projector, _ = made("parallel")
    c = np.array([0.01, 0.1, 0.2])
    pitch = projector.device.pixel_pitch_m
    room = ring_pitch._ROOM
    assert projector_gaps(projector, c) == pytest.approx(room * 3 * pitch)
    device = PinholeModel(
        np.array([[1500.0, 0, 511.5], [0, 1500.0, 383.5], [0, 0, 1]]),
        (1024, 768),
        (0.5, 2.0),
    )
    frame = projector.world_from_device
    centred = PlannedProjector("P1", "diverging", frame, frame, device, c)
    found = projector_gaps(centred, np.array([0.01, 0.1, 0.2, 0.9]))
    # Beyond the panel's corner nothing is drawn.
    assert found == pytest.approx(room * np.array([2e-3, 2e-3, 2e-3, 0.0]), rel=1e-6)
    assert room >= 1.0


def test_errors_between_rings_fall(bench, spaced):
    scene, even, _ = bench
    beam = ring_beam(scene, even, find_creases(scene.mesh, 0.005))
    before, after = (
        np.quantile(beam.errors_under(projector), 0.99)
        for projector in (even, spaced.projectors[0])
    )
    assert after < 0.9 * before
    assert spaced.records[0].over_tolerance <= 0.01


def test_uniform_leaves_the_rings_and_reports(bench):
    scene, projector, cameras = bench
    stage = space_rings(scene, [projector], cameras, "uniform")
    assert stage.projectors[0] is projector
    record = stage.records[0]
    assert record.spacing == "uniform"
    assert not record.kept_even


def test_rings_that_would_lose_samples_are_not_taken(bench, monkeypatch):
    """Room of a half: rings so fine that cameras can't separate them."""
    scene, projector, cameras = bench
    monkeypatch.setattr(ring_pitch, "_ROOM", 0.5)
    stage = space_rings(scene, [projector], cameras, "curvature")
    assert stage.projectors[0] is projector
    assert stage.records[0].kept_even


def test_the_best_pitch_is_that_of_a_loop_over_pairs(bench):
    scene, projector, cameras = bench
    rows = lit_samples(scene, [projector], scene.target_samples(Draw(300, 80)))
    views = [
        measurability.view(c, rows.target, scene.requirements.camera, scene.occlusion)
        for c in cameras
    ]
    both = best_pitch(scene, [projector], views, rows)[:, 0]
    alone = [best_pitch(scene, [projector], [v], rows)[:, 0] for v in views]
    assert np.array_equal(both, np.maximum(*alone))
    assert np.all((both == 0) | (both >= 6.0))


def test_a_rings_share_of_the_ball_is_all_or_nothing_about_its_axis():
    scene, projector, cameras = made("parallel")
    radii = np.array([0.03, 0.07, 0.08, 0.09, 0.097, 0.11])
    shares = ring_shares(scene, replace(projector, ring_radii=radii), cameras)
    assert shares.on_object == (1.0, 1.0, 1.0, 1.0, 1.0, 0.0)
    assert shares.on_target == shares.on_object
    # Lit up to 60 degrees of incidence, R = a sin 60 = 0.0866.
    assert max(shares.measured[3:]) == 0.0
    assert min(shares.measured[:3]) > 0.3


def test_a_shifted_ring_lands_on_the_ball_for_an_arc():
    """Two circles: radius R about the axis, a about the centre, d apart."""
    scene, projector, cameras = made("parallel", tilt_deg=8.0)
    d = AWAY * np.tan(np.deg2rad(8.0))
    radii = np.array([0.10, 0.15, 0.20])
    shares = ring_shares(scene, replace(projector, ring_radii=radii), cameras)
    arc = np.arccos((radii**2 + d**2 - RADIUS**2) / (2.0 * radii * d)) / np.pi
    assert shares.on_object == pytest.approx(arc, abs=4e-3)


def test_rings_that_miss_the_ball_are_left_out(bench):
    """The ball reaches from d - a to d + a of an axis d aside; a margin goes on top."""
    scene, projector, cameras = bench
    d, unit = AWAY * np.tan(np.deg2rad(8.0)), 1.0
    inner, outer = d - RADIUS, d + RADIUS
    if projector.light == "diverging":
        half, tilt, unit = np.arcsin(RADIUS / AWAY), np.deg2rad(8.0), 1.0 / AWAY
        inner, outer = np.tan(tilt - half), np.tan(tilt + half)
    margin, radii = 0.006 * unit, projector.ring_radii
    stage = space_rings(scene, [projector], cameras, "uniform", margin=margin)
    shown, left_out = stage.projectors[0].ring_radii, stage.records[0].left_out
    assert np.allclose(np.sort([*shown, *left_out]), radii)
    gap = radii[0]
    # The band of the first ring ends on the ball, widened; rays stand a quarter apart.
    assert inner - margin - gap <= shown[0] <= inner - margin + 0.3 * gap
    assert outer + margin - 0.3 * gap <= shown[-1] <= outer + margin + gap
    assert len(left_out) >= 2
    assert np.array_equal(stage.even[0].ring_radii, radii)


def test_kept_rings_and_a_beam_that_misses_leave_nothing_out():
    scene, projector, _ = made("parallel", tilt_deg=8.0)
    kept = replace(projector, keeps_rings=True)
    assert len(without_idle(scene, kept, 0.0).ring_radii) == len(projector.ring_radii)
    away = replace(projector, ring_radii=np.array([0.01, 0.02, 0.03]))
    assert len(without_idle(scene, away, 0.0).ring_radii) == 3


def test_a_pin_that_rays_miss_keeps_its_ring():
    """A needle 2 um wide, 0.2 m aside of the axis: only its vertices are met."""
    ball = sphere(0.05, subdivisions=3)
    n, x = len(ball.vertices), 0.19
    pin = [[x, -0.1, 0.0137], [x, 0.0, 0.0137], [x + 2e-6, 0.0, 0.0137]]
    mesh = TriangleMesh(
        np.vstack([ball.vertices, pin]), np.vstack([ball.faces, [[n, n + 1, n + 2]]])
    )
    scene, projector, _ = made("parallel", mesh=mesh)
    whole = replace(projector, ring_radii=np.arange(1, 81) * 0.003)
    shown = without_idle(scene, whole, 0.0).ring_radii
    coordinate = pattern_of(projector).coordinate(np.array(pin[:1]))[0]
    assert np.abs(shown - coordinate).min() < 0.003
    assert len(shown) < 40


def test_the_last_ring_is_shown_for_what_lies_beyond_it():
    """A small ball, and a hoop from 65 mm on about the axis; the last ring is 60 mm."""
    hoop = torus(0.08, 0.015)
    upright = TriangleMesh(hoop.vertices[:, [0, 2, 1]], hoop.faces[:, ::-1])
    mesh = joined(sphere(0.012, subdivisions=3), upright)
    scene, projector, _ = made("parallel", mesh=mesh)
    whole = replace(projector, ring_radii=np.arange(1, 7) * 0.01)
    shown = without_idle(scene, whole, 0.0).ring_radii
    np.testing.assert_allclose(shown, [0.01, 0.02, 0.06])


def test_a_centred_axis_runs_through_the_middle_of_what_is_lit(bench):
    scene, projector, _ = bench
    (centred,) = centred_axes(scene, [projector], 0.0)
    gap = projector.ring_radii[0]
    reach = RADIUS * np.sin(np.deg2rad(60.0))
    if projector.light == "diverging":
        # Incidence is the angle at the ball's centre and the ray's to the axis.
        ray = np.arcsin(RADIUS / AWAY * np.sin(np.deg2rad(60.0)))
        reach = np.tan(ray)
    frame = centred.world_from_ring
    towards = -frame[:3, 3]
    off = np.linalg.norm(towards - (towards @ frame[:3, 2]) * frame[:3, 2])
    assert off < 0.002
    assert reach - 0.5 * gap <= centred.ring_radii[-1] <= reach + 1.3 * gap
    assert centred.ring_radii[1] == projector.ring_radii[1]
    (wider,) = centred_axes(scene, [projector], 3.0 * gap)
    assert len(wider.ring_radii) == len(centred.ring_radii) + 3
    kept = replace(projector, keeps_rings=True)
    assert centred_axes(scene, [kept], 0.0) == (kept,)


def test_a_centred_axis_is_in_the_middle_of_what_its_own_rings_light(bench):
    """Rings about the axis before reach one side of the ball alone."""
    scene, projector, _ = bench
    (centred,) = centred_axes(scene, [projector], 0.0)
    few = replace(projector, ring_radii=centred.ring_radii)
    lit = lit_stages(scene, [few, centred], scene.target_samples(DRAWS.axes)) == LIT
    assert lit[:, 0].sum() < 0.97 * lit[:, 1].sum()
    (again,) = centred_axes(scene, [few], 0.0)
    frame = again.world_from_ring
    towards = -frame[:3, 3]
    off = np.linalg.norm(towards - (towards @ frame[:3, 2]) * frame[:3, 2])
    assert off < 0.002


def test_a_part_of_a_ring_beyond_the_panel_lands_nowhere():
    scene, projector, cameras = made("parallel", mesh=box((2.0, 0.05, 2.0)))
    half = projector.device.half_panel[1]
    radii = np.array([0.5 * half, 1.1 * half])
    shares = ring_shares(scene, replace(projector, ring_radii=radii), cameras)
    outside = 2.0 * np.arccos(1.0 / 1.1) / np.pi
    assert shares.on_object == pytest.approx([1.0, 1.0 - outside], abs=6e-3)


def test_a_roof_is_a_crease_of_its_slope_jump():
    """Two planes of slope +-0.5 meet in a ridge across the light: J = 1, J h / 4."""
    x = 0.09
    corners = np.array(
        [[s * x, 0.5 * x, z] for s in (-1, 1) for z in (-x, x)]
        + [[0.0, 0.0, -x], [0.0, 0.0, x]]
    )
    faces = np.array([[4, 5, 0], [0, 5, 1], [4, 2, 5], [2, 3, 5]])
    mesh = TriangleMesh(corners, faces)
    assert np.all(mesh.face_normals[:, 1] < 0)
    scene, projector, _ = made("parallel", tilt_deg=8.0, mesh=mesh)
    creases = find_creases(mesh, 0.005)
    assert creases.length.sum() == pytest.approx(2 * x)
    lit, error = crease_errors(scene, projector, creases)
    assert lit.all()
    # Where a ring crosses the ridge aslant, its own direction sees less of the jump.
    ring = creases.points - projector.world_from_ring[:3, 3]
    local = ring @ projector.world_from_ring[:3, :3]
    share = np.abs(local[:, 0]) / np.hypot(local[:, 0], local[:, 1])
    assert share.min() > 0.8
    gap = projector.ring_radii[1] - projector.ring_radii[0]
    assert error == pytest.approx(0.25 * share * gap, rel=1e-6, abs=1e-12)
