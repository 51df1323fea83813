"""Plans before a turntable: turned rigidly, audited, and refused."""

from dataclasses import replace

import numpy as np
import pytest
from support.group_rigs import egg, planned, table_rig

from planning.cameras.stations.heads.head_cover import HeadSets
from planning.cameras.stations.heads.head_poses import PlacedHead
from planning.cameras.stations.turntable import table_lattice
from planning.cameras.stations.turntable.table_lattice import TableLattice, about_axis
from planning.cameras.stations.turntable.table_sets import TableSets
from planning.model.device_poses import moved_to
from planning.model.errors import InfeasibleLimitsError, InputError, PlanFileError
from planning.scene.draws import DRAWS
from planning.steps.prepare import prepared
from planning.verify.audit.audit import audit_plan

_WALL = {
    "name": "wall",
    "centre_mm": [0.0, 900.0, 0.0],
    "size_mm": [900.0, 100.0, 900.0],
}


@pytest.fixture(scope="module")
def few(with_little_work):
    """Few circles and samples."""
    with pytest.MonkeyPatch.context() as patch, with_little_work():
        patch.setattr(table_lattice, "_CIRCLES", 3)
        patch.setitem(vars(DRAWS), "cameras", replace(DRAWS.cameras, count=500))
        yield


@pytest.fixture(scope="module")
def plan(few):
    rig = table_rig(table={"point_mm": [12.0, -7.0, 0.0]})
    return planned(rig, max_projectors=2, max_cameras=2, coverage=0.85)


def test_devices_of_a_step_are_those_of_the_room_turned_back(plan):
    told = plan.document.stations
    every = {d.id: d for d in (*plan.projectors, *plan.cameras)}
    axis, centre = np.array(told.axis), np.array(told.point_m)
    first = told.stations[0]
    for one in told.stations:
        a, b = -one.angle, -first.angle
        for name, again in zip(
            (*first.projectors, *first.cameras),
            (*one.projectors, *one.cameras),
            strict=True,
        ):
            # About z the azimuth of the way from the axis turns, the height stays.
            before = every[name].world_from_device[:3, 3] - centre
            after = every[again].world_from_device[:3, 3] - centre
            assert after @ axis == pytest.approx(before @ axis, abs=3e-5)
            turn = np.arctan2(after[1], after[0]) - np.arctan2(before[1], before[0])
            assert np.exp(1j * turn) == pytest.approx(np.exp(1j * (a - b)), abs=1e-3)


def test_devices_stand_upright_whichever_way_the_part_turns(few):
    rig = table_rig(table={"axis": [0.0, 0.0, -3.0]})
    turned = planned(rig, max_projectors=1, max_cameras=2, coverage=0.8)
    for device in (*turned.projectors, *turned.cameras):
        # The image's y points down.
        assert device.world_from_device[2, 1] < 0.0
    assert audit_plan(turned, n_samples=2000).failures == ()


def test_the_audit_finds_every_claim_true(plan):
    audit = audit_plan(plan, n_samples=5000)
    assert audit.failures == ()
    assert audit.unmet == ()


def test_steps_for_other_devices_are_told_and_more_devices_take_no_more(plan):
    rows = {(r.projectors, r.cameras): r for r in plan.document.stations.steps}
    assert set(rows) == {(1, 1), (1, 2), (2, 1), (2, 2)}
    for (p, c), row in rows.items():
        if row.steps is None:
            continue
        assert row.lower_bound <= row.steps
        for more in ((p + 1, c), (p, c + 1)):
            if more in rows:
                assert rows[more].steps <= row.steps
    taken = plan.document.stations.stations[0]
    row = rows[len(taken.projectors), len(taken.cameras)]
    found = [r.steps for r in rows.values() if r.steps is not None]
    assert row.steps == min(found)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda s: s["stations"][1].update(angle=0.1), "about the axis"),
        (lambda s: s.update(axis=[0.0, 1.0, 0.0]), "axis"),
        (lambda s: s.update(point_m=[0.0, 0.0, 0.0]), "point_m"),
        (lambda s: s["count"].update(lower_bound=99), "lower_bound"),
        (lambda s: s["stations"].reverse(), "projectors"),
        (lambda s: s.update(count=None), "count"),
        (lambda s: s.update(steps=[]), "each once"),
        (lambda s: s["steps"].append(s["steps"][0]), "each once"),
        (lambda s: [row.update(steps=1) for row in s["steps"]], "needed"),
        (lambda s: [row.update(lower_bound=0) for row in s["steps"]], "needed"),
        (lambda s: s["count"].update(needed=9, lower_bound=9), "needed"),
        (lambda s: s["stations"][0].update(angle=2.0 * np.pi), "less than a turn"),
        (lambda s: s["stations"][1].update(id="T1"), "all different"),
    ],
)
def test_lies_about_steps_are_found(plan, handmade, change, told):
    lie = handmade.tampered(plan, lambda document: change(document["stations"]))
    failures = audit_plan(lie, n_samples=2000).failures
    assert any(told in failure for failure in failures)


def test_a_step_of_devices_that_the_plan_lacks_is_refused(plan, handmade):
    def change(document):
        document["stations"]["stations"][0]["projectors"] = ["P9"]

    with pytest.raises(PlanFileError, match="P9"):
        handmade.tampered(plan, change)


@pytest.mark.parametrize(
    ("steps", "told"), [({"steps": 5}, "evenly"), ({"max_steps": 1}, "may have")]
)
def test_angles_that_the_table_of_the_rig_lacks_are_found(plan, handmade, steps, told):
    lie = handmade.tampered(
        plan, lambda document: document["rig"]["turntable"].update(steps)
    )
    failures = audit_plan(lie, n_samples=2000).failures
    assert any(told in failure for failure in failures)


def test_what_pairs_measure_at_an_angle_is_what_they_do_turned_back(few):
    """The tensors by circles and places, against devices that are turned one by one."""
    from planning.model.progress import Stopwatch
    from planning.report.partial_plan import PlanRequest
    from planning.rig.wishes import Wishes

    rig = table_rig(table={"point_mm": [10.0, 5.0, 0.0], "axis": [0.1, -0.2, 1.0]})
    wishes = Wishes(max_projectors=1, target="surface", pattern="dense")
    ready = prepared(PlanRequest(egg(), rig, wishes, threads=1), Stopwatch())
    space = ready.scene.requirements.workspace
    table = rig.turntable.moved(space.origin_m)
    scene = ready.scene.within(about_axis(space, table))
    lattice = TableLattice.about(table, space, ready.templates, ready.cameras)
    target = scene.target_samples(DRAWS.cameras)
    sets = TableSets.of(scene, lattice, target)
    lamps, eyes = ((1, 2),), ((1, 3), (0, 1))
    steps = sets.steps_of(lamps, eyes)
    assert steps.measured.any()
    for j in (0, 3):
        back = np.linalg.inv(table.turn(lattice.angle(j)))
        room = PlacedHead(
            np.eye(4),
            tuple(lattice.placed(lattice.projectors[e], i) for e, i in lamps),
            tuple(lattice.placed(lattice.cameras[f], k) for f, k in eyes),
        )
        seen = PlacedHead(
            back,
            tuple(moved_to(p, back @ p.world_from_device) for p in room.projectors),
            tuple(moved_to(c, back @ c.world_from_device) for c in room.cameras),
        )
        truth = HeadSets.of(scene, [seen], target)
        assert (steps.lit[:, j] != truth.lit[:, 0]).mean() < 0.005
        assert (steps.measured[:, j] != truth.measured[:, 0]).mean() < 0.005


def test_too_few_devices_are_told_with_the_angles(few):
    rig = table_rig(table={"max_steps": 1})
    with pytest.raises(InfeasibleLimitsError, match="at 1 angle of the table"):
        planned(rig, max_projectors=1, max_cameras=1)


@pytest.mark.parametrize(
    ("tables", "asked", "told"),
    [
        ({}, {"max_heads": 2}, r"no \[head\]"),
        ({}, {"pattern": "rings"}, "dense"),
        ({}, {"survive": 1}, "survive"),
        ({"workspace": {"keep_out": [_WALL]}}, {}, "stands still"),
    ],
)
def test_what_cannot_be_asked_of_a_turntable_is_told_in_one_line(tables, asked, told):
    with pytest.raises(InputError, match=told) as error:
        planned(table_rig(**tables), **({"max_projectors": 1} | asked))
    assert "\n" not in str(error.value)
