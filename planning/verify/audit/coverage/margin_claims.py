"""Claims about the least margin of what is assigned to each projector."""

import numpy as np
from numpy.typing import NDArray

from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.audit_samples import samples_at_centroids
from planning.verify.audit.estimates import POINT, ROUNDING
from planning.verify.audit.predicates.recompute import light_of_plan

# Two honest sets of samples may miss the very least margin by so much.
MARGIN_SLACK = np.radians(2.0)


def audit_margins(case: AuditCase, findings: AuditFindings) -> None:
    """Check min_margin_rad of every projector, on the target.

    The least margin over samples is an extreme: few may undercut it, none by far. Not
    more than 1 % (and three standard errors) of the assigned area may have a smaller
    margin than claimed, and somewhere in the lit area, of which any sliver may be
    assigned, the margin must be as small, within 2 degrees. There the centroids of all
    faces of the target help to find the least. A projector with no samples has none.
    """
    plan, actual = case.plan, case.actual
    within = plan.surface.target_faces(plan.requirements.target)
    centroids = samples_at_centroids(plan.surface, within)
    _, at_centroids = light_of_plan(plan, centroids, case.shadow)
    target = case.samples.in_target
    for p, projector in enumerate(plan.document.projectors):
        both = np.concatenate([actual.margins[p, target], at_centroids[p]])
        assigned = actual.margins[p, target & (actual.primary == p)]
        lit = both[np.isfinite(both)]
        key = f"{projector.id}.min_margin_rad"
        _audit_margin(key, projector.min_margin_rad, assigned, lit, findings)


def _audit_margin(
    key: str,
    claimed: float | None,
    assigned: NDArray[np.float64],
    lit: NDArray[np.float64],
    findings: AuditFindings,
) -> None:
    n = len(assigned)
    if claimed is None or len(lit) == 0:
        findings.holds(
            claimed is None and n == 0,
            key,
            f"{claimed!r} is claimed, but {n} samples of the audit are assigned to it",
        )
        return
    findings.holds(
        claimed >= -ROUNDING, key, f"{claimed:.6g} rad: a lit sample's is 0 or more"
    )
    findings.holds(
        claimed >= lit.min() - MARGIN_SLACK,
        key,
        f"claimed {claimed:.6g} rad, recomputed {lit.min():.6g} rad, "
        f"tolerance {MARGIN_SLACK:.2g} rad",
    )
    if n == 0:
        return
    share = float((assigned < claimed - ROUNDING).mean())
    allowed = POINT + 3.0 * float(np.sqrt(share * n + 1.0) / (n + 2.0))
    findings.holds(
        share <= allowed,
        key,
        f"claimed {claimed:.6g} rad, but {100 * share:.3g} % of its area has a smaller "
        f"margin (least {assigned.min():.6g} rad), {100 * allowed:.2g} % may",
    )
