"""Claims about ring axes: that they are centred, and what others would measure."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from geometry.arrays import Mask
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.devices.workspace_claims import audit_ring_frames
from planning.verify.audit.predicates.audit_devices import AuditProjector
from planning.verify.audit.predicates.predicates import LIT, MEASURED, light_steps
from planning.verify.audit.predicates.recompute import pairs_with

# Other samples reach a little farther: so much wider than the narrowest may a ring be,
# and so many may lie outside, which of few that are lit are most.
_WIDER, _OUTSIDE = 0.05, 10


def audit_ring_axes(case: AuditCase, findings: AuditFindings) -> None:
    """Check `ring_axes`; a plan without claims nothing."""
    axes, findings = case.plan.document.ring_axes, findings.at("ring_axes")
    if axes is None:
        return
    findings.holds(
        axes.asked in (axes.taken, "auto"),
        "taken",
        f"{axes.taken!r} is claimed where {axes.asked!r} was asked",
    )
    # A member's light is a part of what the axis is in the middle of.
    if axes.taken == "centred" and not case.plan.of_member:
        audit_centred(((case,),), findings)
    if axes.other is None:
        return
    others, below = axes.other.projectors, findings.at("other")
    ids = [record.id for record in case.plan.document.projectors]
    named = [other.id for other in others]
    if not below.holds(named == ids, "projectors", f"are {named}, the plan's {ids}"):
        return
    turned = [
        replace(
            projector,
            world_from_ring=np.array(other.world_from_ring),
            radii=np.array(other.ring_radii),
        )
        for projector, other in zip(case.projectors, others, strict=True)
    ]
    for projector in turned:
        frame = projector.world_from_ring
        audit_ring_frames("world_from_ring", projector.light, frame, below)
    claimed, measured = axes.other.measured_m2, _measured(case, turned)
    case.estimator.audit("measured_m2", claimed, measured, below, part="target")


def audit_centred(
    groups: Sequence[Sequence[AuditCase]], findings: AuditFindings
) -> None:
    """Check that hardly narrower rings about other axes hold what is lit in all cases.

    All cases are of the same projectors, each before a surface of its own; an axis is
    in the middle of what is lit in the cases of one group. A projector that keeps its
    rings is left out.
    """
    first = groups[0][0]
    for p, record in enumerate(first.plan.document.projectors):
        if record.rings is not None and record.rings.spacing == "kept":
            continue
        rings = [_rings_of(group, p) for group in groups]
        reach, least = min(rings, key=lambda ring: ring[0] - (1.0 + _WIDER) * ring[1])
        findings.at(record.id).holds(
            reach <= (1.0 + _WIDER) * least,
            "world_from_ring",
            f"is claimed to be centred, but what is lit reaches out to a ring of "
            f"{reach:.5g}, and about another axis to one of {least:.5g}",
        )


def _rings_of(cases: Sequence[AuditCase], p: int) -> tuple[float, float]:
    """Return the ring that holds what a projector lights, and the narrowest there is.

    Of few points nothing is said: 0 and 0.
    """
    projector = cases[0].projectors[p]
    lit = [case.samples.points[case.actual.lit_by[p]] for case in cases]
    points = np.concatenate(lit)
    if len(points) <= _OUTSIDE:
        return 0.0, 0.0
    reach = np.sort(projector.ring_coordinate(points))[-1 - _OUTSIDE]
    return float(reach), projector.light.narrowest_ring(points)


def _measured(case: AuditCase, projectors: Sequence[AuditProjector]) -> Mask:
    """Whether any pair measures each sample of the target, shape (n,)."""
    limits, chosen = case.plan.requirements, np.flatnonzero(case.samples.in_target)
    samples = case.samples.take(chosen)
    lit_by = np.stack(
        [light_steps(p, samples, limits.projector, case.shadow) for p in projectors]
    )
    measured = np.zeros(len(case.samples), dtype=bool)
    for camera in case.cameras:
        steps = pairs_with(
            camera, projectors, samples, lit_by == LIT, limits, case.shadow
        )
        measured[chosen] |= np.any(steps == MEASURED, axis=0)
    return measured
