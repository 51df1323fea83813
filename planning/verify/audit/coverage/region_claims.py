"""Claims about the dominant regions: their size, and who lights them how far."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planning.model.plan import RigPlan
from planning.model.requirements import ProjectorLimits
from planning.verify.audit.audit_samples import AuditSamples, samples_at_centroids
from planning.verify.audit.estimates import POINT, Estimator
from planning.verify.audit.ledger import Ledger, as_number
from planning.verify.audit.predicates.occlusion import Shadow
from planning.verify.audit.predicates.predicates import LIGHT_CAUSES, light_steps
from planning.verify.audit.predicates.recompute import Recomputed, audit_projectors

from .area_claims import ROUNDING
from .margin_claims import MARGIN_SLACK

# Room for the rounding of a written direction or angle [rad].
_ANGLE = 1e-4
_SELECTIONS = ("curvature", "faces", "vertex_weight")


def audit_regions(
    plan: RigPlan, own: Recomputed, estimator: Estimator, shadow: Shadow, ledger: Ledger
) -> None:
    """Check ids, area_m2, n_faces, normals, lit_by and lit_fraction of regions."""
    centroids = samples_at_centroids(plan.surface, plan.surface.in_dominant)
    able = _able(plan, centroids, shadow)
    numbers = {int(number) for number in centroids.region}
    listed = _listed(plan.to_document()["regions"])
    ledger.holds(
        set(listed) == numbers,
        "regions",
        f"ids {sorted(listed)}, but surface.npz has {sorted(numbers)}",
    )
    _audit_selection(plan, ledger)
    for number in sorted(set(listed) & numbers):
        key, claims = f"regions.{number}", listed[number]
        inside = own.samples.region == number
        _audit_size(plan, number, key, claims, ledger)
        _audit_fraction(key, claims, inside, own, estimator, ledger)
        could = np.any(able[:, centroids.region == number], axis=1)
        _audit_lit_by(
            plan, key, claims.get("lit_by"), could, own.server[inside], ledger
        )


def _audit_selection(plan: RigPlan, ledger: Ledger) -> None:
    """Check what is said of the faces that were chosen; who chose them is no claim."""
    claims = ledger.read("surface", "selection")
    if claims is None:
        return
    key, chosen = "surface.selection", plan.surface.region >= 0
    area = float(plan.surface.mesh.face_areas[chosen].sum())
    for name, own, slack, unit in (
        ("n_faces", float(chosen.sum()), 0.0, ""),
        ("area_m2", area, ROUNDING * area, "m²"),
    ):
        claimed = ledger.read("surface", "selection", name)
        ledger.number(f"{key}.{name}", claimed, own, slack, unit)
    kind = ledger.read("surface", "selection", "kind")
    ledger.holds(
        kind in _SELECTIONS, f"{key}.kind", f"is {kind!r}, must be one of {_SELECTIONS}"
    )


def _listed(regions: list[dict[str, Any]]) -> dict[int, dict[str, Any]]:
    """Regions by the number that their faces carry; other ids count by their place."""
    return {
        entry["id"] if isinstance(entry.get("id"), int) else place: entry
        for place, entry in enumerate(regions)
    }


def _able(plan: RigPlan, samples: AuditSamples, shadow: Shadow) -> NDArray[np.bool_]:
    """Whether each projector lights each sample but for shadows and 2 degrees.

    Where this holds nowhere in a region, no sample of it, however few, can be served.
    """
    limits = plan.requirements.projector
    relaxed = ProjectorLimits(
        limits.max_incidence + MARGIN_SLACK, limits.min_tangent_angle - MARGIN_SLACK
    )
    steps = [
        light_steps(lamp, samples, relaxed, shadow) for lamp in audit_projectors(plan)
    ]
    return np.array(steps).reshape(-1, len(samples)) >= LIGHT_CAUSES.index(
        "projector_occlusion"
    )


def _audit_size(
    plan: RigPlan, number: int, key: str, claims: Mapping[str, Any], ledger: Ledger
) -> None:
    """Exact sums over faces."""
    mesh, faces = plan.surface.mesh, plan.surface.region == number
    area = float(mesh.face_areas[faces].sum())
    ledger.number(f"{key}.area_m2", claims.get("area_m2"), area, ROUNDING * area)
    ledger.number(f"{key}.n_faces", claims.get("n_faces"), float(faces.sum()), 0.0, "")
    if claims.get("mean_normal") is None:
        return
    mean = mesh.face_areas[faces] @ mesh.face_normals[faces]
    length = float(np.linalg.norm(mean))
    if length > ROUNDING * area:
        ledger.array(
            f"{key}.mean_normal",
            claims["mean_normal"],
            mean / length,
            _ANGLE,
            "the area-weighted mean of its faces' normals",
        )


def _audit_fraction(
    key: str,
    claims: Mapping[str, Any],
    inside: NDArray[np.bool_],
    own: Recomputed,
    estimator: Estimator,
    ledger: Ledger,
) -> None:
    """Lit share of one region: both samplings are conditioned on falling into it.

    A region may hold a handful of samples, and there may be hundreds of them: the
    standard error is that of the pooled share, and four of them are tolerated.
    """
    n = int(inside.sum())
    value = as_number(claims.get("lit_fraction"))
    if n == 0 or value is None or not 0.0 <= value <= 1.0:
        ledger.holds(
            value is not None and 0.0 <= value <= 1.0,
            f"{key}.lit_fraction",
            f"{claims.get('lit_fraction')!r} isn't a share",
        )
        return
    fraction = float((inside & own.lit).sum()) / n
    share = estimator.area(inside) / estimator.target_m2
    n_claimed = max(estimator.n_claimed * share, 1.0)
    p = (fraction * n + value * n_claimed + 1.0) / (n + n_claimed + 2.0)
    error = float(np.sqrt(p * (1.0 - p) * (1.0 / n + 1.0 / n_claimed)))
    tolerance = POINT + 4.0 * error
    ledger.number(f"{key}.lit_fraction", value, fraction, tolerance, "")


def _audit_lit_by(
    plan: RigPlan,
    key: str,
    lit_by: object,
    could: NDArray[np.bool_],
    server: NDArray[np.int64],
    ledger: Ledger,
) -> None:
    """Who clearly serves a part must be named; who can light none of it must not be."""
    names = [projector.id for projector in plan.projectors]
    if not isinstance(lit_by, list) or not set(lit_by) <= set(names):
        ledger.fail(f"{key}.lit_by", f"{lit_by!r} must list ids of projectors")
        return
    n = max(len(server), 1)
    for row, name in enumerate(names):
        count = int((server == row).sum())
        if name in lit_by:
            ledger.holds(
                count > 0 or could[row],
                f"{key}.lit_by",
                f"{name} is named, but can light no part of the region",
            )
            continue
        allowed = POINT + 3.0 * float(np.sqrt(count + 1.0)) / n
        ledger.holds(
            count / n <= allowed,
            f"{key}.lit_by",
            f"{name} isn't named, but serves {100 * count / n:.3g} % of the region",
        )
