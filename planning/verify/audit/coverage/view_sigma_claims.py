"""Claims about the deviation of what cameras alone measure."""

from collections.abc import Iterator

import numpy as np

from geometry.arrays import Array, Ints
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.predicates.audit_devices import audit_cameras
from planning.verify.audit.predicates.recomputed_views import RecomputedViews
from planning.verify.audit.predicates.view_pairs import GOOD, Sighted, view_terms

from .sigma_claims import audit_deviations, least_terms


def audit_view_sigma(case: AuditCase, findings: AuditFindings) -> None:
    """Check `coverage.sigma` by the best pair of each measured sample."""
    claims = case.plan.coverage
    if "sigma" in claims.model_fields_set:
        below = findings.at("coverage.sigma")
        audit_deviations(case, _best_pairs, ("matches",), below)


def _best_pairs(case: AuditCase) -> dict[str, Array]:
    """Terms of the best pair of each measured sample of the target [m], (n,) each."""
    actual, limits = case.actual, case.plan.requirements.triangulation
    assert isinstance(actual, RecomputedViews)
    wanted, met = actual.samples.in_target & actual.measured, actual.met
    cameras = audit_cameras(case.plan)

    def pairs() -> Iterator[tuple[Ints, dict[str, Array]]]:
        for i in range(len(cameras)):
            for j in range(i):
                some = np.flatnonzero(wanted & (met[i, j] == GOOD))
                samples = actual.samples.take(some)
                one, other = (Sighted.of(cameras[k], samples) for k in (i, j))
                yield some, view_terms(one, other, samples.normals, limits)

    return least_terms(wanted, "matches", pairs())
