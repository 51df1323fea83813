"""Claims of bounds: over all poses, and areas that so many devices cover at most."""

import numpy as np

from planning.model.document.certificates import Certificate
from planning.verify.audit.audit_case import AuditCase, DeviceKind
from planning.verify.audit.audit_findings import AuditFindings, square_centimetres
from planning.verify.audit.estimates import POINT, ROUNDING

from .table_claims import marginal_of

# Covers are chosen on fewer samples than areas are claimed from.
_FEWEST_SAMPLES = 1000


def audit_continuous(
    kind: DeviceKind, case: AuditCase, findings: AuditFindings
) -> None:
    """What holds for all poses holds for the candidates too, on equal samples.

    The candidates are the reference poses, so that they reach no larger a share, and
    what is required; not all, where devices that were moved reach what none does.
    """
    claims = kind.proof
    table = claims.continuous
    if table is None:
        return
    samples, below = table.n_samples, findings.at("continuous")
    # Of a member that needn't be served there may be none.
    below.holds(
        min(1, claims.n_samples) <= samples <= claims.n_samples,
        "n_samples",
        f"{samples} must be some of the certificate's {claims.n_samples}",
    )
    target = case.plan.coverage.target
    whole = target.area_m2 if kind.name == "projector" else target.lit_m2
    if whole > 0.0:
        share, once = (
            area / whole for area in (kind.reachable_m2, _once_reachable_m2(kind, case))
        )
        slack = max(samples, 1) * _noise(samples, share, 1.0)
        most, least = samples * once, kind.share * samples * share
        below.holds(
            least - slack <= table.n_reached <= most + slack,
            "n_reached",
            f"claimed {table.n_reached} samples, recomputed {least:.6g} that are "
            f"required to {most:.6g}, tolerance {slack:.3g}",
        )
    below.holds(
        table.n_reached <= samples, "n_reached", f"{table.n_reached} of {samples}"
    )
    proved, least, needed = table.status == "proved", table.lower_bound, claims.needed
    # One device more than was proved may have come in for fresh samples.
    below.holds(
        proved == (least == needed.count) or (proved and claims.status == "feasible"),
        "status",
        f"{table.status!r} is claimed of {least}, and {needed.count} are needed",
    )
    same = samples == claims.n_samples
    here = claims.needed.lower_bound if same else claims.needed.count
    findings.holds(
        table.lower_bound <= here,
        "continuous.lower_bound",
        f"{table.lower_bound} is claimed over all poses, but only {here} over the "
        f"candidates, which are some of them",
    )
    upper, fewer = table.one_fewer_upper_bound_m2, claims.needed.count - 1
    for entry in claims.by_count:
        if upper is not None and same and entry.count == fewer:
            findings.holds(
                entry.value_m2 <= upper * (1.0 + ROUNDING),
                "continuous.one_fewer_upper_bound_m2",
                f"{square_centimetres(upper)} is claimed over all poses, but {fewer} "
                f"of the candidates cover {square_centimetres(entry.value_m2)}",
            )


def audit_areas(
    kind: DeviceKind, slack: float, case: AuditCase, findings: AuditFindings
) -> None:
    """Check required_m2, best_area and one_fewer.

    If no fewer devices suffice, the bound on one fewer must fall short too.
    """
    claims, whole = kind.proof, case.estimator.target_m2
    reachable = _once_reachable_m2(kind, case)
    required = kind.share * kind.reachable_m2
    # What was reachable then is between what is and what was at most.
    required = min(max(claims.required_m2, required), kind.share * reachable)
    # Cameras are chosen on what is lit of a draw of the whole target.
    part = case.plan.coverage.target.lit_m2 / whole if kind.name == "camera" else 1.0
    drawn = round(claims.n_samples / max(part, 1.0 / _FEWEST_SAMPLES))
    doubt = max(slack, kind.share * _noise(drawn, reachable, whole))
    findings.number("required_m2", claims.required_m2, required, doubt)
    best, fewer = claims.best_area.upper_bound_m2, claims.one_fewer
    room = _noise(claims.n_samples, reachable, whole)
    findings.holds(
        best <= reachable + room,
        "best_area.upper_bound_m2",
        f"{square_centimetres(best)} exceeds the {square_centimetres(reachable)} that "
        f"can be reached (tolerance {square_centimetres(room)})",
    )
    if fewer is None:
        return
    upper, name = fewer.upper_bound_m2, "one_fewer.upper_bound_m2"
    findings.holds(upper >= 0.0, name, f"{upper!r} must be an area")
    fewest = fewest_for_total(claims) == claims.count
    findings.holds(
        not fewest or upper <= claims.required_m2 + slack,
        name,
        f"{square_centimetres(upper)}, which is enough for the "
        f"{square_centimetres(claims.required_m2)} required (tolerance "
        f"{square_centimetres(slack)}), but {claims.count} are claimed to be "
        f"the fewest",
    )


def audit_by_count(kind: DeviceKind, case: AuditCase, findings: AuditFindings) -> None:
    """Check what numbers of candidates cover against what else is said of as many.

    What they cover at most bounds what they were found to cover, and, but for sampling,
    what the marginal table says of as many: its entries for other counts than the
    plan's speak of candidates, too.
    """
    claims, whole, count = kind.proof, case.estimator.target_m2, kind.proof.count
    most = {entry.count: entry.upper_bound_m2 for entry in claims.by_count}
    counts = [entry.count for entry in claims.by_count]
    findings.holds(
        counts == sorted(set(counts)) and min(counts, default=1) > 0,
        "by_count",
        f"rows of {counts}: each number once, rising from 1 at least",
    )
    entries = {f"by_count: for {e.count}": e for e in claims.by_count}
    for name, entry in ({"best_area": claims.best_area} | entries).items():
        findings.holds(
            0.0 <= entry.value_m2 <= entry.upper_bound_m2 * (1.0 + ROUNDING),
            name,
            f"value_m2 {square_centimetres(entry.value_m2)} exceeds upper_bound_m2 "
            f"{square_centimetres(entry.upper_bound_m2)}",
        )
    for name, number in (("best_area", count), ("one_fewer", count - 1)):
        entry = getattr(claims, name)
        if entry is not None and number in most:
            truth = {"upper_bound_m2": most[number]}
            findings.at(name).numbers(entry, truth, ROUNDING * whole, "m²")
    for number, area in marginal_of(case.plan, kind.name, "target"):
        upper = np.inf if number == count else most.get(number, np.inf)
        room = _noise(claims.n_samples, upper, whole)
        findings.holds(
            area <= upper + room,
            "by_count",
            f"at most {square_centimetres(upper)} are claimed for {number}, but "
            f"marginal has {square_centimetres(area)} (tolerance "
            f"{square_centimetres(room)})",
        )


def _once_reachable_m2(kind: DeviceKind, case: AuditCase) -> float:
    """Return what the candidates reached at most when devices were chosen of them.

    Rings that were spaced finer since let cameras reach less of what is lit.
    """
    rings = [projector.rings for projector in case.plan.document.projectors]
    spaced = any(one is not None and one.spacing == "curvature" for one in rings)
    if kind.name == "camera" and spaced:
        return case.plan.coverage.target.lit_m2
    return kind.reachable_m2


def _noise(n_samples: int, area_m2: float, whole: float) -> float:
    """A point, and three standard errors of an area from so many samples."""
    n = max(n_samples, _FEWEST_SAMPLES)
    p = min(max(area_m2 / whole, 1.0 / n), 1.0 - 1.0 / n)
    return whole * (POINT + 3.0 * float(np.sqrt(p * (1.0 - p) / n)))


def fewest_for_total(claims: Certificate) -> int:
    """Return the least number of devices that is claimed for the total alone."""
    total = claims.candidates.for_total
    return claims.candidates.lower_bound if total is None else total
