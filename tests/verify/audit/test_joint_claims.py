"""What a plan says of devices that were planned together: truths, and lies."""

from dataclasses import replace

import numpy as np
import pytest

from geometry.mesh.sampling import SurfaceSamples
from planning.report.tolerance.joint_lines import joint_lines, joint_words
from planning.scene.samples import Target
from planning.scene.scene import Scene
from planning.steps.joint.slack import slack_at_share
from planning.steps.joint.tables import JointTables
from planning.verify.audit.audit_case import examine
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.counts.joint_claims import audit_joint, best_slack

_COUNTS = {"projectors": 2, "cameras": 2, "cost": 4.0}


def record(margin):
    return {
        "two_stage": {"projectors": 2, "cameras": 3, "cost": 5.0},
        "joint": dict(_COUNTS),
        "found": "candidates",
        "over": {"projectors": 3, "cameras": 4, "samples": 1000},
        "needed": 4.0,
        "lower_bound": 3.0,
        "status": "feasible",
        "proof": "hitting sets of 2 sets of projectors",
        "margin_before": 0.5 * margin,
        "margin": margin,
    }


def examined(handmade, light):
    return examine(handmade.build_plan(light), seed=1, n_samples=2000, threads=1)


@pytest.fixture(scope="module")
def case(handmade):
    return examined(handmade, "diverging")


@pytest.fixture(scope="module")
def told(case, handmade):
    """A plan with a true record, of the slack that its planner would claim."""
    inside, areas = case.samples.in_target, case.plan.coverage.target
    share = case.plan.requirements.coverage * areas.reachable_by_cameras_m2
    slack = best_slack(case)[inside]
    margin = slack_at_share(slack, int(share / areas.area_m2 * len(slack)))
    assert margin > 0.0

    def claim(document):
        document["joint"] = record(margin)

    return handmade.tampered(case.plan, claim)


def found(case, plan):
    findings = AuditFindings()
    audit_joint(replace(case, plan=plan), findings)
    return findings.failures


@pytest.mark.parametrize("light", ["diverging", "parallel"])
def test_slack_of_planner_and_audit_agree_sample_by_sample(handmade, light):
    case = examined(handmade, light)
    plan, samples = case.plan, case.samples
    scene = Scene(
        plan.surface.mesh,
        plan.surface.region,
        plan.surface.steep,
        plan.requirements,
        0,
        1,
    )
    faces = np.zeros(len(samples), dtype=np.int64)
    target = Target(
        SurfaceSamples(samples.points, samples.normals, faces, 1.0), samples.steep
    )
    tables = JointTables.of(scene, target, plan.projectors, plan.cameras)
    planned = tables.best([0, 1], [0, 1])
    audited = best_slack(case)
    both = np.isfinite(planned) & np.isfinite(audited)
    assert both.sum() > 200
    assert np.mean(np.isfinite(planned) != np.isfinite(audited)) < 0.01
    # The planner keeps single precision.
    assert np.allclose(planned[both], audited[both], atol=1e-5)


def test_a_true_record_passes(case, told):
    assert found(case, told) == ()


def test_without_a_record_nothing_is_claimed(case):
    assert found(case, case.plan) == ()
    assert joint_lines(case.plan) == []
    assert joint_words(case.plan) is None


@pytest.mark.parametrize(
    ("key", "lie", "where"),
    [
        ("joint", _COUNTS | {"cameras": 3}, "joint.joint.cameras"),
        ("joint", _COUNTS | {"projectors": 1}, "joint.joint.projectors"),
        ("joint", _COUNTS | {"cost": 3.5}, "joint.joint.cost"),
        ("two_stage", _COUNTS | {"cost": 7.0}, "joint.two_stage.cost"),
        ("two_stage", {"projectors": 1, "cameras": 2, "cost": 3.0}, "joint.found"),
        ("found", "two stages", "joint.found"),
        ("lower_bound", 4.5, "joint.needed"),
        ("needed", 6.0, "joint.needed"),
        ("lower_bound", 4.0, "joint.status"),
        ("status", "optimal", "joint.status"),
        ("over", {"projectors": 1, "cameras": 4, "samples": 9}, "joint.over.projec"),
        ("over", {"projectors": 3, "cameras": 999, "samples": 9}, "joint.over.cam"),
        ("margin", 0.9, "joint.margin:"),
        ("margin", 0.0, "joint.margin"),
        ("margin", None, "joint.margin:"),
        ("margin_before", 0.95, "joint.margin_before"),
    ],
)
def test_each_lie_is_told(case, told, handmade, key, lie, where):
    def change(document):
        document["joint"][key] = lie

    failures = found(case, handmade.tampered(told, change))
    assert any(one.startswith(where) for one in failures), failures


def test_costs_of_the_rig_are_those_of_the_plan(case, told, handmade):
    def dearer(document):
        document["rig"]["projector"]["cost"] = 3.0
        document["rig"]["camera"]["cost"] = 0.5

    assert any(
        "joint.joint.cost" in one
        for one in found(case, handmade.tampered(told, dearer))
    )

    def stated(document):
        dearer(document)
        document["joint"]["joint"]["cost"] = 7.0
        document["joint"]["two_stage"]["cost"] = 7.5
        document["joint"] |= {"needed": 7.0, "lower_bound": 7.0, "status": "optimal"}

    plan = handmade.tampered(told, stated)
    assert found(case, plan) == ()
    words = " ".join(joint_lines(plan))
    assert "2 projectors and 2 cameras for 7 instead of" in words
    assert "7 in cost are claimed the least of 3 projectors" in words


def test_the_summary_says_what_was_saved_and_what_is_proved(told):
    lines = joint_lines(told)
    assert lines[0].startswith(
        "JOINT    2 projectors and 2 cameras instead of 2 projectors and 3 cameras"
    )
    assert "at least 3 devices are needed, 4 suffice of 3 projectors" in lines[1]
    label, words = joint_words(told)
    assert label == "JOINT"
    assert words.endswith("at least 3 of both together of the candidates are needed")
