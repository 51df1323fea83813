"""Objects wider than one field: devices side by side, as many as areas ask for."""

from dataclasses import replace

import numpy as np
import pytest
from support.plain_shapes import box, grid
from support.written import requirements_of

from geometry.devices import ParallelModel, PinholeModel
from geometry.mesh.mesh import TriangleMesh
from geometry.poses import inverse, transform
from geometry.shapes.primitives import sphere
from planning.cameras.camera_cover import camera_candidate_views
from planning.model.devices.bodies import Box
from planning.model.devices.device_poses import moved_to
from planning.model.devices.planned import PlannedCamera
from planning.model.progress import Stopwatch
from planning.projectors.candidate_set import CandidateSet, CandidateSource
from planning.projectors.one_fewer import one_fewer
from planning.projectors.projector_poses import widen_margins
from planning.projectors.projector_stage import plan_projectors
from planning.projectors.proved_projectors import prove_fewest
from planning.projectors.share_margin import margin_at_share
from planning.proofs.all_poses import Effort
from planning.report.advice.projector_relaxations import wider_field
from planning.report.partial_plan import PlanRequest
from planning.rig.rig import load_rig
from planning.rig.wishes import Wishes
from planning.scene.draws import Draw
from planning.scene.lighting import lit_margins, lit_stages
from planning.scene.limits.projector_limits import LIT
from planning.scene.workspace.candidates import Candidates
from planning.scene.workspace.view_tiles import poses_beside, tiled_poses
from planning.steps.prepare import prepared
from planning.verify.audit.devices.workspace_claims import outside_by

EFFORT = Effort(finest=4, maps=4, budget=1e7, shadows=0.0, most_samples=500)
SHIFTED = PinholeModel(
    np.array([[1500.0, 0, 511.5], [0, 1500.0, 880.0], [0, 0, 1]]),
    (1024, 768),
    (0.9, 2.0),
)


ASKEW = np.array(
    [[np.cos(0.6), np.sin(0.6), 0], [-np.sin(0.6), np.cos(0.6), 0], [0, 0, 1]]
)


def askew(width, height):
    """A plate whose sides are along no axis."""
    flat = grid(width, height, divisions=(6, 4))
    return TriangleMesh(flat.vertices @ ASKEW, flat.faces)


def readied(mesh, light, incidence, most=9, share=0.99, **workspace):
    """The scene, and the template, limits as given in degrees."""
    wishes = Wishes(max_projectors=most, target="surface", dominant_coverage=share)
    order = PlanRequest(mesh, load_rig("default", light), wishes)
    ready = prepared(order, Stopwatch())
    required = ready.scene.requirements
    required = replace(
        required,
        projector=replace(required.projector, max_incidence=np.radians(incidence)),
        workspace=replace(required.workspace, **workspace),
    )
    bare = np.zeros_like(ready.scene.steep)
    scene = replace(ready.scene, requirements=required, steep=bare)
    return scene, ready.templates[0]


def most_lit(device, incidence):
    """Area that one projector lights of a plane at most.

    Of parallel light it is the panel's over the cosine of the incidence, of diverging
    light the solid angle of the image times the square of the range over that.
    """
    slant = np.cos(np.radians(incidence))
    if isinstance(device, ParallelModel):
        return 4.0 * device.half_panel.prod() / slant
    pixels = np.stack(np.meshgrid(np.arange(1024.0), np.arange(768.0)), axis=-1)
    z = device.rays(pixels.reshape(-1, 2))[:, 2]
    solid_angle = float((z**3).sum()) / device.focal_px**2
    return solid_angle * device.range_m[1] ** 2 / slant


@pytest.mark.parametrize(
    ("light", "incidence", "sides", "count"),
    [
        # A panel of 819 x 614 mm holds half and a quarter of these.
        ("parallel", 15.0, (1.40, 0.55), 2),
        ("parallel", 15.0, (1.58, 1.12), 4),
        # Sharp to 1.77 m, from 1.65 an image of 978 x 698 mm holds half of this.
        ("diverging", 25.0, (1.52, 0.66), 2),
    ],
)
def test_a_plate_takes_as_many_beams_as_its_area_asks_for(
    monkeypatch, light, incidence, sides, count
):
    """They are enough side by side; one fewer light too little, wherever they stand.

    The plate lies askew: its sides are along no axis.
    """
    # Directions around the normal alone: a lattice of the whole shell takes more poses.
    scene, template = readied(
        askew(*sides), light, incidence, share=0.98, half_angle=0.6
    )
    least = 0.98 * sides[0] * sides[1] / most_lit(template.device, incidence)
    assert count - 1 < least <= count
    stage = plan_projectors(scene, (template,), 60, rounds=1)
    stage = prove_fewest(scene, stage, (template,), EFFORT)
    needed = stage.certificate.needed
    assert (needed.count, needed.lower_bound) == (count, count)
    assert stage.certificate.continuous.lower_bound <= count
    if light == "parallel":
        return
    monkeypatch.setattr("planning.projectors.projector_poses._SWEEPS", 1)
    rows = stage.candidates.samples
    moved = widen_margins(scene, stage)
    lit = lit_stages(scene, moved, rows) == LIT
    assert lit.any(axis=1).mean() >= 0.98
    space = scene.requirements.workspace
    places = np.stack([p.world_from_device[:3, 3] for p in moved])
    assert outside_by(places, space.projector_radius_m, space).max() <= 0.0
    required = int(np.ceil(0.98 * len(rows)))
    before, after = (
        margin_at_share(lit_margins(scene, group, rows, on), required)
        for group, on in (
            (stage.projectors, lit_stages(scene, stage.projectors, rows) == LIT),
            (moved, lit),
        )
    )
    assert after > before


def test_two_beams_that_leave_a_gap_are_moved_together():
    """Panels of 819 mm, 880 apart over a plate of 1.4 m: 61 mm between are dark."""
    scene, template = readied(
        grid(1.4, 0.55, divisions=(6, 4)), "parallel", 15.0, half_angle=0.3
    )
    rows = scene.target_samples(Draw(1000, 100))
    turn = np.array([[1.0, 0, 0], [0, -1.0, 0], [0, 0, -1.0]])
    apart = []
    for x in (-0.44, 0.0, 0.44):
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = turn, (x, 0.0, 1.2)
        apart.append(moved_to(template, pose))
    lattice = CandidateSet.over(scene, rows, tuple(apart))
    dark = ~np.any(lattice.lit[:, [0, 2]], axis=1)
    assert dark.mean() == pytest.approx(0.061 / 1.4, abs=0.01)
    found = one_fewer(
        CandidateSource(scene, (template,)),
        lattice,
        2,
        finer=lambda: lattice,
        reached=lattice.reached,
    )
    assert found is not None
    assert len(found.projectors) == 2
    assert found.reached.mean() >= 0.99


def test_offers_towards_a_direction_look_beside_the_centre_too():
    scene, template = readied(grid(2.0, 0.5, divisions=(6, 4)), "parallel", 50.0)
    site = scene.site("projector", template.device)
    offer = Candidates(template, scene.requirements.workspace, site)
    found = offer.towards(np.array([[0.0, 0.6, 0.8]]))
    poses = np.stack([p.world_from_device for p in found])
    assert np.allclose(poses[:, :3, 2], [0.0, -0.6, -0.8])
    assert poses[:, 0, 3].min() < -0.5
    assert poses[:, 0, 3].max() > 0.5
    rows = scene.target_samples(Draw(300, 7))
    assert np.any(lit_stages(scene, found, rows) == LIT, axis=1).all()


@pytest.mark.parametrize("light", ["parallel", "diverging"])
def test_rings_reach_the_corners_of_an_image_that_looks_beside(light):
    _, template = readied(box((0.62, 0.1, 0.1)), light, 60.0)
    corner = load_rig("default", light).outer_ring_radius()
    assert template.ring_radii[-1] == pytest.approx(corner)


def test_one_beam_too_few_says_how_wide_two_must_be():
    """A plate of 1.4 x 0.55 m by one beam: a disc of the half diagonal, at 15 degrees

    at least one of that times its cosine where the long side lies along the slant.
    """
    scene, template = readied(
        grid(1.4, 0.55, divisions=(6, 4)), "parallel", 15.0, most=1, share=1.0
    )
    stage = plan_projectors(scene, (template,), 60, rounds=1)
    said = wider_field(scene, stage, 1)
    points = stage.candidates.samples.samples.points[:2000, :2]
    upright = 1e3 * np.hypot(*points.T).max()
    aslant = 1e3 * np.hypot(points[:, 0] * np.cos(np.radians(15)), points[:, 1]).max()
    radius = int(said.removeprefix("a beam of ").split(" mm")[0])
    assert np.floor(aslant) <= radius <= np.ceil(upright) + 1


def test_one_image_too_few_is_wide_enough_from_as_far_as_it_is_sharp():
    """What counts is up to r from the middle, at asin(r / 1.77) degrees or more."""
    scene, template = readied(askew(1.5, 0.66), "diverging", 40.0, most=1, share=0.95)
    stage = plan_projectors(scene, (template,), 60, rounds=1)
    said = wider_field(scene, stage, 1)
    degrees = int(said.removeprefix("an image that reaches ").split(" degrees")[0])
    off = np.hypot(*stage.candidates.samples.samples.points[:2000, :2].T)
    reach = np.quantile(off, 0.95)
    least = np.degrees(np.arcsin(reach / template.device.range_m[1]))
    assert np.floor(least) <= degrees <= least + 4.0


def test_what_fits_stays_as_it_was_and_is_named_by_no_key():
    """The threshold is that of the ball: R = 307 mm for the panel, sin for an image."""
    beam = ParallelModel((1024, 768), 8e-4, (0.4, 2.5))
    assert beam.holds_ball(0.307, 1.0 + 0.307)
    assert not beam.holds_ball(0.3073, 1.0 + 0.3073)
    assert not replace(beam, beam_radius=0.1).holds_ball(0.11, 1.11)
    centred = replace(
        SHIFTED, camera_matrix=np.array([[1500, 0, 511.5], [0, 1500, 383.5], [0, 0, 1]])
    )
    sine = np.sin(np.arctan(384.0 / 1500.0))
    largest = sine / (1.0 - sine)
    assert centred.holds_ball(largest - 1e-6, 1.0 + largest - 1e-6)
    assert not centred.holds_ball(largest + 1e-6, 1.0 + largest + 1e-6)
    fitting, *_ = readied(box((0.2, 0.2, 0.1)), "parallel", 60.0)
    written = fitting.requirements.to_document()["workspace"]
    assert not [key for key in written if "standoff" in key]
    assert fitting.site("projector", beam) is None
    low, _ = fitting.requirements.workspace.projector_radius_m
    assert low == pytest.approx(0.95 + 0.15, abs=1e-9)
    wide, *_ = readied(box((1.0, 0.2, 0.1)), "parallel", 60.0)
    space = wide.requirements.workspace
    document = wide.requirements.to_document()
    assert document["workspace"]["projector_standoff_m"] == 1.0
    assert requirements_of(document).workspace == space
    far = 1.05 + space.object_radius_m
    assert space.projector_radius_m == pytest.approx((0.95, far))
    assert space.camera_radius_m == space.projector_radius_m


@pytest.mark.parametrize("distance", [1.0, 1.7])
def test_the_rectangle_lies_in_an_image_whose_lens_is_shifted(distance):
    half = SHIFTED.half_rectangle(distance)
    signs = np.array([[a, b] for a in (-1, 1) for b in (-1, 1)])
    middle = SHIFTED.middle_ray
    y = np.cross(middle, [1.0, 0.0, 0.0])
    x = np.cross(y, middle)
    flat = signs * half
    corners = distance * middle + flat @ np.stack([x, y / np.linalg.norm(y)])
    pixels = SHIFTED.project(corners)
    assert SHIFTED.contains(pixels).all()
    # Two corners lie on its border.
    off = np.abs(pixels[:, None] - np.array([[-0.5, -0.5], [1023.5, 767.5]])).min()
    assert off < 1e-6


@pytest.mark.parametrize("beam", [0.2, 0.35, 0.45, 0.6])
def test_the_rectangle_in_a_round_beam_is_in_the_panel_too(beam):
    device = ParallelModel((1024, 768), 8e-4, (0.4, 2.5), beam)
    half = device.half_rectangle(1.0)
    assert np.hypot(*half) == pytest.approx(min(beam, 0.512))
    assert np.all(half <= device.half_panel + 1e-12)


ROOM = Box("room", (0.0, 0.0, 0.8), (1.5, 0.6, 0.7), ((1, 0, 0), (0, 1, 0), (0, 0, 1)))
CEILING = Box(
    "ceiling", (0.0, 0.0, 1.2), (2.0, 2.0, 0.005), ((1, 0, 0), (0, 1, 0), (0, 0, 1))
)


@pytest.mark.parametrize("light", ["parallel", "diverging"])
@pytest.mark.parametrize(
    "zones",
    [
        {},
        {"half_angle": 0.7, "floor_m": 0.6},
        {"box": ROOM},
        {"mounting": (CEILING,)},
    ],
)
def test_devices_side_by_side_stand_where_the_workspace_lets_them(light, zones):
    """By the audit's own measure; and they reach all of a plate 2 m long."""
    plate = grid(2.0, 0.5, divisions=(6, 4))
    scene, template = readied(plate, light, 50.0, **zones)
    space = scene.requirements.workspace
    site = scene.site("projector", template.device)
    found = Candidates(template, space, site).over(40)
    places = np.stack([p.world_from_device for p in found])[:, :3, 3]
    assert outside_by(places, space.projector_radius_m, space).max() <= 1e-9
    if not ("box" in zones or "mounting" in zones):
        # Those that look at the centre stand off the ball about the object.
        away = np.linalg.norm(places[:40] - np.array(space.centre), axis=1)
        assert np.allclose(away, 1.0 + space.object_radius_m)
    rows = scene.target_samples(Draw(100, 7))
    assert np.all(np.any(lit_stages(scene, found, rows) == LIT, axis=1))
    beside = poses_beside(
        site, np.stack([p.world_from_device for p in found[::40]]), 20, reach=0.2
    )
    assert outside_by(beside[:, :3, 3], space.projector_radius_m, space).max() <= 1e-9


def test_tiles_hold_the_plate_from_each_direction_and_none_is_offered_from_behind():
    """A plate of 2 m lies askew; a panel is 819 mm wide, 614 high, or the other way.

    Seen along its normal it takes 3 or 4 tiles, at 30 degrees (1.73 m) 3 either way, at
    48 (1.34 m) 2 or 3; and once more one more.
    """
    scene, template = readied(askew(2.0, 0.5), "parallel", 50.0)
    site = scene.site("projector", template.device)
    tilts = np.radians([0.0, 30.0, 48.0, 180.0])
    along = np.column_stack([np.sin(tilts), 0.0 * tilts, np.cos(tilts)])
    directions = along @ ASKEW
    poses, owner = tiled_poses(site, directions, (0.0, np.pi / 2))
    assert np.bincount(owner).tolist() == [3 + 4 + 4 + 5, 2 * (3 + 4), 2 + 3 + 3 + 4]
    points = site.samples.points
    space = scene.requirements.workspace
    many = Candidates(template, space, site).over(300)
    assert 300 < len(many) <= 5 * 300
    for k in range(3):
        held = np.zeros(len(points), dtype=bool)
        for pose in poses[owner == k]:
            assert np.allclose(pose[:3, 2], -directions[k])
            local = transform(inverse(pose), points)
            inside = np.all(np.abs(local[:, :2]) <= template.device.half_panel, axis=1)
            held |= inside
            # The standoff over what stands out farthest, or where the shell begins.
            near = local[inside, 2].min()
            inner = np.linalg.norm(pose[:3, 3] - np.array(space.centre)) < 1.0 + 1e-9
            assert near == pytest.approx(1.0, abs=0.02) or (inner and near > 1.0)
        assert held.all()


def test_a_farther_set_of_tiles_stays_below_the_top_of_the_shell():
    """A ball of 0.4 m faces 60 degrees of light with 0.69 m across.

    At 1 m the image holds 592 x 423 mm of it: 2 x 2 tiles, and 3 x 3; at 1.4 m, the
    farthest from the centre, 829 mm: 1 x 2.
    """
    scene, template = readied(sphere(0.4, subdivisions=3), "diverging", 60.0)
    site = scene.site("projector", template.device)
    poses, _ = tiled_poses(site, np.array([[0.0, 0.0, 1.0]]), (0.0,))
    assert len(poses) == 4 + 9 + 2
    away = np.linalg.norm(poses[:, :3, 3], axis=1)
    assert away.max() <= 1.4 + 1e-9


@pytest.mark.parametrize("light", ["parallel", "diverging"])
def test_poses_around_one_keep_its_aim_or_its_direction(light):
    scene, template = readied(grid(2.0, 0.5, divisions=(6, 4)), light, 50.0)
    site = scene.site("projector", template.device)
    pose = tiled_poses(site, np.array([[0.0, 0.0, 1.0]]), (0.0,))[0][0]
    middle = template.device.middle_ray
    aim = pose[:3, 3] + pose[:3, :3] @ middle
    found = poses_beside(site, pose[None], 30, reach=0.1)
    kept = np.array([np.allclose(p[:3, :3], pose[:3, :3], atol=1e-12) for p in found])
    assert 20 <= kept.sum() <= 30
    for other in found[~kept]:
        to_aim = inverse(other)[:3, :3] @ (aim - other[:3, 3])
        assert np.linalg.norm(np.cross(to_aim, middle)) < 1e-9
        turn = other[:3, :3] @ middle @ (pose[:3, :3] @ middle)
        assert np.arccos(min(turn, 1.0)) <= 0.1 + 1e-9
    aside = found[kept][:, :2, 3] - pose[:2, 3]
    reach = 0.3 * template.device.half_rectangle(1.0).min()
    assert 0.5 * reach < np.hypot(*aside.T).max() <= reach


def test_cameras_stand_side_by_side_over_what_only_they_are_too_narrow_for():
    """A box of 0.6 m: it fits the beam, but not the camera's 0.44 m at 1 m."""
    scene, *_ = readied(box((0.58, 0.1, 0.1)), "parallel", 60.0)
    space = scene.requirements.workspace
    assert space.projector_standoff_m is None
    assert space.camera_standoff_m == 1.0
    device = load_rig("default", "parallel").camera_device()
    template = PlannedCamera("", np.eye(4), device)
    few = camera_candidate_views(scene, (template,), 60).cameras
    assert 60 < len(few) <= 6 * 60
    places = np.stack([c.world_from_device[:3, 3] for c in few])
    assert outside_by(places, space.camera_radius_m, space).max() <= 1e-9
    # Each side of the tiles' middle ones looks at its own half.
    looks = {round(float(c.world_from_device[0, 3]), 3) for c in few[60:]}
    assert min(looks) < -0.05
    assert max(looks) > 0.05
