"""Plans of heads: rigid, measured by their own pairs, audited, and refused."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from support.group_rigs import head_rig, planned

from geometry.shapes.boxes import box_gap
from planning.cameras.stations.heads.fewest_heads import fewest_heads
from planning.model.devices.planned import meet
from planning.model.errors import InputError, PlanFileError
from planning.report.page.per_face import centroids, per_face
from planning.report.summary.devices.station_lines import fewest_words
from planning.report.summary.shortfall import missing
from planning.rig.rig import Rig
from planning.scene.draws import DRAWS
from planning.scene.placed_bodies import placed_box
from planning.verify.audit.audit import audit_plan
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.request_claims import audit_request

_BODY = {"size_mm": [420.0, 100.0, 80.0], "centre_mm": [0.0, 0.0, -30.0]}


@pytest.fixture(scope="module")
def few(with_little_work):
    """Few candidates, and little work on the rest."""
    with with_little_work(), pytest.MonkeyPatch.context() as patch:
        patch.setattr(Rig, "n_projector_poses", 40)
        patch.setitem(vars(DRAWS), "cameras", replace(DRAWS.cameras, count=600))
        yield


@pytest.fixture(scope="module")
def plan(few):
    return planned(head_rig(head={"body": _BODY}), max_heads=9)


def _at(plan, one):
    every = {d.id: d for d in (*plan.projectors, *plan.cameras)}
    return [every[name] for name in (*one.projectors, *one.cameras)]


def test_every_head_holds_its_devices_as_the_rig_says(plan):
    head, told = plan.document.rig.head.head(), plan.document.stations
    assert told.kind == "heads"
    assert [one.id for one in told.stations] == [
        f"H{k + 1}" for k in range(len(told.stations))
    ]
    for one in told.stations:
        world = np.array(one.world_from_station)
        for device, planned_at in zip(head.devices, _at(plan, one), strict=True):
            truth = world @ device.head_from_device
            assert planned_at.world_from_device == pytest.approx(truth, abs=2e-5)
            assert planned_at.station == one.id


def test_count_and_bounds_are_told_and_what_is_asked_is_measured(plan):
    count, target = plan.document.stations.count, plan.coverage.target
    assert count.count == len(plan.document.stations.stations) == count.needed
    assert 1 <= count.lower_bound <= count.count
    assert 1 <= count.everywhere <= count.count
    assert target.measured_m2 >= 0.95 * target.reachable_by_cameras_m2
    assert target.lit_m2 >= 0.9 * target.reachable_by_projectors_m2


@pytest.mark.long
def test_no_more_are_needed_than_meet_all_that_is_asked(few, monkeypatch):
    """Candidates alone would take two more; those planned were moved."""

    def pessimist(*args):
        found = fewest_heads(*args)
        n = len(found.chosen)
        return replace(found, needed=n + 2, lower_bound=n + 1)

    monkeypatch.setattr("planning.steps.stations.heads.fewest_heads", pessimist)
    plan = planned(head_rig(head={"body": _BODY}), max_heads=9)
    count = plan.document.stations.count
    assert count.needed == count.lower_bound == count.count
    assert "suffice" not in fewest_words(plan)
    assert audit_plan(plan, n_samples=2000).failures == ()


def test_housings_keep_apart(plan):
    body = plan.document.rig.head.body
    boxes = [
        placed_box(body, np.array(one.world_from_station))
        for one in plan.document.stations.stations
    ]
    gaps = [box_gap(a, b) for k, a in enumerate(boxes) for b in boxes[:k]]
    assert min(gaps) > 0.0


def test_the_audit_finds_every_claim_true(plan):
    audit = audit_plan(plan, n_samples=6000)
    assert audit.failures == ()
    assert audit.unmet == ()


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda s: s["stations"][0].update(id="H9"), "station"),
        (lambda s: s["count"].update(lower_bound=99), "lower_bound"),
        (lambda s: s["count"].update(count=1), "count"),
        (lambda s: s["count"].update(greedy=0), "greedy"),
        (lambda s: s["count"].update(n_candidates=5), "n_candidates"),
        (lambda s: s.update(way_m=1.0), "way_m"),
        (lambda s: s["stations"][0].update(angle=0.5), "angle"),
        (lambda s: s.update(n_reference=3), "n_reference"),
        (lambda s: s.update(cross=True), "station"),
        (lambda s: s.update(kind="turntable"), "axis"),
        (
            lambda s: s["stations"][0]["world_from_station"][0].__setitem__(3, 0.0),
            "beside where the head holds it",
        ),
    ],
)
def test_lies_about_heads_are_found(plan, handmade, change, told):
    lie = handmade.tampered(plan, lambda document: change(document["stations"]))
    failures = audit_plan(lie, n_samples=2000).failures
    assert any(told in failure for failure in failures)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda d, n: None, None),
        (lambda d, n: d["request"].update(max_heads=n - 1), "request.max_heads is"),
        (lambda d, n: d["request"].update(max_cameras=99), "request.max_cameras"),
        (
            lambda d, n: d["rig"].update(stations={"carrier": "robot", "max": n - 1}),
            "rig.stations.max is",
        ),
    ],
)
def test_more_heads_than_were_asked_for_are_found(plan, handmade, change, told):
    n, findings = len(plan.document.stations.stations), AuditFindings()
    lie = handmade.tampered(plan, lambda document: change(document, n))
    audit_request(SimpleNamespace(plan=lie), findings)
    named = [f for f in findings.failures if f.startswith(("stations:", "request."))]
    assert any(told in f for f in named) if told else named == []


def test_a_housing_between_another_head_and_the_object_is_found(plan, handmade):
    """The first head is moved half-way to the object from where the second stands."""

    def between(document):
        one, other = document["stations"]["stations"][:2]
        pose = np.array(other["world_from_station"])
        pose[:3, 3] *= 0.5
        one["world_from_station"] = pose.tolist()

    failures = audit_plan(handmade.tampered(plan, between), n_samples=2000).failures
    assert any("stands between" in failure for failure in failures)


def test_a_head_that_holds_nothing_is_refused(plan, handmade):
    with pytest.raises(PlanFileError, match="devices"):
        handmade.tampered(plan, lambda d: d["rig"]["head"].update(devices=[]))


@pytest.mark.long
def test_cameras_of_heads_that_cross_measure_with_no_projector_but_the_plans(few):
    """Beside heads of the reference set they would, and claim to cover all that is lit.

    Pairs of one head alone are 15 degrees apart or more: at 600 mm that is 160 mm.
    """
    limits = {"max_sigma_mm": 1.0, "min_angle_deg": 16.0}
    rig = head_rig(head={"cross": True}, limits=limits)
    plan = planned(rig, max_heads=2, pattern="dense")
    target, proof = plan.coverage.target, plan.document.certificates.cameras
    assert target.measured_m2 < 0.5 * target.lit_m2
    assert proof.best_area.value_m2 == pytest.approx(target.measured_m2, rel=0.15)
    assert audit_plan(plan).failures == ()


def test_other_heads_reach_nothing_with_the_projectors_of_heads_that_cross(few):
    """Hardly a pair of one head is 16.5 degrees apart; a camera elsewhere would be."""
    limits = {"max_sigma_mm": 1.0, "min_angle_deg": 16.5}
    rig = head_rig(head={"cross": True}, limits=limits)
    plan = planned(rig, max_heads=1, pattern="dense")
    target, proof = plan.coverage.target, plan.document.certificates.cameras
    assert target.reachable_by_cameras_m2 < 0.2 * target.lit_m2
    asked = plan.requirements.coverage * target.reachable_by_cameras_m2
    assert proof.required_m2 == pytest.approx(asked, rel=0.15)


def test_a_pair_across_heads_measures_nothing(plan, handmade):
    """Without names of stations more is measured than was claimed, or as much."""

    def unnamed(document):
        for device in (*document["projectors"], *document["cameras"]):
            device.pop("station")

    alone = audit_plan(plan, n_samples=4000).case.actual
    across = audit_plan(handmade.tampered(plan, unnamed), n_samples=4000).case.actual
    for p, projector in enumerate(plan.projectors):
        for c, camera in enumerate(plan.cameras):
            measured = (alone.pairs[p, c] == alone.pairs.max()).any()
            if not meet(projector.station, camera.station):
                assert not measured
    assert (across.pairs >= alone.pairs).all()
    assert (across.pairs > alone.pairs).any()


@pytest.mark.long
def test_stations_of_one_head_are_in_the_order_of_the_shortest_way(few, handmade):
    timed = {"seconds_per_metre": 4.0, "seconds_per_station": 1.5}
    rig = head_rig(stations={"carrier": "robot"} | timed)
    carried = planned(rig, max_heads=9)
    told = carried.document.stations
    places = np.array([np.array(s.world_from_station)[:3, 3] for s in told.stations])
    assert told.kind == "stations"
    took = 4.0 * told.way_m + 1.5 * len(told.stations)
    assert told.move_s == pytest.approx(took, abs=1e-9)
    assert told.way_m == pytest.approx(
        float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum()), abs=1e-4
    )
    # One head can't shine from two places at once.
    groups = carried.document.firing_schedule.groups
    assert all(len(group) == 1 for group in groups)
    assert audit_plan(carried, n_samples=4000).failures == ()

    def longer(document):
        stations = document["stations"]["stations"]
        stations[0], stations[1] = stations[1], stations[0]
        at = [np.array(s["world_from_station"])[:3, 3] for s in stations]
        way = np.linalg.norm(np.diff(at, axis=0), axis=1).sum()
        document["stations"]["way_m"] = float(way)

    failures = audit_plan(handmade.tampered(carried, longer), n_samples=2000).failures
    assert any("in another" in failure for failure in failures)


def test_too_few_heads_measure_what_they_can_and_say_how_many_would(few):
    short = planned(head_rig(), max_heads=1)
    count = short.document.stations.count
    assert (len(short.projectors), len(short.cameras)) == (1, 2)
    assert count.needed > 1
    assert count.lower_bound > 1


@pytest.mark.long
def test_heads_that_reach_too_little_say_which_limit_would_give_more(few):
    """Pixels are 0.5 mm apart at 600 mm, more where the light meets at an angle."""
    limits = {"max_sigma_mm": 1.0, "max_sample_distance_mm": 0.52}
    place = {"standoff_mm": 600.0, "standoff_play_mm": 1.0}
    short = planned(head_rig(limits=limits, placement=place), max_heads=2)
    reach = next(one for one in missing(short) if "can be lit at all" in one.figure)
    assert reach.helps[0].startswith("limits.max_sample_distance_mm = ")
    shares = [one.reachable_share for one in short.coverage.relaxations]
    assert max(shares) >= 0.9
    assert not any("whole shell" in text for text in reach.helps)


def test_of_cameras_of_heads_it_is_said_that_no_advice_is_computed(plan, handmade):
    def unmeasurable(document):
        target = document["coverage"]["target"]
        target["reachable_by_cameras_m2"] = 0.5 * target["lit_m2"]

    (reach,) = (
        one
        for one in missing(handmade.tampered(plan, unmeasurable))
        if "can be measured at all" in one.figure
    )
    assert "what limit would help, isn't computed of heads and turntables" in str(reach)


@pytest.mark.long
def test_heads_that_never_have_room_beside_each_other_end_and_claim_nothing(few):
    """No two housings keep three metres apart: one stands, and no number is known."""
    place = {"standoff_mm": 600.0, "clearance_mm": 3000.0}
    short = planned(head_rig(head={"body": _BODY}, placement=place), max_heads=9)
    count = short.document.stations.count
    assert (count.count, count.needed) == (1, None)
    assert count.lower_bound > 1
    audit = audit_plan(short, n_samples=3000)
    assert audit.failures == ()
    assert audit.unmet
    assert "housings keep off each other" in fewest_words(short)


@pytest.mark.long
def test_the_plan_is_the_same_with_two_threads(plan):
    again = planned(head_rig(head={"body": _BODY}), max_heads=9, threads=2)
    assert len(again.projectors) == len(plan.projectors)
    for a, b in zip(again.projectors, plan.projectors, strict=True):
        assert np.array_equal(a.world_from_device, b.world_from_device)


@pytest.mark.parametrize(
    ("rig", "asked", "told"),
    [
        ({}, {"max_projectors": 2}, "max_heads"),
        ({}, {"max_heads": 2, "pattern": "rings"}, "dense"),
        ({}, {"max_heads": 2, "views": 2}, "views"),
        ({}, {"max_heads": 2, "survive": 1}, "survive"),
        ({}, {"max_heads": 2, "robust": 0.9}, "robust"),
        ({}, {"max_heads": 0}, "1 or more"),
        ({"stations": {"carrier": "tripod", "max": 3}}, {"max_heads": 4}, "allows 3"),
        (
            {"turntable": {"point_mm": [0, 0, 0], "axis": [0, 0, 1], "steps": 4}},
            {"max_heads": 2},
            "one of both",
        ),
        ({"head": {"cross": True, "body": _BODY}}, {"max_heads": 2}, "cross"),
    ],
)
def test_what_cannot_be_asked_of_heads_is_told_in_one_line(rig, asked, told):
    tables = dict(rig)
    head = tables.pop("head", None)
    with pytest.raises(InputError, match=told) as error:
        planned(head_rig(head=head, **tables), **asked)
    assert "\n" not in str(error.value)


def test_heads_need_a_rig_that_has_one():
    from planning import load_rig

    with pytest.raises(InputError, match=r"no \[head\]"):
        planned(load_rig("default"), max_heads=2)


def test_the_page_counts_pairs_of_one_head_alone(plan):
    facts = per_face(plan, centroids(plan), threads=1)
    for p, projector in enumerate(plan.projectors):
        for c, camera in enumerate(plan.cameras):
            if not meet(projector.station, camera.station):
                assert (facts.pairs[p, c] == -1).all()
    cameras = len(plan.cameras) // len(plan.projectors)
    assert facts.n_pairs.max() <= cameras * len(plan.projectors)
    assert facts.n_pairs.max() > 0
