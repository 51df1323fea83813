"""Claims about the area on which light of two projectors falls."""

from collections.abc import Mapping
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planning.model.plan import RigPlan
from planning.verify.audit.audit_samples import AuditSamples
from planning.verify.audit.estimates import Estimator
from planning.verify.audit.ledger import Ledger, entries
from planning.verify.audit.predicates.blocks import free_of
from planning.verify.audit.predicates.occlusion import Shadow
from planning.verify.audit.predicates.predicates import (
    AuditProjector,
    in_beam,
    light_of,
)
from planning.verify.audit.predicates.recompute import audit_projectors

# Light that grazes a face at more than this is left out.
_GRAZING = np.cos(np.radians(89.0))
_DEVIATIONS = 4.0
_PARTS = ("target_m2", "surface_m2")


def audit_overlaps(
    plan: RigPlan, shadow: Shadow, estimator: Estimator, ledger: Ledger
) -> None:
    """Check `overlaps`: each pair once, with its areas, and that none fires together.

    A group may hold a pair of which few samples get light from both: the planner's may
    have missed them. It may not where so many do that this is no chance.

    Args:
        plan: The plan.
        shadow: Occlusion.
        estimator: Of areas, with its samples.
        ledger: Takes the false claims.
    """
    samples = estimator.samples
    names = [projector.id for projector in plan.projectors]
    falls = {
        name: light_falls(lamp, samples, shadow)
        for name, lamp in zip(names, audit_projectors(plan), strict=True)
    }
    claims = _by_pair(ledger, names)
    for pair in combinations(names, 2):
        both = falls[pair[0]] & falls[pair[1]]
        _audit_pair(" + ".join(pair), claims.get(pair), both, estimator, ledger)
    for group in _groups(ledger.read("firing_schedule", "groups")):
        for pair in combinations(group, 2):
            if not set(pair) <= set(names):
                continue
            both = falls[pair[0]] & falls[pair[1]]
            ledger.holds(
                not _clearly_some(both, estimator),
                "firing_schedule.groups",
                f"{pair[0]} and {pair[1]} fire together, but light of both falls on "
                f"{1e4 * estimator.area(both):.3g} cm²",
            )


def light_falls(
    lamp: AuditProjector, samples: AuditSamples, shadow: Shadow
) -> NDArray[np.bool_]:
    """Return on which samples any light of a projector falls, shape (n,).

    Its last annulus ends one gap beyond its last ring.
    """
    before, last = (0.0, *lamp.radii)[-2:]
    outer = replace(lamp, radii=np.array([last, last + (last - before)]))
    falls = in_beam(outer, samples.points)
    chosen = np.flatnonzero(falls)
    along, length = light_of(lamp, samples.points[chosen])
    facing = -np.einsum("ij,ij->i", samples.normals[chosen], along)
    met = (facing >= _GRAZING) & (length >= 0.0)
    falls[chosen] = met
    rest = chosen[met]
    falls[rest] = shadow.free(
        samples.points[rest], samples.faces[rest], along[met], length[met]
    ) & free_of(lamp.blocks, samples.points[rest], along[met], length[met])
    return falls


def _by_pair(
    ledger: Ledger, names: list[str]
) -> dict[tuple[str, ...], Mapping[str, Any]]:
    found: dict[tuple[str, ...], Mapping[str, Any]] = {}
    rows = entries(ledger.read("overlaps"))
    for row in rows:
        pair = row.get("projectors")
        if isinstance(pair, list) and all(name in names for name in pair):
            found[tuple(sorted(pair, key=names.index))] = row
    pairs = set(combinations(names, 2))
    ledger.holds(
        set(found) == pairs and len(rows) == len(pairs),
        "overlaps",
        f"must name each of the {len(pairs)} pairs of {', '.join(names)} exactly once",
    )
    return found


def _audit_pair(
    name: str,
    claim: Mapping[str, Any] | None,
    both: NDArray[np.bool_],
    estimator: Estimator,
    ledger: Ledger,
) -> None:
    if claim is None:
        return
    within = {"target_m2": estimator.samples.in_target, "surface_m2": True}
    wholes = {"target_m2": estimator.target_m2, "surface_m2": estimator.area_m2}
    for part in _PARTS:
        chosen = both & within[part]
        ledger.number(
            f"overlaps.{name}.{part}",
            claim.get(part),
            estimator.area(chosen),
            estimator.tolerance(chosen, wholes[part]),
        )


def _clearly_some(both: NDArray[np.bool_], estimator: Estimator) -> bool:
    """Whether that many samples can't be what a set of the planner's size misses."""
    inside = estimator.samples.in_target
    for part in (inside, ~inside):
        n, k = int(part.sum()), int((both & part).sum())
        if n == 0:
            continue
        p = (k + 1.0) / (n + 2.0)
        error = np.sqrt(p * (1.0 - p) * (1.0 / n + 1.0 / max(estimator.n_claimed, 1)))
        if k / n > _DEVIATIONS * error:
            return True
    return False


def _groups(value: object) -> list[list[str]]:
    """Groups that are lists of names; whether they are whole is for the schedule."""
    if not isinstance(value, list):
        return []
    return [[str(name) for name in group] for group in value if isinstance(group, list)]
