"""Claims about rings: spacing, shares, errors between them, and what they cost."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planning.model.plan import RigPlan
from planning.model.requirements import Requirements
from planning.verify.audit.estimates import Estimator
from planning.verify.audit.ledger import Ledger, as_number
from planning.verify.audit.predicates.occlusion import Shadow
from planning.verify.audit.predicates.predicates import (
    MEASURED,
    SEEN,
    AuditProjector,
    pair_steps,
)
from planning.verify.audit.predicates.recompute import (
    Recomputed,
    audit_cameras,
    audit_projectors,
)

from .chords import Chords, counted_chords, random_beam
from .creases import audit_creases, find_creases
from .ring_gaps import audit_gaps, audit_spacing
from .ring_light import RingLight, gap_about
from .share_claims import audit_ring_shares

_STREAM = 20_151_104
_RAYS = 60_000
_LEVEL = 0.99
_DEVIATIONS = 4.0
# Beside sampling: of a share of chords, and of a quantile of their errors.
_SHARE, _RELATIVE = 0.004, 0.05
# The largest hundredth of fewer chords is a chord or two, where a few lie together
# between creases: nothing to hold a claim against.
_LEAST_CHORDS = 200
# Chords side by side bend alike: so many say as much as one that stands alone.
_ALIKE = 2.0
# On a plane errors are roundings, and no claim.
_FLAT_M = 1e-9


def audit_rings(
    plan: RigPlan,
    own: Recomputed,
    shadow: Shadow,
    estimator: Estimator,
    ledger: Ledger,
    *,
    seed: int,
) -> None:
    """Check `rings` and `ring_shares` of every projector, and `lost_to_rings_m2`.

    A plan that has none of them claims nothing; one that has some must have all.
    `rings` may be null in a run that was cut.

    Args:
        plan: The plan.
        own: What its devices measure of the audit's samples.
        shadow: Occlusion.
        estimator: Of areas.
        ledger: Takes the false claims.
        seed: Of the rays.
    """
    entries = plan.to_document()["projectors"]
    spoken = [key in e for e in entries for key in ("rings", "ring_shares")]
    lost = ledger.read("coverage", "lost_to_rings_m2")
    if lost is None and not any(spoken):
        return
    light = RingLight(plan, shadow)
    audit_ring_shares(plan, light, seed, ledger)
    rng = np.random.default_rng((_STREAM, seed))
    creases = find_creases(plan.surface.mesh, rng)
    wish = ledger.read("rig", "rings", "spacing")
    every_even: list[NDArray[np.float64]] = []
    for row, (entry, lamp) in enumerate(zip(entries, light.lamps, strict=True)):
        key, rings = f"{entry['id']}.rings", entry.get("rings")
        every_even.append(lamp.radii)
        if not isinstance(rings, dict):
            ledger.holds(
                rings is None and plan.to_document()["truncated"], key, "is missing"
            )
            continue
        even = audit_spacing(key, rings, lamp, wish, ledger)
        if even is None:
            continue
        every_even[row] = even
        beam = random_beam(light, lamp, 0.5 * even[0], rng)
        audit_gaps(key, rings, lamp, even, beam.strikes, ledger, light, rng)
        theta = plan.requirements.projector.max_incidence
        chords = counted_chords(light, beam, even[0], creases.points, theta)
        _audit_errors(key, rings, lamp, even[0], chords, plan.requirements, ledger)
        claims = rings.get("creases")
        audit_creases(
            f"{key}.creases", claims, lamp, light, plan.surface.mesh, creases, ledger
        )
    found = _lost(plan, own, every_even)
    ledger.number(
        "coverage.lost_to_rings_m2",
        lost,
        estimator.area(found),
        estimator.tolerance(found, estimator.target_m2),
    )


def _audit_errors(
    key: str,
    rings: Mapping[str, Any],
    lamp: AuditProjector,
    even: float,
    chords: Chords,
    limits: Requirements,
    ledger: Ledger,
) -> None:
    """Check the errors between rings: e over one even gap, times (gap / even gap)^2."""
    asked = limits.triangulation.max_sigma_m
    tolerance = limits.check.max_p95_m if asked is None else asked
    ledger.number(
        f"{key}.error_tolerance_m",
        rings.get("error_tolerance_m"),
        tolerance,
        1e-9,
        "m",
    )
    shrunk = (gap_about(lamp.radii, chords.middles) / even) ** 2
    own = chords.errors * shrunk
    _audit_quantile(f"{key}.error_p99_m", rings.get("error_p99_m"), own, ledger)
    _audit_quantile(
        f"{key}.error_p99_even_m", rings.get("error_p99_even_m"), chords.errors, ledger
    )
    share = float(np.mean(own > tolerance)) if len(own) else 0.0
    over = as_number(rings.get("over_tolerance"))
    # A share of few chords is uncertain in the plan, too.
    likely = min(max(share, over or 0.0), 1.0)
    slack = _SHARE + _DEVIATIONS * float(
        np.sqrt(likely * len(own) + 1.0) / (len(own) + 2.0)
    )
    ledger.number(f"{key}.over_tolerance", over, share, slack, "of the chords")
    # How fine rings may be hangs on samples of the planner's; they are no finer.
    cross = as_number(rings.get("limits_cross"))
    ledger.holds(
        cross is not None and 0.0 <= cross <= (over or 0.0) + _SHARE,
        f"{key}.limits_cross",
        f"{rings.get('limits_cross')!r} is claimed, must lie between 0 and "
        f"over_tolerance = {over!r}",
    )


def _audit_quantile(
    key: str, claimed: object, errors: NDArray[np.float64], ledger: Ledger
) -> None:
    """Check that 99 % of the errors are no larger than claimed, and no 99.x % are."""
    n, value = len(errors), as_number(claimed)
    if n < _LEAST_CHORDS or (claimed is None and float(errors.max()) <= _FLAT_M):
        # On flat surface the plan may have met no chord at all.
        return
    alone = n / _ALIKE
    noise = _SHARE / 2.0 + _DEVIATIONS * float(np.sqrt(_LEVEL * (1.0 - _LEVEL) / alone))
    low = float(np.quantile(errors, max(_LEVEL - noise, 0.0))) * (1.0 - _RELATIVE)
    high = float(np.quantile(errors, min(_LEVEL + noise, 1.0))) * (1.0 + _RELATIVE)
    if _LEVEL + noise >= 1.0:
        # Too few chords to bound what they haven't met.
        high = np.inf
    ledger.holds(
        value is not None and low - _FLAT_M <= value <= high + _FLAT_M,
        key,
        f"claimed {claimed!r} m, recomputed {np.quantile(errors, _LEVEL):.6g} m, "
        f"accepted {low:.6g} to {high:.6g} m",
    )


def _lost(
    plan: RigPlan, own: Recomputed, even: list[NDArray[np.float64]]
) -> NDArray[np.bool_]:
    """Whether only even rings would measure each sample of the target, (n,)."""
    lost = np.zeros(len(own.samples), dtype=bool)
    left = own.samples.in_target & ~own.measured
    for row, (lamp, radii) in enumerate(zip(audit_projectors(plan), even, strict=True)):
        evenly = replace(lamp, radii=radii)
        for column, eye in enumerate(audit_cameras(plan)):
            seen = np.flatnonzero(left & (own.pairs[row, column] >= SEEN))
            steps = pair_steps(
                evenly, eye, own.samples.take(seen), plan.requirements.triangulation
            )
            lost[seen] |= steps == MEASURED - SEEN
    return lost
