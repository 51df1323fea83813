"""Claims about the two routes to the cameras: counts that fit the certificate.

The cameras of the route that wasn't taken aren't in the plan, so its count can only be
held against what else is claimed: a bound over candidates that hold the cameras of
either route is no higher than the count of either, and the smaller count is taken.
"""

from collections.abc import Mapping
from typing import Any

from planning.verify.audit.ledger import Ledger, as_number

_KEY = "certificates.cameras.routes"
_KINDS = ("cover", "paper")


def audit_routes(ledger: Ledger) -> None:
    """Check `certificates.cameras.routes`; a plan without it claims nothing of them."""
    proof = ledger.read("certificates", "cameras")
    if not isinstance(proof, Mapping) or "routes" not in proof:
        return
    routes = proof["routes"]
    if not (isinstance(routes, Mapping) and _whole(routes, ledger)):
        ledger.holds(isinstance(routes, Mapping), _KEY, f"{routes!r} is no table")
        return
    counts = {kind: as_number(routes[kind]) for kind in _KINDS}
    taken = counts[routes["taken"]]
    known = [count for count in counts.values() if count is not None]
    needed = proof.get("needed")
    needed = needed if isinstance(needed, Mapping) else {}
    bound, count = (as_number(needed.get(key)) for key in ("lower_bound", "count"))
    for other in known:
        ledger.holds(
            bound is not None and bound <= other,
            _KEY,
            f"a route needs {other:g} cameras, but at least {needed.get('lower_bound')}"
            f" are claimed to be needed",
        )
    if taken is None:
        met = proof.get("status") != "infeasible"
        ledger.holds(not met, _KEY, "the route that was taken has no count")
        return
    ledger.holds(
        taken == min(known),
        _KEY,
        f"{taken:g} cameras are taken instead of {min(known):g}",
    )
    # One more than the route needs may have come in for fresh samples, unproved.
    more = proof.get("status") == "feasible"
    ledger.holds(
        count == taken or (more and count is not None and count > taken),
        _KEY,
        f"the route that was taken needs {taken:g}, the certificate says "
        f"{needed.get('count')}",
    )


def _whole(routes: Mapping[str, Any], ledger: Ledger) -> bool:
    """Whether the table can be read, and holds counts of the routes that were asked."""
    asked, taken = routes.get("asked"), routes.get("taken")
    if not ledger.holds(
        asked in (*_KINDS, "both") and taken in _KINDS and asked in (taken, "both"),
        _KEY,
        f"asked {asked!r} and taken {taken!r} must be one of cover, paper (or both)",
    ):
        return False
    for kind in _KINDS:
        count = routes.get(kind, "missing")
        number = as_number(count)
        good = count is None or (number is not None and number == int(number) >= 1)
        if not ledger.holds(
            good and (count is None or asked in (kind, "both")),
            f"{_KEY}.{kind}",
            f"{count!r} must be a number of cameras, or null where {asked!r} was asked",
        ):
            return False
    return True
