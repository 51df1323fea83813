"""What turns with a table keeps off what stands still, at every angle of a turn."""

import copy

import numpy as np
import pytest
from support.group_rigs import egg, planned, table_rig

from geometry.shapes.boxes import OrientedBox
from planning.cameras.stations.turntable.table_sweep import TableSweep
from planning.model.devices.heads import Turntable
from planning.model.errors import InfeasibleLimitsError

# The egg is 100 x 120 x 160 mm: about x, 80 mm reach far, and about z 60.
_ABOUT_X = {"axis": [1.0, 0.0, 0.0]}
_PIN = {"name": "pin", "shape": "box", "size_mm": [20.0, 20.0, 20.0]}


def _refused(**rig):
    with pytest.raises(InfeasibleLimitsError) as error:
        planned(table_rig(**copy.deepcopy(rig)), max_projectors=1, max_cameras=1)
    return str(error.value)


@pytest.fixture
def swept(with_little_work, monkeypatch):
    """Plans that end once it is known what turns."""

    class Clear(Exception):
        pass

    def end(*_):
        raise Clear

    module = "planning.steps.stations.turntable.TableSets.of"
    monkeypatch.setattr(module, end)
    with with_little_work():
        yield Clear


def test_a_pin_that_the_part_turns_into_is_told_with_angle_and_depth(swept):
    """At y = 75 the part isn't at angle 0, but 90 degrees later, 5 mm deep."""
    pin = _PIN | {"centre_mm": [0.0, 85.0, 0.0]}
    said = _refused(table=_ABOUT_X | {"still": ["pin"]}, obstacle=[pin])
    assert "the part turns 5.0 mm into obstacle 'pin'" in said
    angle = float(said.split("turned by ")[1].split()[0])
    # The end of the egg that is 80 mm off points to the pin: at 90 or 270 degrees.
    assert abs(angle % 180.0 - 90.0) < 8.0
    assert "\n" not in said


def test_a_pin_inside_the_part_and_one_that_holds_it_are_refused_at_once(swept):
    for size in (10.0, 400.0):
        pin = _PIN | {"centre_mm": [0.0, 0.0, 0.0], "size_mm": [size] * 3}
        assert "obstacle 'pin'" in _refused(table={"still": ["pin"]}, obstacle=[pin])


def test_what_turns_with_the_part_keeps_off_as_well(swept):
    pin = _PIN | {"centre_mm": [0.0, 200.0, -100.0], "size_mm": [20.0, 20.0, 100.0]}
    arm = {"centre_mm": [150.0, 0.0, -100.0], "size_mm": [200.0, 20.0, 20.0]}
    arm |= {"name": "arm", "shape": "box"}
    said = _refused(table={"still": ["pin"]}, obstacle=[pin, arm])
    assert "obstacle 'arm' turns 20.1 mm into obstacle 'pin'" in said


@pytest.mark.parametrize(
    ("table", "obstacle"),
    [
        ({"still": ["pin"]}, _PIN | {"centre_mm": [0.0, 71.0, 0.0]}),
        # It stands on it, and its lowest point stays where it is.
        ({"still": ["pin"]}, {"name": "pin", "shape": "table", "size_mm": [90.0] * 3}),
        # It is in the part's way, but turns along.
        ({}, _PIN | {"centre_mm": [0.0, 60.0, 0.0]}),
        # This table never turns.
        (_ABOUT_X | {"still": ["pin"], "steps": 1}, _PIN | {"centre_mm": [0, 75, 0]}),
    ],
)
def test_what_only_touches_or_turns_along_is_left(swept, table, obstacle):
    with pytest.raises(swept):
        planned(table_rig(table=table, obstacle=[obstacle]), max_projectors=1)


def test_a_solid_zone_is_in_the_way_and_forbidden_ground_is_not(swept):
    zone = _PIN | {"centre_mm": [0.0, 75.0, 0.0]}
    del zone["shape"]
    assert "'pin'" in _refused(table=_ABOUT_X, workspace={"keep_out": [zone]})
    ground = {"keep_out": [zone | {"blocks": False}]}
    with pytest.raises(swept):
        planned(table_rig(table=_ABOUT_X, workspace=ground), max_projectors=1)


def test_a_wall_that_the_part_turns_through_is_told(swept):
    """About y its half of 80 mm along z swings out to x."""
    about_y = {"axis": [0.0, 1.0, 0.0]}
    low = [-70.0, -2000.0, -2000.0]
    room = {"shape": "box", "min_mm": low, "max_mm": [2000.0] * 3}
    said = _refused(table=about_y, workspace=room)
    assert "10.0 mm into a wall of the room when it has turned by" in said


def test_a_floor_that_the_part_reaches_through_at_once_binds_devices_alone(swept):
    about_y = {"axis": [0.0, 1.0, 0.0], "point_mm": [0.0, 0.0, -5.0]}
    with pytest.raises(swept):
        planned(table_rig(table=about_y, workspace={"floor_mm": 0.0}), max_projectors=1)
    said = _refused(table=about_y, workspace={"floor_mm": -81.0})
    assert "the part turns 9.0 mm into the floor" in said


@pytest.mark.parametrize("degrees", [0.0, 3.75, 7.5])
def test_a_housing_keeps_off_what_passes_between_two_places(degrees):
    """A thin arm, at angle 0 beside the housing by any angle."""
    arm = TableSweep(
        Turntable((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
        {"arm": egg().corners * [8.0, 0.05, 0.05]},
    )
    azimuth = np.radians(90.0 + degrees)
    out = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    for radius, room in ((0.38, False), (0.43, True)):
        solid = OrientedBox(radius * out, np.eye(3), np.full(3, 0.01))
        assert arm.clears(solid) is room
