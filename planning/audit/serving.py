"""Claims about who serves what: least margins, and the regions' projectors."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from planning.plan import RigPlan

from .areas import ROUNDING
from .estimates import POINT, Estimator
from .ledger import Ledger, as_number
from .occlusion import Shadow
from .recompute import Recomputed, light_only
from .samples import samples_at_centroids

# Two honest sets of samples may miss the very least margin by so much.
_MARGIN_SLACK = np.radians(2.0)


def audit_serving(
    plan: RigPlan, own: Recomputed, estimator: Estimator, shadow: Shadow, ledger: Ledger
) -> None:
    """Check min_margin_rad, and area_m2, n_faces, lit_by, lit_fraction of regions."""
    within = plan.surface.target_faces(plan.requirements.target)
    centroids = samples_at_centroids(plan.surface, within)
    _, at_centroids = light_only(plan, centroids, shadow)
    target = own.samples.in_target
    margins = np.hstack([own.margins[:, target], at_centroids])
    region = np.concatenate([own.samples.region[target], centroids.region])
    for row, entry in enumerate(plan.document["projectors"]):
        served = target & (own.server == row)
        key, claimed = f"{entry['id']}.min_margin_rad", entry.get("min_margin_rad")
        _audit_margin(
            key, claimed, own.margins[row, served], _served(margins, row), ledger
        )
    numbers = {
        int(number): index
        for index, number in enumerate(np.unique(region[region >= 0]).tolist())
    }
    listed = _listed(plan.document["regions"])
    ledger.holds(
        set(listed) == set(numbers),
        "regions",
        f"ids {sorted(listed)}, but surface.npz has {sorted(numbers)}",
    )
    for number in sorted(set(listed) & set(numbers)):
        near = margins[:, region == number]
        _audit_region(plan, number, listed[number], near, own, estimator, ledger)


def _served(margins: NDArray[np.float64], row: int) -> NDArray[np.float64]:
    """Margins of what one projector serves, or all but serves, shape (k,)."""
    best = margins.max(axis=0, initial=-np.inf)
    mine = margins[row]
    return mine[np.isfinite(mine) & (mine >= best - _MARGIN_SLACK)]


def _audit_margin(
    key: str,
    claimed: object,
    served: NDArray[np.float64],
    nearly: NDArray[np.float64],
    ledger: Ledger,
) -> None:
    """The least margin over samples is an extreme: few may undercut it, none by far.

    Not more than 1 % (and three standard errors) of the served area may have a smaller
    margin than claimed, and somewhere the margin must be as small, within 2 degrees.
    """
    value = as_number(claimed)
    if value is None:
        ledger.holds(
            claimed is None and len(served) == 0,
            key,
            f"{claimed!r} is claimed, but it serves {len(served)} samples of the audit",
        )
        return
    ledger.holds(
        value >= -ROUNDING, key, f"{value:.6g} rad: a lit sample's is 0 or more"
    )
    if len(served) == 0:
        ledger.holds(
            len(nearly) > 0, key, f"{value:.6g} rad is claimed, but it serves nothing"
        )
        return
    n = len(served)
    share = float((served < value - ROUNDING).mean())
    allowed = POINT + 3.0 * float(np.sqrt(share * n + 1.0) / (n + 2.0))
    ledger.holds(
        share <= allowed,
        key,
        f"claimed {value:.6g} rad, but {100 * share:.3g} % of the area it serves has "
        f"a smaller margin (least {served.min():.6g} rad), {100 * allowed:.2g} % may",
    )
    least = float(min(served.min(), nearly.min(initial=np.inf)))
    ledger.holds(
        value >= least - _MARGIN_SLACK,
        key,
        f"claimed {value:.6g} rad, recomputed {least:.6g} rad, "
        f"tolerance {_MARGIN_SLACK:.2g} rad",
    )


def _listed(regions: list[dict[str, Any]]) -> dict[int, dict[str, Any]]:
    """Regions by the number that their faces carry; other ids count by their place."""
    return {
        entry["id"] if isinstance(entry.get("id"), int) else place: entry
        for place, entry in enumerate(regions)
    }


def _audit_region(
    plan: RigPlan,
    number: int,
    claims: dict[str, Any],
    margins: NDArray[np.float64],
    own: Recomputed,
    estimator: Estimator,
    ledger: Ledger,
) -> None:
    key = f"regions.{number}"
    faces = plan.surface.region == number
    area = float(plan.surface.mesh.face_areas[faces].sum())
    ledger.number(f"{key}.area_m2", claims.get("area_m2"), area, ROUNDING * area)
    ledger.number(f"{key}.n_faces", claims.get("n_faces"), float(faces.sum()), 0.0, "")
    inside = own.samples.region == number
    n = int(inside.sum())
    if n:
        lit = inside & own.lit
        fraction = float(lit.sum()) / n
        # A share of one region: both samplings are conditioned on falling into it.
        n_claimed = max(estimator.n_claimed * area / estimator.target_m2, 1.0)
        p = (fraction * n + 1.0) / (n + 2.0)
        error = np.sqrt(p * (1.0 - p) * (1.0 / n + 1.0 / n_claimed))
        tolerance = POINT + 3.0 * float(error)
        ledger.number(
            f"{key}.lit_fraction", claims.get("lit_fraction"), fraction, tolerance, ""
        )
    _audit_lit_by(plan, key, claims.get("lit_by"), margins, own.server[inside], ledger)


def _audit_lit_by(
    plan: RigPlan,
    key: str,
    lit_by: object,
    margins: NDArray[np.float64],
    server: NDArray[np.int64],
    ledger: Ledger,
) -> None:
    """A projector that clearly serves a part must be named, one that can't must not."""
    names = [projector.id for projector in plan.projectors]
    if not ledger.holds(
        isinstance(lit_by, list) and set(lit_by) <= set(names),
        f"{key}.lit_by",
        f"{lit_by!r} must list ids of projectors",
    ):
        return
    assert isinstance(lit_by, list)
    n = max(len(server), 1)
    for row, name in enumerate(names):
        count = int((server == row).sum())
        allowed = POINT + 3.0 * float(np.sqrt(count + 1.0)) / n
        if name not in lit_by:
            ledger.holds(
                count / n <= allowed,
                f"{key}.lit_by",
                f"{name} isn't named, but serves {100 * count / n:.3g} % of the region",
            )
        else:
            ledger.holds(
                count > 0 or len(_served(margins, row)) > 0,
                f"{key}.lit_by",
                f"{name} is named, but serves no sample of the region",
            )
