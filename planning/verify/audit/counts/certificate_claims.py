"""Claims of the certificates: counts, bounds and what the plan itself refutes."""

import numpy as np

from geometry.arrays import Mask
from planning.model.document.certificates import Certificate
from planning.verify.audit.audit_case import AuditCase, DeviceKind
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.estimates import POINT, ROUNDING

from .bound_claims import (
    audit_areas,
    audit_by_count,
    audit_continuous,
)
from .route_claims import audit_routes


def audit_certificates(case: AuditCase, findings: AuditFindings) -> None:
    """Check counts, bounds and statuses, and that the plan doesn't refute them."""
    for kind in case.kinds:
        chosen = np.any(kind.covers, axis=0) & case.samples.in_target
        slack = case.estimator.tolerance(chosen, case.estimator.target_m2)
        below = findings.at(f"certificates.{kind.name}s")
        _audit_counts(kind, below)
        _audit_floors(kind, case, below)
        _audit_greedy(kind.proof, below)
        audit_continuous(kind, case, below)
        audit_areas(kind, slack, case, below)
        audit_by_count(kind, case, below)
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


def _audit_bodies(kind: DeviceKind, findings: AuditFindings) -> None:
    """Where planned devices have bodies the bounds must say that these are left out.

    Of devices at stations nothing is proved: what is, is of stations.
    """
    claims = kind.proof
    bodied = any(
        d.body is not None and not d.existing and not d.station for d in kind.devices
    )
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
