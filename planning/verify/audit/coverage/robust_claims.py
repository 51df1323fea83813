"""The claim that enough rigs meet what was asked that aren't built exactly as planned.

`docs/reference/semantics.md`, "Drawn rigs". Rigs, samples and triangulation are the
audit's own; floors of regions, and what the plan without it would do, aren't looked at.
"""

from dataclasses import replace

import numpy as np

from geometry.arrays import Array, Mask
from planning.model.devices.calibration_errors import Robust
from planning.model.document.coverage_records import RobustRecord
from planning.model.plan import RigPlan
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.predicates.built_rigs import (
    BuiltRig,
    built_rig,
    retriangulated,
)
from planning.verify.audit.predicates.error_terms import (
    PairGeometry,
    deviation,
    drawn_off,
    error_terms,
    light_noise_px,
)
from planning.verify.audit.predicates.predicates import MEASURED
from planning.verify.audit.predicates.recompute import (
    Reachable,
    Recomputed,
    reachable_by,
    recompute,
)

# Rigs, and samples of the target, that the audit looks at.
_RIGS, _SAMPLES = 60, 1500
# A true claim is called false so seldom; as many standard errors belong to its samples.
_SELDOM, _ERRORS = 1e-3, 3.0
# Doubt that the plan's own number of rigs must leave no more than.
_DOUBT = 0.05
# Of an error that is estimated from few samples, as a share.
_SLACK = 0.03
_NAMES = ("dominant_coverage", "coverage", "region_coverage")


def audit_robust(case: AuditCase, findings: AuditFindings) -> None:
    """Check that enough drawn rigs meet what was asked, if that is claimed."""
    plan, below = case.plan, findings.at("robust")
    robust, record = plan.requirements.robust, plan.document.robust
    if robust is None and record is None:
        return
    if robust is None or record is None:
        below.fail("", "there without the other: `robust` and `requirements.robust`")
        return
    if not _audit_numbers(plan, robust, record, below):
        return
    # Takes a second to load, which only plans with drawn rigs need.
    from scipy.stats import binom

    share = record.n_met / max(record.n_drawn, 1)
    error = np.sqrt(share * (1.0 - share) / max(record.n_drawn, 1))
    claimed = max(share - _ERRORS * error, 0.0)
    met = _rigs_that_meet(case, robust)
    below.holds(
        binom.cdf(met, _RIGS, claimed) >= _SELDOM,
        "n_met",
        f"{record.n_met} of {record.n_drawn} rigs are claimed to meet what was asked, "
        f"recomputed {met} of {_RIGS} other ones",
    )


def _audit_numbers(
    plan: RigPlan, robust: Robust, record: RobustRecord, below: AuditFindings
) -> bool:
    """Check what was asked against what was planned, and the least number of rigs.

    Return whether all of them can be.
    """
    from scipy.stats import binom

    required, n_before = plan.requirements, len(below.failures)
    for name in _NAMES:
        now, asked = getattr(required, name), getattr(robust, name)
        below.holds(
            0.0 <= asked <= now,
            name,
            f"{asked:g} was asked, and less is required: {now:g}",
        )
    sigma = required.triangulation.max_sigma_m
    below.holds(
        robust.max_sigma_m is None
        or (sigma is not None and sigma <= robust.max_sigma_m),
        "max_sigma_m",
        f"{robust.max_sigma_m} was asked, and {sigma} is the limit",
    )
    below.holds(
        0.0 < robust.quantile < 1.0 and 0 <= record.n_met <= record.n_drawn,
        "quantile",
        f"{robust.quantile:g}, {record.n_met} of {record.n_drawn} rigs can't be",
    )
    n = max(record.n_drawn, 1)
    chances = binom.sf(np.arange(-1, n), n, robust.quantile)
    least = int(np.argmax(chances <= _DOUBT)) if chances[-1] <= _DOUBT else n
    below.same("least", record.least, least, "what the number of rigs makes it")
    return len(below.failures) == n_before


def _rigs_that_meet(case: AuditCase, robust: Robust) -> int:
    """How many of the audit's own rigs meet what was asked."""
    plan = _as_asked(case.plan, robust)
    inside = np.flatnonzero(case.samples.in_target)
    samples = case.samples.take(inside[:_SAMPLES])
    planned = recompute(plan, samples, case.shadow)
    reach = reachable_by(plan, planned, case.shadow, case.seed)
    met = 0
    for index in range(_RIGS):
        rng = np.random.default_rng((20_141_204, case.seed, index))
        rig = built_rig(plan, robust.mounting, rng)
        found = recompute(rig.plan, samples, case.shadow)
        met += _meets(plan, planned, reach, found, _errors(rig, found, rng))
    return met


def _as_asked(plan: RigPlan, robust: Robust) -> RigPlan:
    limits = plan.requirements.triangulation
    required = replace(
        plan.requirements,
        triangulation=replace(limits, max_sigma_m=robust.max_sigma_m),
    )
    return RigPlan(plan.document.changed(requirements=required), plan.surface)


def _meets(
    plan: RigPlan,
    planned: Recomputed,
    reach: Reachable,
    found: Recomputed,
    errors: Array,
) -> bool:
    """Whether a rig meets what was asked, samples being as few as they are."""
    robust, required = plan.requirements.robust, plan.requirements
    assert robust is not None
    within = np.abs(errors) <= required.check.tau_m
    limit = robust.max_sigma_m
    if required.triangulation.accuracy_of == "noise":
        limit = None
    some = errors[np.isfinite(errors)]
    return (
        _reaches(found.lit, reach.projectors, robust.dominant_coverage)
        and _reaches(found.measured, reach.cameras, robust.coverage)
        and _reaches(
            within & planned.measured, planned.measured, required.check.min_completeness
        )
        and (
            limit is None
            or bool((some**2).sum() <= len(some) * (limit * (1.0 + _SLACK)) ** 2)
        )
    )


def _reaches(part: Mask, whole: Mask, share: float) -> bool:
    n = max(int(whole.sum()), 1)
    error = np.sqrt(share * (1.0 - share) / n)
    return bool(part.sum() / n >= share - _ERRORS * error)


def _errors(rig: BuiltRig, found: Recomputed, rng: np.random.Generator) -> Array:
    """Errors along the normal of the best pair of each measured sample, NaN of others.

    Shape (n,) [m].
    """
    n = len(found.samples)
    least, errors = np.full(n, np.inf), np.full(n, np.nan)
    limits = rig.plan.requirements.triangulation
    edges = rng.standard_normal((n, 3))
    for p, projector in enumerate(rig.projectors):
        for c, camera in enumerate(rig.cameras):
            some = np.flatnonzero(found.pairs[p, c] == MEASURED)
            if not len(some):
                continue
            pair = PairGeometry.of(projector, camera, found.samples.take(some))
            total = deviation(error_terms(pair, limits))
            better = total < least[some]
            rows = some[better]
            least[rows] = total[better]
            photons = light_noise_px(pair, limits)[better]
            noise = np.hypot(limits.noise_px / pair.incidence[better], photons)
            rings = np.full(len(rows), limits.ring_sigma_m or 0.0)
            if limits.drawn_edges is not None:
                rings = np.hypot(rings, drawn_off(pair, limits.drawn_edges)[better])
            there = retriangulated(
                found.samples.points[rows],
                projector,
                camera,
                (rig.unknown[p], rig.unknown[len(rig.projectors) + c]),
                noise[:, None] * edges[rows, :2],
                rings * edges[rows, 2],
            )
            moved = there - found.samples.points[rows]
            errors[rows] = (moved * found.samples.normals[rows]).sum(axis=1)
    return errors
