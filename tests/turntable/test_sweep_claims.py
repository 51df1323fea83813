"""The audit of a turn: a planner that doesn't look is found out."""

from dataclasses import replace

import numpy as np
import pytest
from support.group_rigs import DEVICES, planned, table_rig

from planning.cameras.stations.turntable import table_lattice
from planning.cameras.stations.turntable.table_sweep import TableSweep
from planning.model.errors import InfeasibleLimitsError
from planning.scene.draws import DRAWS
from planning.verify.audit.audit import audit_plan

_BODY = {"size_mm": [80.0, 60.0, 120.0], "centre_mm": [0.0, 0.0, -40.0]}
# It turns with the part, 330 mm up to 670, where the housings at mid height are.
_ARM = {
    "name": "arm",
    "shape": "box",
    "centre_mm": [500.0, 0.0, 0.0],
    "size_mm": [340.0, 6.0, 6.0],
}
_PIN = {
    "name": "pin",
    "shape": "box",
    "centre_mm": [58.0, 0.0, 0.0],
    "size_mm": [8.0, 8.0, 40.0],
}
_LEVEL = {
    "floor_mm": -70.0,
    "keep_out": [
        {
            "name": "lid",
            "centre_mm": [0.0, 0.0, 900.0],
            "size_mm": [3000.0, 3000.0, 1660.0],
            "blocks": False,
        }
    ],
}


@pytest.fixture(scope="module")
def few(with_little_work):
    """Few circles and samples."""
    with with_little_work(), pytest.MonkeyPatch.context() as patch:
        patch.setattr(table_lattice, "_CIRCLES", 3)
        patch.setitem(vars(DRAWS), "cameras", replace(DRAWS.cameras, count=500))
        yield


def _level(arm, *others, **table):
    """A plan of devices that can only stand at mid height, beside an arm."""
    housed = {kind: DEVICES[kind] | {"body": _BODY} for kind in ("projector", "camera")}
    rig = table_rig(table=table, obstacle=[arm, *others], workspace=_LEVEL, **housed)
    asked = {"coverage": 0.3, "dominant_coverage": 0.3}
    return planned(rig, max_projectors=1, max_cameras=1, **asked)


@pytest.fixture(scope="module")
def careless(few):
    """A plan whose arm hits housings between two places, and the part a pin."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(TableSweep, "clears", lambda *_: True)
        patch.setattr(TableSweep, "check", lambda *_: None)
        yield _level(_ARM, _PIN, still=["pin"])


@pytest.mark.long
@pytest.mark.parametrize("degrees", [0.0, 7.5])
def test_an_arm_between_two_places_of_the_lattice_leaves_no_room(few, degrees):
    """Housings stand 15 degrees apart; a thin arm passes all of their circle."""
    a = np.radians(degrees)
    there = [500.0 * np.cos(a), 500.0 * np.sin(a), 0.0]
    arm = _ARM | {"centre_mm": there, "turn_deg": [0.0, 0.0, degrees]}
    with pytest.raises(InfeasibleLimitsError, match="1 projector and 1 camera"):
        _level(arm)


def test_the_part_and_what_turns_with_it_are_held_against_all_that_stands(careless):
    failures = audit_plan(careless, n_samples=1000).failures
    assert any("obstacle 'pin (T1)': the part turns" in one for one in failures)
    for name in ("P1", "C1"):
        told = f"{name}.body: obstacle 'arm' turns"
        assert any(told in one for one in failures), failures


def test_a_wall_that_the_part_turns_through_is_found(careless, handmade):
    def narrower(document):
        axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
        document["requirements"]["workspace"]["box"] = {
            "name": "room",
            "centre_m": [0.945, 0.0, 0.0],
            "half_m": [1.0, 1.0, 1.0],
            "axes": axes,
        }

    lie = handmade.tampered(careless, narrower)
    failures = audit_plan(lie, n_samples=1000).failures
    assert any("box: the part turns 4.8 mm through it" in one for one in failures)


def test_a_table_of_one_step_turns_nothing_into_anything(careless, handmade):
    lie = handmade.tampered(
        careless, lambda document: document["rig"]["turntable"].update(steps=1)
    )
    assert not any(" turns " in f for f in audit_plan(lie, n_samples=1000).failures)
