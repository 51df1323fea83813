"""What is required of cameras is a share of what few samples said can be measured."""

import numpy as np
import pytest

from planning.verify.audit.audit_case import examine
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.counts.bound_claims import audit_areas


def kind_of(plan, name):
    case = examine(plan, seed=3, n_samples=3000, threads=1)
    (kind,) = (k for k in case.kinds if k.name == name)
    return case, kind


@pytest.mark.parametrize("name", ["projector", "camera"])
@pytest.mark.parametrize(("errors", "well"), [(2.0, True), (-2.0, True), (6.0, False)])
def test_it_may_be_off_by_the_noise_of_its_draw(handmade, name, errors, well):
    """However little the devices cover, and however surely."""
    plan = handmade.build_plan()
    case, kind = kind_of(plan, name)
    whole, target = case.estimator.target_m2, plan.coverage.target
    # Cameras are chosen on what is lit of their draw.
    part = target.lit_m2 / whole if name == "camera" else 1.0
    share = kind.reachable_m2 / whole
    noise = np.sqrt(share * (1.0 - share) * part / kind.proof.n_samples)
    off = errors * noise + 0.009 * np.sign(errors)
    required = kind.share * (kind.reachable_m2 + off * whole)

    def change(document):
        document["certificates"][f"{name}s"]["required_m2"] = float(required)

    case, kind = kind_of(handmade.tampered(plan, change), name)
    findings = AuditFindings()
    audit_areas(kind, 0.0, case, findings)
    assert any("required_m2" in line for line in findings.failures) != well
