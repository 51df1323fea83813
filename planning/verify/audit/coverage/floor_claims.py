"""Claims about what is lit and measured of each region, and about floors."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Ints, Mask, rows_of
from planning.model.document.coverage_records import (
    ProjectorMarginal,
    RegionCoverage,
    RegionRecord,
)
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.audit_samples import AuditSamples, draw_region
from planning.verify.audit.estimates import POINT, ROUNDING, pooled_error
from planning.verify.audit.predicates.examined import what_any_could, what_devices_do
from planning.verify.audit.predicates.recompute import Reachable, Recomputed
from planning.verify.audit.predicates.view_pairs import CAUSES

# Samples of the audit in a large region, and of the plan, which earns no more tolerance
# for stating fewer.
_AT_LEAST, _CLAIMED = 500, 400
_SLACK = 1e-9


# What becomes of samples, what could, and which region they lie in.
_Parts = Sequence[tuple[Recomputed, Reachable]]


def audit_floors(case: AuditCase, findings: AuditFindings) -> None:
    """Check `centre_m` and `coverage` of regions, their floors, the worst of each row.

    Plans from before have none of these, and no floors.
    """
    plan, large = case.plan, case.large_regions
    parts = region_parts(case) if any(r.coverage for r in plan.document.regions) else ()
    share = plan.requirements.region_coverage
    for region in plan.document.regions:
        below = findings.at(f"regions.{region.id}")
        _audit_centre(case, region, below)
        if region.coverage is None:
            missing = share > 0.0 and region.id in large
            below.holds(not missing, "coverage", "is missing, but a floor is asked for")
            continue
        floor = region.coverage.floor
        expected = _floor(region.coverage, share) if region.id in large else None
        below.same("coverage.floor", floor, expected, "by its areas the floor")
        if region.area_m2 > 0.0:
            lit = region.coverage.lit_m2 / region.area_m2
            below.number("lit_fraction", region.lit_fraction, lit, ROUNDING, "")
            _audit_coverage(case, region, region.coverage, parts, below.at("coverage"))
    _audit_worst(case, large, findings)


def _floor(areas: RegionCoverage, share: float) -> str | None:
    """Whether a floor of this share is met, by the areas as they are claimed."""
    if not share > 0.0:
        return None
    lit = areas.lit_m2 >= share * areas.reachable_by_projectors_m2 * (1.0 - _SLACK)
    enough = share * areas.reachable_by_cameras_m2 * (1.0 - _SLACK)
    return "met" if lit and areas.measured_m2 >= enough else "missed"


def _audit_centre(
    case: AuditCase, region: RegionRecord, findings: AuditFindings
) -> None:
    surface, mesh = case.plan.surface, case.plan.surface.mesh
    faces = surface.region == region.id
    weights = mesh.face_areas[faces]
    if region.centre_m is None or not weights.sum() > 0.0:
        return
    middle = weights @ rows_of(mesh.face_centroids, faces) / weights.sum()
    whose = "the mean of its faces' centroids"
    findings.same("centre_m", region.centre_m, middle, whose, ROUNDING * mesh.radius)


def _audit_coverage(
    case: AuditCase,
    region: RegionRecord,
    areas: RegionCoverage,
    parts: _Parts,
    findings: AuditFindings,
) -> None:
    """Check that the areas are parts of each other, and what they and causes are.

    A share of the audit's samples of the region and of the plan's may differ by 1 % and
    four standard errors, for there are hundreds of shares. Where no sample of either
    fell into it there is nothing to compare.
    """
    inside = [actual.samples.region == region.id for actual, _ in parts]

    def joined(columns: Iterable[NDArray[Any]]) -> NDArray[Any]:
        pairs = zip(columns, inside, strict=True)
        return np.concatenate([column[..., mask] for column, mask in pairs], axis=-1)

    covered = {
        "measured_m2": joined(a.measured for a, _ in parts),
        "reachable_by_cameras_m2": joined(r.cameras for _, r in parts),
        "lit_m2": joined(a.lit for a, _ in parts),
        "reachable_by_projectors_m2": joined(r.projectors for _, r in parts),
    }
    cause = joined(actual.cause for actual, _ in parts)
    large, whole, n = region.id in case.large_regions, region.area_m2, len(cause)
    fallen = case.plan.coverage.samples * min(whole / case.estimator.target_m2, 1.0)
    n_claimed = max(areas.samples, int(fallen), _CLAIMED if large else 0)
    unmeasured = whole - areas.measured_m2
    if areas.samples < 1:
        findings.holds(not large, "samples", f"{areas.samples!r} of a large region")
        return
    claimed = {name: getattr(areas, name) for name in covered}
    for (smaller, low), (larger, high) in pairwise((claimed | {"area": whole}).items()):
        findings.holds(
            -ROUNDING * whole <= low <= high + ROUNDING * whole,
            smaller,
            f"claimed {low:.6g} m², must lie between 0 and {larger} = {high:.6g} m²",
        )
    causes = areas.uncovered_by_cause
    unknown = ", ".join(sorted(set(causes) - set(CAUSES)))
    key = "uncovered_by_cause"
    findings.holds(not unknown, key, f"causes that there are not: {unknown}")
    findings.number(f"{key} (sum)", sum(causes.values()), unmeasured, 1e-4 * whole)
    if n == 0:
        return
    masks = {name: (claimed[name], mask) for name, mask in covered.items()}
    masks |= {
        f"{key}.{cause}": (causes.get(cause, 0.0), mask)
        for cause, mask in _by_cause(cause)
    }
    names, by = [camera.id for camera in case.plan.cameras], areas.measured_by
    stranger = ", ".join(sorted(set(by) - set(names)))
    findings.holds(not stranger, "measured_by", f"cameras that aren't: {stranger}")
    masks |= {
        f"measured_by.{name}": (by.get(name, 0.0), mask)
        for name, mask in zip(
            names, joined(a.measured_by for a, _ in parts), strict=True
        )
    }
    for name, (area, mask) in masks.items():
        count = float(mask.sum())
        error = pooled_error(count, n, area / whole, max(n_claimed, 1))
        findings.number(name, area, whole * count / n, (POINT + 4.0 * error) * whole)


def _by_cause(cause: Ints) -> Iterator[tuple[str, Mask]]:
    """Yield each cause and where it is the one; an obstacle's stands in two places."""
    for name in dict.fromkeys(CAUSES):
        yield name, np.isin(cause, [k for k, c in enumerate(CAUSES) if c == name])


def region_parts(case: AuditCase) -> _Parts:
    """The audit's samples, and more of large regions in which they are too few."""
    parts = [(case.actual, case.reachable)]
    surface, region = case.plan.surface, case.samples.region
    lacking = {r: _AT_LEAST - int((region == r).sum()) for r in case.large_regions}
    more = [
        draw_region(surface, r, n, case.seed)
        for r, n in sorted(lacking.items())
        if n > 0
    ]
    if more:
        actual = what_devices_do(case.plan, AuditSamples.joined(more), case.shadow)
        reachable = what_any_could(case.plan, actual, case.shadow, case.seed)
        parts.append((actual, reachable))
    return parts


def _audit_worst(case: AuditCase, large: set[int], findings: AuditFindings) -> None:
    """Check which region each row of `marginal` calls the worst.

    The row of the plan's own count follows from its regions; of others, whose poses
    aren't written, only that it names a large region and a share.
    """
    document = case.plan.document
    shares = {
        region.id: areas.lit_m2 / areas.reachable_by_projectors_m2
        for region in document.regions
        if (areas := region.coverage) is not None
        and region.id in large
        and areas.reachable_by_projectors_m2 > 0.0
    }
    for row in document.marginal:
        if not isinstance(row, ProjectorMarginal):
            continue
        below = findings.at(f"marginal.projectors.{row.n_projectors}")
        if row.n_projectors == len(document.projectors) and shares:
            key, least = "worst_region", min(shares.values())
            below.number(f"{key}_lit", row.worst_region_lit, least, 1e-6, "")
            whose = shares.get(-1 if row.worst_region is None else row.worst_region)
            below.holds(
                whose is not None and whose <= least + 1e-6,
                key,
                f"{row.worst_region!r} is claimed, lit {whose!r}, but the least "
                f"share of a large region is {least:.6g}",
            )
        elif shares or row.worst_region is not None:
            worst, share = row.worst_region, row.worst_region_lit
            below.holds(
                worst in large and share is not None and 0 <= share <= 1,
                "worst_region",
                f"{worst!r} at {share!r} must be a large region and a share",
            )
        else:
            share = row.worst_region_lit
            below.holds(share is None, "worst_region", f"None is lit {share!r}")
