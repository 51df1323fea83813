"""Devices that are bolted already: poses from a CSV file, and of an earlier plan."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.written import requirements_of

from geometry.poses import pan_tilt_roll
from planning import load_rig, read_mounted
from planning.model.devices.bodies import Body
from planning.model.errors import InputError
from planning.rig.mounted import split_fixed
from planning.rig.wishes import Wishes

CENTRE = np.array([0.3, -0.2, 0.1])
NAMES = (
    "name,kind,x_mm,y_mm,z_mm,aim_x_mm,aim_y_mm,aim_z_mm,pan_deg,tilt_deg,roll_deg,"
    "qw,qx,qy,qz"
)
PLACE = "projector,100,-1200,300"
AIMED = f"left,{PLACE},310,-180,90,,,,,,,"


@pytest.fixture
def written(tmp_path):
    def write(*lines, header=NAMES, name="mounted.csv"):
        path = tmp_path / name
        path.write_text("\n".join((header, *lines)) + "\n", encoding="utf-8")
        return path

    return write


def required(rig, mounted, **wishes):
    asked = Wishes(max_projectors=9, **wishes)
    resolved = mounted.on(rig).requirements(CENTRE, 0.1, asked, tau_m=0.003)
    return mounted.with_rings(resolved)


def pose_of(device):
    return np.array(device.world_from_device)


@pytest.mark.parametrize("up", ["z", "-y", "x"])
@pytest.mark.parametrize("roll", ["", "25"])
def test_aim_angles_and_quaternion_say_one_pose_in_the_axes_of_the_mesh(
    written, up, roll
):
    rig = load_rig()
    aimed = AIMED.split(",")
    aimed[10] = roll
    aim = read_mounted(written(",".join(aimed)), rig)
    (device,) = required(rig, aim, up=up).existing
    pose = pose_of(device)
    # Not from the object's centre; the middle of the image is on the aim.
    assert pose[:3, 3] == pytest.approx([0.1, -1.2, 0.3], abs=1e-9)
    local = pose[:3, :3].T @ (np.array([0.31, -0.18, 0.09]) - pose[:3, 3])
    pixel = rig.projector_device().camera_matrix @ (local / local[2])
    assert pixel[:2] == pytest.approx([511.5, 383.5], abs=1e-6)

    world_up = np.array(required(rig, aim, up=up).workspace.up)
    pan, tilt, turn = np.degrees(pan_tilt_roll(pose[:3, :3], world_up))
    w, x, y, z = Rotation.from_matrix(pose[:3, :3]).as_quat(scalar_first=True)
    for row in (
        f"left,{PLACE},,,,{pan},{tilt},{turn},,,,",
        f"left,{PLACE},,,,,,,{w},{x},{y},{z}",
    ):
        (same,) = required(rig, read_mounted(written(row), rig), up=up).existing
        assert pose_of(same) == pytest.approx(pose, abs=1e-9)


def test_straight_down_pan_says_where_the_image_points(written):
    row = "down,camera,0,0,1200,,,,90,-90,,,,,"
    rig = load_rig()
    (device,) = required(rig, read_mounted(written(row), rig)).existing
    turn = pose_of(device)[:3, :3]
    assert turn == pytest.approx(
        np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]), abs=1e-12
    )


def test_columns_may_stand_in_any_order_and_those_unused_be_left_out(written):
    header = "kind, name ,z_mm,y_mm,x_mm,tilt_deg,pan_deg"
    path = written("# by the tracker", "camera,top,3,2,1,-10,20", "", header=header)
    (table,) = read_mounted(path, load_rig()).tables
    assert (table.name, table.position_mm) == ("top", [1.0, 2.0, 3.0])
    assert (table.pan_deg, table.tilt_deg, table.roll_deg) == (20.0, -10.0, 0.0)


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ([], r"mounted.csv: holds no device"),
        ([AIMED, AIMED], r"line 3: 'left' is on line 2 already"),
        ([f",{PLACE},310,-180,90,,,,,,,"], "line 2: name is empty"),
        ([AIMED.replace("projector", "lamp")], r"line 2: `kind` = 'lamp'"),
        ([AIMED.replace("1200", "12oo")], r"line 2: y_mm = '-12oo' must be a number"),
        ([AIMED.replace("1200", "1e12")], "line 2: y_mm = -1e.12 must be finite, at m"),
        (["# hm", "", AIMED[:-1]], r"line 4: 14 cells, the header has 15"),
        ([f"left,{PLACE},,,,,,,,,,"], r"line 2: 'left' lacks where it looks; fill in"),
        ([f"left,{PLACE},1,2,3,4,5,,,,,"], r"line 2: 'left' says twice where it lo"),
        ([f"left,{PLACE},1,,3,,,,,,,"], "line 2: aim_y_mm is empty; fill it in"),
        ([f"left,{PLACE},,,,90,91,,,,,"], "line 2: `tilt_deg` = 91.0"),
        ([f"left,{PLACE},100,-1200,300,,,,,,,"], "line 2: aim_mm .* not be its posit"),
        ([f"left,{PLACE},,,,,,,1,0.1,0,0"], "line 2: qw, qx, qy, qz has length 1.0"),
        ([f"left,{PLACE},,,,,,7,1,0,0,0"], "line 2: roll_deg beside a quaternion"),
    ],
)
def test_bad_rows_are_refused_by_their_line(written, lines, message):
    with pytest.raises(InputError, match=message):
        read_mounted(written(*lines), load_rig())


@pytest.mark.parametrize(
    ("header", "message"),
    [
        (NAMES.replace("kind,", ""), "line 1: the header lacks 'kind'"),
        (NAMES.replace("tilt", "tilted"), "line 1: the header doesn't know 'tilted_"),
        (NAMES.replace("qz", "qw"), "line 1: the header names qw twice"),
        (NAMES.replace(",", ";"), "line 1: .* by ';', must be by commas, with poi"),
        (NAMES.replace(",", "\t"), r"line 1: .* by '\\t', must be by commas"),
    ],
)
def test_bad_headers_are_refused(written, header, message):
    with pytest.raises(InputError, match=message):
        read_mounted(written(AIMED, header=header), load_rig())


def test_names_choose_devices_and_unknown_ones_are_told(written):
    path = written(AIMED, AIMED.replace("left", "right").replace("100", "400"))
    chosen = read_mounted(path, load_rig(), ["right"])
    assert [table.name for table in chosen.tables] == ["right"]
    with pytest.raises(InputError, match="no device 'P1'; its devices are left, right"):
        read_mounted(path, load_rig(), ["P1"])
    assert split_fixed(f"{path}:left, right") == (str(path), ["left", "right"])
    assert split_fixed(str(path)) == (str(path), None)
    assert split_fixed("nowhere.json") == ("nowhere.json", None)


def test_what_the_rig_file_knows_stands_where_it_was_measured(written, tmp_path):
    old = (
        '[[existing]]\nname = "{}"\nkind = "projector"\nposition_mm = [0, -999, 0]\n'
        "aim_mm = [0, 0, 0]\n"
    )
    body = "[existing.body]\nsize_mm = [100, 100, 200]\ncentre_mm = [0, 0, -101]\n"
    path = tmp_path / "rig.toml"
    path.write_text('base = "default"\n' + old.format("left") + body)
    rig = load_rig(path)
    (device,) = required(rig, read_mounted(written(AIMED), rig)).existing
    assert pose_of(device)[:3, 3] == pytest.approx([0.1, -1.2, 0.3])
    assert device.body.half_m == pytest.approx((0.05, 0.05, 0.1))

    path.write_text('base = "default"\n' + old.format("wall"))
    rig = load_rig(path)
    both = required(rig, read_mounted(written(AIMED), rig)).existing
    assert [device.name for device in both] == ["left", "wall"]
    # The rig file's own counts from the object's centre.
    assert pose_of(both[1])[:3, 3] == pytest.approx(CENTRE + [0.0, -0.999, 0.0])
    mounted = read_mounted(written(AIMED.replace("left,projector", "wall,camera")), rig)
    with pytest.raises(InputError, match="existing names 'wall' twice"):
        mounted.on(rig)


# ---- of a plan


@pytest.fixture
def plan_file(handmade, tmp_path):
    plan = handmade.build_plan()
    plan.save(tmp_path / "old" / "plan.json")
    return plan, tmp_path / "old" / "plan.json"


class _RigOf:
    """The optics of a plan's devices, as a rig gives them."""

    name, housing = "theirs", None

    def __init__(self, plan):
        self.plan = plan

    def models(self, kind):
        device = getattr(self.plan, f"{kind}s")[0].device
        body = self.housing if kind == "camera" else None
        return (SimpleNamespace(name="", device=device, body=body),)


def test_devices_of_a_plan_stand_where_it_says_by_their_ids(plan_file):
    plan, path = plan_file
    mounted = read_mounted(path, _RigOf(plan))
    every = (*plan.projectors, *plan.cameras)
    assert [table.name for table in mounted.tables] == [d.id for d in every]
    rig = load_rig()
    existing = required(rig, mounted).existing
    for device, planned in zip(existing, every, strict=True):
        # Positions are kept to 0.01 mm.
        assert pose_of(device) == pytest.approx(planned.world_from_device, abs=6e-6)
    folder = read_mounted(path.parent, _RigOf(plan), ["C1"])
    assert [table.name for table in folder.tables] == ["C1"]
    with pytest.raises(InputError, match=r"no device 'C9'; its devices are P1, .*C1"):
        read_mounted(path, _RigOf(plan), ["P1", "C9"])


def test_rings_of_a_plan_stay_and_are_written_down(plan_file):
    plan, path = plan_file
    mounted = read_mounted(path, _RigOf(plan))
    # Those of a run that was cut before they were spaced don't.
    assert not any(record.rings for record in plan.document.projectors)
    assert mounted.rings == {}
    (first, *_) = plan.projectors
    mounted = replace(mounted, rings={first.id: first})
    resolved = required(load_rig(), mounted)
    one, *others = resolved.existing
    assert np.array(one.world_from_ring) == pytest.approx(first.world_from_ring)
    assert one.ring_radii == tuple(first.ring_radii)
    assert not any(other.ring_radii for other in others)
    document = resolved.to_document()
    assert "ring_radii" not in document["existing"][1]
    assert requirements_of(document) == resolved


def test_a_plan_of_another_rig_is_refused(plan_file):
    with pytest.raises(
        InputError,
        match=r"P1 has K = .* a projector of rig 'default' .* --rig the file",
    ):
        read_mounted(plan_file[1], load_rig())


def test_housings_of_a_plan_arent_left_behind(plan_file):
    plan, path = plan_file
    document = json.loads(path.read_text())
    body = {"centre_m": [0.0, 0.0, -0.05], "half_m": [0.03, 0.03, 0.05]}
    document["cameras"][0]["body"] = body
    path.write_text(json.dumps(document))
    with pytest.raises(InputError, match=r"C1 has a housing, .* 'theirs' none; give"):
        read_mounted(path, _RigOf(plan))
    housed = _RigOf(plan)
    housed.housing = Body((0.0, 0.0, 0.0), (0.02, 0.02, 0.04))
    assert len(read_mounted(path, housed, ["C1"]).tables) == 1
