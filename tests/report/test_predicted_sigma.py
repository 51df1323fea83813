"""What a plan predicts of the standard deviation of its points."""

import numpy as np
import pytest
from support.handmade import tampered
from support.plain_shapes import box

from planning import RequirementError, RigPlan, load_rig, plan_rig
from planning.report.summary.coverage_lines import coverage_lines
from planning.verify.audit.audit import audit_plan

RIG = """
base = "default"
[placement]
n_candidate_projectors = 30
n_candidate_cameras = 30
n_reference_projectors = 600
n_reference_cameras = 400
"""


@pytest.fixture(scope="module")
def plan(tmp_path_factory) -> RigPlan:
    path = tmp_path_factory.mktemp("sigma") / "rig.toml"
    path.write_text(RIG)
    try:
        return plan_rig(
            box((0.15, 0.15, 0.05), divisions=12),
            load_rig(path),
            max_projectors=3,
            target="surface",
            min_reachable=0.3,
            check=False,
            threads=1,
        )
    except RequirementError as missed:
        return missed.plan


def failures(plan: RigPlan, change) -> list[str]:
    found = audit_plan(tampered(plan, change), n_samples=4000).failures
    return [failure for failure in found if "sigma" in failure]


def test_the_claim_is_what_the_audit_finds(plan):
    sigma = plan.coverage.sigma
    assert 0.0 < sigma.median_m <= sigma.p95_m
    assert sigma.p95_m <= plan.requirements.triangulation.max_sigma_m
    assert audit_plan(plan, n_samples=4000).failures == ()


@pytest.mark.parametrize("name", ["median_m", "p95_m"])
@pytest.mark.parametrize("factor", [0.7, 1.4, np.nan])
def test_a_false_prediction_is_found(plan, name, factor):
    def change(document):
        value = document["coverage"]["sigma"][name]
        document["coverage"]["sigma"][name] = value * factor

    if np.isnan(factor):
        with pytest.raises(ValueError, match="sigma"):
            failures(plan, change)
        return
    (failure,) = failures(plan, change)
    assert failure.startswith(f"coverage.sigma.{name}")


def test_no_prediction_of_what_is_measured_is_found(plan):
    def change(document):
        document["coverage"]["sigma"] = None

    assert "null, but the target is measured" in failures(plan, change)[0]


def test_it_is_told_with_its_limit(plan):
    sigma = plan.coverage.sigma
    (line,) = [line for line in coverage_lines(plan) if "predicted sigma" in line]
    assert f"median {1e3 * sigma.median_m:.3f} mm" in line
    assert line.endswith("(limit 0.3)")
