"""Claims about the deviation of what cameras alone measure."""

import numpy as np

from geometry.arrays import Array
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.predicates.audit_devices import audit_cameras
from planning.verify.audit.predicates.recomputed_views import RecomputedViews
from planning.verify.audit.predicates.view_pairs import GOOD, Sighted, view_terms

from .sigma_claims import audit_deviations


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
    wanted = actual.samples.in_target & actual.measured
    least = np.full(len(wanted), np.inf)
    best: dict[str, Array] = {"matches": np.zeros(len(wanted))}
    cameras = audit_cameras(case.plan)
    for i in range(len(cameras)):
        for j in range(i):
            some = np.flatnonzero(wanted & (actual.met[i, j] == GOOD))
            samples = actual.samples.take(some)
            one, other = (Sighted.of(cameras[k], samples) for k in (i, j))
            terms = view_terms(one, other, samples.normals, limits)
            total = np.sqrt(sum(term**2 for term in terms.values()))
            better = total < least[some]
            rows = some[better]
            least[rows] = total[better]
            for name, values in terms.items():
                best.setdefault(name, np.zeros(len(wanted)))[rows] = values[better]
    return {name: values[wanted] for name, values in best.items()}
