"""Claims about areas: coverage, causes, and what each device contributes."""

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planning.model.plan import RigPlan
from planning.verify.audit.estimates import Estimator
from planning.verify.audit.ledger import Ledger, as_number
from planning.verify.audit.predicates.predicates import (
    LIGHT_CAUSES,
    LIT,
    MEASURED,
    PAIR_CAUSES,
    SIGHT_CAUSES,
)
from planning.verify.audit.predicates.recompute import Reach, Recomputed

CAUSES = LIGHT_CAUSES + SIGHT_CAUSES + PAIR_CAUSES
# Room for the rounding of written numbers, as a share.
ROUNDING = 1e-6

_ORDER = (
    "measured_m2",
    "reachable_by_cameras_m2",
    "lit_m2",
    "reachable_by_projectors_m2",
    "area_m2",
)


def recomputed_areas(
    own: Recomputed, reach: Reach, estimator: Estimator
) -> dict[str, dict[str, float]]:
    """Return AREAS of the surface and of the target, as `coverage` has them."""
    masks = _masks(own, reach)
    target = own.samples.in_target
    wholes = {"surface": estimator.area_m2, "target": estimator.target_m2}
    return {
        part: {"area_m2": wholes[part]}
        | {
            name: estimator.area(mask & (target if part == "target" else True))
            for name, mask in masks.items()
        }
        for part in wholes
    }


def audit_areas(
    own: Recomputed, reach: Reach, estimator: Estimator, ledger: Ledger
) -> None:
    """Check every entry of AREAS, in both directions, and their order."""
    masks = _masks(own, reach)
    parts = {
        "surface": (np.ones(len(own.samples), dtype=bool), estimator.area_m2),
        "target": (own.samples.in_target, estimator.target_m2),
    }
    for part, (within, whole) in parts.items():
        key = f"coverage.{part}"
        claims = ledger.read("coverage", part)
        if not ledger.holds(isinstance(claims, dict), key, "is missing"):
            continue
        ledger.number(f"{key}.area_m2", claims.get("area_m2"), whole, ROUNDING * whole)
        for name, mask in masks.items():
            ledger.number(
                f"{key}.{name}",
                claims.get(name),
                estimator.area(mask & within),
                estimator.tolerance(mask & within, whole),
            )
        _audit_order(key, claims, whole, ledger)


def audit_causes(
    own: Recomputed, reach: Reach, estimator: Estimator, ledger: Ledger
) -> None:
    """Check the split of what isn't measured, and of what no projector reaches."""
    target = own.samples.in_target
    _audit_split(
        "uncovered_by_cause",
        CAUSES,
        [target & (own.cause == index) for index in range(len(CAUSES))],
        "measured_m2",
        estimator,
        ledger,
    )
    dark = target & ~reach.projectors
    _audit_split(
        "unreachable_by_cause",
        LIGHT_CAUSES,
        [dark & (reach.furthest == index) for index in range(LIT)],
        "reachable_by_projectors_m2",
        estimator,
        ledger,
    )
    # Only there where it is more than the requirement allows.
    if ledger.read("coverage", "unmeasurable_by_cause") is not None:
        beyond = target & own.lit & ~reach.cameras
        _audit_split(
            "unmeasurable_by_cause",
            SIGHT_CAUSES + PAIR_CAUSES,
            [beyond & (reach.furthest_pair == index) for index in range(MEASURED)],
            "reachable_by_cameras_m2",
            estimator,
            ledger,
            whole="lit_m2",
        )


def audit_contributions(
    plan: RigPlan, own: Recomputed, estimator: Estimator, ledger: Ledger
) -> None:
    """Check lit_area_m2, seen_area_m2 and sole_area_m2 of every device."""
    target, whole = own.samples.in_target, estimator.target_m2
    claims: list[tuple[str, Any, NDArray[np.bool_]]] = []
    for row, entry in enumerate(plan.to_document()["projectors"]):
        key = f"{entry['id']}.lit_area_m2"
        claims.append((key, entry.get("lit_area_m2"), own.lit_by[row]))
    for row, entry in enumerate(plan.to_document()["cameras"]):
        seen = own.measured_by[row]
        others = np.any(np.delete(own.measured_by, row, axis=0), axis=0)
        key = f"{entry['id']}.seen_area_m2"
        claims.append((key, entry.get("seen_area_m2"), seen))
        key = f"{entry['id']}.sole_area_m2"
        claims.append((key, entry.get("sole_area_m2"), seen & ~others))
    for key, claimed, mask in claims:
        chosen = mask & target
        ledger.number(
            key, claimed, estimator.area(chosen), estimator.tolerance(chosen, whole)
        )


def _masks(own: Recomputed, reach: Reach) -> dict[str, NDArray[np.bool_]]:
    return {
        "reachable_by_projectors_m2": reach.projectors,
        "lit_m2": own.lit,
        "reachable_by_cameras_m2": reach.cameras,
        "measured_m2": own.measured,
    }


def _audit_order(
    key: str, claims: dict[str, Any], whole: float, ledger: Ledger
) -> None:
    """Each area of AREAS is part of the next, whatever the sampling."""
    for smaller, larger in pairwise(_ORDER):
        low, high = as_number(claims.get(smaller)), as_number(claims.get(larger))
        if low is None or high is None:
            continue
        ledger.holds(
            0.0 <= low <= high + ROUNDING * whole,
            f"{key}.{smaller}",
            f"claimed {low:.6g} m², must lie between 0 and {larger} = {high:.6g} m²",
        )


def _audit_split(
    name: str,
    causes: tuple[str, ...],
    masks: list[NDArray[np.bool_]],
    rest: str,
    estimator: Estimator,
    ledger: Ledger,
    *,
    whole: str = "area_m2",
) -> None:
    """Check a split of `whole` less `rest` by causes, part by part and as a sum."""
    key = f"coverage.{name}"
    split = ledger.read("coverage", name)
    if not ledger.holds(isinstance(split, dict), key, "is missing"):
        return
    unknown = sorted(set(split) - set(causes))
    ledger.holds(not unknown, key, f"causes that there are not: {', '.join(unknown)}")
    target = estimator.target_m2
    for cause, mask in zip(causes, masks, strict=True):
        ledger.number(
            f"{key}.{cause}",
            split.get(cause, 0.0),
            estimator.area(mask),
            estimator.tolerance(mask, target),
        )
    total = sum(as_number(value) or 0.0 for value in split.values())
    area = as_number(ledger.read("coverage", "target", whole)) or 0.0
    done = as_number(ledger.read("coverage", "target", rest)) or 0.0
    ledger.number(f"{key} (sum)", total, area - done, 1e-4 * target)
