"""Claims about margins, and dominant regions: their size, and who lights them."""

import numpy as np

from geometry.arrays import Array, Mask, rows_of
from planning.model.document.coverage_records import RegionRecord
from planning.model.document.input_records import SelectionRecord
from planning.model.requirements import ProjectorLimits
from planning.model.surface import Surface
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.audit_samples import AuditSamples, samples_at_centroids
from planning.verify.audit.estimates import POINT, ROUNDING, pooled_error
from planning.verify.audit.predicates.predicates import OCCLUDED, light_steps
from planning.verify.audit.predicates.recompute import light_of_plan

# Two honest sets of samples may miss the very least margin by so much.
MARGIN_SLACK = np.radians(2.0)
# Room for the rounding of a written direction or angle [rad].
_ANGLE = 1e-4
# Standard errors that a share may lie off by chance.
_ERRORS = 3.0
# Share of a region's area whose normals its cone holds.
_HELD = 0.98
_OF_NO_FILE = ("curvature", "outside")
_SELECTIONS = (*_OF_NO_FILE, "faces", "vertex_weight")


def audit_margins(case: AuditCase, findings: AuditFindings) -> None:
    """Check min_margin_rad of every projector, on the target.

    The least margin over samples is an extreme: few may undercut it, none by far. Not
    more than 1 % (and three standard errors) of the assigned area may have a smaller
    margin than claimed, and somewhere in the lit area, of which any sliver may be
    assigned, the margin must be as small, within 2 degrees. There the centroids of all
    faces of the target help to find the least. A projector with no samples has none;
    of the audit's more than by chance mustn't be assigned to it then.
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
        below = findings.at(f"{projector.id}.min_margin_rad")
        if projector.min_margin_rad is None:
            _audit_unassigned(len(assigned), int(target.sum()), case, below)
        else:
            _audit_margin(projector.min_margin_rad, assigned, lit, below)


def _audit_unassigned(
    n_assigned: int, n: int, case: AuditCase, findings: AuditFindings
) -> None:
    """A sliver of the target may hold samples of the audit and none of the plan's.

    No more of n than three standard errors of the difference of both shares.
    """
    error = pooled_error(n_assigned, max(n, 1), 0.0, case.estimator.n_earned)
    allowed = int(_ERRORS * error * n)
    findings.holds(
        n_assigned <= allowed,
        "",
        f"None is claimed, but {n_assigned} of {n} samples of the audit are assigned "
        f"to it, {allowed} may be by chance",
    )


def _audit_margin(
    claimed: float, assigned: Array, lit: Array, findings: AuditFindings
) -> None:
    n = len(assigned)
    if len(lit) == 0:
        findings.fail("", f"{claimed:.6g} rad is claimed, but it lights no sample")
        return
    findings.holds(
        claimed >= -ROUNDING, "", f"{claimed:.6g} rad: a lit sample's is 0 or more"
    )
    findings.holds(
        claimed >= lit.min() - MARGIN_SLACK,
        "",
        f"claimed {claimed:.6g} rad, recomputed {lit.min():.6g} rad, "
        f"tolerance {MARGIN_SLACK:.2g} rad",
    )
    if n == 0:
        return
    share = float((assigned < claimed - ROUNDING).mean())
    allowed = POINT + _ERRORS * float(np.sqrt(share * n + 1.0) / (n + 2.0))
    findings.holds(
        share <= allowed,
        "",
        f"claimed {claimed:.6g} rad, but {100 * share:.3g} % of its area has a smaller "
        f"margin (least {assigned.min():.6g} rad), {100 * allowed:.2g} % may",
    )


def audit_regions(case: AuditCase, findings: AuditFindings) -> None:
    """Check ids, area_m2, n_faces, normals, lit_by and lit_fraction of regions."""
    surface = case.plan.surface
    centroids = samples_at_centroids(surface, surface.in_dominant)
    lightable = _lightable(case, centroids)
    listed = {region.id: region for region in case.plan.document.regions}
    numbers = {int(number) for number in centroids.region}
    findings.holds(
        set(listed) == numbers,
        "regions",
        f"ids {sorted(listed)}, but surface.npz has {sorted(numbers)}",
    )
    _audit_selection(case, findings.at("surface.selection"))
    for number in sorted(set(listed) & numbers):
        region, chosen = listed[number], centroids.region == number
        below = findings.at(f"regions.{number}")
        _audit_size(case, region, below)
        _audit_fraction(case, region, below)
        _audit_lit_by(case, region, np.any(lightable[:, chosen], axis=1), below)


def _audit_selection(case: AuditCase, findings: AuditFindings) -> None:
    """Check what is said of the faces that were chosen; who chose them is no claim."""
    selection, surface = case.plan.document.surface.selection, case.plan.surface
    kind = case.plan.document.faces_chosen_by
    target = case.plan.requirements.target
    findings.holds(
        (kind == "outside") == (target == "outside"),
        "kind",
        f"is {kind!r}, but requirements.target is {target!r}",
    )
    if selection is None:
        return
    _audit_faces(selection, surface, surface.region >= 0, findings)
    own = selection.source, selection.sha256, selection.n_removed_by_repair
    findings.holds(
        selection.kind not in _OF_NO_FILE or own == (None, None, 0),
        "source",
        f"{own} is told of faces that were chosen by {selection.kind}, of no file",
    )
    findings.holds(
        selection.kind in _SELECTIONS,
        "kind",
        f"is {selection.kind!r}, must be one of {_SELECTIONS}",
    )


def _audit_faces(
    record: SelectionRecord | RegionRecord,
    surface: Surface,
    chosen: Mask,
    findings: AuditFindings,
) -> None:
    area = float(surface.mesh.face_areas[chosen].sum())
    findings.number("area_m2", record.area_m2, area, ROUNDING * area)
    findings.number("n_faces", record.n_faces, float(chosen.sum()), 0.0, "faces")


def _lightable(case: AuditCase, samples: AuditSamples) -> Mask:
    """Whether each projector lights each sample but for shadows and 2 degrees.

    Where this holds nowhere in a region, no sample of it, however few, is assigned.
    """
    limits = case.plan.requirements.projector
    relaxed = ProjectorLimits(
        limits.max_incidence + MARGIN_SLACK, limits.min_tangent_angle - MARGIN_SLACK
    )
    steps = [light_steps(p, samples, relaxed, case.shadow) for p in case.projectors]
    return np.array(steps).reshape(len(steps), len(samples)) >= OCCLUDED


def _audit_size(case: AuditCase, region: RegionRecord, findings: AuditFindings) -> None:
    surface, mesh = case.plan.surface, case.plan.surface.mesh
    faces = surface.region == region.id
    _audit_faces(region, surface, faces, findings)
    areas, normals = mesh.face_areas[faces], rows_of(mesh.face_normals, faces)
    mean = areas @ normals
    length = float(np.linalg.norm(mean))
    if length > ROUNDING * float(areas.sum()):
        whose = "the area-weighted mean of its faces' normals"
        claimed = region.mean_normal
        findings.same("mean_normal", claimed, mean / length, whose, _ANGLE)
        _audit_cone(region, normals, areas, findings)


def _audit_cone(
    region: RegionRecord, normals: Array, areas: Array, findings: AuditFindings
) -> None:
    """The angle about the mean normal that holds 98 % of a region's area.

    Where some faces hold just that, rounding says if one more is needed.
    """
    off = np.arccos(np.clip(normals @ np.array(region.mean_normal), -1.0, 1.0))
    order = np.argsort(off)
    held = np.cumsum(areas[order]) / areas.sum()
    angles = [
        float(off[order][np.argmax(held >= min(_HELD * share, held[-1]))])
        for share in (1.0 - ROUNDING, 1.0 + ROUNDING)
    ]
    truth = min(angles, key=lambda angle: abs(angle - region.cone_angle))
    findings.number("cone_angle", region.cone_angle, truth, 2.0 * _ANGLE, "rad")


def _audit_fraction(
    case: AuditCase, region: RegionRecord, findings: AuditFindings
) -> None:
    """Lit share of one region: both samplings are conditioned on falling into it.

    A region may hold a handful of samples, and there may be hundreds of them: the
    standard error is that of the pooled share, and four of them are tolerated.
    """
    inside = case.samples.region == region.id
    key, value, n = "lit_fraction", region.lit_fraction, int(inside.sum())
    if not findings.holds(0.0 <= value <= 1.0, key, f"{value!r} isn't a share"):
        return
    if n == 0:
        return
    fraction = float(case.actual.lit[inside].mean())
    share = case.estimator.area(inside) / case.estimator.target_m2
    n_claimed = max(case.estimator.n_claimed * share, 1.0)
    error = pooled_error(fraction * n, n, value, n_claimed)
    findings.number(key, value, fraction, POINT + 4.0 * error, "")


def _audit_lit_by(
    case: AuditCase, region: RegionRecord, lightable: Mask, findings: AuditFindings
) -> None:
    """Primary projectors of a region must be named; who can light none must not."""
    key, names = "lit_by", [p.id for p in case.plan.projectors]
    if not set(region.lit_by) <= set(names):
        findings.fail(key, f"{list(region.lit_by)!r} must list ids of projectors")
        return
    primary = case.actual.primary[case.samples.region == region.id]
    n = max(len(primary), 1)
    for p, name in enumerate(names):
        count = int((primary == p).sum())
        if name in region.lit_by:
            findings.holds(
                count > 0 or lightable[p],
                key,
                f"{name} is named, but can light no part of the region",
            )
            continue
        allowed = POINT + _ERRORS * float(np.sqrt(count + 1.0)) / n
        findings.holds(
            count / n <= allowed,
            key,
            f"{name} isn't named, but {100 * count / n:.3g} % of the region is "
            f"assigned to it",
        )
