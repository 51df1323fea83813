"""Claims about light: the rig's figures, exposures, and how bright samples come out."""

from math import log, sqrt

import numpy as np

from geometry.arrays import Array
from geometry.rays.proximity import closest_points
from planning.model.document.device_records import ExposureRecord, GreySample
from planning.model.document.input_records import RigRecord
from planning.model.light.light_budget import LightBudget
from planning.model.plan import RigPlan
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.predicates.light_levels import LightLevels

_EXACT, _ROUNDED = 1e-9, 1e-6
# Of the brightest, the farthest and the most grazing of some samples, against others.
_EXTREME = 0.03
# With what chance samples of the audit may deny an extreme that is true.
_CHANCE = 1e-7
# How full a planned exposure may be.
_FULL = 0.95 * 255.0
_AS_WRITTEN = (
    *("lumens", "contrast", "room_lux", "lumens_per_watt", "transmission"),
    *("quantum_efficiency", "full_well_e", "read_noise_e", "bits", "min_contrast"),
)


def audit_exposures(case: AuditCase, findings: AuditFindings) -> None:
    """Check what a plan says of light: all of it, or nothing."""
    light = case.plan.requirements.triangulation.light
    stated = bool(case.plan.document.rig.photometry)
    findings.holds(
        (light is not None) == stated,
        "requirements.triangulation.light",
        "there without `rig.photometry`, or the other way round",
    )
    if light is not None and stated:
        _audit_light(case.plan, light, findings.at("requirements.triangulation.light"))
    for p, record in enumerate(case.plan.document.projectors):
        below = findings.at(f"projectors.{p}.exposure")
        if (record.exposure is None) != (light is None):
            below.fail("", "there without `requirements.triangulation.light`, or not")
        elif record.exposure is not None and light is not None:
            _audit_time(case, p, record.exposure.exposure_s, light, below)
            _audit_extremes(case, p, record.exposure, light, below)


def _audit_light(plan: RigPlan, light: LightBudget, below: AuditFindings) -> None:
    """The figures that light is computed with are the rig's."""
    rig, whose = plan.document.rig, "the rig's"
    camera, refresh = rig.camera, rig.projector.figures.frame_rate_hz
    for name in _AS_WRITTEN:
        if name in rig.photometry:
            truth = rig.photometry[name]
            below.same(name, getattr(light, name), truth, whose, _EXACT)
    albedo = rig.photometry.get("albedo")
    pair = np.broadcast_to(albedo or 0.0, 2)
    below.same("albedo", light.albedo, pair, whose, _EXACT)
    gain = 10.0 ** (rig.photometry.get("gain_db", 0.0) / 20.0)
    below.same("gain", light.gain, gain, whose, _EXACT)
    stop = camera.figures.focus and camera.figures.focus.f_number
    below.same("f_number", light.f_number, stop, whose, _EXACT)
    side = 1e-6 * (camera.figures.pixel_um or 0.0)
    below.same("pixel_m", light.pixel_m, side, whose, 1e-15)
    matrix = camera.K
    focal = 0.0 if matrix is None else sqrt(matrix[0][0] * matrix[1][1])
    below.same("focal_px", light.focal_px, focal, whose, 1e-6)
    period = None if refresh is None else 1.0 / refresh
    below.same("period_s", light.period_s, period, whose, _EXACT)
    longest = _longest_s(plan.document.rig)
    below.same("max_exposure_s", light.max_exposure_s, longest, whose, 1e-9)


def _longest_s(rig: RigRecord) -> float | None:
    """The longest exposure [s]: as written, else the camera's in whole refreshes.

    One refresh at least; None: the rig says nothing that it follows from.
    """
    written, stated = rig.photometry.get("max_exposure_ms"), rig.camera.figures
    rate = rig.projector.figures.frame_rate_hz
    if written is not None:
        return 1e-3 * written
    own = None if stated.exposure_ms is None else 1e-3 * stated.exposure_ms
    return own if rate is None else max(round((own or 0.0) * rate), 1) / rate


def _audit_time(
    case: AuditCase, p: int, time: float, light: LightBudget, below: AuditFindings
) -> None:
    """An exposure is allowed, and the longest under which nothing lit clips."""
    step = light.period_s or 0.0
    whole = not step or (
        time > 0.5 * step and abs(time / step - round(time / step)) < 1e-6
    )
    below.holds(
        0.0 < time <= light.max_exposure_s * (1.0 + _EXACT) and whole,
        "exposure_s",
        f"{1e3 * time:.4g} ms must be whole refreshes of {1e3 * step:.4g} ms, at most "
        f"{1e3 * light.max_exposure_s:.4g} ms",
    )
    samples = case.samples
    lit = samples.in_target & case.actual.lit_by[p]
    if not (time > 0.0 and lit.any()):
        return
    levels = LightLevels.of(
        light, case.projectors[p], samples.points[lit], samples.normals[lit]
    )
    brightest = float(levels.brightest.max())
    words = f"{1e3 * time:.4g} ms makes {brightest:.0f} grey levels of the brightest"
    below.holds(
        brightest <= _FULL * (1.0 + _EXTREME) or time <= step * (1.0 + _EXACT),
        "exposure_s",
        f"{words}, at most {_FULL:.0f}",
    )
    longer = time + step if step else time * (1.0 + _EXTREME)
    below.holds(
        longer > light.max_exposure_s * (1.0 + _EXACT)
        or brightest * longer / time > _FULL * (1.0 - _EXTREME),
        "exposure_s",
        f"{words}; {1e3 * longer:.4g} ms wouldn't clip it yet",
    )


def n_beyond(values: Array, largest: float) -> int:
    """Return how many lie beyond an extreme by more than it may be written off.

    In parallel light all of a plane is equally bright, but for rounding.
    """
    return int((values > largest + _ROUNDED * max(largest, 1.0)).sum())


def most_beyond(case: AuditCase) -> float:
    """Return how many of m samples may lie beyond the largest of n others.

    k or more do with a chance of (m / (m + n))^k at most.
    """
    m, n = int(case.samples.in_target.sum()), case.estimator.n_claimed
    return log(_CHANCE) / log(m / (m + max(n, 1))) if m else 0.0


def _audit_extremes(
    case: AuditCase,
    p: int,
    record: ExposureRecord,
    light: LightBudget,
    below: AuditFindings,
) -> None:
    """No more of the assigned samples lie beyond than their draw explains."""
    samples, projector = case.samples, case.projectors[p]
    chosen = samples.in_target & (case.actual.primary == p)
    points = samples.points[chosen]
    along, _ = projector.light.to_points(points)
    away = np.linalg.norm(points - projector.world_from_device[:3, 3], axis=1)
    angles = np.arccos(-(samples.normals[chosen] * along).sum(axis=1))
    levels = LightLevels.of(light, projector, points, samples.normals[chosen])
    for name, values, grey, claimed in (
        ("farthest", away, record.farthest, "distance_m"),
        ("most_grazing", angles, record.most_grazing, "incidence"),
        ("brightest", levels.brightest, record.brightest, "lit"),
    ):
        largest = -np.inf
        if grey is not None:
            _audit_grey(case, p, grey, light, below.at(name))
            largest = np.max(getattr(grey, claimed))
        n = n_beyond(values, float(largest))
        below.holds(
            n <= most_beyond(case),
            name,
            f"{n} of {len(values)} samples assigned to it lie beyond",
        )


def _audit_grey(
    case: AuditCase, p: int, grey: GreySample, light: LightBudget, below: AuditFindings
) -> None:
    """A sample lies on the surface, and is as bright as its place makes it."""
    point, normal = np.array([grey.point_m]), np.array([grey.normal])
    mesh, projector = case.plan.surface.mesh, case.projectors[p]
    foot = closest_points(mesh, point)
    off = float(abs(foot.distances[0]))
    turned = float(np.abs(mesh.face_normals[foot.faces] - normal).max())
    below.holds(off <= 1e-6 and turned <= 1e-6, "point_m", "isn't of the surface")
    along, _ = projector.light.to_points(point)
    levels = LightLevels.of(light, projector, point, normal)
    away = np.linalg.norm(point[0] - projector.world_from_device[:3, 3])
    below.number("distance_m", grey.distance_m, float(away), _ROUNDED, "m")
    incidence = float(np.arccos(np.clip(-(along @ normal[0]), -1.0, 1.0))[0])
    below.number("incidence", grey.incidence, incidence, _ROUNDED, "rad")
    for name, claimed, electrons in (
        ("lit", grey.lit, levels.lit),
        ("dark", grey.dark, levels.dark),
    ):
        truth: Array = levels.grey(electrons) * np.array(light.albedo)
        below.same(name, list(claimed), truth, "recomputed", _ROUNDED * truth.max())
