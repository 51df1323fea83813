"""Claims of the certificates: counts, bounds and what the plan itself refutes."""

import numpy as np

from planning.model.document.certificates import Certificate
from planning.verify.audit.audit_case import AuditCase, DeviceKind
from planning.verify.audit.audit_findings import AuditFindings, square_centimetres
from planning.verify.audit.estimates import POINT, ROUNDING

from .table_claims import marginal_of

# Covers are chosen on fewer samples than areas are claimed from.
_FEWEST_SAMPLES = 1000


def audit_certificates(case: AuditCase, findings: AuditFindings) -> None:
    """Check counts, bounds and statuses, and that the plan doesn't refute them."""
    target, estimator = case.samples.in_target, case.estimator
    for kind in case.kinds:
        key = f"certificates.{kind.name}s"
        chosen = np.any(kind.covers, axis=0) & target
        slack = estimator.tolerance(chosen, estimator.target_m2)
        _audit_counts(key, kind, findings)
        _audit_continuous(key, kind.proof, findings)
        _audit_areas(key, kind, slack, case, findings)
        _audit_bodies(key, kind, findings)
        _audit_refuted(key, kind, slack, case, findings)


def _audit_counts(key: str, kind: DeviceKind, findings: AuditFindings) -> None:
    """Check count, bounds, status and what is needed against each other."""
    claims, count = kind.proof, len(kind.devices)
    bound, needed = claims.candidates.lower_bound, claims.needed
    # A proof over fewer candidates than the reference poses proves less.
    candidates = claims.candidates.n_candidates
    name = f"{key}.candidates.n_candidates"
    findings.number(f"{key}.count", claims.count, count, 0.0, "")
    findings.number(name, candidates, len(kind.poses), 0.0, "poses")
    met = claims.status != "infeasible"
    most = f"exceeds the count of {count}"
    scopes = {"candidates": bound}
    if claims.continuous is not None:
        scopes["continuous"] = claims.continuous.lower_bound
    for scope, least in scopes.items():
        name = f"{key}.{scope}.lower_bound"
        findings.holds(least >= 0, name, f"{least} is negative")
        findings.holds(least <= count or not met, name, f"{least} {most}")
    findings.holds(
        claims.status != "optimal" or bound == count,
        f"{key}.status",
        f"optimal is claimed, but {count} devices stand against a bound of {bound}",
    )
    findings.holds(
        needed.count == count if met else needed.count >= count,
        f"{key}.needed.count",
        f"{needed.count} is claimed for a plan of {count} that is {claims.status!r}",
    )
    findings.holds(
        needed.lower_bound <= needed.count,
        f"{key}.needed.lower_bound",
        f"{needed.lower_bound} exceeds the count of {needed.count}",
    )


def _audit_continuous(key: str, claims: Certificate, findings: AuditFindings) -> None:
    """What holds for all poses holds for the candidates too, on equal samples."""
    table = claims.continuous
    if table is None:
        return
    same = table.n_samples == claims.n_samples
    here = claims.needed.lower_bound if same else claims.needed.count
    findings.holds(
        table.lower_bound <= here,
        f"{key}.continuous.lower_bound",
        f"{table.lower_bound} is claimed over all poses, but only {here} over the "
        f"candidates, which are some of them",
    )
    upper, fewer = table.one_fewer_upper_bound_m2, claims.needed.count - 1
    if upper is None or not same:
        return
    for entry in claims.by_count:
        findings.holds(
            entry.count != fewer or entry.value_m2 <= upper * (1.0 + ROUNDING),
            f"{key}.continuous.one_fewer_upper_bound_m2",
            f"{square_centimetres(upper)} is claimed over all poses, but {fewer} of "
            f"the candidates cover {square_centimetres(entry.value_m2)}",
        )


def _audit_areas(
    key: str,
    kind: DeviceKind,
    slack: float,
    case: AuditCase,
    findings: AuditFindings,
) -> None:
    """Check required_m2, best_area, one_fewer, by_count and the marginal table.

    What a number of candidates covers at most bounds what they were found to cover,
    and, but for sampling, what the marginal table says of as many: its entries for
    other counts than the plan's speak of candidates, too.
    """
    claims, whole = kind.proof, case.estimator.target_m2
    required = kind.share * kind.reachable_m2
    findings.number(f"{key}.required_m2", claims.required_m2, required, slack)
    most = {entry.count: entry.upper_bound_m2 for entry in claims.by_count}
    best, fewer, count = claims.best_area, claims.one_fewer, claims.count
    entries = {f"by_count: for {e.count}": e for e in claims.by_count}
    for name, entry in ({"best_area": best} | entries).items():
        findings.holds(
            0.0 <= entry.value_m2 <= entry.upper_bound_m2 * (1.0 + ROUNDING),
            f"{key}.{name}",
            f"value_m2 {square_centimetres(entry.value_m2)} exceeds upper_bound_m2 "
            f"{square_centimetres(entry.upper_bound_m2)}",
        )
    name = f"{key}.best_area.upper_bound_m2"
    room = _noise(claims, kind.reachable_m2, whole)
    findings.holds(
        best.upper_bound_m2 <= kind.reachable_m2 + room,
        name,
        f"{square_centimetres(best.upper_bound_m2)} exceeds the "
        f"{square_centimetres(kind.reachable_m2)} that can be reached (tolerance "
        f"{square_centimetres(room)})",
    )
    if count in most:
        findings.number(name, best.upper_bound_m2, most[count], ROUNDING * whole)
    if fewer is not None:
        if count - 1 in most:
            name, listed = f"{key}.one_fewer.upper_bound_m2", most[count - 1]
            findings.number(name, fewer.upper_bound_m2, listed, ROUNDING * whole)
        _audit_one_fewer(key, claims, fewer.upper_bound_m2, slack, findings)
    for number, area in marginal_of(case.plan, kind.name, "target"):
        upper = most.get(number)
        if upper is None or number == count:
            continue
        room = _noise(claims, upper, whole)
        findings.holds(
            area <= upper + room,
            f"{key}.by_count",
            f"at most {square_centimetres(upper)} are claimed for {number}, but "
            f"marginal has {square_centimetres(area)} (tolerance "
            f"{square_centimetres(room)})",
        )


def _audit_one_fewer(
    key: str, claims: Certificate, upper: float, slack: float, findings: AuditFindings
) -> None:
    """If no fewer devices suffice, the bound on one fewer must fall short too."""
    name = f"{key}.one_fewer.upper_bound_m2"
    findings.holds(upper >= 0.0, name, f"{upper!r} must be an area")
    fewest = claims.candidates.lower_bound == claims.count
    findings.holds(
        not fewest or upper <= claims.required_m2 + slack,
        name,
        f"{square_centimetres(upper)}, which is enough for the "
        f"{square_centimetres(claims.required_m2)} required (tolerance "
        f"{square_centimetres(slack)}), but {claims.count} are claimed to be "
        f"the fewest",
    )


def _noise(claims: Certificate, area_m2: float, whole: float) -> float:
    """A point, and three standard errors of an area from the certificate's samples."""
    n = max(claims.n_samples, _FEWEST_SAMPLES)
    p = min(max(area_m2 / whole, 1.0 / n), 1.0 - 1.0 / n)
    return whole * (POINT + 3.0 * float(np.sqrt(p * (1.0 - p) / n)))


def _audit_bodies(key: str, kind: DeviceKind, findings: AuditFindings) -> None:
    """Where planned devices have bodies the bounds must say that these are left out."""
    claims = kind.proof
    bodied = any(d.body is not None and not d.existing for d in kind.devices)
    findings.holds(
        not bodied or claims.bounds_leave_out,
        f"{key}.bounds_leave_out",
        "is missing, but planned devices have bodies",
    )
    stated = "but_for_bodies" in claims.model_fields_set
    findings.holds(
        not stated or (bodied and claims.but_for_bodies >= 1),
        f"{key}.but_for_bodies",
        f"{claims.but_for_bodies!r} must be a number of devices with bodies "
        f"(the plan has {len(kind.devices)})",
    )


def _audit_refuted(
    key: str,
    kind: DeviceKind,
    slack: float,
    case: AuditCase,
    findings: AuditFindings,
) -> None:
    """A bound is false if the plan meets the requirement with fewer devices than that.

    Devices are left out one after the other, always the one that is missed least;
    existing ones belong to every cover that the bound speaks of.
    """
    bound = kind.proof.candidates.lower_bound
    enough = kind.proof.required_m2 + slack
    covers = kind.covers & case.samples.in_target
    spare = [i for i, device in enumerate(kind.devices) if not device.existing]
    staying = list(range(len(kind.devices)))
    while len(staying) >= bound and spare:
        areas = [
            case.estimator.area(
                np.any(covers[[i for i in staying if i != out]], axis=0)
            )
            for out in spare
        ]
        best = int(np.argmax(areas))
        staying.remove(spare.pop(best))
        if len(staying) < bound and areas[best] > enough:
            findings.fail(
                f"{key}.candidates.lower_bound",
                f"{bound} is claimed, but {len(staying)} of the plan's devices cover "
                f"{areas[best]:.6g} m², more than the {enough:.6g} m² required",
            )
            return
