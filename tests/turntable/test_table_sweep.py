"""What turns keeps off what stands still, all the way round."""

import numpy as np
import pytest
from support.plain_shapes import box

from geometry.mesh.mesh import TriangleMesh
from planning.cameras.stations.turntable.table_sweep import check_sweep
from planning.model.errors import InfeasibleLimitsError
from planning.model.heads import Turntable
from planning.scene.placed_bodies import Obstruction
from planning.verify.audit.stations.sweep_claims import _meets

AXIS, POINT = np.array([0.0, 0.0, 1.0]), np.zeros(3)
TABLE = Turntable((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
UP = np.array([0.0, 0.0, 1.0])
# 200 x 40 x 40 mm: it sweeps out to a radius of hypot(100, 20) = 102 mm.
BAR = box((0.2, 0.04, 0.04), divisions=4)


def at(x, y, z, size=(0.01, 0.01, 0.02)):
    mesh = box(size)
    return TriangleMesh(mesh.vertices + np.array([x, y, z]), mesh.faces)


def refused(part, still, turning=(), floor=None):
    solids = [[Obstruction(n, m, 1e-6) for n, m in some] for some in (turning, still)]
    try:
        check_sweep(TABLE, part, *solids, floor)
    except InfeasibleLimitsError as error:
        return str(error)
    return ""


@pytest.mark.parametrize(
    ("where", "hits"),
    [
        # Beside the bar at angle 0, but where its ends come by.
        ((0.0, 0.06, 0.0), True),
        ((0.0, 0.095, 0.0), True),
        # Its corner passes at 101.98 mm; the pin begins at 103 and at 102.2 mm.
        ((0.0, 0.108, 0.0), False),
        ((0.0, 0.1072, 0.0), True),
        # Above and below, with two millimetres between.
        ((0.0, 0.05, 0.032), False),
        ((0.0, 0.05, -0.032), False),
        # In the hollow of the sweep there is none: the bar holds the axis.
        ((0.0, 0.0, 0.0), True),
    ],
)
def test_a_pin_in_the_way_of_a_bar(where, hits):
    pin = at(*where)
    message = refused(BAR, [("pin", pin)])
    assert bool(message) is hits
    if hits:
        assert "obstacle 'pin' stands still" in message
        assert "\n" not in message


def test_a_part_inside_what_stands_still():
    assert refused(BAR, [("big", at(0, 0, 0, (0.5, 0.5, 0.5)))])


def test_what_is_fastened_to_the_part_turns_too():
    arm = at(0.2, 0.0, 0.1, (0.2, 0.01, 0.01))
    pin = at(0.0, 0.25, 0.1)
    assert not refused(BAR, [("pin", pin)])
    assert "obstacle 'arm'" in refused(BAR, [("pin", pin)], [("arm", arm)])


def test_a_part_may_glide_on_a_table_but_not_sink_into_it():
    top = at(0, 0, -0.03, (0.5, 0.5, 0.02))
    assert not refused(BAR, [("table", top)])
    sunk = TriangleMesh(BAR.vertices - [0, 0, 0.002], BAR.faces)
    assert refused(sunk, [("table", top)])


@pytest.mark.parametrize(("floor", "hits"), [(-0.11, False), (-0.09, True)])
def test_an_axis_that_lies_down_takes_the_part_to_the_floor(floor, hits):
    table = Turntable((0.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    if hits:
        with pytest.raises(InfeasibleLimitsError, match=r"12\.0 mm below the floor"):
            check_sweep(table, BAR, [], [], (UP, floor))
    else:
        check_sweep(table, BAR, [], [], (UP, floor))


def test_an_upright_axis_takes_no_part_below_the_floor():
    check_sweep(TABLE, BAR, [], [], (UP, 0.5))


@pytest.mark.parametrize(
    ("where", "hits"),
    [((0.0, 0.06, 0.0), True), ((0.0, 0.108, 0.0), False), ((0, 0.05, 0.032), False)],
)
def test_the_audit_sees_the_same_by_chords(where, hits):
    pin = at(*where)
    met = _meets(BAR, pin, AXIS, POINT) or _meets(pin, BAR, AXIS, POINT)
    assert met is hits


def test_the_audit_sees_a_needle_that_only_turning_points_meet():
    needle = at(0.0, 0.05, 0.1, (1e-5, 1e-5, 0.19))
    met = _meets(BAR, needle, AXIS, POINT) or _meets(needle, BAR, AXIS, POINT)
    assert met
