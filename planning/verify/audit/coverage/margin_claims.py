"""Claims about the least margin of what each projector serves."""

import numpy as np
from numpy.typing import NDArray

from planning.model.plan import RigPlan
from planning.verify.audit.audit_samples import samples_at_centroids
from planning.verify.audit.estimates import POINT
from planning.verify.audit.ledger import Ledger, as_number
from planning.verify.audit.predicates.occlusion import Shadow
from planning.verify.audit.predicates.recompute import Recomputed, light_only

from .area_claims import ROUNDING

# Two honest sets of samples may miss the very least margin by so much.
MARGIN_SLACK = np.radians(2.0)


def audit_margins(
    plan: RigPlan, own: Recomputed, shadow: Shadow, ledger: Ledger
) -> None:
    """Check min_margin_rad of every projector, on the target.

    The least margin over samples is an extreme: few may undercut it, none by far. Not
    more than 1 % (and three standard errors) of the served area may have a smaller
    margin than claimed, and somewhere in the lit area, of which any sliver may be
    served, the margin must be as small, within 2 degrees. There the centroids of all
    faces of the target help to find the least. A projector that serves nothing has
    none.
    """
    within = plan.surface.target_faces(plan.requirements.target)
    centroids = samples_at_centroids(plan.surface, within)
    _, at_centroids = light_only(plan, centroids, shadow)
    target = own.samples.in_target
    for row, entry in enumerate(plan.to_document()["projectors"]):
        both = np.concatenate([own.margins[row, target], at_centroids[row]])
        served = own.margins[row, target & (own.server == row)]
        key = f"{entry['id']}.min_margin_rad"
        lit = both[np.isfinite(both)]
        _audit_margin(key, entry.get("min_margin_rad"), served, lit, ledger)


def _audit_margin(
    key: str,
    claimed: object,
    served: NDArray[np.float64],
    lit: NDArray[np.float64],
    ledger: Ledger,
) -> None:
    value = as_number(claimed)
    if value is None or len(lit) == 0:
        ledger.holds(
            claimed is None and len(served) == 0,
            key,
            f"{claimed!r} is claimed, but it serves {len(served)} samples of the audit",
        )
        return
    ledger.holds(
        value >= -ROUNDING, key, f"{value:.6g} rad: a lit sample's is 0 or more"
    )
    ledger.holds(
        value >= lit.min() - MARGIN_SLACK,
        key,
        f"claimed {value:.6g} rad, recomputed {lit.min():.6g} rad, "
        f"tolerance {MARGIN_SLACK:.2g} rad",
    )
    n = len(served)
    if n == 0:
        return
    share = float((served < value - ROUNDING).mean())
    allowed = POINT + 3.0 * float(np.sqrt(share * n + 1.0) / (n + 2.0))
    ledger.holds(
        share <= allowed,
        key,
        f"claimed {value:.6g} rad, but {100 * share:.3g} % of the area it serves has "
        f"a smaller margin (least {served.min():.6g} rad), {100 * allowed:.2g} % may",
    )
