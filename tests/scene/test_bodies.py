"""Bodies of devices: what they touch, what they shade, and plans that bear them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from scipy.spatial.transform import Rotation
from support.factories import make_requirements, make_scene
from support.plain_shapes import grid
from support.written import requirements_of

from geometry.devices import ParallelModel, PinholeModel
from geometry.mesh.mesh import TriangleMesh
from geometry.shapes.boxes import (
    OrientedBox,
    box_gap,
    boxes_overlap,
    lines_cross,
    triangles_touch,
)
from planning import load_rig
from planning.cameras.camera_baselines import BaselineSamples
from planning.cameras.camera_bodies import CameraInterference, resolved_cover
from planning.cameras.camera_cover import CameraCover
from planning.model.devices.bodies import Body, Box, Existing
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.errors import InfeasibleLimitsError, RigError
from planning.projectors.projector_poses import _Lit
from planning.proofs.conflicts import (
    Interference,
    resolve_conflicts,
    resolve_others,
)
from planning.proofs.marginals import marginals
from planning.proofs.selection import CandidateCover, select_fewest
from planning.report.drawing.figures import device_figures
from planning.rig.wishes import Wishes
from planning.scene import lighting
from planning.scene.bodies.clearance import (
    candidates_with_clearance,
    check_existing_clearance,
    lacks_clearance,
)
from planning.scene.draws import Draw
from planning.scene.lighting import lit_stages
from planning.scene.limits import camera_limits, projector_limits
from planning.scene.measuring import measurability
from planning.scene.measuring.camera_views import camera_views
from planning.scene.measuring.measured import lit_samples, measured_by
from planning.scene.placed_bodies import bodies_of
from planning.verify.audit.audit_samples import AuditSamples
from planning.verify.audit.predicates.audit_devices import AuditCamera, AuditProjector
from planning.verify.audit.predicates.occlusion import Block, Shadow, block_of
from planning.verify.audit.predicates.predicates import (
    CAMERA_BODY,
    PROJECTOR_BODY,
    light_steps,
    sight_steps,
)
from planning.verify.reconstruction.render.occluders import obstacles_of

# ---- boxes


def random_box(rng, *, spread=1.0):
    turn = Rotation.random(random_state=rng).as_matrix()
    return OrientedBox(spread * rng.normal(size=3), turn, rng.uniform(0.1, 0.8, 3))


def as_block(box):
    return Block("", box.axes.T, box.centre, box.half)


def gap(a, b):
    """Distance of two boxes: least squares over the places within both."""
    between = np.hstack([a.axes.T, -b.axes.T])
    half = np.concatenate([a.half, b.half])
    return lsq_linear(between, b.centre - a.centre, (-half, half)).cost ** 0.5


def test_boxes_overlap_where_the_point_between_them_says_so():
    rng = np.random.default_rng(1)
    counts = [0, 0]
    for _ in range(160):
        a, b = random_box(rng, spread=0.6), random_box(rng, spread=0.6)
        apart = gap(a, b)
        if 1e-5 < apart < 1e-3:
            continue
        counts[int(apart > 1e-3)] += 1
        assert boxes_overlap(a, b) == (apart <= 1e-5)
        assert as_block(a).overlaps(as_block(b)) == (apart <= 1e-5)
    assert min(counts) > 40


def test_boxes_side_by_side_touch_only_when_grown():
    square = OrientedBox(np.zeros(3), np.eye(3), np.full(3, 0.5))
    beside = replace(square, centre=np.array([1.001, 0.3, 0.0]))
    assert not boxes_overlap(square, beside)
    assert boxes_overlap(square.grown(0.0011), beside)
    inside = replace(square, half=np.full(3, 0.1))
    assert boxes_overlap(square, inside)
    assert as_block(square).overlaps(as_block(inside))


def test_lines_and_triangles_meet_a_box_where_their_points_do():
    rng = np.random.default_rng(2)
    share = np.linspace(0.0, 1.0, 401)[:, None]
    grid_ab = np.array([(a, b) for a in share[::10, 0] for b in share[::10, 0]])
    weights = np.column_stack([grid_ab, 1.0 - grid_ab.sum(axis=1)])
    weights = weights[weights[:, 2] >= 0.0]
    met = 0
    for _ in range(200):
        box = random_box(rng, spread=0.5)
        corners = 1.5 * rng.normal(size=(3, 3))
        line = corners[0] + share * (corners[1] - corners[0])
        found = bool(lines_cross(box, corners[0], corners[1:2])[0])
        assert found == as_block(box).meets(corners[:1], corners[1:2])[0]
        for points, answer in (
            (line, found),
            (weights @ corners, bool(triangles_touch(box, corners[None])[0])),
        ):
            beyond = (np.abs(box.local(points)) - box.half).max(axis=1).min()
            assert answer or beyond > 0.0
            assert not answer or beyond < 0.06
            met += answer
    assert 60 < met < 340
    # Along a face, in it and beside it: no division by zero decides.
    cube = OrientedBox(np.zeros(3), np.eye(3), np.ones(3))
    ends = np.array([[2.0, 0.5, 0.5], [2.0, 1.5, 0.5], [-1.5, 0.5, 0.5]])
    starts = np.array([[-2.0, 0.5, 0.5], [-2.0, 1.5, 0.5], [-2.0, 0.5, 0.5]])
    assert lines_cross(cube, starts, ends).tolist() == [True, False, False]


# ---- a plate, a lamp over it, and a camera whose body is between

DOWN = np.diag([1.0, -1.0, -1.0, 1.0])
LENS = PinholeModel(
    np.array([[1000.0, 0, 511.5], [0, 1000.0, 383.5], [0, 0, 1]]), (1024, 768), (0.3, 2)
)
BEAM = ParallelModel((1024, 768), 1e-3, (0.3, 2.0))
HOUSING = Body((0.0, 0.0, 0.0), (0.05, 0.03, 0.02))


def at(x, y, z):
    pose = DOWN.copy()
    pose[:3, 3] = x, y, z
    return pose


def projector(x=0.0, y=0.0, z=1.0, *, light="diverging", body=None, name="P1"):
    model = LENS if light == "diverging" else BEAM
    pose, radii = at(x, y, z), np.linspace(0.01, 0.9, 90)
    return PlannedProjector(name, light, pose, pose, model, radii, body=body)


def camera(x=0.02, y=0.01, z=0.6, *, body=HOUSING, name="C1"):
    return PlannedCamera(name, at(x, y, z), LENS, body=body)


@pytest.fixture(scope="module")
def scene():
    plate = grid(0.5, 0.5, divisions=(20, 20))
    required = make_requirements(plate, load_rig(), max_projectors=3, tau_m=0.003)
    return make_scene(plate, required)


def shadow_of_housing(light):
    """Corners of the rectangle on z = 0, by the theorem on intersecting lines."""
    low, high = np.array([-0.03, -0.02]), np.array([0.07, 0.04])
    scale = 1.0 if light == "parallel" else 1.0 / (1.0 - 0.62)
    return scale * low, scale * high


def audit_samples(target):
    samples, n = target.samples, len(target)
    return AuditSamples(
        samples.points,
        samples.normals,
        samples.faces,
        target.steep,
        np.full(n, -1),
        np.ones(n, dtype=bool),
        np.full(n, samples.weight),
    )


@pytest.mark.parametrize("light", ["diverging", "parallel"])
def test_a_body_in_the_beam_casts_a_rectangle(scene, light):
    low, high = shadow_of_housing(light)
    lamp, eye = projector(light=light), camera()
    target = scene.target_samples(Draw(4000, 7))
    points = target.samples.points
    dark = np.all((points[:, :2] > low) & (points[:, :2] < high), axis=1)
    area = np.prod(high - low)
    assert target.samples.weight * dark.sum() == pytest.approx(area, rel=0.15)
    assert np.all(lit_stages(scene, [lamp], target)[:, 0] == projector_limits.LIT)
    among = scene.among([lamp, eye])
    expected = np.where(dark, projector_limits.BLOCKED, projector_limits.LIT)
    assert np.array_equal(lit_stages(among, [lamp], target)[:, 0], expected)
    single = lighting.first_failure(
        lamp,
        target,
        scene.requirements.projector,
        scene.occlusion,
        bodies=among.bodies,
    )
    assert np.array_equal(single, expected)
    # The audit and the check from pixels, each with code of its own.
    samples = audit_samples(target)
    shade = AuditProjector(
        lamp.device, lamp.world_from_device, lamp.world_from_ring, lamp.ring_radii
    )
    limits = scene.requirements.projector
    free = Shadow(scene.mesh, threads=1)
    shade = replace(shade, blocks=(block_of(eye),))
    steps = light_steps(shade, samples, limits, free)
    assert np.array_equal(steps == PROJECTOR_BODY, dark)
    starts = lamp.world_from_device[:3, 3]
    if light == "parallel":
        starts = points + [0.0, 0.0, 1.0]
    ways = points - starts
    reach = np.linalg.norm(ways, axis=1)
    rig = SimpleNamespace(projectors=[lamp], cameras=[eye], obstacles=())
    ray = starts, ways / reach[:, None], 0.999 * reach
    hidden = scene.visibility.caster.occluded(*ray)
    hidden |= obstacles_of(rig, "P1").occluded(*ray)
    assert np.array_equal(hidden, dark)
    assert obstacles_of(rig, "C1") is None


def test_a_body_before_a_camera_hides_the_same_rectangle_but_never_its_own(scene):
    low, high = shadow_of_housing("diverging")
    blind, eye = camera(0.0, 0.0, 1.0, body=None, name="C2"), camera()
    target = scene.target_samples(Draw(3000, 8))
    points = target.samples.points
    dark = np.all((points[:, :2] > low) & (points[:, :2] < high), axis=1)
    among = scene.among([blind, eye])
    limits = scene.requirements.camera
    stage = measurability.view(
        blind, target, limits, scene.occlusion, among.bodies
    ).first_violated
    assert np.array_equal(
        stage, np.where(dark, camera_limits.BLOCKED, camera_limits.SEEN)
    )
    over, own = camera_views(among, [blind, eye], target)
    assert np.array_equal(over.samples, np.flatnonzero(~dark))
    assert np.array_equal(own.samples, camera_views(scene, [eye], target)[0].samples)
    samples = audit_samples(target)
    looks = AuditCamera(LENS, blind.world_from_device, (block_of(eye),))
    steps = sight_steps(looks, samples, limits, Shadow(scene.mesh, threads=1))
    assert np.array_equal(steps == CAMERA_BODY, dark)


# ---- room


def with_space(scene, **changes):
    required = scene.requirements
    space = replace(required.workspace, **changes)
    return replace(scene, requirements=replace(required, workspace=space))


BIG = Body((0.0, 0.0, 0.0), (2.0, 2.0, 2.0))
SQUARE = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@pytest.mark.parametrize(
    ("changes", "moved", "what"),
    [
        ({}, {}, ""),
        ({"floor_m": 0.57}, {}, ""),
        ({"floor_m": 0.59}, {}, "the floor"),
        ({"box": Box("box", (0, 0, 0.5), (0.08, 0.05, 0.2), SQUARE)}, {}, ""),
        (
            {"box": Box("box", (0, 0, 0.5), (0.06, 0.05, 0.2), SQUARE)},
            {},
            "the walls of the room",
        ),
        (
            {"keep_out": (Box("robot", (0.2, 0, 0.6), (0.12, 0.1, 0.1), SQUARE),)},
            {},
            "",
        ),
        (
            {"keep_out": (Box("robot", (0.2, 0, 0.6), (0.14, 0.1, 0.1), SQUARE),)},
            {},
            "the keep-out volume 'robot'",
        ),
        ({}, {"z": 0.01}, "the object"),
        ({}, {"body": BIG}, "the object"),
        ({}, {"x": 0.5, "y": 0.3, "z": 0.0}, "the body of P1"),
        ({}, {"x": 0.5, "y": 0.37, "z": 0.0}, ""),
    ],
)
def test_what_a_body_may_not_touch_is_named(scene, changes, moved, what):
    lamp = projector(0.5, 0.3, 0.04, body=HOUSING)
    space = with_space(scene, **changes).among([lamp])
    assert lacks_clearance(space, camera(**moved)) == what
    if not moved and what:
        # Devices that stand already may stand beyond the floor and the zones.
        assert lacks_clearance(space, replace(camera(), existing="old")) == ""


def test_lattices_are_refined_until_enough_have_room(scene):
    low = with_space(scene, floor_m=0.5)
    asked = []

    def offer(n):
        asked.append(n)
        return tuple(camera(z=z) for z in np.linspace(0.2, 1.0, n))

    kept = candidates_with_clearance(low, 10, offer)
    assert len(kept) >= 10
    assert asked[0] == 10
    assert len(asked) > 1
    assert all(c.world_from_device[2, 3] > 0.52 for c in kept)
    with pytest.raises(
        InfeasibleLimitsError, match=r"no camera of .* has room .* the floor 100 %"
    ):
        candidates_with_clearance(with_space(scene, floor_m=9.0), 10, offer)


def test_existing_bodies_that_overlap_are_refused(scene):
    def standing(name, x):
        rows = tuple(tuple(row) for row in at(x, 0.0, 0.6).tolist())
        return Existing(name, "camera", rows, HOUSING)

    def checked(x):
        pair = (standing("left", 0.0), standing("right", x))
        required = replace(scene.requirements, existing=pair)
        check_existing_clearance(
            replace(scene, requirements=required), (projector(),), (camera(),)
        )

    checked(0.11)
    with pytest.raises(
        InfeasibleLimitsError, match=r"'left': its body touches the body of right"
    ):
        checked(0.09)


# ---- clearance


def test_gaps_of_boxes_are_those_of_their_nearest_points():
    rng = np.random.default_rng(4)
    for _ in range(40):
        a, b = random_box(rng, spread=1.5), random_box(rng, spread=1.5)
        expected = np.sqrt(2.0) * gap(a, b)
        assert box_gap(a, b) == pytest.approx(expected, abs=1e-7)
        assert as_block(a).gap(as_block(b)) == pytest.approx(expected, abs=1e-6)
    square = OrientedBox(np.zeros(3), np.eye(3), np.full(3, 0.5))
    corner = replace(square, centre=np.array([1.03, 1.04, 0.2]))
    assert box_gap(square, corner) == pytest.approx(0.05, abs=1e-9)
    assert as_block(square).gap(as_block(corner)) == pytest.approx(0.05, abs=1e-9)


@pytest.mark.parametrize(
    ("aside", "down", "free"),
    [
        (0.1125, 0.0, False),
        (0.1135, 0.0, True),
        # Corner to corner 5 and 12 mm are 13: boxes grown by 13 mm would overlap.
        (0.105, 0.0718, False),
        (0.105, 0.0725, True),
    ],
)
def test_housings_keep_the_clearance_between_nearest_points(scene, aside, down, free):
    apart = with_space(scene, clearance_m=0.013)
    beside = camera(0.02 + aside, 0.01 + down, name="C2")
    among = apart.among([beside])
    assert (lacks_clearance(among, camera()) == "") == free
    assert lacks_clearance(scene.among([beside]), camera()) == ""
    lit = shares((0, 50), (50, 100))
    points = np.zeros((100, 3))
    pair = [camera(), beside]
    assert Interference(pair, points, lit, 0.013).stand_together([0, 1]) == free
    assert Interference(pair, points, lit, 0.0).stand_together([0, 1])


def test_the_clearance_binds_what_is_planned_and_nothing_but_housings(scene):
    old = with_space(scene, clearance_m=0.05)
    left, right = (
        Existing(name, "camera", tuple(map(tuple, at(x, 0.0, 0.6).tolist())), HOUSING)
        for name, x in (("left", 0.0), ("right", 0.11))
    )
    required = replace(old.requirements, existing=(left, right))
    standing = replace(old, requirements=required)
    check_existing_clearance(standing, (projector(),), (camera(),))
    near, far = camera(-0.12, 0.0), camera(-0.16, 0.0)
    assert lacks_clearance(standing, near) == "the body of left"
    assert lacks_clearance(standing, far) == ""
    # The plate is 1 mm away.
    assert lacks_clearance(standing, camera(-0.5, 0.0, 0.021)) == ""


# ---- chosen devices among each other


def interference_of(devices, lit):
    n = len(lit)
    points = np.column_stack([np.linspace(-0.2, 0.2, n), np.zeros((n, 2))])
    return Interference(devices, points, lit, 0.0)


def shares(*parts):
    lit = np.zeros((100, len(parts)), dtype=bool)
    for column, (start, stop) in enumerate(parts):
        lit[start:stop, column] = True
    return lit


def settled(devices, lit, share, max_count=None):
    cover = CandidateCover(lit, share, max_count=max_count)
    found = select_fewest(cover)
    bodied = interference_of(devices, lit)
    selection = resolve_conflicts(bodied, cover, found)
    return found, selection, bodied


SIDE_BY_SIDE = [
    projector(0.0, body=HOUSING),
    projector(0.08, body=HOUSING),
    projector(1.0, body=HOUSING),
    projector(-1.0, body=HOUSING),
]
PARTS = shares((0, 50), (50, 100), (50, 96), (96, 100))


def test_two_that_would_collide_are_kept_apart(scene):
    found, kept, bodied = settled(SIDE_BY_SIDE, PARTS, 0.95)
    assert found.chosen.tolist() == [0, 1]
    assert kept.chosen.tolist() == [0, 2]
    assert (kept.n_covered, kept.status, kept.but_for_bodies) == (96, "optimal", None)
    assert not bodied.stand_together([0, 1])
    cover = CandidateCover(PARTS, 0.95)
    others = resolve_others(bodied, cover, marginals(cover, kept), 2)
    assert all(bodied.stand_together(c) for c in others.by_count.values())
    assert bodied.covers([0], [0, 1, 2]).sum(axis=0).tolist() == [50, 0, 46]


def test_bodies_may_cost_a_device_more_than_is_proved_or_the_requirement():
    _, kept, _ = settled(SIDE_BY_SIDE, PARTS, 0.98)
    assert kept.chosen.tolist() == [0, 2, 3]
    assert (kept.lower_bound, kept.needed, kept.status) == (2, 3, "feasible")
    assert kept.n_covered == 100 <= kept.n_covered_bound
    assert kept.but_for_bodies == 2
    _, short, _ = settled(SIDE_BY_SIDE, PARTS, 0.98, max_count=2)
    assert short.chosen.tolist() == [0, 2]
    assert (short.n_covered, short.status, short.needed) == (96, "infeasible", 3)
    # Without the third there is no way at all: two would do, but for their bodies.
    lit = PARTS & [True, True, False, False]
    _, none, _ = settled(SIDE_BY_SIDE, lit, 0.98)
    assert (none.n_covered, none.status) == (50, "infeasible")
    assert none.but_for_bodies == none.needed == 2


def test_one_that_stands_in_anothers_light_is_replaced():
    # The second stands under the first and takes all of its light.
    wide = replace(HOUSING, half_m=(0.3, 0.3, 0.02))
    devices = [
        projector(0.0, 0.0, 1.0, body=wide),
        projector(0.0, 0.0, 0.6, body=wide),
        projector(1.0, 0.0, 1.0, body=HOUSING),
    ]
    lit = shares((0, 60), (60, 100), (58, 96))
    found, kept, bodied = settled(devices, lit, 0.95)
    assert found.chosen.tolist() == [0, 1]
    assert bodied.covers([0, 1], [0, 1]).sum(axis=0).tolist() == [0, 40]
    assert kept.chosen.tolist() == [0, 2]
    assert kept.n_covered == 96


def test_without_bodies_nothing_is_looked_at():
    bare = [replace(device, body=None) for device in SIDE_BY_SIDE]
    found, kept, _ = settled(bare, PARTS, 0.95)
    assert kept is found


def test_cameras_in_the_beam_are_judged_by_the_light_they_take(scene):
    places = [(0.02, 0.01, 0.6), (0.6, 0.0, 1.0), (0.68, 0.0, 1.0), (0.3, 0.0, 1.0)]
    lamp, eyes = projector(), [camera(*place) for place in places]
    rows = lit_samples(scene, [lamp], scene.target_samples(Draw(2000, 9)))
    measured = np.ones((len(rows.target), len(eyes)), dtype=bool)
    low, high = shadow_of_housing("diverging")
    points = rows.target.samples.points[:, :2]
    dark = np.all((points > low) & (points < high), axis=1)
    among = scene.among([lamp])

    points = rows.target.samples.points
    bodied = CameraInterference.among(among, (lamp,), rows, eyes, measured)
    assert not bodied.stand_together([0, 1])
    assert bodied.stand_together([1, 3])
    assert bodied.covers([1], [0, 1]).sum(axis=0).tolist() == [0, len(dark)]
    covers = bodied.covers([0], [0, 1])
    assert not covers[dark].any()
    # What stays lit is measured anew where the light on it changed, else as before.
    assert covers[~dark].all()
    # The third is too near to the second; the first stands in the view of the fourth.
    assert not bodied.stand_together([1, 2])
    assert bodied.covers([1], [1, 2]).sum(axis=0).tolist() == [len(dark), 0]
    body, aside = bodies_of(eyes[:1])[0].box, np.array(places[3])
    hidden = lines_cross(body, aside, rows.target.samples.points)
    assert 0 < (hidden & ~dark).sum() < len(dark)
    assert np.array_equal(bodied.covers([0], [3])[:, 0], ~hidden & ~dark)


def test_moves_into_anothers_body_or_beam_are_refused(scene):
    lamps = [projector(body=HOUSING), projector(0.3, body=HOUSING, name="P2")]
    rows = scene.target_samples(Draw(500, 10))
    state = _Lit(scene, rows, lamps, np.ones(len(rows), dtype=bool))
    beside = state.with_moved(1, projector(0.11, body=HOUSING))
    assert np.isfinite(beside).all()
    assert state.with_moved(1, projector(0.09, body=HOUSING)) is None
    under = state.with_moved(1, projector(0.02, 0.01, 0.6, body=HOUSING))
    assert 0.1 < np.isinf(under[:, 0]).mean() < 0.2
    # A single lamp: what a camera shades no other lights.
    lamps = lamps[:1]
    lit = lit_samples(scene, lamps, rows)

    samples = BaselineSamples(scene.among(lamps), tuple(lamps), lit)

    def measure(x, y, least_lit):
        eyes = [camera(x, y, 0.8), camera(-0.5, 0.5, 0.8)]
        return samples.measured(eyes, least_lit)

    n = len(lit.target)
    eyes = [camera(0.5, 0.5, 0.8), camera(-0.5, 0.5, 0.8)]
    expected = measured_by(scene, eyes, lit)
    assert expected.any()
    assert np.array_equal(measure(0.5, 0.5, n), expected)
    assert not measure(-0.42, 0.5, n).any()
    # In the beam it takes light for good.
    assert measure(0.1, 0.0, 0).any()
    assert not measure(0.1, 0.0, n).any()


# ---- rig files

FRAME = "[camera.body]\nsize_mm = [60, 70, 120]\ncentre_mm = [0, 5, -40]\n"


@pytest.fixture
def rig_of(tmp_path):
    def build(text, light=None):
        path = tmp_path / "rig.toml"
        path.write_text(f'base = "default"\n{text}', encoding="utf-8")
        return load_rig(path, light)

    return build


def test_bodies_of_a_rig_file_reach_devices_plan_and_existing(rig_of):
    old = (
        '[[existing]]\nname = "{}"\nkind = "camera"\nposition_mm = [0, -1100, {}]\n'
        "aim_mm = [0, 0, 0]\n"
    )
    own = "[existing.body]\nsize_mm = [10, 20, 30]\ncentre_mm = [1, 2, 3]\n"
    beam = FRAME.replace("camera", "parallel_projector")
    rig = rig_of(FRAME + beam + old.format("a", 0) + old.format("b", 500) + own)
    body = Body((0.0, 0.005, -0.04), (0.03, 0.035, 0.06))
    assert rig.camera_models[0].body == body
    assert rig.projector_models[0].body is None
    parallel = rig_of(FRAME + beam, "parallel").projector_models[0].body
    assert parallel is not None
    assert np.allclose(parallel.centre_m, body.centre_m)
    assert np.allclose(rig.to_document()["camera"]["body"]["half_m"], body.half_m)
    assert "body" not in rig.to_document()["projector"]
    required = rig.requirements(np.zeros(3), 0.1, Wishes(max_projectors=3), tau_m=0.003)
    a, b = required.existing
    assert a.body == body
    assert b.body is not None
    assert np.allclose(
        [*b.body.half_m, *b.body.centre_m][:4], [5e-3, 0.01, 0.015, 1e-3]
    )
    assert requirements_of(required.to_document()) == required
    without = rig_of(old.format("a", 0))
    assert "body" not in without.to_document()["existing"][0]
    required = without.requirements(
        np.zeros(3), 0.1, Wishes(max_projectors=3), tau_m=0.003
    )
    assert "body" not in required.to_document()["existing"][0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (FRAME.replace("[60,", "[0,"), r"camera.body.size_mm\[0\]"),
        (FRAME.replace("centre_mm = [0, 5, -40]\n", ""), "camera.body.centre_mm"),
        (FRAME.replace("size_mm", "sizes_mm"), "did you mean size_mm"),
    ],
)
def test_bad_bodies_are_refused(rig_of, text, message):
    with pytest.raises(RigError, match=message):
        rig_of(text)


def test_the_edges_of_a_body_are_drawn_where_it_is(scene):
    rig = SimpleNamespace(
        projectors=[projector()], cameras=[camera()], surface=SimpleNamespace()
    )
    rig.surface.mesh = scene.mesh
    bare, housed = device_figures(rig, body_m=0.01)  # type: ignore[arg-type]
    edges = np.concatenate(housed.body[len(bare.body) :])
    corners = {tuple(corner) for corner in np.round(edges, 9).tolist()}
    expected = bodies_of([camera()])[0].box.corners
    assert corners == {tuple(corner) for corner in np.round(expected, 9).tolist()}
    assert len(housed.body) == len(bare.body) + 12


def test_the_bodies_of_all_devices_but_ones_own_stand(scene):
    lamp, eye = projector(body=HOUSING), camera()
    assert [body.name for body in bodies_of([lamp, eye, camera(body=None)])] == [
        "P1",
        "C1",
    ]
    assert scene.among([projector(), camera(body=None)]) is scene
    mesh = obstacles_of(
        SimpleNamespace(projectors=[lamp], cameras=[eye], obstacles=()), "X"
    ).mesh
    assert isinstance(mesh, TriangleMesh)
    # Closed, and outwards: the divergence theorem gives both volumes.
    volume = np.linalg.det(mesh.corners).sum() / 6.0
    assert volume == pytest.approx(2 * 8 * np.prod(HOUSING.half_m))


def test_where_every_camera_keeps_something_dark_the_bodies_are_blamed(scene):
    lamp, eyes = projector(), [camera(0.02, 0.01, 0.6), camera(-0.02, 0.0, 0.6)]
    rows = lit_samples(scene, [lamp], scene.target_samples(Draw(500, 9)))
    measured = np.ones((len(rows.target), len(eyes)), dtype=bool)
    selection = select_fewest(CandidateCover(measured, 0.95))
    offered = SimpleNamespace(cameras=eyes)
    cover = CameraCover(offered, rows, measured, selection)  # type: ignore[arg-type]
    with pytest.raises(InfeasibleLimitsError, match="each of 2 camera bodies"):
        resolved_cover(scene.among([lamp]), (lamp,), cover)
