"""Claims of the certificates: counts, bounds and what the plan itself refutes."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planning.model.plan import RigPlan
from planning.model.planned import PlannedCamera, PlannedProjector
from planning.verify.audit.coverage.area_claims import ROUNDING
from planning.verify.audit.devices.existing_claims import droppable
from planning.verify.audit.estimates import POINT, Estimator
from planning.verify.audit.ledger import Ledger, as_number, entries, square_centimetres
from planning.verify.audit.predicates.recompute import Recomputed

from .count_claims import FEWEST_ROWS, audit_counts

_STATUSES = ("optimal", "feasible", "infeasible")


def audit_certificates(
    plan: RigPlan, own: Recomputed, estimator: Estimator, ledger: Ledger
) -> None:
    """Check counts, bounds and statuses, and that the plan doesn't refute them."""
    limits = plan.requirements
    poses = {
        "projectors": plan.surface.reference_projectors,
        "cameras": plan.surface.reference_cameras,
    }
    for kind, devices, share, of, covers, area in (
        (
            "projectors",
            plan.projectors,
            limits.dominant_coverage,
            "reachable_by_projectors_m2",
            own.lit_by,
            own.lit,
        ),
        (
            "cameras",
            plan.cameras,
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
        _audit_candidates(key, claims, len(poses[kind]), ledger)
        _audit_needed(key, claims, len(covers), ledger)
        _audit_continuous(key, claims, ledger)
        _audit_best_area(key, claims, reachable, estimator.target_m2, ledger)
        _audit_one_fewer(key, claims, len(covers), slack, ledger)
        audit_counts(key, claims, kind, estimator.target_m2, ledger)
        _audit_bodies(key, claims, devices, ledger)
        ledger.number(
            f"{key}.required_m2", claims.get("required_m2"), share * reachable, slack
        )
        required = as_number(claims.get("required_m2"))
        bound = _best_bound(claims)
        if required is not None and bound is not None:
            target = own.samples.in_target
            spare = droppable(devices)
            _audit_refuted(
                key, covers & target, spare, bound, required + slack, estimator, ledger
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


def _audit_candidates(
    key: str, claims: dict[str, Any], n_poses: int, ledger: Ledger
) -> None:
    """The candidates are the reference poses: a proof over fewer proves less."""
    table = claims.get("candidates")
    if isinstance(table, dict):
        ledger.number(
            f"{key}.candidates.n_candidates",
            table.get("n_candidates"),
            float(n_poses),
            0.0,
            "poses",
        )


def _audit_needed(key: str, claims: dict[str, Any], count: int, ledger: Ledger) -> None:
    needed = claims.get("needed")
    if not isinstance(needed, dict):
        return
    number = as_number(needed.get("count"))
    bound = as_number(needed.get("lower_bound"))
    if not ledger.holds(
        number is not None and bound is not None,
        f"{key}.needed",
        f"{needed!r} must hold count and lower_bound",
    ):
        return
    assert number is not None
    assert bound is not None
    met = claims.get("status") != "infeasible"
    ledger.holds(
        number == count if met else number >= count,
        f"{key}.needed.count",
        f"{number:g} is claimed for a plan of {count} that is {claims.get('status')!r}",
    )
    ledger.holds(
        bound <= number,
        f"{key}.needed.lower_bound",
        f"{bound:g} exceeds the count of {number:g}",
    )


def _audit_continuous(key: str, claims: dict[str, Any], ledger: Ledger) -> None:
    """What holds for all poses holds for the candidates too, on equal samples."""
    table, needed = claims.get("continuous"), claims.get("needed")
    if not (isinstance(table, dict) and isinstance(needed, dict)):
        return
    same = table.get("n_samples", claims.get("n_samples")) == claims.get("n_samples")
    everywhere = as_number(table.get("lower_bound"))
    here = as_number(needed.get("lower_bound" if same else "count"))
    if everywhere is not None and here is not None:
        ledger.holds(
            everywhere <= here,
            f"{key}.continuous.lower_bound",
            f"{everywhere:g} is claimed over all poses, but only {here:g} over the "
            f"candidates, which are some of them",
        )
    if same:
        _audit_fewer_anywhere(key, claims, table, ledger)


def _audit_fewer_anywhere(
    key: str, claims: dict[str, Any], table: dict[str, Any], ledger: Ledger
) -> None:
    """What one fewer covers anywhere at most, no candidates exceed."""
    upper = as_number(table.get("one_fewer_upper_bound_m2"))
    needed = as_number(claims["needed"].get("count"))
    if upper is None or needed is None:
        return
    for row in entries(claims.get("by_count")):
        value = as_number(row.get("value_m2"))
        if row.get("count") != needed - 1 or value is None:
            continue
        ledger.holds(
            value <= upper * (1.0 + ROUNDING),
            f"{key}.continuous.one_fewer_upper_bound_m2",
            f"{square_centimetres(upper)} is claimed over all poses, but "
            f"{needed - 1:g} of the candidates cover {square_centimetres(value)}",
        )


def _audit_best_area(
    key: str,
    claims: dict[str, Any],
    reachable: float,
    whole: float,
    ledger: Ledger,
) -> None:
    """value_m2 <= upper_bound_m2 <= what can be reached at all, as far as sampled."""
    area = claims.get("best_area")
    if not isinstance(area, dict):
        return
    value = as_number(area.get("value_m2"))
    upper = as_number(area.get("upper_bound_m2"))
    name = f"{key}.best_area"
    if value is None or upper is None:
        ledger.fail(name, f"{area!r} must hold value_m2 and upper_bound_m2")
        return
    ledger.holds(
        0.0 <= value <= upper * (1.0 + ROUNDING),
        name,
        f"value_m2 {square_centimetres(value)} exceeds upper_bound_m2 "
        f"{square_centimetres(upper)}",
    )
    n = max(as_number(claims.get("n_samples")) or 0.0, FEWEST_ROWS)
    p = min(max(reachable / whole, 1.0 / n), 1.0 - 1.0 / n)
    slack = whole * (POINT + 3.0 * float(np.sqrt(p * (1.0 - p) / n)))
    ledger.holds(
        upper <= reachable + slack,
        f"{key}.best_area.upper_bound_m2",
        f"{square_centimetres(upper)} exceeds the {square_centimetres(reachable)} "
        f"that can be reached (tolerance {square_centimetres(slack)})",
    )


def _audit_one_fewer(
    key: str, claims: dict[str, Any], count: int, slack: float, ledger: Ledger
) -> None:
    """If no fewer devices suffice, the bound on one fewer must fall short too."""
    table = claims.get("one_fewer")
    if not isinstance(table, dict):
        return
    upper = as_number(table.get("upper_bound_m2"))
    name = f"{key}.one_fewer.upper_bound_m2"
    if upper is None or not upper >= 0.0:
        ledger.fail(name, f"{table.get('upper_bound_m2')!r} must be an area")
        return
    required = as_number(claims.get("required_m2"))
    if required is None or _best_bound(claims) != count:
        return
    ledger.holds(
        upper <= required + slack,
        name,
        f"{square_centimetres(upper)}, which is enough for the "
        f"{square_centimetres(required)} required (tolerance "
        f"{square_centimetres(slack)}), but {count} are claimed to be the fewest",
    )


def _audit_bodies(
    key: str,
    claims: dict[str, Any],
    devices: Sequence[PlannedProjector] | Sequence[PlannedCamera],
    ledger: Ledger,
) -> None:
    """Where planned devices have bodies the bounds must say that these are left out."""
    bodied = any(d.body is not None and not d.existing for d in devices)
    ledger.holds(
        not bodied or "bounds_leave_out" in claims,
        f"{key}.bounds_leave_out",
        "is missing, but planned devices have bodies",
    )
    if "but_for_bodies" in claims:
        number, count = as_number(claims["but_for_bodies"]), as_number(claims["count"])
        ledger.holds(
            bodied and number is not None and number >= 1.0 and number == int(number),
            f"{key}.but_for_bodies",
            f"{claims['but_for_bodies']!r} must be a number of devices with bodies "
            f"(the plan has {count:g})",
        )


def _best_bound(claims: dict[str, Any]) -> float | None:
    """The bound that speaks of the plan's own count; None if nothing was proved."""
    table = claims.get("candidates")
    return as_number(table.get("lower_bound")) if isinstance(table, dict) else None


def _audit_refuted(
    key: str,
    covers: NDArray[np.bool_],
    spare: list[int],
    bound: float,
    enough_m2: float,
    estimator: Estimator,
    ledger: Ledger,
) -> None:
    """A bound is false if the plan meets the requirement with fewer devices than that.

    Devices are left out one after the other, always the one that is missed least;
    those that stand already belong to every cover that the bound speaks of.
    """
    left, spare = list(range(len(covers))), list(spare)
    while len(left) >= bound and spare:
        areas = [
            estimator.area(np.any(covers[[i for i in left if i != out]], axis=0))
            for out in spare
        ]
        best = int(np.argmax(areas))
        left.remove(spare.pop(best))
        if len(left) < bound and not areas[best] <= enough_m2:
            ledger.fail(
                f"{key}.candidates.lower_bound",
                f"{bound:g} is claimed, but {len(left)} of the plan's devices cover "
                f"{areas[best]:.6g} m², more than the {enough_m2:.6g} m² required",
            )
            return
