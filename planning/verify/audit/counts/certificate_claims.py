"""Claims of the certificates: counts, bounds and what the plan itself refutes."""

import numpy as np

from geometry.arrays import Mask
from planning.model.document.certificates import Certificate
from planning.verify.audit.audit_case import AuditCase, DeviceKind
from planning.verify.audit.audit_findings import AuditFindings, square_centimetres
from planning.verify.audit.estimates import POINT, ROUNDING

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
        _audit_floors(kind.proof, case, below)
        _audit_continuous(kind.proof, below)
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
            least >= 0 and (least <= count or not met),
            f"{scope}.lower_bound",
            f"{least} exceeds the count of {count}, or is negative",
        )
    findings.holds(
        claims.status != "optimal" or bound == count,
        "status",
        f"optimal is claimed, but {count} devices stand against a bound of {bound}",
    )
    findings.holds(
        needed.count == count if met else needed.count >= count,
        "needed.count",
        f"{needed.count} is claimed for a plan of {count} that is {claims.status!r}",
    )
    findings.holds(
        needed.lower_bound <= needed.count,
        "needed.lower_bound",
        f"{needed.lower_bound} exceeds the count of {needed.count}",
    )


def _audit_floors(
    claims: Certificate, case: AuditCase, findings: AuditFindings
) -> None:
    """Check of how many regions the count is said to meet the floor."""
    asked = case.plan.requirements.region_coverage > 0.0
    truth = len(case.large_regions) if asked else 0
    findings.number("floors", claims.floors, truth, 0.0, "regions")
    total, least = claims.candidates.for_total, claims.candidates.lower_bound
    findings.holds(
        total is None or 0 <= total <= max(least, claims.needed.lower_bound),
        "candidates.for_total",
        f"{total} is claimed without floors, but only {least} with them",
    )


def _audit_continuous(claims: Certificate, findings: AuditFindings) -> None:
    """What holds for all poses holds for the candidates too, on equal samples."""
    table = claims.continuous
    if table is None:
        return
    same = table.n_samples == claims.n_samples
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
    room = _noise(claims, kind.reachable_m2, whole)
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
        room = _noise(claims, upper, whole)
        findings.holds(
            area <= upper + room,
            "by_count",
            f"at most {square_centimetres(upper)} are claimed for {number}, but "
            f"marginal has {square_centimetres(area)} (tolerance "
            f"{square_centimetres(room)})",
        )


def _noise(claims: Certificate, area_m2: float, whole: float) -> float:
    """A point, and three standard errors of an area from the certificate's samples."""
    n = max(claims.n_samples, _FEWEST_SAMPLES)
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
        if not areas[best] > enough:
            return
        floors = _meets_floors(kind, np.any(covers[staying], axis=0), case)
        for name, least in (("for_total", total), ("lower_bound", bound)):
            if len(staying) < least and (floors or name == "for_total"):
                findings.fail(
                    f"candidates.{name}",
                    f"{least} is claimed, but {len(staying)} of the plan's devices "
                    f"cover {areas[best]:.6g} m², more than the {enough:.6g} m² "
                    f"required",
                )
                return


def audit_routes(proof: Certificate, findings: AuditFindings) -> None:
    """Check counts of the two routes to the cameras against the certificate.

    The cameras of the route that wasn't taken aren't in the plan, so its count can only
    be held against what else is claimed: a bound over candidates that hold the cameras
    of either route is no higher than the count of either, and the smaller is taken.
    """
    findings = findings.at("routes")
    routes, needed = proof.routes, proof.needed
    if routes is None or not findings.holds(
        routes.asked in (routes.taken, "both"),
        "",
        f"{routes.taken!r} is taken where {routes.asked!r} was asked for",
    ):
        return
    counts = {"cover": routes.cover, "paper": routes.paper}
    for kind, count in counts.items():
        if count is None:
            continue
        findings.holds(
            count >= 1 and routes.asked in (kind, "both"),
            kind,
            f"{count!r} must be a number of cameras, or null where {routes.asked!r} "
            f"was asked for",
        )
        findings.holds(
            needed.lower_bound <= count,
            "",
            f"a route needs {count} cameras, but at least {needed.lower_bound} are "
            f"claimed to be needed",
        )
    taken = counts[routes.taken]
    if taken is None:
        met = proof.status != "infeasible"
        findings.holds(not met, "", "the route that was taken has no count")
        return
    least = min(count for count in counts.values() if count is not None)
    findings.holds(taken == least, "", f"{taken} cameras are taken instead of {least}")
    # One more than the route needs may have come in for fresh samples, unproved.
    findings.holds(
        needed.count == taken or (proof.status == "feasible" and needed.count > taken),
        "",
        f"the route that was taken needs {taken}, the certificate says {needed.count}",
    )
