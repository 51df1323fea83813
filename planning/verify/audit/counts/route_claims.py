"""Claims about the two routes to the cameras: counts that fit the certificate.

The cameras of the route that wasn't taken aren't in the plan, so its count can only be
held against what else is claimed: a bound over candidates that hold the cameras of
either route is no higher than the count of either, and the smaller count is taken.
"""

from planning.model.document.certificates import Certificate, RouteCounts
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings

_KEY = "certificates.cameras.routes"


def audit_routes(case: AuditCase, findings: AuditFindings) -> None:
    """Check `certificates.cameras.routes`; a plan without it claims nothing of them."""
    audit_route_counts(case.plan.document.certificates.cameras, findings)


def audit_route_counts(proof: Certificate, findings: AuditFindings) -> None:
    """Check the routes of the cameras' certificate."""
    routes = proof.routes
    if routes is None or not _whole(routes, findings):
        return
    counts = {"cover": routes.cover, "paper": routes.paper}
    taken, needed = counts[routes.taken], proof.needed
    known = [count for count in counts.values() if count is not None]
    for count in known:
        findings.holds(
            needed.lower_bound <= count,
            _KEY,
            f"a route needs {count} cameras, but at least {needed.lower_bound} are "
            f"claimed to be needed",
        )
    if taken is None:
        met = proof.status != "infeasible"
        findings.holds(not met, _KEY, "the route that was taken has no count")
        return
    findings.holds(
        taken == min(known), _KEY, f"{taken} cameras are taken instead of {min(known)}"
    )
    # One more than the route needs may have come in for fresh samples, unproved.
    findings.holds(
        needed.count == taken or (proof.status == "feasible" and needed.count > taken),
        _KEY,
        f"the route that was taken needs {taken}, the certificate says {needed.count}",
    )


def _whole(routes: RouteCounts, findings: AuditFindings) -> bool:
    """Whether there are counts of the routes that were asked for, and of no others."""
    if not findings.holds(
        routes.asked in (routes.taken, "both"),
        _KEY,
        f"{routes.taken!r} is taken where {routes.asked!r} was asked for",
    ):
        return False
    return all(
        findings.holds(
            count is None or (count >= 1 and routes.asked in (kind, "both")),
            f"{_KEY}.{kind}",
            f"{count!r} must be a number of cameras, or null where {routes.asked!r} "
            f"was asked for",
        )
        for kind, count in (("cover", routes.cover), ("paper", routes.paper))
    )
