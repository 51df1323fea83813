"""Claims about the two routes to the cameras."""

from planning.model.document.certificates import Certificate
from planning.verify.audit.audit_findings import AuditFindings


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
