"""What a plan predicts of the standard deviation of its points."""

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
from support.handmade import tampered
from support.plain_shapes import box

from planning import RequirementError, RigPlan, load_rig, plan_rig, verify_plan
from planning.report.summary.coverage_lines import coverage_lines
from planning.report.summary.light_lines import light_lines
from planning.scene.limits.pair_quality import Term
from planning.verify.audit.audit import audit_plan
from planning.verify.audit.audit_case import AuditCase, examine
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.counts.table_claims import audit_limits
from planning.verify.audit.coverage.sigma_claims import audit_sigma
from planning.verify.audit.devices.exposure_claims import audit_exposures

RIG = """
base = "default"
[placement]
n_candidate_projectors = 30
n_candidate_cameras = 30
n_reference_projectors = 600
n_reference_cameras = 400
[limits]
ring_sigma_mm = 0.01
[calibration]
angle_deg = 0.005
position_mm = 0.01
focal_percent = 0.005
principal_px = 0.1
[photometry]
lumens = 1500.0
albedo = [0.4, 0.6]
room_lux = 200.0
sensor = "imx250"
max_exposure_ms = 80.0
"""


@pytest.fixture(scope="module")
def plan(tmp_path_factory, with_little_work) -> RigPlan:
    path = tmp_path_factory.mktemp("sigma") / "rig.toml"
    path.write_text(RIG)
    try:
        with with_little_work():
            return plan_rig(
                box((0.15, 0.15, 0.05), divisions=12),
                load_rig(path),
                max_projectors=3,
                target="surface",
                min_reachable=0.3,
                check=False,
                cameras_by="cover",
                threads=1,
            )
    except RequirementError as missed:
        return missed.plan


@pytest.fixture(scope="module")
def case(plan) -> AuditCase:
    return examine(plan, seed=0, n_samples=4000, threads=1)


@pytest.fixture
def failures(plan, case):
    """What the audit of these claims finds of a plan that was tampered with."""

    def found(change) -> tuple[str, ...]:
        findings = AuditFindings()
        audit_sigma(replace(case, plan=tampered(plan, change)), findings)
        return findings.failures

    return found


def test_the_claim_is_what_the_audit_finds(plan):
    sigma = plan.coverage.sigma
    assert 0.0 < sigma.median_m <= sigma.p95_m
    assert sigma.p95_m <= plan.requirements.triangulation.max_sigma_m
    assert audit_plan(plan, n_samples=4000).failures == ()


@pytest.mark.long
def test_a_check_in_the_light_that_the_rig_states_is_held_to_that(plan):
    """Not to `check.ambient`, which is of rigs whose light nobody knows."""
    record = verify_plan(plan, threads=1).reconstruction.record()
    assert record.ambient != pytest.approx(plan.requirements.check.ambient)
    for ambient, told in ((record.ambient, 0), (1.001 * record.ambient, 1)):
        document = record.changed(ambient=ambient).to_document()
        kept = tampered(plan, lambda d, r=document: d.update(reconstruction=r))
        failures = verify_plan(kept, check_pixels=False, threads=1).failures
        assert sum("reconstruction.ambient" in line for line in failures) == told


FIGURES = [
    *(("median_m",), ("p95_m",), ("noise_median_m",), ("noise_p95_m",)),
    *(("terms_rms_m", term) for term in get_args(Term) if term != "phase"),
]


@pytest.mark.parametrize("path", FIGURES, ids=".".join)
@pytest.mark.parametrize("factor", [0.7, 1.4])
def test_a_false_prediction_is_found(failures, path, factor):
    def change(document):
        where = document["coverage"]["sigma"]
        for key in path[:-1]:
            where = where[key]
        where[path[-1]] *= factor

    (failure,) = failures(change)
    assert failure.startswith(f"coverage.sigma.{'.'.join(path)}")


@pytest.mark.parametrize("name", ["median_m", "noise_p95_m"])
def test_a_prediction_that_is_no_number_is_refused(failures, name):
    def change(document):
        document["coverage"]["sigma"][name] = np.nan

    with pytest.raises(ValueError, match="sigma"):
        failures(change)


def test_terms_that_the_limits_lack_or_have_beside_are_found(failures):
    def without(document):
        del document["coverage"]["sigma"]["terms_rms_m"]["camera"]

    (failure,) = failures(without)
    assert "limits: camera, edges, light, linearity, projector, rings" in failure


def test_terms_add_up_and_the_limit_is_of_all(plan):
    sigma = plan.coverage.sigma
    assert set(sigma.terms_rms_m) == set(get_args(Term)) - {"phase"}
    assert sigma.noise_median_m < sigma.median_m
    assert sigma.noise_p95_m < sigma.p95_m
    assert sigma.p95_m <= plan.requirements.triangulation.max_sigma_m


def test_no_prediction_of_what_is_measured_is_found(failures):
    def change(document):
        document["coverage"]["sigma"] = None

    assert "null, but the target is measured" in failures(change)[0]


def test_of_nothing_measured_there_is_no_prediction(failures):
    """Fresh samples may yet meet a trace: how much, is the area's to say."""

    def change(document):
        document["coverage"]["sigma"] = None
        document["coverage"]["target"]["measured_m2"] = 0.0

    assert not any("sigma" in line for line in failures(change))


def test_noise_and_calibration_are_told_apart(plan):
    sigma = plan.coverage.sigma
    alone, whole = (line for line in coverage_lines(plan) if "median" in line)
    assert "edge noise, that of the light and the panel's pixels alone" in alone
    assert f"median {1e3 * sigma.noise_median_m:.3f} mm" in alone
    assert f"median {1e3 * sigma.median_m:.3f} mm" in whole
    assert "(limit 0.3); rms by term edges" in whole

    bare = plan.to_document()
    bare["requirements"]["triangulation"]["calibration"] = None
    (line,) = (
        line
        for line in coverage_lines(RigPlan.from_document(bare, plan.surface))
        if "median" in line
    )
    assert line.endswith("(limit 0.3); the rig states no [calibration]")


@pytest.mark.parametrize(
    ("code", "lit", "words"),
    [
        ({"phase_noise": np.radians(1.5)}, False, ", 1.5 degrees of phase noise and"),
        ({}, True, ", that of the phase by the light and"),
        ({"shifts": 0}, False, ", codes told to a pixel and"),
    ],
)
def test_the_noise_of_coded_pixels_is_told_with_that_of_the_phase(
    plan, code, lit, words
):
    """It is the largest term."""

    def coded(document):
        for record in document["projectors"]:
            record |= {"ring_radii": [], "rings": None, "ring_shares": None}
            record["code"] = {"shifts": 4, "period_px": 16, "phase_noise": 0.02} | code
        if not lit:
            document["requirements"]["triangulation"]["light"] = None

    alone = next(x for x in coverage_lines(tampered(plan, coded)) if "median" in x)
    assert f"px edge noise{words} the panel's pixels alone" in alone


def _told_of_limits(plan, case, change):
    findings = AuditFindings()
    audit_limits(replace(case, plan=tampered(plan, change)), findings)
    return list(findings.failures)


@pytest.mark.parametrize("name", ["focus_m", "aperture_m", "in_focus_m", "camera_px"])
def test_other_edges_than_the_rigs_and_the_renderers_are_found(plan, case, name):
    def change(document):
        document["requirements"]["triangulation"]["drawn_edges"][name] *= 1.1

    assert _told_of_limits(plan, case, lambda _: None) == []
    (failure,) = _told_of_limits(plan, case, change)
    assert failure.startswith(f"requirements.triangulation.drawn_edges.{name}")


@pytest.mark.parametrize("before", [False, True])
def test_edges_are_left_out_of_plans_from_before_alone(plan, case, before):
    def change(document):
        document["requirements"]["triangulation"]["drawn_edges"] = None
        if before:
            del document["request"]

    found = _told_of_limits(plan, case, change)
    key = "requirements.triangulation.drawn_edges: None is claimed"
    assert [line.startswith(key) for line in found] == ([] if before else [True])


def test_exposures_and_greys_are_planned_and_told(plan):
    light = plan.requirements.triangulation.light
    lines = light_lines(plan)
    for record, line in zip(plan.document.projectors, lines[1:], strict=True):
        exposure = record.exposure
        n = round(60.0 * exposure.exposure_s)
        assert n > 1
        assert exposure.exposure_s == pytest.approx(n / 60.0)
        grey = exposure.farthest
        assert grey.lit[1] == pytest.approx(1.5 * grey.lit[0])
        assert light.min_contrast < grey.lit[0] - grey.dark[0] < grey.lit[1] < 255.0
        assert f"exposed {1e3 * n / 60.0:.1f} ms ({n} refreshes)" in line
        assert f"{grey.lit[0]:.0f} to {grey.lit[1]:.0f} and {grey.dark[0]:.0f}" in line


EXPOSED = ("projectors", 0, "exposure")
LIGHT = ("requirements", "triangulation", "light")


@pytest.mark.parametrize(
    ("path", "change", "told"),
    [
        ((*EXPOSED, "exposure_s"), lambda t: 1.5 * t, "whole refreshes"),
        ((*EXPOSED, "exposure_s"), lambda t: 2.0 * t, "at most 242"),
        ((*EXPOSED, "exposure_s"), lambda t: 0.5 * t, "wouldn't clip it yet"),
        ((*EXPOSED, "farthest", "lit", 0), lambda g: g + 1.0, "farthest.lit"),
        ((*EXPOSED, "farthest", "dark", 1), lambda g: g + 1.0, "farthest.dark"),
        ((*EXPOSED, "farthest", "distance_m"), lambda d: d - 0.05, "lie beyond"),
        ((*EXPOSED, "most_grazing", "incidence"), lambda a: a - 0.3, "lie beyond"),
        ((*EXPOSED, "brightest", "lit", 1), lambda g: 0.9 * g, "lie beyond"),
        ((*EXPOSED, "most_grazing", "point_m", 0), lambda x: x + 0.01, "distance_m"),
        ((*LIGHT, "lumens"), lambda x: 2.0 * x, "light.lumens"),
        ((*LIGHT, "f_number"), lambda x: 0.5 * x, "light.f_number"),
        ((*LIGHT, "period_s"), lambda x: 0.5 * x, "light.period_s"),
        ((*LIGHT, "albedo", 0), lambda x: 0.5 * x, "light.albedo"),
        ((*LIGHT, "max_exposure_s"), lambda x: 0.5 * x, "light.max_exposure_s"),
        (LIGHT, lambda _: None, "without `rig.photometry`"),
        (EXPOSED, lambda _: None, "there without"),
    ],
)
def test_false_claims_of_light_are_found(plan, case, path, change, told):
    def falsify(document):
        where = document
        for key in path[:-1]:
            where = where[key]
        where[path[-1]] = change(where[path[-1]])

    findings = AuditFindings()
    false = tampered(plan, falsify)
    audit_exposures(replace(case, plan=false), findings)
    assert any(told in failure for failure in findings.failures), findings.failures
