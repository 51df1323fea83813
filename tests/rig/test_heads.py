"""Sensor heads in rig files: read into metres, laid over, refused, and written."""

import copy
import json

import numpy as np
import pytest
from support.head_rigs import HEAD, LENS, RIG, SHARP

from planning import load_rig
from planning.model.devices.bodies import Body
from planning.model.devices.heads import Head, HeadDevice, MeasuringVolume
from planning.model.document.input_records import RigRecord
from planning.model.errors import RigError
from planning.rig.devices.rig_heads import seen_share, sees
from planning.rig.tables.head_tables import check_housing


def rig_of(*, without=(), device=None, **head):
    tables = copy.deepcopy(RIG)
    tables["head"] |= head
    for key in without:
        del tables["head"][key]
    if device:
        tables["head"]["camera"][0] |= device
    return load_rig(tables)


def test_a_head_is_read_in_metres_in_its_own_frame():
    head = load_rig(RIG).head
    assert isinstance(head, Head)
    assert [(d.kind, d.name) for d in head.devices] == [
        ("projector", "p"),
        ("camera", "c"),
    ]
    # The camera looks from 150 mm to the right at (0, 0, 500): its z is that direction,
    # its x square to it and level, its y the head's.
    slant = np.hypot(150.0, 500.0)
    x, y, z, place = head.cameras[0].head_from_device[:3].T
    assert z == pytest.approx([-150.0 / slant, 0.0, 500.0 / slant], abs=1e-12)
    assert x == pytest.approx([500.0 / slant, 0.0, 150.0 / slant], abs=1e-12)
    assert y == pytest.approx([0.0, 1.0, 0.0], abs=1e-12)
    assert place == pytest.approx([0.15, 0.0, 0.0], abs=1e-12)
    # An untilted device at the origin has the head's axes.
    assert head.projectors[0].head_from_device == pytest.approx(np.eye(4), abs=1e-12)
    assert head.baseline_m == pytest.approx(0.15)
    assert (head.working_m, head.cross, head.body) == (pytest.approx(0.5), False, None)
    assert not head.devices[0].head_from_device.flags.writeable


def test_roll_turns_from_x_towards_y_and_a_pose_says_the_same():
    rolled = rig_of(device={"position_mm": [150.0, 0.0, 0.0], "roll_deg": 90.0})
    plain = load_rig(RIG).head.cameras[0].head_from_device
    pose = rolled.head.cameras[0].head_from_device
    assert pose[:3, 0] == pytest.approx(plain[:3, 1], abs=1e-12)
    assert pose[:3, 1] == pytest.approx(-plain[:3, 0], abs=1e-12)
    rows = pose.copy()
    rows[:3, 3] *= 1e3
    tables = copy.deepcopy(RIG)
    tables["head"]["camera"] = [{"name": "c", "pose_mm": rows.tolist()}]
    assert load_rig(tables).head.cameras[0].head_from_device == pytest.approx(pose)


def test_the_volume_widens_evenly_and_a_box_does_not():
    volume = load_rig(RIG).head.volume
    assert volume == MeasuringVolume(0.4, 0.6, (0.2, 0.15), (0.3, 0.225))
    assert volume.size_at(np.array([0.4, 0.5, 0.6])) == pytest.approx(
        np.array([[0.2, 0.15], [0.25, 0.1875], [0.3, 0.225]])
    )
    points = volume.samples(5)
    assert len(points) == 125
    across, depth = np.abs(points[:, :2]), points[:, 2]
    assert np.all(across < 0.5 * volume.size_at(depth))
    assert (depth.min(), depth.max()) == pytest.approx((0.4, 0.6))
    frustum = ("near_mm", "far_mm", "near_size_mm", "far_size_mm")
    box = rig_of(without=frustum, volume_mm=[200.0, 100.0, 160.0]).head.volume
    assert (box.near_m, box.far_m) == pytest.approx((0.42, 0.58))
    assert box.near_size_m == box.far_size_m == pytest.approx((0.2, 0.1))


def test_the_standoff_is_the_heads_unless_the_file_says_one():
    rig = load_rig(RIG)
    assert (rig.standoff_m, rig.standoff_play_m) == pytest.approx((0.5, 0.05))
    flat = rig_of(near_mm=480.0, far_mm=520.0)
    assert flat.standoff_play_m == pytest.approx(0.01)
    written = rig.replace(placement={"standoff_mm": 520.0})
    assert written.standoff_m == pytest.approx(0.52)
    # Neither default nor head is taken as written: another head replaces it.
    assert rig.replace(head={"working_mm": 450.0}).standoff_m == pytest.approx(0.45)
    assert rig_of(without=["working_mm"]).standoff_m == pytest.approx(0.5)
    assert load_rig().standoff_m == 1.0


def test_a_file_lays_figures_over_the_heads_and_their_sources_go():
    tables = copy.deepcopy(RIG)
    tables["head"] |= {
        "stated": {"noise_mm": 0.05, "at_mm": 500.0},
        "sources": {"near_mm": "read: a", "stated.noise_mm": "read: b"},
    }
    rig = load_rig(tables)
    figures = rig.head.figures
    assert (figures.noise_m, figures.at_m) == pytest.approx((5e-5, 0.5))
    assert figures.baseline_m is None
    assert figures.sources == {"near_mm": "read: a", "stated.noise_mm": "read: b"}
    near = rig.replace(head={"near_mm": 450.0})
    assert near.head.volume.near_m == pytest.approx(0.45)
    assert near.head.figures.sources == {"stated.noise_mm": "read: b"}
    other = rig.replace(head={"stated": {"noise_mm": 0.1}})
    assert other.head.figures.at_m is None
    assert other.head.figures.sources == {"near_mm": "read: a"}
    box = rig.replace(head={"volume_mm": [200.0, 100.0, 160.0]})
    assert box.head.volume.near_m == pytest.approx(0.42)
    frustum = {key: HEAD[key] for key in ("near_mm", "far_mm")}
    sizes = {key: HEAD[key] for key in ("near_size_mm", "far_size_mm")}
    again = box.replace(head=frustum | sizes)
    assert again.head.volume == MeasuringVolume(0.4, 0.6, (0.2, 0.15), (0.3, 0.225))
    # By its own name a head is another one, whole.
    with pytest.raises(RigError, match=r"`head.camera` is missing"):
        rig.replace(head={"name": "other"})


def test_devices_name_models_of_the_rigs_lists():
    tables = copy.deepcopy(RIG)
    narrow = {"name": "narrow", **LENS, **SHARP, "focal_px": [1600.0, 1600.0]}
    tables["camera"] = [tables["camera"], narrow]
    tables["head"]["camera"] += [
        {
            "name": "d",
            "position_mm": [-150.0, 0.0, 0.0],
            "aim_mm": [0.0, 0.0, 500.0],
            "model": "narrow",
        }
    ]
    rig = load_rig(tables)
    assert [d.model for d in rig.head.cameras] == ["", "narrow"]
    assert rig.optics_of("camera", "narrow").focal_px == pytest.approx(1600.0)
    assert len(rig.head.pairs) == 2
    tables["head"]["camera"][1]["model"] = "wide"
    with pytest.raises(RigError, match=r"'d': model = 'wide' is none of the rig's cam"):
        load_rig(tables)
    with pytest.raises(RigError, match="no camera is called 'wide'"):
        rig.optics_of("camera", "wide")


AWAY = {"aim_mm": [600.0, 0.0, 0.0]}
BODY = {"size_mm": [100.0, 80.0, 60.0], "centre_mm": [0.0, 0.0, -10.0]}


@pytest.mark.parametrize(
    ("head", "told"),
    [
        ({"camera": []}, "`head.camera`.*should have at least 1 item"),
        ({"near_mm": 650.0}, "near_mm = 650 must be less than far_mm = 600"),
        ({"working_mm": 700.0}, "working_mm = 700 must lie between near_mm = 400 and"),
        ({"far_size_mm": [0.0, 1.0]}, "greater than 0"),
        ({"volume_mm": [1.0, 1.0, 1.0]}, "has volume_mm beside near_mm"),
        (
            {"body": {**BODY, "centre_mm": [0.0, 90.0, 0.0]}},
            "holds none of the optical centres",
        ),
        (
            {"body": {**BODY, "size_mm": [100.0, 80.0, 900.0]}},
            "stands in the head's own measuring volume",
        ),
        (
            # A plate before the camera, held by the projector.
            {"body": {"size_mm": [900.0, 400.0, 20.0], "centre_mm": [0.0, 0.0, 8.0]}},
            "",
        ),
        ({"colour": "red"}, "`head.colour` is not a known key"),
    ],
)
def test_heads_that_cannot_be_are_refused_in_one_line(head, told):
    if not told:
        # The camera stands in that body, too, so it blocks nobody.
        assert rig_of(**head).head.body is not None
        return
    with pytest.raises(RigError, match=told) as error:
        rig_of(**head)
    assert len(str(error.value).splitlines()) == 1
    assert error.value.exit_code == 3


@pytest.mark.parametrize(
    ("device", "told"),
    [
        ({"position_mm": [0.0, 0.0, 0.5]}, "'p' and 'c' stand at the same place"),
        ({"name": "p"}, "head names 'p' twice"),
        ({"aim_mm": [150.0, 0.0, 0.0]}, "must not be its position_mm"),
        (AWAY, "camera 'c' looks away from the measuring volume"),
        ({"aim_mm": [0.0, 0.0, -500.0]}, "camera 'c' looks away from the measuring"),
        (
            {"position_mm": [0.0, 0.0, -900.0]},
            "camera 'c' is sharp from 300 to 900 mm, the measuring volume is 1300 to",
        ),
        ({"pose_mm": np.eye(4).tolist()}, "has pose_mm beside position_mm"),
    ],
)
def test_devices_that_cannot_stand_there_are_refused(device, told):
    with pytest.raises(RigError, match=told) as error:
        rig_of(device=device)
    assert len(str(error.value).splitlines()) == 1


def test_a_pair_that_shares_nothing_is_refused_and_one_that_shares_little_told():
    wide = {"near_size_mm": [900.0, 150.0], "far_size_mm": [900.0, 150.0]}
    sharing = rig_of(**wide, device={"aim_mm": [100.0, 0.0, 500.0]})
    (note,) = (n for n in sharing.notes() if "measuring volume" in n)
    assert "image 4" in note
    assert not [n for n in load_rig(RIG).notes() if "measuring volume" in n]
    with pytest.raises(RigError, match="'p' and 'c' share nothing of the measuring"):
        rig_of(
            **wide,
            device={"position_mm": [900.0, 0.0, 0.0], "aim_mm": [700.0, 0.0, 500.0]},
        )


def test_of_two_cameras_the_farther_makes_the_baseline_and_either_may_see():
    wide = {"near_size_mm": [560.0, 150.0], "far_size_mm": [560.0, 150.0]}
    other = {
        "name": "d",
        "position_mm": [-80.0, 0.0, 0.0],
        "aim_mm": [-200.0, 0.0, 500.0],
    }
    one = copy.deepcopy(HEAD["camera"][0]) | {"aim_mm": [200.0, 0.0, 500.0]}
    both = rig_of(**wide, camera=[one, other])
    assert both.head.baseline_m == pytest.approx(0.15)
    assert [(p.name, c.name) for p, c in both.head.pairs] == [("p", "c"), ("p", "d")]
    points = both.head.volume.plane(0.5)
    alone = [
        seen_share(rig.head, rig.optics_of, points)
        for rig in (rig_of(**wide, camera=[each]) for each in (one, other))
    ]
    together = seen_share(both.head, both.optics_of, points)
    assert together > max(alone) + 0.1
    assert together <= sum(alone)


def test_what_a_device_sees_is_what_its_image_and_focus_hold():
    """A camera 150 mm aside: the edges of its field and of its focus by hand."""
    rig = load_rig(RIG)
    camera, optics = rig.head.cameras[0], rig.camera_device()
    pose = camera.head_from_device
    local = np.array(
        [
            [0.249, 0.0, 0.5],  # 1000 px at f = 1000: half a metre at a metre
            [0.251, 0.0, 0.5],
            [0.0, 0.0, 0.301],
            [0.0, 0.0, 0.299],
            [0.0, 0.0, 0.901],
        ]
    )
    points = local @ pose[:3, :3].T + pose[:3, 3]
    assert sees(camera, optics, points).tolist() == [True, False, True, False, False]


def test_a_housing_that_hides_the_volume_from_a_device_outside_is_refused():
    # Around the projector and before the camera, which stands behind it.
    body = {"size_mm": [60.0, 60.0, 60.0], "centre_mm": [0.0, 0.0, 0.0]}
    behind = {"position_mm": [0.0, 0.0, -60.0]}
    with pytest.raises(RigError, match="hides the whole measuring volume from 'c'"):
        rig_of(body=body, device=behind)
    beside = {"position_mm": [0.0, 200.0, -60.0]}
    assert rig_of(body=body, device=beside).head.body is not None


def test_a_housing_behind_a_device_or_beyond_the_volume_hides_nothing():
    volume = load_rig(RIG).head.volume
    ahead = {"p": np.array([0.0, 0.0, -0.07]), "c": np.zeros(3)}
    behind = Body((0.0, 0.0, -0.07), (0.2, 0.2, 0.03))
    check_housing(behind, volume, ahead)
    with pytest.raises(ValueError, match="hides the whole measuring volume from 'c'"):
        check_housing(behind, volume, ahead | {"c": np.array([0.0, 0.0, -0.2])})
    # The sights of one beside it pass, though they cross each of its slabs.
    narrow = MeasuringVolume(0.4, 0.6, (0.01, 0.01), (0.01, 0.01))
    housing = Body((0.0, 0.0, 0.0), (0.03, 0.03, 0.03))
    beside = {"p": np.zeros(3), "c": np.array([0.0, 0.2, -0.06])}
    check_housing(housing, narrow, beside)
    # One that looks back, from beyond.
    beyond = Body((0.0, 0.0, 1.0), (0.5, 0.5, 0.1))
    check_housing(beyond, volume, {"p": np.array([0.0, 0.0, 1.0]), "c": np.zeros(3)})


def test_devices_are_sharp_by_their_own_distance_not_by_the_standoff():
    """A camera 200 mm behind the head's origin, sharp from 550 mm on."""
    tables = copy.deepcopy(RIG)
    tables["camera"]["range_mm"] = [550.0, 900.0]
    tables["head"]["camera"][0]["position_mm"] = [150.0, 0.0, -200.0]
    rig = load_rig(tables)
    assert rig.standoff_m < rig.camera_device().range_m[0]


@pytest.mark.parametrize(
    ("tables", "told"),
    [
        ({"camera": {"count": 2}}, r"\[camera\] has count, and stands in a \[head\]"),
        ({"projector": {"body": BODY}}, r"rigid body; write \[head.body\]"),
        ({"camera": {"mount": {"grid_mm": 5.0}}}, r"\[camera\] has mount"),
    ],
)
def test_models_of_a_head_have_no_body_mount_or_count_of_their_own(tables, told):
    with pytest.raises(RigError, match=told):
        load_rig(RIG).replace(**tables)


def test_the_housing_of_a_head_is_one_that_clearance_counts_from():
    rig = load_rig(RIG).replace(head={"body": BODY}, placement={"clearance_mm": 20.0})
    assert rig.head.body.half_m == pytest.approx((0.05, 0.04, 0.03))
    with pytest.raises(RigError, match="is between housings"):
        load_rig(RIG).replace(placement={"clearance_mm": 20.0})


def test_a_plans_rig_holds_the_head_and_gives_it_back():
    rig = load_rig(RIG).replace(head={"body": BODY, "cross": True})
    written = json.loads(json.dumps(rig.to_document()))
    record = RigRecord.model_validate(written)
    assert record.to_document() == written
    head = record.head.head()
    assert head.volume == rig.head.volume
    assert (head.body, head.cross) == (rig.head.body, True)
    assert head.figures == rig.head.figures
    for mine, its in zip(head.devices, rig.head.devices, strict=True):
        assert (mine.kind, mine.name, mine.model) == (its.kind, its.name, its.model)
        assert np.array_equal(mine.head_from_device, its.head_from_device)
    assert not {"head", "turntable", "stations"} & set(load_rig().to_document())


def test_values_refuse_what_is_none():
    pose = np.eye(4)
    volume = MeasuringVolume(0.4, 0.6, (0.2, 0.1), (0.2, 0.1))
    with pytest.raises(ValueError, match="needs a projector and a camera"):
        Head("h", (HeadDevice("camera", "c", pose),), volume, 0.5)
    with pytest.raises(ValueError, match="4 x 4"):
        HeadDevice("camera", "c", np.eye(3))
    for depths in ((0.6, 0.4), (0.0, 0.4), (np.nan, 0.4)):
        with pytest.raises(ValueError, match="must rise from above 0"):
            MeasuringVolume(*depths, (0.2, 0.1), (0.2, 0.1))
    with pytest.raises(ValueError, match="must be positive"):
        MeasuringVolume(0.4, 0.6, (0.2, np.nan), (0.2, 0.1))
