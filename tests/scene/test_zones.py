"""Rooms, keep-out volumes and mounting planes: who may stand where, and who checks."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from support.plain_shapes import box as plate_of
from support.written import requirements_of

from geometry.mesh.mesh import TriangleMesh
from geometry.poses import fibonacci_cap
from planning import load_rig, plan_rig
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.errors import InfeasibleLimitsError, RigError
from planning.model.plan import RequirementError, RigPlan
from planning.rig.wishes import Wishes
from planning.scene.workspace.admissible import (
    admissible,
    depth,
    half_spaces,
    may_stand,
    stands,
)
from planning.scene.workspace.candidates import Candidates
from planning.scene.workspace.shell_positions import along_rays, shell_positions
from planning.verify.audit.audit import audit_plan
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.devices.zone_claims import audit_zones, zone_excess

# A ball of 100 mm: devices stand 1050 to 1150 mm from its centre, which is off the
# origin, so that offsets and positions differ.
RADIUS, CENTRE = 0.1, np.array([0.3, -0.2, 0.1])
ROOM = 'shape = "box"\nmin_mm = [-2000, -600, -500]\nmax_mm = [2000, 2000, 900]\n'
PRESS = (
    '[[workspace.keep_out]]\nname = "press"\ncentre_mm = [900, 0, 200]\n'
    "size_mm = [900, 700, 800]\nturn_deg = [10, 20, 30]\n"
)
CEILING = (
    '[[workspace.mounting]]\nname = "ceiling"\ncentre_mm = [0, 0, 1000]\n'
    "normal = [0, 0, -2]\nextent_mm = [1500, 900]\n"
)
WALL = (
    '[[workspace.mounting]]\nname = "wall"\ncentre_mm = [100, -900, 0]\n'
    "normal = [0, 1, 0.2]\nextent_mm = [1800, 1000]\nthickness_mm = 40\n"
    "along = [1, 1, 1]\n"
)
ZONES = {
    "room": ROOM,
    "press": PRESS,
    "both": ROOM + PRESS,
    "planes": CEILING + WALL,
    "all": 'floor_mm = -300\nshape = "box"\nmin_mm = [-700, -2000, -2000]\n'
    "max_mm = [2000, 2000, 2000]\n" + PRESS + CEILING + WALL,
}


@pytest.fixture
def workspace_of(tmp_path):
    def build(text, radius=RADIUS):
        path = tmp_path / "rig.toml"
        path.write_text(f'base = "default"\n[workspace]\n{text}', encoding="utf-8")
        return (
            load_rig(path)
            .requirements(CENTRE, radius, Wishes(max_projectors=3), tau_m=0.003)
            .workspace
        )

    return build


def turned(degrees):
    """Rz Ry Rx, written out."""
    (a, b, c), zero = np.radians(degrees), 0.0
    x = [[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]]
    y = [[np.cos(b), 0, np.sin(b)], [zero, 1, 0], [-np.sin(b), 0, np.cos(b)]]
    z = [[np.cos(c), -np.sin(c), 0], [np.sin(c), np.cos(c), zero], [0, 0, 1]]
    return np.array(z) @ np.array(y) @ np.array(x)


def kept_by_hand(name, x):
    """The zones of this file, in millimetres as they are written."""
    x = 1e3 * x
    good = np.ones(len(x), dtype=bool)
    if name in ("room", "both"):
        good &= np.all((x >= [-2000, -600, -500]) & (x <= [2000, 2000, 900]), axis=1)
    if name in ("press", "both", "all"):
        local = (x - [900, 0, 200]) @ turned([10, 20, 30])
        good &= ~np.all(np.abs(local) < [450, 350, 400], axis=1)
    if name in ("planes", "all"):
        flat = np.abs(x - [0, 0, 1000])
        on_ceiling = np.all(flat <= [750, 450, 5], axis=1)
        normal = np.array([0, 1, 0.2]) / np.sqrt(1.04)
        along = np.ones(3) - (np.ones(3) @ normal) * normal
        along /= np.linalg.norm(along)
        y = x - [100, -900, 0]
        across = np.abs(y @ np.cross(normal, along))
        on_wall = (np.abs(y @ along) <= 900) & (across <= 500)
        good &= on_ceiling | (on_wall & (np.abs(y @ normal) <= 20))
    if name == "all":
        good &= (x[:, 0] >= -700) & (x[:, 2] >= -300)
    return good


def shell_points(rng, n, low=1.05, high=1.15):
    v = rng.normal(size=(n, 3))
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    return v * rng.uniform(low, high, (n, 1))


def near_zones(rng, space, n):
    """Points of the shell, half of them about the mounting planes."""
    points = [shell_points(rng, n)]
    for plane in space.mounting:
        local = rng.uniform(-1.1, 1.1, (60 * n, 3)) * np.array(plane.half_m)
        found = np.array(plane.centre_m) + local @ np.array(plane.axes)
        distance = np.linalg.norm(found, axis=1)
        points.append(found[(distance > 1.05) & (distance < 1.15)][:n])
    return np.concatenate(points)


@pytest.mark.parametrize("name", ZONES)
def test_planner_audit_and_the_rig_file_agree(workspace_of, name):
    space = workspace_of(ZONES[name])
    x = near_zones(np.random.default_rng(1), space, 3000)
    truth = kept_by_hand(name, x)
    assert 0.02 < truth.mean() < 0.98
    assert np.array_equal(admissible(space, space.camera_radius_m, x), truth)
    ours = np.max(zone_excess(x, space), axis=0) <= 0.0
    floor = x[:, 2] >= (-0.3 if name == "all" else -9.0)
    assert np.array_equal(ours & floor, truth)


def test_depth_is_the_distance_to_the_nearest_face(workspace_of):
    zone = workspace_of(PRESS).keep_out[0]
    turn = turned([10, 20, 30])
    inside = np.array([0.9, 0.0, 0.2]) + turn @ [0.40, 0.1, -0.1]
    beside = np.array([0.9, 0.0, 0.2]) + turn @ [0.75, 0.35, 0.8]
    found = depth(zone, np.stack([inside, beside]))
    assert found == pytest.approx([0.05, -0.5])  # 300 and 400 mm beyond two faces
    assert depth(zone.grown(0.02), inside[None])[0] == pytest.approx(0.07)


@pytest.mark.parametrize("name", ZONES)
def test_half_spaces_hold_their_position_and_nothing_that_is_forbidden(
    workspace_of, name
):
    space = workspace_of(ZONES[name])
    rng = np.random.default_rng(2)
    x = near_zones(rng, space, 800)
    for start in x[stands(space, x)][:60]:
        normals, offsets = half_spaces(space, start)
        assert np.all(normals @ start >= offsets - 1e-9)
        assert np.linalg.norm(normals, axis=1) == pytest.approx(1.0)
        near = start + rng.normal(scale=0.3, size=(400, 3))
        held = np.all(near @ normals.T >= offsets, axis=1)
        assert np.all(stands(space, near[held]))


@pytest.mark.parametrize("name", ZONES)
def test_no_admissible_position_is_in_a_cell_that_was_dropped(workspace_of, name):
    space = workspace_of(ZONES[name])
    rng = np.random.default_rng(3)
    x = near_zones(rng, space, 2000)
    x = x[stands(space, x)][:1500]
    dropped = 0
    for angle in (0.02, 0.2, 1.0):
        middles = rng.normal(size=(len(x), 3))
        middles /= np.linalg.norm(middles, axis=1, keepdims=True)
        # Middles that hold x within the angle, and any.
        towards = x / np.linalg.norm(x, axis=1, keepdims=True)
        across = np.cross(towards, middles)
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        turn = angle * rng.uniform(0.9, 1.0, (len(x), 1))
        near = np.cos(turn) * towards + np.sin(turn) * across
        assert np.all(may_stand(space, near, angle, 1.05, 1.15))
        dropped += int((~may_stand(space, middles, angle, 1.05, 1.15)).sum())
    assert dropped > 30


@pytest.mark.parametrize("name", ZONES)
def test_candidates_fill_what_is_left(workspace_of, name):
    space = workspace_of(ZONES[name])
    template = PlannedCamera("", np.eye(4), load_rig().camera_device())
    found = Candidates(template, space).over(500)
    positions = np.stack([c.world_from_device[:3, 3] for c in found]) - CENTRE
    assert 500 <= len(found) < 900
    assert np.all(kept_by_hand(name, positions))
    distance = np.linalg.norm(positions, axis=1)
    assert np.all((distance >= 1.05 - 1e-9) & (distance <= 1.15 + 1e-9))
    # No admissible place is far from all of them.
    x = near_zones(np.random.default_rng(4), space, 2000)
    x = x[kept_by_hand(name, x)]
    apart = np.linalg.norm(x[:, None] - positions[None], axis=2).min(axis=1)
    assert np.quantile(apart, 0.99) < 0.2


@pytest.mark.parametrize("name", ZONES)
def test_rays_find_the_admissible_radius_nearest_to_the_middle(workspace_of, name):
    space = workspace_of(ZONES[name])
    rays = fibonacci_cap(400, np.array([0.0, 0, 1]), np.pi)
    found = along_rays(space, (1.05, 1.15), rays, 1.1)
    radii = np.linalg.norm(found, axis=1)
    steps = np.linspace(1.05, 1.15, 2001)
    n_with, at = 0, 0
    for ray in rays:
        good = steps[kept_by_hand(name, steps[:, None] * ray)]
        hit = at < len(found) and np.allclose(found[at] / radii[at], ray, atol=1e-9)
        if not hit:
            assert len(good) <= 5  # nothing, or less than 0.25 mm of the ray
            continue
        assert kept_by_hand(name, found[at : at + 1])[0]
        if len(good):
            best = np.abs(good - 1.1).min()
            assert abs(radii[at] - 1.1) <= best + 2.5e-4
        n_with, at = n_with + 1, at + 1
    assert at == len(found) > 20


def test_candidates_around_a_chosen_one_keep_the_zones(workspace_of):
    space = workspace_of(ZONES["planes"])
    rig = load_rig()
    pose = np.eye(4)
    pose[:3, 3] = CENTRE + [0.2, 0.1, 1.0]
    device = rig.projector_device()
    chosen = PlannedProjector("", "diverging", pose, pose, device, np.array([0.1, 0.2]))
    found = Candidates(chosen, space).around([chosen], 600)
    offsets = np.stack([p.world_from_device[:3, 3] for p in found]) - CENTRE
    assert len(found) > 10
    assert np.all(kept_by_hand("planes", offsets))


# ---- rig files


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('shape = "box"', "needs min_mm and max_mm"),
        ("min_mm = [0, 0, 0]", "need shape = 'box'"),
        (
            'shape = "box"\nmin_mm = [0, 0, 9]\nmax_mm = [1, 1, 9]',
            r"min_mm = \[0.0, 0.0, 9.0\] must be less than max_mm",
        ),
        (PRESS.replace("900, 700", "900, -700"), r"keep_out\[0\].size_mm\[1\].*-700"),
        (PRESS.replace("turn_deg", "turn_degrees"), "did you mean turn_deg"),
        (PRESS.replace('name = "press"\n', ""), r"keep_out\[0\].name` is missing"),
        (PRESS + PRESS, "keep_out names 'press' twice"),
        (CEILING.replace("0, -2]", "0, 0]"), "normal = .* must not be zero"),
        (CEILING + "along = [0, 0, 5]\n", "is the direction of normal"),
        (CEILING + "thickness_mm = 0.5\n", "thickness_mm.*greater than or equal to 1"),
        (CEILING.replace("1500, 900", "1500"), "extent_mm"),
    ],
)
def test_bad_zones_are_refused(workspace_of, text, message):
    with pytest.raises(RigError, match=message):
        workspace_of(text + "\n")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            'shape = "box"\nmin_mm = [-500, -500, -500]\nmax_mm = [500, 500, 500]',
            r"min_mm = \[-500, -500, -500\].*ends 866 mm.*at least 1050 mm.*standoff",
        ),
        (
            'shape = "box"\nmin_mm = [1200, -500, -500]\nmax_mm = [2000, 500, 500]',
            "begins 1200 mm.*at most 1150 mm.*move it nearer or raise",
        ),
        (
            'floor_mm = 500\nshape = "box"\nmin_mm = [-2e3, -2e3, -2e3]\n'
            "max_mm = [2e3, 2e3, 400]",
            "ends 400 mm over.*under workspace.floor_mm = 500; lower the floor",
        ),
        (
            CEILING.replace("0, 1000]", "0, 1300]"),
            r"mounting 'ceiling' at \[0, 0, 1300\] mm: it begins 1295 mm.*at most 1150",
        ),
        (CEILING.replace("0, 1000]", "0, 300]"), "it ends 926 mm.*at least 1050"),
    ],
)
def test_limits_that_never_meet_the_shell_are_named(workspace_of, text, message):
    with pytest.raises(InfeasibleLimitsError, match=message) as caught:
        workspace_of(text + "\n")
    assert caught.value.exit_code == 4


def test_one_plane_within_reach_is_enough(workspace_of):
    far = CEILING.replace("ceiling", "roof").replace("0, 1000]", "0, 3000]")
    space = workspace_of(CEILING + far)
    found = shell_positions(space, space.camera_radius_m, 300) - CENTRE
    assert len(found) >= 300
    assert np.all(np.abs(found[:, 2] - 1.0) <= 0.005 + 1e-9)


@pytest.mark.parametrize(
    ("text", "blamed", "innocent"),
    [
        (
            PRESS.replace("900, 0, 200", "0, 0, 0").replace(
                "900, 700, 800", "3e3, 3e3, 3e3"
            )
            + CEILING,
            ["keep_out 'press' (3000 x 3000 x 3000 mm", "make it smaller or move it"],
            "mounting",
        ),
        (
            ROOM + CEILING.replace("0, 1000]", "0, 1100]"),
            ["max_mm = [2000, 2000, 900] (widen it)", "mounting 'ceiling' (move"],
            "keep_out",
        ),
    ],
)
def test_the_zone_that_leaves_no_position_is_named(
    workspace_of, text, blamed, innocent
):
    space = workspace_of(text)
    template = PlannedCamera("", np.eye(4), load_rig().camera_device())
    with pytest.raises(InfeasibleLimitsError) as caught:
        Candidates(template, space).over(100)
    said = str(caught.value)
    assert all(words in said for words in blamed), said
    assert innocent not in said
    assert "no position 1050 to 1150 mm" in said


def test_zones_survive_the_plan_file_and_others_get_no_key(handmade, workspace_of):
    asked = requirements_of(handmade.build_plan().to_document()["requirements"])
    assert not {"box", "keep_out", "mounting"} & set(asked.to_document()["workspace"])
    zoned = replace(asked, workspace=workspace_of(ZONES["both"] + CEILING))
    document = zoned.to_document()
    assert document["workspace"]["keep_out"][0]["name"] == "press"
    assert requirements_of(document) == zoned


# ---- a whole plan


@pytest.fixture(scope="module")
def planned(tmp_path_factory, with_little_work):
    """A plate, a ceiling over it with a hole where one would rather stand."""
    path = tmp_path_factory.mktemp("rig") / "ceiling.toml"
    path.write_text(
        'base = "default"\n[workspace]\n' + CEILING + "[[workspace.keep_out]]\n"
        'name = "hole"\ncentre_mm = [0, 0, 1000]\nsize_mm = [500, 500, 100]\n'
        "blocks = false\n"
        "[requirements]\ncoverage = 0.8\ndominant_coverage = 0.8\nmin_reachable = 0.1\n"
        "[placement]\nn_candidate_projectors = 600\nn_reference_projectors = 600\n"
        "n_candidate_cameras = 400\nn_reference_cameras = 400\n"
    )
    plate = plate_of((0.1, 0.1, 0.01), divisions=4)
    plate = TriangleMesh(plate.vertices + CENTRE, plate.faces)
    try:
        with with_little_work():
            return plan_rig(
                plate, load_rig(path), max_projectors=2, target="surface", check=False
            )
    except RequirementError as missed:
        return missed.plan


def test_devices_are_mounted_and_the_audit_agrees(planned):
    assert audit_plan(planned, n_samples=4000).failures == ()
    devices = planned.projectors + planned.cameras
    assert planned.projectors
    assert planned.cameras
    centre = np.array(planned.requirements.workspace.centre)
    for device in devices:
        x, y, z = 1e3 * (device.world_from_device[:3, 3] - centre)
        assert abs(z - 1000) <= 5.02
        assert abs(x) <= 750.02
        assert abs(y) <= 450.02
        assert max(abs(x), abs(y)) >= 249.98
    # The pose program moved it along its plane.
    moved = planned.projectors[0].world_from_device[:3, 3]
    offered = planned.surface.reference_projectors[:, :3, 3]
    assert np.linalg.norm(offered - moved, axis=1).min() > 1e-3
    proof = planned.to_document()["certificates"]["projectors"]
    assert proof["continuous"]["lower_bound"] == proof["count"] == 1


def _tampered(plan, change):
    document = plan.to_document()
    change(document)
    return audit_plan(
        RigPlan.from_document(document, plan.surface), n_samples=500
    ).failures


@pytest.mark.parametrize(
    ("key", "place", "value", "sentence"),
    [
        ("keep_out", "half_m", [0.7, 0.4, 0.05], "mm outside requirements.workspace"),
        ("keep_out", "half_m", [0.2, 0.25, 0.05], "differs from rig.workspace's by 50"),
        ("mounting", "centre_m", [0.0, 0.0, 1.03], "mm outside requirements.workspace"),
        ("mounting", "centre_m", [0.0, 0.0, 1.03], "mounting.0.centre_m: claimed"),
        ("mounting", "half_m", [1.0, 0.45, 0.005], "mounting.0.half_m: claimed"),
        (
            "mounting",
            "axes",
            [[1.0, 0.1, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]],
            "mounting.0.axes: are no rotation",
        ),
        (
            "mounting",
            "axes",
            [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]],
            "axes.0: [0.0, 1.0, 0.0] doesn't run along rig.workspace's [1.0, 0.0, 0.0]",
        ),
    ],
)
def test_false_zones_are_named(planned, key, place, value, sentence):
    def change(document):
        document["requirements"]["workspace"][key][0][place] = value

    found = _tampered(planned, change)
    assert any(sentence in failure for failure in found), found


@pytest.mark.parametrize(
    ("key", "value", "sentence"),
    [
        ("floor_m", -2.5, "floor_m: -2.5 m, but rig.workspace states None m"),
        ("camera_radius_m", [0.5, 2.4], "camera_radius_m: claimed"),
        ("projector_radius_m", [0.5, 2.4], "projector_radius_m: claimed"),
        ("camera_standoff_m", 0.4, "camera_standoff_m: 0.4 m, but rig.standoff_m"),
    ],
)
def test_another_workspace_than_the_rigs_is_named(planned, key, value, sentence):
    """What is proved over a workspace is proved of the rig's."""

    def change(document):
        document["requirements"]["workspace"][key] = value

    found = _tampered(planned, change)
    assert any(sentence in failure for failure in found), found


def test_a_zone_that_was_left_out_is_named(planned):
    def change(document):
        del document["requirements"]["workspace"]["keep_out"]

    found = _tampered(planned, change)
    assert any("keep_out: holds 0, but rig.workspace states 1" in f for f in found)


@pytest.mark.parametrize("up", ["x", "y", "-z"])
@pytest.mark.parametrize(
    "plane",
    [
        "normal = [0, 0, -2]",
        "normal = [1, 0, 0]",
        "normal = [0.3, -1, 0.2]",
        "normal = [3e-9, -2, 3e-9]",
        "normal = [0, 1, 0.2]\nalong = [1, 1, 1]",
    ],
)
def test_the_audit_knows_where_planes_run(workspace_of, handmade, tmp_path, plane, up):
    """Also those that don't say; turned in itself a plane is another."""
    honest = workspace_of(
        f'up = "{up}"\n[[workspace.mounting]]\nname = "plane"\ncentre_mm = [0, 0, 0]\n'
        f"extent_mm = [3000, 3000]\n{plane}\n"
    )
    (box,) = honest.mounting
    one, two, normal = box.axes
    other = replace(box, axes=(two, tuple(-x for x in one), normal))

    def told(space):
        def change(document):
            rig = load_rig(tmp_path / "rig.toml").to_document()
            document["rig"]["workspace"] = rig["workspace"]
            asked = replace(requirements_of(document["requirements"]), workspace=space)
            document["requirements"] = asked.to_document()

        plan = handmade.tampered(handmade.unclaimed(), change)
        findings = AuditFindings()
        audit_zones(SimpleNamespace(plan=plan, kinds=()), findings)
        return [f for f in findings.failures if ".mounting" in f]

    assert told(honest) == []
    (sentence,) = told(replace(honest, mounting=(other,)))
    assert ".mounting.0.axes.0: " in sentence
