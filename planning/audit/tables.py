"""Claims of the tables: marginal gains, certificates, cost and members."""

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planning.plan import RigPlan

from .areas import ROUNDING
from .estimates import POINT, Estimator
from .ledger import Ledger, as_number, entries
from .recompute import Recomputed

_STATUSES = ("optimal", "feasible", "infeasible")


def audit_marginal(own: Recomputed, estimator: Estimator, ledger: Ledger) -> None:
    """Check that tables rise with the number, and at the plan's count say its area."""
    target = own.samples.in_target
    everything = np.ones_like(target)
    wholes = (("target", target), ("surface", everything))
    for kind, verb, mask, count in (
        ("projectors", "lit", own.lit, len(own.light)),
        ("cameras", "measured", own.measured, len(own.measured_by)),
    ):
        rows = _rows(ledger.read("marginal"), kind)
        ledger.holds(len(rows) > 0, f"marginal.{kind}", "is missing")
        for part, within in wholes:
            whole = estimator.target_m2 if part == "target" else estimator.area_m2
            chosen = mask & within
            _audit_column(
                f"marginal.{kind}",
                f"n_{kind}",
                f"{verb}_{part}_m2",
                rows,
                (count, estimator.area(chosen), estimator.tolerance(chosen, whole)),
                ledger,
            )


def _rows(marginal: object, kind: str) -> list[Mapping[str, Any]]:
    """Rows of one kind of device: from a table for each, or from one common list."""
    table = marginal.get(kind) if isinstance(marginal, dict) else marginal
    return [
        row for row in entries(table) if as_number(row.get(f"n_{kind}")) is not None
    ]


def _audit_column(
    key: str,
    count_name: str,
    name: str,
    rows: list[Mapping[str, Any]],
    plan: tuple[int, float, float],
    ledger: Ledger,
) -> None:
    table = sorted(
        (row[count_name], as_number(row.get(name))) for row in rows if name in row
    )
    if name.endswith("target_m2") and rows:
        ledger.holds(table, key, f"{name} is missing")
    count, area, tolerance = plan
    for number, value in table:
        if number == count:
            ledger.number(f"{key}.{count}.{name}", value, area, tolerance)
    for (fewer, less), (_, more) in pairwise(table):
        ledger.holds(
            less is not None and more is not None and more >= less - ROUNDING * area,
            key,
            f"{name} falls from {less} to {more} m² with one device more than {fewer}",
        )


def audit_certificates(
    plan: RigPlan, own: Recomputed, estimator: Estimator, ledger: Ledger
) -> None:
    """Check counts, bounds and statuses, and that the plan doesn't refute them."""
    limits = plan.requirements
    for kind, share, of, covers, area in (
        (
            "projectors",
            limits.dominant_coverage,
            "reachable_by_projectors_m2",
            own.lit_by,
            own.lit,
        ),
        (
            "cameras",
            limits.coverage,
            "reachable_by_cameras_m2",
            own.measured_by,
            own.measured,
        ),
    ):
        key = f"certificates.{kind}"
        claims = ledger.read("certificates", kind)
        if not ledger.holds(isinstance(claims, dict), key, "is missing"):
            continue
        ledger.number(f"{key}.count", claims.get("count"), float(len(covers)), 0.0, "")
        _audit_bounds(key, claims, len(covers), ledger)
        reachable = as_number(ledger.read("coverage", "target", of)) or 0.0
        slack = estimator.tolerance(area & own.samples.in_target, estimator.target_m2)
        ledger.number(
            f"{key}.required_m2", claims.get("required_m2"), share * reachable, slack
        )
        required = as_number(claims.get("required_m2"))
        bound = _best_bound(claims)
        if required is not None and bound is not None:
            target = own.samples.in_target
            _audit_refuted(
                key, covers & target, bound, required + slack, estimator, ledger
            )


def _audit_bounds(key: str, claims: dict[str, Any], count: int, ledger: Ledger) -> None:
    status = claims.get("status")
    ledger.holds(
        status in _STATUSES, f"{key}.status", f"{status!r} isn't one of {_STATUSES}"
    )
    met = status != "infeasible"
    for scope in ("candidates", "continuous"):
        table = claims.get(scope)
        if table is None and scope == "continuous":
            continue
        bound = as_number(table.get("lower_bound")) if isinstance(table, dict) else None
        name = f"{key}.{scope}.lower_bound"
        if bound is None:
            ledger.fail(name, "is missing")
            continue
        ledger.holds(bound >= 0, name, f"{bound:g} is negative")
        if met:
            ledger.holds(
                bound <= count, name, f"{bound:g} exceeds the count of {count}"
            )
    best = _best_bound(claims)
    if status == "optimal" and best is not None:
        ledger.holds(
            best == count,
            f"{key}.status",
            f"optimal is claimed, but {count} devices stand against a bound of "
            f"{best:g}",
        )
    area = claims.get("best_area")
    if isinstance(area, dict):
        value, upper = (
            as_number(area.get("value_m2")),
            as_number(area.get("upper_bound_m2")),
        )
        if value is not None and upper is not None:
            ledger.holds(
                value <= upper * (1.0 + ROUNDING),
                f"{key}.best_area",
                f"value_m2 {value:.6g} exceeds upper_bound_m2 {upper:.6g}",
            )
    needed = claims.get("needed")
    if isinstance(needed, dict):
        number, bound = (
            as_number(needed.get("count")),
            as_number(needed.get("lower_bound")),
        )
        if number is not None and bound is not None:
            ledger.holds(
                bound <= number,
                f"{key}.needed.lower_bound",
                f"{bound:g} exceeds the count of {number:g}",
            )


def _best_bound(claims: dict[str, Any]) -> float | None:
    """The bound that speaks of the plan's own count; None if nothing was proved."""
    table = claims.get("candidates")
    return as_number(table.get("lower_bound")) if isinstance(table, dict) else None


def _audit_refuted(
    key: str,
    covers: NDArray[np.bool_],
    bound: float,
    enough_m2: float,
    estimator: Estimator,
    ledger: Ledger,
) -> None:
    """A bound is false if the plan meets the requirement with fewer devices than that.

    Devices are left out one after the other, always the one that is missed least.
    """
    left = list(range(len(covers)))
    while len(left) >= bound and left:
        areas = [
            estimator.area(np.any(covers[[i for i in left if i != out]], axis=0))
            for out in left
        ]
        best = int(np.argmax(areas))
        del left[best]
        if len(left) < bound and not areas[best] <= enough_m2:
            ledger.fail(
                f"{key}.candidates.lower_bound",
                f"{bound:g} is claimed, but {len(left)} of the plan's devices cover "
                f"{areas[best]:.6g} m², more than the {enough_m2:.6g} m² required",
            )
            return


def audit_rest(plan: RigPlan, ledger: Ledger) -> None:
    """Check pixels of the cost, the dominant share, and members of a single mesh."""
    document, surface = plan.document, plan.surface
    pixels = sum(
        camera.device.resolution[0] * camera.device.resolution[1]
        for camera in plan.cameras
    )
    if ledger.read("cost", "pixels") is not None:
        ledger.number(
            "cost.pixels", document["cost"]["pixels"], float(pixels), 0.0, "px"
        )
    share = float(
        surface.mesh.face_areas[surface.in_dominant].sum() / surface.mesh.area
    )
    ledger.number(
        "surface.dominant_share",
        ledger.read("surface", "dominant_share"),
        share,
        ROUNDING,
        "",
    )
    areas = [as_number(mesh.get("area_m2")) or 0.0 for mesh in document["meshes"]]
    total = surface.mesh.area
    ledger.number("meshes.area_m2 (sum)", sum(areas), total, POINT * 1e-2 * total)
    members = entries(document["members"])
    if len(document["meshes"]) == 1 and members:
        ledger.holds(
            len(members) == 1
            and members[0].get("coverage") in (document["coverage"], None),
            "members.0.coverage",
            "differs from coverage, of which it is the only member",
        )
