"""Plans before a turntable: turned rigidly, audited, and refused."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from support.group_rigs import DEVICES, egg, planned, table_rig

from geometry.mesh.mesh import TriangleMesh
from planning.cameras.stations.heads.head_cover import HeadSets
from planning.cameras.stations.heads.head_poses import PlacedHead
from planning.cameras.stations.turntable import table_lattice
from planning.cameras.stations.turntable.fewest_steps import StepSearch
from planning.cameras.stations.turntable.table_lattice import TableLattice, about_axis
from planning.cameras.stations.turntable.table_sets import TableSets
from planning.handover.export.export_frames import frame_of
from planning.handover.export.exported_rig import ExportedRig
from planning.handover.export.sheets.landmarks import Landmarks
from planning.model.devices.device_poses import moved_to
from planning.model.errors import (
    InfeasibleLimitsError,
    InputError,
    PlanFileError,
    RigError,
)
from planning.model.plan import RigPlan
from planning.report.page.claim_tables import claim_tables
from planning.report.summary.brief import brief
from planning.report.summary.check_lines import cost_lines
from planning.report.summary.devices.station_lines import station_lines, trade_lines
from planning.scene.draws import DRAWS
from planning.steps.prepare import prepared
from planning.verify.audit.audit import audit_plan
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.request_claims import audit_request
from planning.verify.reconstruction.render.mitsuba.scene_text import (
    Shine,
    Window,
    scene_text,
)
from planning.verify.reconstruction.scanner import Scanner
from planning.verify.verification import verify_plan

_POST = {
    "name": "post",
    "shape": "box",
    "centre_mm": [250.0, 0.0, 0.0],
    "size_mm": [20.0, 160.0, 600.0],
}
_CLAMP = {
    "name": "clamp",
    "shape": "box",
    "centre_mm": [0.0, 0.0, -100.0],
    "size_mm": [30.0, 30.0, 30.0],
}
_BODY = {"size_mm": [80.0, 60.0, 120.0], "centre_mm": [0.0, 0.0, -40.0]}


@pytest.fixture(scope="module")
def few(with_little_work):
    """Few circles and samples."""
    with with_little_work(), pytest.MonkeyPatch.context() as patch:
        patch.setattr(table_lattice, "_CIRCLES", 3)
        patch.setitem(vars(DRAWS), "cameras", replace(DRAWS.cameras, count=500))
        yield


@pytest.fixture(scope="module")
def plan(few):
    rig = table_rig(table={"point_mm": [12.0, -7.0, 0.0], "seconds_per_step": 1.5})
    return planned(rig, max_projectors=2, max_cameras=2, coverage=0.85)


@pytest.fixture(scope="module")
def among(few):
    """A plan among a post that stands, a clamp that turns, and housings."""
    housed = {kind: DEVICES[kind] | {"body": _BODY} for kind in ("projector", "camera")}
    around = [
        _POST
        | {
            "name": f"post {k}",
            "centre_mm": [
                250.0 * np.cos(k * np.pi / 3.0),
                250.0 * np.sin(k * np.pi / 3.0),
                0.0,
            ],
            "turn_deg": [0.0, 0.0, 60.0 * k],
            "size_mm": [20.0, 60.0, 600.0],
        }
        for k in range(3)
    ]
    rig = table_rig(
        table={"still": [post["name"] for post in around], "point_mm": [9.0, 4.0, 0.0]},
        obstacle=[_CLAMP, *around],
        **housed,
    )
    asked = {"coverage": 0.7, "dominant_coverage": 0.8}
    return planned(rig, max_projectors=1, max_cameras=2, **asked)


def test_what_stands_still_is_seen_turned_back_at_each_step(among):
    solids = {o.name: o for o in among.surface.obstacles}
    told = among.document.stations
    assert solids["clamp"].station == ""
    assert len(solids) == 1 + 3 * len(told.stations)
    for one in told.stations:
        solid = solids[f"post 2 ({one.id})"]
        assert (solid.station, solid.rig_name) == (one.id, "post 2")
        # Its azimuth about the axis is that of the room, less the angle.
        away = solid.mesh.vertices.mean(axis=0) - np.array(told.point_m)
        azimuth = 2.0 * np.pi / 3.0
        offset = 0.25 * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        there = among.requirements.workspace.centre + offset
        truth = there - np.array(told.point_m)
        turn = np.arctan2(away[1], away[0]) - np.arctan2(truth[1], truth[0])
        assert np.exp(1j * turn) == pytest.approx(np.exp(-1j * one.angle), abs=1e-6)


@pytest.mark.long
def test_the_audit_and_pixels_bear_out_a_plan_among_posts_and_housings(among):
    found = verify_plan(among, threads=1)
    assert found.passed, found.summary()
    wider = verify_plan(among, truth=_wider_at_first(among), threads=1)
    missing = [
        result.reconstruction.completeness.predicted_missing
        for result in (found, wider)
    ]
    assert missing[0] < 0.01 < missing[1]


@pytest.mark.parametrize(
    ("where", "told"),
    [
        ({"centre_mm": [250.0, 40.0, 0.0]}, "differs from the rig's"),
        ({"name": "pillar"}, "the rig states"),
    ],
)
def test_a_post_elsewhere_than_the_rig_has_it_is_found(among, handmade, where, told):
    lie = handmade.tampered(
        among, lambda document: document["rig"]["obstacle"][1].update(where)
    )
    failures = audit_plan(lie, n_samples=1000).failures
    assert any(told in failure for failure in failures)


@pytest.mark.long
def test_a_post_that_the_plan_forgot_shows_in_its_areas(among):
    """The audit's own rays meet it: areas claimed without it are false."""
    failures = audit_plan(_wider_at_first(among), n_samples=5000).failures
    assert any("lit_area_m2" in failure for failure in failures)


def _wider_at_first(plan):
    """The plan, but what stands still is wider at the first step."""
    solids = tuple(
        replace(o, mesh=_wider(o.mesh)) if o.station == "T1" else o
        for o in plan.surface.obstacles
    )
    return replace(plan, surface=replace(plan.surface, obstacles=solids))


def _wider(mesh):
    """The same solid, grown a good deal about its middle."""
    middle = mesh.vertices.mean(axis=0)
    return TriangleMesh(middle + 8.0 * (mesh.vertices - middle), mesh.faces)


def test_a_path_traced_step_has_what_stands_there_at_that_step(among):
    scanner = Scanner.of(among)
    projector = scanner.projectors[0]
    assert projector.station == "T1"
    windows = [Window.whole(camera) for camera in scanner.cameras]
    text = scene_text(scanner, Shine(projector, "dark.exr"), windows)
    solids = [k for k, o in enumerate(scanner.obstacles) if o.station in ("", "T1")]
    assert len(solids) == 4
    for k in range(len(scanner.obstacles)):
        assert (f"obstacle{k}.ply" in text) == (k in solids)
    # Housings of the projector and of its own cameras.
    there = among.document.stations.stations[0]
    assert text.count('type="cube"') == 1 + len(there.cameras)


@pytest.mark.parametrize("kind", ["obstacle", "zone"])
def test_a_name_that_a_step_would_give_is_refused(kind):
    name = "post (T12)"
    zone = {"name": name, "centre_mm": [0.0, 900.0, 0.0], "size_mm": [9.0, 9.0, 9.0]}
    tables = {
        "obstacle": {"obstacle": [_CLAMP | {"name": name}]},
        "zone": {"workspace": {"keep_out": [zone]}},
    }
    with pytest.raises(RigError, match="call it otherwise"):
        table_rig(**tables[kind])


def test_few_of_a_model_are_before_the_table_at_once(few):
    counted = DEVICES["camera"] | {"count": 1}
    rig = table_rig(camera=counted)
    plan = planned(rig, max_projectors=1, max_cameras=3, coverage=0.7)
    assert {len(one.cameras) for one in plan.document.stations.stations} == {1}
    assert {(r.projectors, r.cameras) for r in plan.document.stations.steps} == {(1, 1)}
    assert audit_plan(plan, n_samples=1000).failures == ()


def test_a_housing_that_the_part_would_hit_at_some_angle_has_no_room(few):
    """A long part turns through where the housing reaches, at angles not used, too."""
    deep = {"size_mm": [80.0, 60.0, 1300.0], "centre_mm": [0.0, 0.0, 0.0]}
    rig = table_rig(camera=DEVICES["camera"] | {"body": deep})
    with pytest.raises(InfeasibleLimitsError, match="1 projector and 1 camera"):
        planned(rig, max_projectors=1, max_cameras=1, coverage=0.3)


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


def test_turning_from_step_to_step_takes_its_time(plan):
    told = plan.document.stations
    assert told.move_s == 1.5 * (len(told.stations) - 1)
    for text in (brief(plan, (), ()), "\n".join(cost_lines(plan.document))):
        assert f"{told.move_s:.1f} s to move between steps" in text
    page = "".join(claim_tables(plan))
    row = page.split("moves between steps</th>")[1].split("</td>")[0]
    assert row.endswith(f">{told.move_s:.1f} s")


def test_a_bound_of_steps_is_called_that_and_not_a_proof(plan):
    heading, *_ = trade_lines(plan.document.stations)
    assert heading.split("  ")[-1] == "at least"
    assert "proved" not in "\n".join(station_lines(plan))


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


def test_more_devices_than_have_room_need_no_more_steps_than_fewer(few, monkeypatch):
    """What one camera does two do, though of two none were found with room."""
    fewest = StepSearch.fewest

    def without_two(self, n_lamps, n_eyes, most):
        if n_eyes == 2:
            return None, 1
        return fewest(self, n_lamps, n_eyes, most)

    monkeypatch.setattr(StepSearch, "fewest", without_two)
    made = planned(table_rig(), max_projectors=1, max_cameras=2, coverage=0.7)
    one, two = made.document.stations.steps
    assert (two.cameras, two.steps, two.lower_bound) == (2, one.steps, 1)
    assert len(made.document.stations.stations[0].cameras) == 1
    assert audit_plan(made, n_samples=1000).failures == ()


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda s: s["stations"][1].update(angle=0.1), "about the axis"),
        (lambda s: s.update(axis=[0.0, 1.0, 0.0]), "axis"),
        (lambda s: s.update(point_m=[0.0, 0.0, 0.0]), "point_m"),
        (lambda s: s["count"].update(lower_bound=99), "lower_bound"),
        (lambda s: s["stations"].reverse(), "projectors"),
        (lambda s: s.update(count=None), "count"),
        (lambda s: s.update(move_s=0.5), "move_s"),
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


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        ({}, None),
        ({"max_projectors": 0}, "requirements.max_projectors: "),
        ({"max_cameras": 0}, "requirements.max_cameras: "),
        ({"max_heads": 2}, "request.max_heads (there): "),
    ],
)
def test_more_at_a_step_than_was_asked_for_is_found(plan, handmade, asked, told):
    """Also where what was used says that as many were allowed."""
    lie = handmade.tampered(plan, lambda document: document["request"].update(asked))
    findings = AuditFindings()
    audit_request(SimpleNamespace(plan=lie), findings)
    named = [f for f in findings.failures if ".asked" not in f]
    assert [f.startswith(told) for f in named] == [True] if told else named == []


def test_one_step_of_more_devices_is_found(plan, handmade):
    """Though all steps together have no more than was asked of each."""

    def change(document):
        one, other, *_ = document["stations"]["stations"]
        most = document["request"]["max_projectors"]
        one["projectors"] = [*one["projectors"], *other["projectors"]]
        one["projectors"] = (one["projectors"] * most)[: most + 1]

    findings = AuditFindings()
    lie = handmade.tampered(plan, change)
    audit_request(SimpleNamespace(plan=lie), findings)
    assert any("are at one, but request.max_projectors" in f for f in findings.failures)


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


def test_a_plane_that_no_circle_meets_is_told_in_one_line(few):
    wall = {"name": "wall", "centre_mm": [0, -620, 0], "normal": [0, 1, 0]}
    wall |= {"extent_mm": [900, 900], "thickness_mm": 1}
    rig = table_rig(workspace={"mounting": [wall]})
    with pytest.raises(InfeasibleLimitsError, match="left to a projector") as error:
        planned(rig, max_projectors=1)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("tables", "asked", "told"),
    [
        ({}, {"max_heads": 2}, r"no \[head\]"),
        ({}, {"pattern": "rings"}, "dense"),
        ({}, {"survive": 1}, "survive"),
        ({"camera": DEVICES["camera"] | {"mount": {"pan_step_deg": 5.0}}}, {}, "mount"),
    ],
)
def test_what_cannot_be_asked_of_a_turntable_is_told_in_one_line(tables, asked, told):
    with pytest.raises(InputError, match=told) as error:
        planned(table_rig(**tables), **({"max_projectors": 1} | asked))
    assert "\n" not in str(error.value)


def test_an_aiming_sheet_knows_what_stands_at_its_step(among):
    frame = frame_of(None, among.requirements.workspace)
    rig = ExportedRig.of(among, frame)
    landmarks, differs = Landmarks(rig), 0
    for device in rig.devices:
        for every in (False, True):
            there = [
                obstacle
                for obstacle in among.surface.obstacles
                if every or obstacle.station in ("", device.planned.station)
            ]
            # As if all of these stood there at once.
            still = tuple(replace(obstacle, station="") for obstacle in there)
            surface = replace(among.surface, obstacles=still)
            alone = Landmarks(ExportedRig.of(RigPlan(among.document, surface), frame))
            same = np.array_equal(alone.seen_by(device), landmarks.seen_by(device))
            assert same or every
            differs += not same
    assert differs
