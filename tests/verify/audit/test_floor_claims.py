"""Each false claim about a region or its floor is found, with the sentence for it."""

from dataclasses import replace

import pytest

from planning.verify.audit.audit import audit_plan
from planning.verify.audit.audit_case import AuditCase, examine
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.counts.certificate_claims import audit_certificates
from planning.verify.audit.coverage.floor_claims import audit_floors


@pytest.fixture(scope="module")
def case(handmade) -> AuditCase:
    """The figures of a true plan; lies about regions change none of them."""
    return examine(handmade.build_plan(), seed=3, n_samples=3000, threads=1)


def findings_of(case: AuditCase, plan) -> tuple[str, ...]:
    findings = AuditFindings()
    audit_floors(replace(case, plan=plan), findings)
    return findings.failures


def _region(index, **values):
    """Change claims of a region's coverage: to a value, or by a function of it."""

    def change(document):
        claims = document["regions"][index]["coverage"]
        for name, value in values.items():
            claims[name] = value(claims[name]) if callable(value) else value

    return change


def _cause(name, area_m2):
    return _region(1, uncovered_by_cause=lambda x: {**x, name: area_m2})


def _swapped(split):
    """The same areas, two of them under each other's cause."""
    (first, a), (second, b), *rest = sorted(split.items(), key=lambda pair: -pair[1])
    return {first: b, second: a, **dict(rest)}


def _asked(name, value):
    return lambda document: document["requirements"].update({name: value})


def _row(index, **values):
    return lambda document: document["marginal"][index].update(values)


LIES = {
    "centre": (
        lambda document: document["regions"][0]["centre_m"].__setitem__(2, 0.0301),
        "regions.0.centre_m: claimed",
    ),
    "lit": (_region(1, lit_m2=lambda x: 1.2 * x), "1.coverage.lit_m2: claimed"),
    "lit fraction": (
        lambda document: document["regions"][1].update(lit_fraction=0.65),
        "regions.1.lit_fraction: claimed",
    ),
    "measured": (
        _region(0, measured_m2=lambda x: 0.6 * x),
        "0.coverage.measured_m2: claimed",
    ),
    "lightable": (
        _region(1, reachable_by_projectors_m2=lambda x: 0.8 * x),
        "1.coverage.reachable_by_projectors_m2: claimed",
    ),
    "measurable": (
        _region(0, reachable_by_cameras_m2=lambda x: 1.4 * x),
        "0.coverage.reachable_by_cameras_m2: claimed",
    ),
    "order": (
        _region(0, reachable_by_cameras_m2=1e-3),
        "0.coverage.measured_m2: claimed 0.00",
    ),
    "causes": (
        _region(0, uncovered_by_cause=_swapped),
        "regions.0.coverage.uncovered_by_cause.",
    ),
    "cause sum": (
        _cause("sigma", 0.0),
        "1.coverage.uncovered_by_cause (sum): claimed",
    ),
    "unknown cause": (
        _cause("gremlins", 0.0),
        "1.coverage.uncovered_by_cause: causes that there are not: gremlins",
    ),
    "camera": (
        _region(0, measured_by=lambda x: {**x, "C1": 0.3 * x["C1"]}),
        "regions.0.coverage.measured_by.C1: claimed",
    ),
    "camera left out": (
        _region(0, measured_by=lambda x: {"C1": x["C1"]}),
        "regions.0.coverage.measured_by.C2: claimed",
    ),
    "unknown camera": (
        _region(0, measured_by=lambda x: {**x, "C9": 0.0}),
        "regions.0.coverage.measured_by: cameras that aren't: C9",
    ),
    "samples": (_region(1, samples=0), "1.coverage.samples: 0 of a large region"),
    "missed": (
        _region(1, floor="missed"),
        "1.coverage.floor: claimed 'missed', but by its areas the floor is 'met'",
    ),
    "untold": (_region(1, floor=None), "1.coverage.floor: claimed None, but"),
    "met": (
        _asked("region_coverage", 0.95),
        "0.coverage.floor: claimed 'met', but by its areas the floor is 'missed'",
    ),
    "no floor": (
        _asked("region_coverage", 0.0),
        "0.coverage.floor: claimed 'met', but by its areas the floor is None",
    ),
    "small region": (
        _asked("region_share", 0.5),
        "1.coverage.floor: claimed 'met', but by its areas the floor is None",
    ),
    "left out": (
        lambda document: document["regions"][1].pop("coverage"),
        "regions.1.coverage: is missing, but a floor is asked for",
    ),
    "worst region": (
        lambda document: document["marginal"][1].update(
            worst_region=1 - document["marginal"][1]["worst_region"]
        ),
        "marginal.projectors.2.worst_region: ",
    ),
    "worst share": (
        _row(1, worst_region_lit=0.9),
        "marginal.projectors.2.worst_region_lit: claimed",
    ),
    "worst left out": (
        _row(1, worst_region=None, worst_region_lit=None),
        "marginal.projectors.2.worst_region_lit: None is claimed",
    ),
    "worst share without a region": (
        _row(0, worst_region=None),
        "marginal.projectors.1.worst_region: None at ",
    ),
    "worst of another count": (
        _row(0, worst_region=7, worst_region_lit=0.5),
        "marginal.projectors.1.worst_region: 7 at 0.5 must be a large region",
    ),
}


def _certificate(**values):
    def change(document):
        proof = document["certificates"]["projectors"]
        proof["candidates"] |= {
            name: values.pop(name)
            for name in ("lower_bound", "for_total")
            if name in values
        }
        proof.update(values)

    return change


# No device covers nothing.
ROW_OF_NONE = [{"count": 0, "value_m2": 0.0, "upper_bound_m2": 0.0}]


def certified(case, plan) -> list[str]:
    findings = AuditFindings()
    audit_certificates(replace(case, plan=plan), findings)
    return list(findings.failures)


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"floors": 1}, "certificates.projectors.floors: claimed 1"),
        ({"floors": 0}, "certificates.projectors.floors: claimed 0"),
        ({"for_total": 2}, "for_total: 2 is claimed without floors, but 1 by"),
        ({"for_total": None}, "for_total: None is claimed beside 1, but 2 regions"),
        (
            {"for_total": 0, "by_count": ROW_OF_NONE},
            "for_total: 0 is claimed without floors, but 1 by by_count",
        ),
    ],
)
def test_a_certificate_speaks_of_every_floor(case, handmade, values, sentence):
    found = certified(case, handmade.tampered(case.plan, _certificate(**values)))
    assert any(sentence in failure for failure in found), found


@pytest.mark.parametrize(
    ("floor", "total", "refuted"),
    [
        # One projector is enough for a tenth, but leaves a region darker than that.
        (0.6, 1, None),
        (0.6, 2, "for_total"),
        (0.0, None, "lower_bound"),
    ],
)
def test_a_floor_may_take_the_device_that_the_total_does_not(
    case, handmade, floor, total, refuted
):
    def change(document):
        limits, proofs = document["requirements"], document["certificates"]
        limits |= {"dominant_coverage": 0.1, "region_coverage": floor}
        reached = document["coverage"]["target"]["reachable_by_projectors_m2"]
        proof = proofs["projectors"]
        proof |= {"required_m2": 0.1 * reached, "floors": 2 if floor else 0}
        proofs["cameras"]["floors"] = 2 if floor else 0
        proof["candidates"] |= {"lower_bound": 2, "for_total": total}
        proof["one_fewer"]["upper_bound_m2"] = 0.0

    found = certified(case, handmade.tampered(case.plan, change))
    key = f"certificates.projectors.candidates.{refuted}: 2 is claimed, but 1"
    assert [failure.startswith(key) for failure in found] == [True] * bool(refuted)


@pytest.mark.parametrize("name", LIES)
def test_a_false_claim_about_a_region_is_found(case, handmade, name):
    change, sentence = LIES[name]
    found = findings_of(case, handmade.tampered(case.plan, change))
    assert any(sentence in failure for failure in found), found


def test_true_claims_and_plans_from_before_pass(case, handmade):
    def before(document):
        for name in ("region_coverage", "region_share"):
            del document["requirements"][name]
        for region in document["regions"]:
            del region["coverage"], region["centre_m"]
        for row in document["marginal"]:
            row.pop("worst_region", None), row.pop("worst_region_lit", None)

    assert findings_of(case, case.plan) == ()
    assert findings_of(case, handmade.tampered(case.plan, before)) == ()


def test_a_missed_floor_is_unmet_and_no_false_claim(handmade):
    def missed(document):
        document["requirements"]["region_coverage"] = 0.69
        for region in document["regions"]:
            region["coverage"]["floor"] = "met"
        document["regions"][0]["coverage"]["floor"] = "missed"

    audit = audit_plan(handmade.tampered(handmade.build_plan(), missed), n_samples=3000)
    assert not [failure for failure in audit.failures if "regions.0" in failure]
    (unmet,) = audit.unmet
    assert "requirements.region_coverage: regions.0 is lit 0.00434" in unmet
