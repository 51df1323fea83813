"""Claims that follow from others: marginal gains, shares, limits, scales and cost."""

import math
from itertools import pairwise

import numpy as np

from planning.model.light.drawn_edges import CAMERA_PX, IN_FOCUS_M
from planning.model.plan import RigPlan
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings, square_centimetres
from planning.verify.audit.estimates import POINT, ROUNDING


def marginal_of(plan: RigPlan, kind: str, part: str) -> list[tuple[int, float]]:
    """Return (count, area of `target` or `surface` in [m²]), by rising count.

    What is lit by so many a `projector`, or measured by so many a `camera`.
    """
    count, area = f"n_{kind}s", f"{_verb(kind)}_{part}_m2"
    return sorted(
        (getattr(row, count), getattr(row, area))
        for row in plan.document.marginal
        if count in type(row).model_fields
    )


def _verb(kind: str) -> str:
    return "lit" if kind == "projector" else "measured"


def audit_tables(case: AuditCase, findings: AuditFindings) -> None:
    """Check the marginal table."""
    for kind in case.kinds:
        verb, chosen = _verb(kind.name), np.any(kind.covers, axis=0)
        for part, (_, whole) in case.estimator.wholes().items():
            table = marginal_of(case.plan, kind.name, part)
            counts = [number for number, _ in table]
            findings.holds(
                min(counts, default=0) > 0
                and counts.count(len(kind.devices)) == 1
                and len(set(counts)) == len(counts),
                f"marginal.{kind.name}s",
                f"rows of {counts} devices: each number once, among them the plan's "
                f"{len(kind.devices)}",
            )
            # Alone, fewer cameras than must see what counts measure nothing.
            least = case.plan.requirements.min_views or 1
            for number, area in table:
                key = f"marginal.{kind.name}s.{number}.{verb}_{part}_m2"
                if number == len(kind.devices):
                    case.estimator.audit(key, area, chosen, findings, part=part)
                    continue
                most = whole * (1.0 + ROUNDING) if number >= least else 0.0
                findings.holds(
                    0.0 <= area <= most,
                    key,
                    f"{area!r} is claimed, must be an area of at most "
                    f"{square_centimetres(most)}",
                )
        slack = case.estimator.tolerance(
            chosen & case.samples.in_target, case.estimator.target_m2
        )
        # On the target more devices do more; on the surface one more may add less.
        table = marginal_of(case.plan, kind.name, "target")
        floored = case.plan.requirements.region_coverage > 0.0
        for (fewer, less), (number, more) in pairwise(table):
            # Those chosen to meet the floors of regions may cover less in all.
            chosen = fewer < kind.proof.needed.count <= number
            if floored and (chosen or number == kind.proof.count):
                continue
            findings.holds(
                more >= less - slack,
                f"marginal.{kind.name}s",
                f"{verb}_target_m2 falls from {square_centimetres(less)} with "
                f"{fewer} {kind.name}{'s' * (fewer != 1)} to "
                f"{square_centimetres(more)} with {number}, more than sampling "
                f"explains ({square_centimetres(slack)})",
            )


def audit_shares(case: AuditCase, findings: AuditFindings) -> None:
    """Check the dominant share and the mesh areas."""
    document, surface = case.plan.document, case.plan.surface
    total = surface.mesh.area
    share = float(surface.mesh.face_areas[surface.in_dominant].sum() / total)
    claimed = document.surface.dominant_share
    findings.number("surface.dominant_share", claimed, share, ROUNDING, "")
    areas = sum(mesh.area_m2 for mesh in document.meshes)
    findings.number("meshes.area_m2 (sum)", areas, total, POINT * 1e-2 * total)


_ROUNDING = 1e-9
_RELATIVE = 1e-6
# Metres of one file unit; a mesh that was scaled to a size names no such unit.
_METRES = {"um": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}
_DEGREE = math.pi / 180.0
# Largest s_N isn't among them: the command line may ask for another accuracy.
_LIMITS: tuple[tuple[str, str, str, float], ...] = (
    ("projector_max_incidence_deg", "projector", "max_incidence", _DEGREE),
    ("min_tangent_angle_deg", "projector", "min_tangent_angle", _DEGREE),
    ("camera_max_incidence_deg", "camera", "max_incidence", _DEGREE),
    ("noise_px", "triangulation", "noise_px", 1.0),
)
_OF_RINGS = (
    ("min_conditioning", "triangulation", "min_conditioning", 1.0),
    ("min_ring_pitch_px", "triangulation", "min_ring_pitch_px", 1.0),
)
_RING_SIGMA = ("ring_sigma_mm", "triangulation", "ring_sigma_m", 1e-3)
_OF_PIXELS = (
    ("min_angle_deg", "triangulation", "min_angle", _DEGREE),
    ("max_angle_deg", "triangulation", "max_angle", _DEGREE),
)
# Where a rig states none, docs/reference/rig-files.md.
_ANGLES = {
    "dense": {"min_angle_deg": 10.0, "max_angle_deg": 90.0},
    "none": {"min_angle_deg": 10.0, "max_angle_deg": 60.0},
}


def audit_limits(case: AuditCase, findings: AuditFindings) -> None:
    """The rig's limits are those of the requirements; a pattern has none of another."""
    limits = case.plan.document.rig.limits
    pattern = case.plan.requirements.pattern
    own, others = _OF_RINGS, _OF_PIXELS
    if pattern != "rings":
        own, others = _OF_PIXELS, (*_OF_RINGS, _RING_SIGMA)
    for name, part, wish, unit in _LIMITS + own:
        stated, whose = limits.get(name), f"rig.limits.{name}"
        if stated is None:
            stated = _ANGLES.get(pattern, {}).get(name)
        truth = None if stated is None else unit * stated
        required = getattr(getattr(case.plan.requirements, part), wish)
        key = f"requirements.{part}.{wish}"
        findings.same(key, required, truth, whose, _ROUNDING)
    for _, part, wish, _ in others:
        key, claimed = f"requirements.{part}.{wish}", case.plan.requirements
        required = getattr(getattr(claimed, part), wish)
        none = 0.0 if wish == "min_conditioning" else None
        findings.same(key, required, none, f"that of the pattern {pattern!r}")
    ambient = case.plan.document.rig.check.get("ambient")
    if ambient is not None:
        key, claimed = "requirements.check.ambient", case.plan.requirements.check
        findings.same(key, claimed.ambient, ambient, "rig.check.ambient", _ROUNDING)
    _audit_drawn_edges(case.plan, findings)


def _audit_drawn_edges(plan: RigPlan, findings: AuditFindings) -> None:
    """Edges are as blurred as the check renders them, in focus where the rig's are.

    A plan that doesn't say what was asked is from before, and may say nothing of them.
    """
    findings = findings.at("requirements.triangulation.drawn_edges")
    drawn = plan.requirements.triangulation.drawn_edges
    model = plan.document.rig.projector
    focus, pixel_um = model.figures.focus, model.figures.pixel_um
    if drawn is None or plan.cameras_alone:
        findings.holds(
            (drawn is None) is plan.cameras_alone or plan.document.request is None,
            "",
            f"{drawn!r} is claimed, but light draws edges unless cameras are alone",
        )
        return
    place, pupil = None, 0.0
    if focus is not None and pixel_um is not None and model.K is not None:
        place = 1e-3 * focus.distance_mm
        focal_px = math.sqrt(model.K[0][0] * model.K[1][1])
        pupil = 1e-6 * pixel_um * focal_px / focus.f_number
    rigs, rendered = "rig.projector.figures.focus", "what the check renders with"
    for name, claimed, truth, whose in (
        ("focus_m", drawn.focus_m, place, rigs),
        ("aperture_m", drawn.aperture_m, pupil, rigs),
        ("in_focus_m", drawn.in_focus_m, IN_FOCUS_M, rendered),
        ("camera_px", drawn.camera_px, CAMERA_PX, rendered),
    ):
        findings.same(name, claimed, truth, whose, _ROUNDING)


def audit_scales(case: AuditCase, findings: AuditFindings) -> None:
    """Check that units and scales of the mesh files agree."""
    for place, mesh in enumerate(case.plan.document.meshes):
        key, truth = f"meshes.{place}.scale_to_m", _METRES.get(mesh.unit)
        findings.holds(
            mesh.scale_to_m > 0.0, key, f"{mesh.scale_to_m!r} must be positive"
        )
        findings.holds(
            truth is not None or mesh.unit == "size_mm",
            f"meshes.{place}.unit",
            f"{mesh.unit!r} isn't one of {', '.join(_METRES)}, size_mm",
        )
        if truth is not None:
            unit = f"m ({mesh.unit})"
            findings.number(key, mesh.scale_to_m, truth, _RELATIVE * truth, unit)
