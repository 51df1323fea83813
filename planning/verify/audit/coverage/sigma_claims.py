"""Claims about the predicted standard deviation of what is measured."""

import numpy as np

from geometry.arrays import Array
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.estimates import POINT, share_error
from planning.verify.audit.predicates.audit_devices import (
    audit_cameras,
    audit_projectors,
)
from planning.verify.audit.predicates.predicates import MEASURED, pair_figures

_SHARES = {"median_m": 0.5, "p95_m": 0.95}


def audit_sigma(case: AuditCase, findings: AuditFindings) -> None:
    """Check that the claimed shares of the measured target lie within each quantile.

    The least standard deviation of each sample is over the pairs that measure it.
    """
    claims = case.plan.coverage
    if "sigma" not in claims.model_fields_set:
        return
    below = findings.at("coverage.sigma")
    least = _least_sigma(case)
    if claims.sigma is None or not len(least):
        either = "null, but the target is measured" if len(least) else "not measured"
        below.holds((claims.sigma is None) == (not len(least)), "", either)
        return
    claimed = int(claims.samples * claims.target.measured_m2 / claims.target.area_m2)
    for name, share in _SHARES.items():
        value = getattr(claims.sigma, name)
        # A thousandth either way: rounded poses move values by less.
        low, high = (float(np.mean(least <= value * f)) for f in (1 - 1e-3, 1 + 1e-3))
        slack = POINT + 3.0 * float(
            share_error(np.array(share * len(least)), len(least), claimed)
        )
        below.holds(
            low - slack <= share <= high + slack,
            name,
            f"{1e3 * value:.4g} mm holds {100.0 * high:.2f} % of the measured target, "
            f"must hold {100.0 * share:g} %",
        )


def _least_sigma(case: AuditCase) -> Array:
    """Of the measured samples of the target [m], shape (n,)."""
    actual = case.actual
    chosen = np.flatnonzero(actual.samples.in_target & actual.measured)
    least = np.full(len(actual.samples), np.inf)
    limits = case.plan.requirements.triangulation
    for p, projector in enumerate(audit_projectors(case.plan)):
        for c, camera in enumerate(audit_cameras(case.plan)):
            some = np.flatnonzero(actual.pairs[p, c] == MEASURED)
            samples = actual.samples.take(some)
            sigma = pair_figures(projector, camera, samples, limits)[1]
            least[some] = np.minimum(least[some], sigma)
    return least[chosen]
