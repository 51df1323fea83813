"""Turntables and stations in rig files, and what a turntable does to the part."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.head_rigs import RIG

from planning import load_rig
from planning.model.devices.heads import Stations, Turntable
from planning.model.document.input_records import RigRecord
from planning.model.errors import RigError

TABLE = {"point_mm": [10.0, 20.0, 0.0], "axis": [0.0, 0.0, 2.0]}
BOX = {
    "name": "robot",
    "shape": "box",
    "size_mm": [100.0, 100.0, 100.0],
    "centre_mm": [900.0, 0.0, 0.0],
}
ZONE = {"name": "pillar", "centre_mm": [0, 900, 0], "size_mm": [99.0, 99.0, 99.0]}
ZONE["centre_mm"] = [0.0, 900.0, 0.0]


def test_a_turntable_is_read_in_metres_with_a_unit_axis():
    rig = load_rig({"base": "default", "turntable": TABLE | {"steps": 12}})
    table = rig.turntable
    assert table.point_m == pytest.approx((0.01, 0.02, 0.0))
    assert table.axis == (0.0, 0.0, 1.0)
    assert (table.steps, table.max_steps, table.still) == (12, None, ())
    assert table.angles == pytest.approx(np.radians(np.arange(0, 360, 30)))
    free = load_rig({"base": "default", "turntable": TABLE}).turntable
    assert (free.steps, free.angles) == (None, ())
    assert load_rig().turntable is None


def test_turning_is_a_rotation_about_the_axis_through_its_point():
    axis = np.array([1.0, -2.0, 0.5])
    axis /= np.linalg.norm(axis)
    table = Turntable((0.1, -0.2, 0.3), tuple(axis.tolist()))
    pose = table.turn(0.7)
    turn = Rotation.from_rotvec(0.7 * axis).as_matrix()
    assert pose[:3, :3] == pytest.approx(turn, abs=1e-14)
    point = np.array([*table.point_m, 1.0])
    assert pose @ point == pytest.approx(point)
    assert pose @ (point + [*(0.4 * axis), 0.0]) == pytest.approx(
        point + [*(0.4 * axis), 0.0]
    )
    assert table.turn(0.3) @ table.turn(0.4) == pytest.approx(pose)
    moved = table.moved((0.0, 1.0, 0.0))
    assert moved.point_m == pytest.approx((0.1, 0.8, 0.3))
    assert moved.axis == table.axis


def test_keep_out_volumes_stand_still_with_the_obstacles_that_are_named():
    zones = [ZONE, ZONE | {"name": "ground", "blocks": False}]
    rig = load_rig(
        {
            "base": "default",
            "obstacle": [BOX, BOX | {"name": "clamp"}],
            "workspace": {"keep_out": zones},
            "turntable": TABLE | {"still": ["robot"]},
        }
    )
    assert rig.turntable.still == ("robot", "pillar")


@pytest.mark.parametrize(
    ("table", "told"),
    [
        (
            {"point_mm": [0.0, 0.0, 0.0]},
            "a turntable without axis; write the direction",
        ),
        ({"axis": [0.0, 0.0, 1.0]}, "a turntable without point_mm; write a point"),
        (TABLE | {"axis": [0.0, 0.0, 0.0]}, "axis = .* must not be zero"),
        (TABLE | {"steps": 0}, "steps"),
        (TABLE | {"steps": 361}, "steps"),
        (TABLE | {"steps": "many"}, "steps"),
        (TABLE | {"steps": 4, "max_steps": 5}, "max_steps = 5 is more than the 4"),
        (TABLE | {"still": ["robot"]}, "still names 'robot', which is no .*: none"),
        (TABLE | {"still": ["a", "a"]}, "still names 'a' twice"),
        (TABLE | {"speed": 1.0}, "`turntable.speed` is not a known key"),
    ],
)
def test_turntables_that_cannot_be_are_refused_in_one_line(table, told):
    with pytest.raises(RigError, match=told) as error:
        load_rig({"base": "default", "turntable": table})
    assert len(str(error.value).splitlines()) == 1
    assert error.value.exit_code == 3


def test_stations_are_of_a_head():
    with pytest.raises(RigError, match=r"poses of a head that is carried"):
        load_rig({"base": "default", "stations": {"max": 3}})
    with pytest.raises(RigError, match=r"stations.carrier` = 'cart'"):
        load_rig({"base": "default", "stations": {"carrier": "cart"}})


def test_carriers_are_in_the_plans_rig_and_come_back():
    stations = {"max": 5, "carrier": "tripod", "seconds_per_station": 20.0}
    turning = TABLE | {"max_steps": 3, "still": ["robot"], "seconds_per_step": 2.0}
    rig = load_rig(
        RIG | {"stations": stations, "turntable": turning, "obstacle": [BOX]}
    )
    assert rig.stations == Stations(5, "tripod", None, 20.0)
    written = json.loads(json.dumps(rig.to_document()))
    record = RigRecord.model_validate(written)
    assert record.to_document() == written
    assert record.stations.stations() == rig.stations
    assert record.turntable.turntable() == rig.turntable
    many = load_rig(RIG | {"stations": {}}).stations
    assert many == Stations(None, "robot")
    record = RigRecord.model_validate(load_rig(RIG | {"stations": {}}).to_document())
    assert record.stations.stations() == many


def test_values_refuse_an_axis_that_is_no_direction():
    for axis in ((0.0, 0.0, 2.0), (0.0, 0.0, np.nan)):
        with pytest.raises(ValueError, match="must be of length 1"):
            Turntable((0.0, 0.0, 0.0), axis)
