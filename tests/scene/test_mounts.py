"""Mounts: where threads and flanges stand, and what a mount can be set to."""

from dataclasses import replace

import numpy as np
import pytest
from support.factories import (
    make_camera,
    make_projector,
    make_requirements,
    make_rig,
    make_scene,
    make_workspace,
)
from support.plain_shapes import box as plate_of

from geometry.mesh.mesh import TriangleMesh
from planning import RequirementError, load_rig, plan_rig
from planning.model.devices.bodies import Mount
from planning.model.errors import InfeasibleLimitsError, RigError
from planning.model.plan import RigPlan
from planning.report.advice.least_changes import ANY_SETTING, larger_workspaces
from planning.report.advice.projector_relaxations import reachability_relaxations
from planning.report.claims.reach import furthest_lit
from planning.report.summary.coverage_lines import coverage_lines
from planning.report.summary.summary import summary
from planning.scene.draws import DRAWS
from planning.scene.limits.projector_limits import LIT
from planning.scene.workspace.admissible import admissible
from planning.scene.workspace.candidates import Candidates, aimed_poses
from planning.scene.workspace.mount_settings import device_from_mount, settable
from planning.verify.audit.audit import audit_plan
from planning.verify.audit.devices.mount_claims import _off_steps

LEVEL = "[camera.mount]\noffset_mm = [0, 30, -40]\naxis = [0, 2, 0]\n"


@pytest.fixture
def rig_of(tmp_path):
    def build(text):
        path = tmp_path / "rig.toml"
        path.write_text(f'base = "default"\n{text}', encoding="utf-8")
        return load_rig(path)

    return build


def test_a_rig_file_says_where_the_thread_is(rig_of):
    rig = rig_of(LEVEL)
    mounts = rig.mounts()
    assert mounts["projector_mount"] is None
    assert mounts["camera_mount"] == Mount((0.0, 0.03, -0.04), (0.0, 1.0, 0.0))
    figures = rig.to_document()["camera"]["figures"]
    assert figures["mount"] == {"offset_mm": [0, 30, -40], "axis": [0, 2, 0]}


@pytest.mark.parametrize(
    ("axis", "x", "z"),
    [
        # A thread below: out of the device is down, forward is forward.
        ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0)),
        # A flange at the back: there is no forward across it, so it is the right.
        ((0.0, 0.0, -1.0), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0)),
        ((0.0, 0.6, -0.8), (0.0, 0.8, 0.6), (0.0, 0.6, -0.8)),
    ],
)
def test_the_frame_of_a_mount_points_out_and_forward(axis, x, z):
    frame = device_from_mount(Mount((0.01, 0.02, 0.03), axis))
    assert frame[:3, 0] == pytest.approx(x)
    assert frame[:3, 2] == pytest.approx(z)
    assert np.linalg.det(frame[:3, :3]) == pytest.approx(1.0)
    assert frame[:3, 3] == pytest.approx([0.01, 0.02, 0.03])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (LEVEL.replace("axis = [0, 2, 0]\n", ""), "go together; write both"),
        ("[camera.mount]\nroll_deg = []", "roll_deg"),
        ("[camera.mount]\npan_step_deg = 7", "= 7 must divide 360"),
        ("[camera.mount]\ntilt_step_deg = 0", "greater than 0"),
        ("[camera.mount]\ngrid_mm = -5", "greater than 0"),
        (LEVEL.replace("[0, 2, 0]", "[0, 0, 0]"), "must not be zero"),
        (LEVEL.replace("axis", "axes"), "did you mean axis"),
    ],
)
def test_bad_mounts_are_refused(rig_of, text, message):
    with pytest.raises(RigError, match=message):
        rig_of(text)


# ---- settings

CENTRE = np.array([0.0123, -0.0321, 0.0777])
UP = np.array([0.0, 0.0, 1.0])
FIVE, QUARTER = np.radians(5.0), 0.5 * np.pi
SPACE = make_workspace(
    0.1,
    1.1,
    centre=tuple(CENTRE),
    projector_radius_m=(1.05, 1.15),
    camera_radius_m=(1.05, 1.15),
)


def device_of(kind):
    rig = make_rig()
    return make_camera(rig) if kind == "camera" else make_projector(rig, [0.1, 0.2])


def poses_about(device, n=60, roll=0.0, seed=0):
    """Poses all about the object whose image centres look at its centre."""
    ways = np.random.default_rng(seed).normal(size=(n, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    ways = ways[np.abs(ways[:, 2]) < 0.8]
    return aimed_poses(CENTRE + 1.1 * ways, CENTRE, UP, device.device, roll=roll)


def angles_by_hand(pose):
    """Pan from +x towards +y, tilt over the horizon, roll clockwise, in degrees."""
    x, _, z = pose[:3, :3].T
    level = np.array([z[1], -z[0], 0.0]) / np.hypot(z[0], z[1])
    down = np.cross(z, level)
    found = [
        np.arctan2(z[1], z[0]),
        np.arctan2(z[2], np.hypot(z[0], z[1])),
        np.arctan2(x @ down, x @ level),
    ]
    return np.degrees(found)


@pytest.mark.parametrize("kind", ["camera", "projector"])
@pytest.mark.parametrize("origin", [None, "mesh"])
def test_settings_are_whole_steps_on_the_grid_and_in_the_workspace(kind, origin):
    device, offset = device_of(kind), np.array([0.02, 0.03, -0.04])
    mount = Mount(tuple(offset), (0.0, 1.0, 0.0), (0.0, QUARTER), FIVE, 2 * FIVE, 0.04)
    space = replace(SPACE, origin=origin, **{f"{kind}_mount": mount})
    start = np.zeros(3) if origin else CENTRE
    found = settable(space, device, poses_about(device))
    assert len(found) > 30
    for pose in found:
        pan, tilt, roll = angles_by_hand(pose)
        assert pan / 5.0 == pytest.approx(round(pan / 5.0), abs=1e-7)
        assert tilt / 10.0 == pytest.approx(round(tilt / 10.0), abs=1e-7)
        assert min(abs(roll), abs(roll - 90.0)) < 1e-6
        steps = (pose[:3, 3] + pose[:3, :3] @ offset - start) / 0.04
        assert steps == pytest.approx(np.rint(steps), abs=1e-7)
    offsets = found[:, :3, 3] - CENTRE
    assert admissible(space, (1.05, 1.15), offsets).all()
    # What can be set already stays.
    assert settable(space, device, found) == pytest.approx(found)


@pytest.mark.parametrize("kind", ["camera", "projector"])
@pytest.mark.parametrize("roll", [0.0, QUARTER, -QUARTER])
def test_on_the_grid_the_image_still_looks_where_it_looked(kind, roll):
    """With the lens shifted by 18 degrees, at any roll of the housing."""
    device = device_of(kind)
    mount = Mount((0.0, 0.05, -0.1), (0.0, 1.0, 0.0), (roll,), grid_m=0.03)
    space = replace(SPACE, **{f"{kind}_mount": mount})
    found = settable(space, device, poses_about(device, roll=roll))
    assert len(found) > 20
    for pose in found:
        assert angles_by_hand(pose)[2] == pytest.approx(np.degrees(roll), abs=1e-6)
        offset = CENTRE - pose[:3, 3]
        middle = pose[:3, :3] @ device.device.middle_ray
        beside = np.linalg.norm(np.cross(middle, offset))
        assert beside < 1e-6
        assert middle @ offset > 1.0


def test_steps_alone_turn_by_half_a_step_at_most_and_leave_the_place():
    device = device_of("camera")
    poses = poses_about(device)
    space = replace(SPACE, camera_mount=Mount(pan_step=FIVE, tilt_step=FIVE))
    found = settable(space, device, poses)
    assert found[:, :3, 3] == pytest.approx(poses[:, :3, 3])
    for before, after in zip(poses, found, strict=True):
        turned = angles_by_hand(after) - angles_by_hand(before)
        assert np.all(np.abs((turned + 180.0) % 360.0 - 180.0) <= 2.5 + 1e-6)


@pytest.mark.parametrize("up", ["+x", "-x", "+y", "-y", "+z", "-z"])
@pytest.mark.parametrize("rolls", [(), (0.0, QUARTER)])
def test_planner_and_audit_agree_about_settings_whatever_is_up(up, rolls):
    way = np.eye(3)["xyz".index(up[1])] * (1.0 if up[0] == "+" else -1.0)
    device = device_of("projector")
    mount = Mount(None, None, rolls, 3 * FIVE, FIVE)
    space = replace(SPACE, up=tuple(way), projector_mount=mount)
    ways = np.random.default_rng(3).normal(size=(80, 3))
    # Among them some that look straight up and down.
    ways = np.concatenate([ways, [way, -way]])
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    poses = aimed_poses(CENTRE + 1.1 * ways, CENTRE, way, device.device, roll=0.3)
    found = settable(space, device, poses)
    assert len(found) > 40
    for off in _off_steps(mount, found[:, :3, :3], way).values():
        assert off.max() < 1e-7
    before = _off_steps(mount, poses[:, :3, :3], way)
    assert before["pan"].max() > 0.05
    assert before["tilt"].max() > 0.02
    assert (before["roll"].max() > 0.1) == bool(rolls)


def test_grids_take_the_nearest_place_that_the_workspace_has():
    """Of a plane 10 mm thick every place is at a height that is on the grid."""
    device = device_of("camera")
    mount = Mount(grid_m=0.05)
    high = replace(SPACE, camera_mount=mount, floor_m=0.4)
    poses = poses_about(device, 200)
    poses = poses[poses[:, 2, 3] - CENTRE[2] > 0.41]
    found = settable(high, device, poses)
    assert len(found) >= 0.9 * len(poses)
    assert (found[:, 2, 3] - CENTRE[2]).min() >= 0.4 - 1e-9


def test_what_falls_together_is_offered_once_and_free_mounts_change_nothing():
    device = device_of("camera")
    poses = poses_about(device, 5)
    double = np.concatenate([poses, poses])
    free = replace(SPACE, camera_mount=Mount((0.0, 0.1, 0.0), (0.0, 1.0, 0.0)))
    assert settable(free, device, double) is double
    stepped = replace(SPACE, camera_mount=Mount(tilt_step=FIVE))
    assert len(settable(stepped, device, double)) == len(poses)
    # The projector's mount isn't the camera's.
    assert settable(stepped, device_of("projector"), double) is double


def test_a_device_may_look_straight_down_and_not_beyond():
    device = device_of("projector")
    over = aimed_poses(
        CENTRE + np.array([[0.0, -0.2, 1.08]]), CENTRE, UP, device.device
    )
    # Its housing would have to lean over by 7 degrees.
    upright = replace(SPACE, projector_mount=Mount(rolls=(0.0,)))
    assert not len(settable(upright, device, over))
    any_roll = replace(SPACE, projector_mount=Mount(tilt_step=np.radians(1.0)))
    assert len(settable(any_roll, device, over)) == 1
    camera = device_of("camera")
    down = aimed_poses(CENTRE + np.array([[0.0, 0.0, 1.1]]), CENTRE, UP, camera.device)
    stepped = Mount(None, None, (0.0,), FIVE, FIVE)
    (pose,) = settable(replace(SPACE, camera_mount=stepped), camera, down)
    assert pose[:3, 2] == pytest.approx([0.0, 0.0, -1.0], abs=1e-9)


def test_candidates_have_the_rolls_that_are_allowed():
    device = device_of("projector")
    wide = replace(SPACE, object_radius_m=0.45)
    assert Candidates(device, SPACE).rolls == (0.0,)
    assert Candidates(device, wide).rolls == (0.0, QUARTER)
    for rolls in ((QUARTER,), (0.0, -QUARTER)):
        mounted = Mount(rolls=rolls)
        there = Candidates(device, replace(SPACE, projector_mount=mounted))
        assert there.rolls == rolls[:1]
        there = Candidates(device, replace(wide, projector_mount=mounted))
        assert there.rolls == rolls


def test_a_mount_that_can_be_set_to_nothing_is_named():
    space = replace(SPACE, camera_mount=Mount(grid_m=3.0))
    with pytest.raises(InfeasibleLimitsError, match="mount of the camera can be"):
        Candidates(device_of("camera"), space).over(50)
    (change,) = larger_workspaces(space, "camera")
    assert change[1].camera_mount == Mount()
    assert not list(larger_workspaces(space, "projector"))


def test_it_is_told_what_a_coarse_mount_costs(handmade):
    plate = plate_of((0.1, 0.1, 0.02), divisions=4)
    rig = make_rig()
    required = make_requirements(plate, rig, max_projectors=3)
    coarse = Mount(pan_step=QUARTER, tilt_step=QUARTER)
    space = replace(required.workspace, projector_mount=coarse)
    scene = make_scene(plate, replace(required, workspace=space))
    device = make_projector(rig, [0.1, 0.2])
    reference = Candidates(device, space).over(30)
    told = reachability_relaxations(scene, reference)
    (free,) = [step for step in told if step.change == ANY_SETTING]
    assert free.reachable_share > 0.95
    assert furthest_share(scene, reference) < free.reachable_share - 0.1

    def change(document):
        document["coverage"]["relaxations"] = [free.to_document()]
        target = document["coverage"]["target"]
        target["reachable_by_projectors_m2"] = 0.5 * target["area_m2"]

    lines = coverage_lines(handmade.tampered(handmade.build_plan(), change))
    (line,) = [line for line in lines if ANY_SETTING in line]
    assert line.endswith("of the target, not 50.0 %")


def furthest_share(scene, projectors):
    """The share of fresh samples that any of them lights."""
    target = scene.target_samples(DRAWS.baselines)
    return float(np.mean(furthest_lit(scene, projectors, target) == LIT))


# ---- a whole plan

STEPPED = """
[calibration]
angle_deg = 0.0
position_mm = 0.0
[workspace]
origin = "mesh"
[projector.mount]
roll_deg = [0]
pan_step_deg = 5
tilt_step_deg = 5
grid_mm = 40
[camera.mount]
offset_mm = [0, 30, -40]
axis = [0, 1, 0]
roll_deg = [0, 90]
pan_step_deg = 5
tilt_step_deg = 2.5
grid_mm = 25
[requirements]
coverage = 0.8
dominant_coverage = 0.8
min_reachable = 0.1
[placement]
n_candidate_projectors = 600
n_reference_projectors = 600
n_candidate_cameras = 400
n_reference_cameras = 400
"""


@pytest.fixture(scope="module")
def planned(tmp_path_factory, with_little_work):
    path = tmp_path_factory.mktemp("rig") / "stepped.toml"
    path.write_text(f'base = "default"\n{STEPPED}')
    plate = plate_of((0.1, 0.1, 0.02), divisions=4)
    plate = TriangleMesh(plate.vertices + CENTRE, plate.faces)
    try:
        with with_little_work():
            return plan_rig(
                plate, load_rig(path), max_projectors=3, target="surface", check=False
            )
    except RequirementError as missed:
        return missed.plan


def test_all_devices_stand_where_mounts_can_be_set_to(planned):
    assert len(planned.projectors) + len(planned.cameras) >= 3
    for device in (*planned.projectors, *planned.cameras):
        projects = device.id.startswith("P")
        pan, tilt, roll = angles_by_hand(device.world_from_device)
        tilts = tilt / (5.0 if projects else 2.5)
        assert pan / 5.0 == pytest.approx(round(pan / 5.0), abs=1e-6)
        assert tilts == pytest.approx(round(tilts), abs=1e-6)
        assert min(abs(roll), abs(roll - 90.0) + 90.0 * projects) < 1e-6
    for record in planned.document.cameras:
        place = 1e3 * np.array(record.world_from_mount)[:3, 3]
        assert place == pytest.approx(25.0 * np.rint(place / 25.0), abs=0.01)
    assert "candidate poses that mounts can be set to reach" in summary(planned, [], [])
    assert audit_plan(planned, n_samples=4000).failures == ()


@pytest.mark.parametrize(
    ("kind", "claims", "figures", "sentence"),
    [
        ("camera", {"pan_step": np.radians(8.0)}, {"pan_step_deg": 8.0}, "pan: is "),
        ("camera", {"tilt_step": np.radians(9)}, {"tilt_step_deg": 9.0}, "tilt: is "),
        ("projector", {"rolls": [0.1]}, {"roll_deg": [np.degrees(0.1)]}, "roll: is "),
        ("projector", {"grid_m": 0.037}, {"grid_mm": 37.0}, "mm off the grid"),
    ],
)
def test_settings_that_a_mount_does_not_have_are_named(
    planned, kind, claims, figures, sentence
):
    document = planned.to_document()
    document["requirements"]["workspace"][f"{kind}_mount"] |= claims
    document["rig"][kind]["figures"]["mount"] |= figures
    found = audit_plan(
        RigPlan.from_document(document, planned.surface), n_samples=400
    ).failures
    name = kind[0].upper() + "1"
    assert any(f.startswith(name) and sentence in f for f in found), found
    references = f"surface.npz reference_{kind}s"
    assert any(f.startswith(references) and sentence in f for f in found), found


@pytest.mark.parametrize(
    ("key", "value"),
    [("pan_step", 0.1), ("tilt_step", None), ("rolls", [0.0]), ("grid_m", 0.005)],
)
def test_other_settings_than_the_rigs_are_named(planned, key, value):
    document = planned.to_document()
    document["requirements"]["workspace"]["camera_mount"][key] = value
    found = audit_plan(
        RigPlan.from_document(document, planned.surface), n_samples=400
    ).failures
    assert any(f"camera_mount.{key}: claimed" in f for f in found), found
