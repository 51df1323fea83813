"""Claims about the area on which light of two projectors falls."""

from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.audit_samples import AuditSamples
from planning.verify.audit.estimates import Estimator
from planning.verify.audit.predicates.audit_devices import AuditProjector
from planning.verify.audit.predicates.audit_optics import dot
from planning.verify.audit.predicates.blocks import free_of
from planning.verify.audit.predicates.occlusion import Shadow

# Light that grazes a face at more than this is left out.
_GRAZING = np.cos(np.radians(89.0))
_DEVIATIONS = 4.0


def audit_overlaps(case: AuditCase, findings: AuditFindings) -> None:
    """Check `overlaps`: each pair once, with its areas, and that none fires together.

    A group may hold a pair of which few samples get light from both: the planner's may
    have missed them. It may not where so many do that this is no chance.
    """
    document, estimator = case.plan.document, case.estimator
    names = [projector.id for projector in document.projectors]
    falls = {
        name: light_falls(projector, case.samples, case.shadow)
        for name, projector in zip(names, case.projectors, strict=True)
    }
    pairs = {frozenset(pair) for pair in combinations(names, 2)}
    listed = [frozenset(overlap.projectors) for overlap in document.overlaps]
    findings.holds(
        set(listed) == pairs and len(listed) == len(pairs),
        "overlaps",
        f"must name each of the {len(pairs)} pairs of {', '.join(names)} exactly once",
    )
    for overlap in document.overlaps:
        one, other = overlap.projectors
        if frozenset(overlap.projectors) in pairs:
            key, both = f"overlaps.{one} + {other}", falls[one] & falls[other]
            claimed = overlap.target_m2
            estimator.audit(f"{key}.target_m2", claimed, both, findings)
            claimed = overlap.surface_m2
            estimator.audit(
                f"{key}.surface_m2", claimed, both, findings, part="surface"
            )
    schedule = document.firing_schedule
    for group in () if schedule is None else schedule.groups:
        for one, other in combinations([n for n in group if n in falls], 2):
            both = falls[one] & falls[other]
            findings.holds(
                not _clearly_some(both, estimator),
                "firing_schedule.groups",
                f"{one} and {other} fire together, but light of both falls on "
                f"{1e4 * estimator.area(both):.3g} cm²",
            )


def light_falls(
    projector: AuditProjector, samples: AuditSamples, shadow: Shadow
) -> NDArray[np.bool_]:
    """Return on which samples any light of a projector falls, shape (n,).

    Its last annulus ends one gap beyond its last ring.
    """
    before, last = (0.0, *projector.radii)[-2:]
    outer = replace(projector, radii=np.array([last, last + (last - before)]))
    along, length = projector.light.to_points(samples.points)
    falls = outer.in_beam(samples.points) & (length >= 0.0)
    falls &= -dot(samples.normals, along) >= _GRAZING
    chosen = np.flatnonzero(falls)
    way = samples.points[chosen], along[chosen], length[chosen]
    free = shadow.free(way[0], samples.faces[chosen], *way[1:])
    falls[chosen] = free & free_of(projector.blocks, *way)
    return falls


def _clearly_some(both: NDArray[np.bool_], estimator: Estimator) -> bool:
    """Whether that many samples can't be what a set of the planner's size misses."""
    inside = estimator.samples.in_target
    for within in (inside, ~inside):
        n, k = int(within.sum()), int((both & within).sum())
        if n == 0:
            continue
        p = (k + 1.0) / (n + 2.0)
        error = np.sqrt(p * (1.0 - p) * (1.0 / n + 1.0 / max(estimator.n_claimed, 1)))
        if k / n > _DEVIATIONS * error:
            return True
    return False
