"""Least margins: a projector that no sample of the plan's is assigned to."""

from dataclasses import replace

import numpy as np
import pytest

from planning.verify.audit.audit_case import examine
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.coverage.region_claims import audit_margins


@pytest.fixture(scope="module")
def case(handmade):
    """A plan that says of P1 that nothing is assigned to it."""

    def claim(document):
        document["projectors"][0]["min_margin_rad"] = None

    plan = handmade.tampered(handmade.build_plan(), claim)
    return examine(plan, seed=1, n_samples=4000, threads=1)


def found(case, n_assigned):
    """What is found where so many samples of the target are assigned to P1."""
    actual = case.actual
    margins, primary = actual.margins.copy(), actual.primary
    spared = np.flatnonzero(case.samples.in_target & (primary == 0))[:n_assigned]
    assert len(spared) == n_assigned
    others = np.setdiff1d(np.arange(margins.shape[1]), spared)
    margins[:, others] = [[-np.inf], [1.0]]
    findings = AuditFindings()
    audit_margins(replace(case, actual=replace(actual, margins=margins)), findings)
    return [line for line in findings.failures if line.startswith("P1.")]


@pytest.mark.parametrize("n_assigned", [0, 1, 3])
def test_a_sliver_may_be_missed_by_all_samples_of_the_plan(case, n_assigned):
    assert found(case, n_assigned) == []


@pytest.mark.parametrize("n_assigned", [30, 200])
def test_what_no_chance_explains_is_a_lie(case, n_assigned):
    (line,) = found(case, n_assigned)
    assert f"None is claimed, but {n_assigned} of " in line
