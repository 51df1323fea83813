"""Claims about the predicted standard deviation of what is measured."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from geometry.arrays import Array
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.estimates import POINT, share_error
from planning.verify.audit.predicates.audit_devices import (
    audit_cameras,
    audit_projectors,
)
from planning.verify.audit.predicates.error_terms import (
    NOISE_TERMS,
    PairGeometry,
    deviation,
    error_terms,
)
from planning.verify.audit.predicates.predicates import MEASURED

_SHARES = {"median_m": 0.5, "p95_m": 0.95}


def audit_sigma(case: AuditCase, findings: AuditFindings) -> None:
    """Check that the claimed shares of the measured target lie within each quantile.

    Of each sample the pair counts that measures it with the least deviation.
    """
    if "sigma" in case.plan.coverage.model_fields_set:
        below = findings.at("coverage.sigma")
        audit_deviations(case, _best_pairs(case), NOISE_TERMS, below)


def audit_deviations(
    case: AuditCase,
    terms: dict[str, Array],
    noise: Sequence[str],
    below: AuditFindings,
) -> None:
    """Check the claims by the terms of each measured sample's best pair [m], (n,) each.

    `noise` names those of which the calibration is no part.
    """
    claims = case.plan.coverage
    n = len(next(iter(terms.values())))
    # By the claim: of a trace other samples than these may have been measured.
    measured = claims.target.measured_m2 > 0.0
    either = "null, but the target is measured" if measured else "not measured"
    below.holds((claims.sigma is None) != measured, "", either)
    if claims.sigma is None or not n:
        return
    # An area that is false, which is told elsewhere, may be next to nothing.
    whole, part = claims.target.area_m2, claims.target.measured_m2
    claimed = (
        int(claims.samples * float(np.clip(part / whole, 0.0, 1.0))) if whole else 0
    )
    for name, share in _SHARES.items():
        for key, values in (
            (name, deviation(terms)),
            (f"noise_{name}", deviation(terms, noise)),
        ):
            if key not in claims.sigma.model_fields_set:
                continue
            value = getattr(claims.sigma, key) or 0.0
            # A thousandth either way: rounded poses move values by less.
            low, high = (
                float(np.mean(values <= value * f)) for f in (1 - 1e-3, 1 + 1e-3)
            )
            slack = POINT + 3.0 * float(share_error(np.array(share * n), n, claimed))
            below.holds(
                low - slack <= share <= high + slack,
                key,
                f"{1e3 * value:.4g} mm holds {100.0 * high:.2f} % of the measured "
                f"target, must hold {100.0 * share:g} %",
            )
    if "terms_rms_m" in claims.sigma.model_fields_set:
        _audit_terms(dict(claims.sigma.terms_rms_m), terms, claimed, below)


def _audit_terms(
    claimed: dict[Any, float],
    terms: dict[str, Array],
    n_claimed: int,
    below: AuditFindings,
) -> None:
    """Check each term's root mean square, by the spread of its square over samples."""
    below.holds(
        set(claimed) == set(terms),
        "terms_rms_m",
        f"names {', '.join(sorted(claimed))}; limits: {', '.join(sorted(terms))}",
    )
    for name in set(terms) & set(claimed):
        square = terms[name] ** 2
        error = np.std(square) * np.sqrt(1.0 / len(square) + 1.0 / max(n_claimed, 1))
        slack = 3.0 * error + 2e-3 * np.mean(square)
        below.holds(
            bool(abs(claimed[name] ** 2 - np.mean(square)) <= slack),
            f"terms_rms_m.{name}",
            f"is {1e3 * claimed[name]:.4g} mm, recomputed "
            f"{1e3 * np.sqrt(np.mean(square)):.4g} mm",
        )


def _best_pairs(case: AuditCase) -> dict[str, Array]:
    """Terms of the best pair of each measured sample of the target [m], (n,) each."""
    actual = case.actual
    wanted = actual.samples.in_target & actual.measured
    least = np.full(len(wanted), np.inf)
    limits = case.plan.requirements.triangulation
    best: dict[str, Array] = {"edges": np.zeros(len(wanted))}
    for p, projector in enumerate(audit_projectors(case.plan)):
        for c, camera in enumerate(audit_cameras(case.plan)):
            some = np.flatnonzero(wanted & (actual.pairs[p, c] == MEASURED))
            pair = PairGeometry.of(projector, camera, actual.samples.take(some))
            terms = error_terms(pair, limits)
            total = deviation(terms)
            better = total < least[some]
            rows = some[better]
            least[rows] = total[better]
            for name, values in terms.items():
                best.setdefault(name, np.zeros(len(wanted)))[rows] = values[better]
    return {name: values[wanted] for name, values in best.items()}
