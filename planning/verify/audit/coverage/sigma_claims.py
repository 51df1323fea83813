"""Claims about the predicted standard deviation of what is measured.

Where a figure seems false, four times as many other samples decide. A draw that misses
the tail of a term has both too small a mean and too small a spread: of a skewness of 5,
one honest claim of two hundred lay beyond three of its standard errors, not one of four
hundred. The larger draw knows the spread, and grants less room.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from geometry.arrays import Array, Ints, Mask
from planning.model.document.coverage_records import PredictedSigma
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.estimates import DOUBT, POINT, chance_below
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
# Samples that decide where a figure seems false, as many times as at first.
_MORE = 4
# A thousandth either way: rounded poses move values by less.
_MOVED = 1e-3


def audit_sigma(case: AuditCase, findings: AuditFindings) -> None:
    """Check that the claimed shares of the measured target lie within each quantile.

    Of each sample the pair counts that measures it with the least deviation.
    """
    if "sigma" in case.plan.coverage.model_fields_set:
        below = findings.at("coverage.sigma")
        audit_deviations(case, _best_pairs, NOISE_TERMS, below)


def audit_deviations(
    case: AuditCase,
    terms_of: Callable[[AuditCase], dict[str, Array]],
    noise: Sequence[str],
    below: AuditFindings,
) -> None:
    """Check the claims by the terms of each measured sample's best pair.

    `terms_of` returns them of a case's samples [m], (n,) each. `noise` names those of
    which the calibration is no part.
    """
    sigma, terms = case.plan.coverage.sigma, terms_of(case)
    # By the claim: of a trace other samples than these may have been measured.
    measured = case.plan.coverage.target.measured_m2 > 0.0
    either = "null, but the target is measured" if measured else "not measured"
    below.holds((sigma is None) != measured, "", either)
    if sigma is None or not _count(terms):
        return
    if "terms_rms_m" in sigma.model_fields_set:
        below.holds(
            set(sigma.terms_rms_m) == set(terms),
            "terms_rms_m",
            f"names {', '.join(sorted(sigma.terms_rms_m))}; limits: "
            f"{', '.join(sorted(terms))}",
        )
    # Those of the plan that were measured.
    claimed, seeming = _n_claimed(case), AuditFindings()
    _audit_figures(sigma, terms, noise, claimed, seeming)
    if seeming.failures:
        terms = terms_of(case.drawn_again(_MORE))
        _audit_figures(sigma, terms, noise, claimed, below)


def _audit_figures(
    sigma: PredictedSigma,
    terms: dict[str, Array],
    noise: Sequence[str],
    n_claimed: int,
    below: AuditFindings,
) -> None:
    if not _count(terms):
        return
    for name, share in _SHARES.items():
        for key, values in (
            (name, deviation(terms)),
            (f"noise_{name}", deviation(terms, noise)),
        ):
            if key in sigma.model_fields_set:
                value = getattr(sigma, key) or 0.0
                _audit_quantile(key, value, share, values, n_claimed, below)
    if "terms_rms_m" in sigma.model_fields_set:
        _audit_terms(dict(sigma.terms_rms_m), terms, n_claimed, below)


def _audit_quantile(
    key: str,
    value: float,
    share: float,
    values: Array,
    n_claimed: int,
    below: AuditFindings,
) -> None:
    """Check that a claimed value is the quantile of a share of n_claimed samples.

    It lies between two of them, whose ranks are known; how many of the audit's values
    may then lie below follows, a point of them apart.
    """
    n, place = len(values), share * (n_claimed - 1)
    ranks = int(np.floor(place)) + 1, int(np.ceil(place)) + 1
    low, high = (
        np.count_nonzero(values <= value * f) for f in (1.0 - _MOVED, 1.0 + _MOVED)
    )
    few = chance_below(high + POINT * n, n, ranks[0], n_claimed)
    many = chance_below(n - low + POINT * n, n, n_claimed + 1 - ranks[1], n_claimed)
    below.holds(
        min(few, many) >= DOUBT,
        key,
        f"{1e3 * value:.4g} mm holds {100.0 * high / n:.2f} % of the measured "
        f"target, must hold {100.0 * share:g} %",
    )


def _audit_terms(
    claimed: dict[Any, float],
    terms: dict[str, Array],
    n_claimed: int,
    below: AuditFindings,
) -> None:
    """Check each term's root mean square, by the spread of its square over samples."""
    for name in set(terms) & set(claimed):
        square = terms[name] ** 2
        error = np.std(square) * np.sqrt(1.0 / len(square) + 1.0 / n_claimed)
        slack = 3.0 * error + 2.0 * _MOVED * np.mean(square)
        below.holds(
            bool(abs(claimed[name] ** 2 - np.mean(square)) <= slack),
            f"terms_rms_m.{name}",
            f"is {1e3 * claimed[name]:.4g} mm, recomputed "
            f"{1e3 * np.sqrt(np.mean(square)):.4g} mm",
        )


def _count(terms: dict[str, Array]) -> int:
    return len(next(iter(terms.values())))


def _n_claimed(case: AuditCase) -> int:
    """Return how many measured samples of the plan the claims are of, at least one."""
    target = case.plan.coverage.target
    # An area that is false, which is told elsewhere, may be next to nothing.
    part, whole = target.measured_m2, target.area_m2
    share = float(np.clip(part / whole, 0.0, 1.0)) if whole else 0.0
    return max(round(case.estimator.n_earned * share), 1)


def least_terms(
    wanted: Mask, of_all: str, pairs: Iterable[tuple[Ints, dict[str, Array]]]
) -> dict[str, Array]:
    """Return the terms of the best pair of each wanted sample [m], (n,) each.

    `pairs` have samples and their terms; the term `of_all` is there without any pair.
    """
    least = np.full(len(wanted), np.inf)
    best = {of_all: np.zeros(len(wanted))}
    for some, terms in pairs:
        total = deviation(terms)
        better = total < least[some]
        rows = some[better]
        least[rows] = total[better]
        for name, values in terms.items():
            best.setdefault(name, np.zeros(len(wanted)))[rows] = values[better]
    return {name: values[wanted] for name, values in best.items()}


def _best_pairs(case: AuditCase) -> dict[str, Array]:
    """Terms of the best pair of each measured sample of the target [m], (n,) each."""
    actual, limits = case.actual, case.plan.requirements.triangulation
    wanted = actual.samples.in_target & actual.measured

    def pairs() -> Iterator[tuple[Ints, dict[str, Array]]]:
        for p, projector in enumerate(audit_projectors(case.plan)):
            for c, camera in enumerate(audit_cameras(case.plan)):
                some = np.flatnonzero(wanted & (actual.pairs[p, c] == MEASURED))
                pair = PairGeometry.of(projector, camera, actual.samples.take(some))
                yield some, error_terms(pair, limits)

    return least_terms(wanted, "edges", pairs())
