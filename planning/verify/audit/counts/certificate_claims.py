"""Claims of the certificates: counts, bounds and what the plan itself refutes."""

import numpy as np

from geometry.arrays import Mask
from planning.model.document.certificates import Certificate
from planning.verify.audit.audit_case import AuditCase, DeviceKind
from planning.verify.audit.audit_findings import AuditFindings, square_centimetres
from planning.verify.audit.estimates import POINT, ROUNDING

from .route_claims import audit_routes
from .table_claims import marginal_of

# Covers are chosen on fewer samples than areas are claimed from.
_FEWEST_SAMPLES = 1000


def audit_certificates(case: AuditCase, findings: AuditFindings) -> None:
    """Check counts, bounds and statuses, and that the plan doesn't refute them."""
    for kind in case.kinds:
        chosen = np.any(kind.covers, axis=0) & case.samples.in_target
        slack = case.estimator.tolerance(chosen, case.estimator.target_m2)
        below = findings.at(f"certificates.{kind.name}s")
        _audit_counts(kind, below)
        _audit_floors(kind, case, below)
        _audit_greedy(kind.proof, below)
        _audit_continuous(kind, case, below)
        _audit_areas(kind, slack, case, below)
        _audit_by_count(kind, case, below)
        _audit_bodies(kind, below)
        _audit_refuted(kind, slack, case, below)
        audit_routes(kind.proof, below)


def _audit_counts(kind: DeviceKind, findings: AuditFindings) -> None:
    """Check count, bounds, status and what is needed against each other."""
    claims, count = kind.proof, len(kind.devices)
    bound, needed = claims.candidates.lower_bound, claims.needed
    # A proof over fewer candidates than the reference poses proves less.
    poses = {"n_candidates": len(kind.poses)}
    findings.at("candidates").numbers(claims.candidates, poses, 0.0, "poses")
    findings.number("count", claims.count, count, 0.0, "")
    met = claims.status != "infeasible"
    for scope, proof in (
        ("candidates", claims.candidates),
        ("continuous", claims.continuous),
    ):
        least = 0 if proof is None else proof.lower_bound
        findings.holds(
            least <= count or not met,
            f"{scope}.lower_bound",
            f"{least} exceeds the count of {count}",
        )
    findings.holds(
        claims.status != "optimal" or bound == count,
        "status",
        f"optimal is claimed, but {count} devices stand against a bound of {bound}",
    )
    findings.holds(
        # Where the stock isn't enough, fewer of one model may have been.
        needed.count == count if met else needed.count >= count or kind.is_counted,
        "needed.count",
        f"{needed.count} is claimed for a plan of {count} that is {claims.status!r}",
    )
    findings.holds(
        needed.lower_bound <= needed.count,
        "needed.lower_bound",
        f"{needed.lower_bound} exceeds the count of {needed.count}",
    )


def _audit_floors(kind: DeviceKind, case: AuditCase, findings: AuditFindings) -> None:
    """Check of how many regions the count is said to meet the floor, and `for_total`.

    Where candidates of a number cover too little at most, it takes one more.
    """
    claims, asked = kind.proof, case.plan.requirements.region_coverage
    truth = len(case.large_regions) if asked > 0.0 else 0
    findings.number("floors", claims.floors, truth, 0.0, "regions")
    total, least = claims.candidates.for_total, claims.candidates.lower_bound
    if total is None:
        # Of what hardly anything can be reached no sample may be asked for.
        findings.holds(
            least == 0
            or not any(
                asked * getattr(region.coverage, f"reachable_by_{kind.name}s_m2")
                > POINT * region.area_m2
                for region in case.plan.document.regions
                if region.id in case.large_regions and region.coverage is not None
            ),
            "candidates.for_total",
            f"None is claimed beside {least}, but {truth} regions have a floor",
        )
        return
    most = max(least, claims.needed.lower_bound)
    required = claims.required_m2 * (1.0 - ROUNDING)
    few = [row.count for row in claims.by_count if row.upper_bound_m2 < required]
    fewest = min(1 + max(few, default=0), most)
    findings.holds(
        fewest <= total <= most,
        "candidates.for_total",
        f"{total} is claimed without floors, but {fewest} by by_count and only {most} "
        f"with them",
    )


def _audit_greedy(claims: Certificate, findings: AuditFindings) -> None:
    """Check that the greedy cover is no smaller than any, nor larger than it can be.

    Greedy covers of n samples take at most 1 + ln n times the fewest sets (Wolsey
    1982); once for the total, and once for what floors lack then.
    """
    least, n = claims.needed.lower_bound, max(claims.n_samples, 1)
    most = 2.0 * (1.0 + np.log(n)) * max(claims.needed.count, 1)
    findings.holds(
        least <= claims.greedy_count <= most,
        "greedy_count",
        f"{claims.greedy_count} must lie between {least}, which are needed, and "
        f"{most:.0f}",
    )


def _audit_continuous(
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
    below.holds(
        1 <= samples <= claims.n_samples,
        "n_samples",
        f"{samples} must be some of the certificate's {claims.n_samples}",
    )
    target = case.plan.coverage.target
    whole = target.area_m2 if kind.name == "projector" else target.lit_m2
    if whole > 0.0:
        share = kind.reachable_m2 / whole
        slack = max(samples, 1) * _noise(samples, share, 1.0)
        most, least = samples * share, kind.share * samples * share
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


def _audit_areas(
    kind: DeviceKind, slack: float, case: AuditCase, findings: AuditFindings
) -> None:
    """Check required_m2, best_area and one_fewer.

    If no fewer devices suffice, the bound on one fewer must fall short too.
    """
    claims, whole = kind.proof, case.estimator.target_m2
    required = kind.share * kind.reachable_m2
    findings.number("required_m2", claims.required_m2, required, slack)
    best, fewer = claims.best_area.upper_bound_m2, claims.one_fewer
    room = _noise(claims.n_samples, kind.reachable_m2, whole)
    findings.holds(
        best <= kind.reachable_m2 + room,
        "best_area.upper_bound_m2",
        f"{square_centimetres(best)} exceeds the "
        f"{square_centimetres(kind.reachable_m2)} that can be reached (tolerance "
        f"{square_centimetres(room)})",
    )
    if fewer is None:
        return
    upper, name = fewer.upper_bound_m2, "one_fewer.upper_bound_m2"
    findings.holds(upper >= 0.0, name, f"{upper!r} must be an area")
    fewest = _for_total(claims) == claims.count
    findings.holds(
        not fewest or upper <= claims.required_m2 + slack,
        name,
        f"{square_centimetres(upper)}, which is enough for the "
        f"{square_centimetres(claims.required_m2)} required (tolerance "
        f"{square_centimetres(slack)}), but {claims.count} are claimed to be "
        f"the fewest",
    )


def _audit_by_count(kind: DeviceKind, case: AuditCase, findings: AuditFindings) -> None:
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


def _noise(n_samples: int, area_m2: float, whole: float) -> float:
    """A point, and three standard errors of an area from so many samples."""
    n = max(n_samples, _FEWEST_SAMPLES)
    p = min(max(area_m2 / whole, 1.0 / n), 1.0 - 1.0 / n)
    return whole * (POINT + 3.0 * float(np.sqrt(p * (1.0 - p) / n)))


def _audit_bodies(kind: DeviceKind, findings: AuditFindings) -> None:
    """Where planned devices have bodies the bounds must say that these are left out."""
    claims = kind.proof
    bodied = any(d.body is not None and not d.existing for d in kind.devices)
    findings.holds(
        not bodied or claims.bounds_leave_out,
        "bounds_leave_out",
        "is missing, but planned devices have bodies",
    )
    stated = "but_for_bodies" in claims.model_fields_set
    findings.holds(
        not stated or (bodied and claims.but_for_bodies >= 1),
        "but_for_bodies",
        f"{claims.but_for_bodies!r} must be a number of devices with bodies "
        f"(the plan has {len(kind.devices)})",
    )


def _for_total(claims: Certificate) -> int:
    """Return the least number of devices that is claimed for the total alone."""
    total = claims.candidates.for_total
    return claims.candidates.lower_bound if total is None else total


def _meets_floors(kind: DeviceKind, covered: Mask, case: AuditCase) -> bool:
    """Whether the samples covered, (n,), meet all floors, more than by chance."""
    share = case.plan.requirements.region_coverage
    for number in case.large_regions if share > 0.0 else ():
        inside = (case.samples.region == number) & kind.coverable
        n, k = int(inside.sum()), int((inside & covered).sum())
        if n and k < n * (share + POINT + 3.0 * np.sqrt(0.25 / n)):
            return False
    return True


def _audit_refuted(
    kind: DeviceKind, slack: float, case: AuditCase, findings: AuditFindings
) -> None:
    """A bound is false if the plan meets what is required with fewer devices than that.

    The required area and all floors; the bound for the total if it meets the former.
    Devices are left out one after the other, always the one that is missed least;
    existing ones belong to every cover that the bound speaks of.
    """
    bound = kind.proof.candidates.lower_bound
    total = kind.proof.candidates.for_total or 0
    enough = kind.proof.required_m2 + slack
    within = case.samples.in_target
    spare = [i for i, device in enumerate(kind.devices) if not device.existing]
    staying = list(range(len(kind.devices)))
    while len(staying) >= bound and spare:
        areas = [
            case.estimator.area(
                kind.covered_with([i for i in staying if i != out]) & within
            )
            for out in spare
        ]
        best = int(np.argmax(areas))
        staying.remove(spare.pop(best))
        if not areas[best] > enough:
            return
        floors = _meets_floors(kind, kind.covered_with(staying) & within, case)
        for name, least in (("for_total", total), ("lower_bound", bound)):
            if len(staying) < least and (floors or name == "for_total"):
                findings.fail(
                    f"candidates.{name}",
                    f"{least} is claimed, but {len(staying)} of the plan's devices "
                    f"cover {areas[best]:.6g} m², more than the {enough:.6g} m² "
                    f"required",
                )
                return
