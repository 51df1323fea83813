"""Claims about the rig's optics: that they follow from the figures beside them."""

import math
from typing import cast

import numpy as np

from geometry.arrays import Array
from planning.model.document.input_records import FiguresRecord, ModelRecord
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings

# Of the larger of two numbers that were rounded once.
_ROUNDING = 1e-9
_PIXELS = 1e-6


def audit_optics(case: AuditCase, findings: AuditFindings) -> None:
    """Check optics of all models of a rig that says what was asked of it.

    `docs/reference/rig-files.md` has the formulas. Plans without a request may be of
    devices that nobody wrote figures of.
    """
    if case.plan.document.request is None:
        return
    rig = case.plan.document.rig
    for kind in ("projector", "camera"):
        for place, model in enumerate(rig.models(kind)):
            key = kind if place == 0 else f"more_{kind}s.{place - 1}"
            audit_model(model, kind, findings.at(f"rig.{key}"))


def audit_model(model: ModelRecord, kind: str, findings: AuditFindings) -> None:
    """Check optics of a model of a `projector` or a `camera`."""
    figures, whose = model.figures, "by its figures"
    findings.same("resolution", model.resolution, figures.resolution_px, whose)
    _audit_body(model, findings)
    if model.K is None:
        for name, used, written in (
            ("pixel_pitch_m", model.pixel_pitch_m, figures.pixel_pitch_mm),
            ("beam_radius", model.beam_radius, figures.beam_radius_mm),
        ):
            length = None if written is None else 1e-3 * written
            findings.same(name, used, length, whose, _ROUNDING)
        ends = None if figures.range_mm is None else 1e-3 * np.array(figures.range_mm)
        findings.same("range_m", model.range_m, ends, whose, _ROUNDING)
        return
    focal = _focal_px(figures)
    if not findings.holds(focal, "figures", "say no focal length"):
        return
    focal = cast(tuple[float, float], focal)
    image = np.array(
        [[focal[0], 0.0, 0.0], [0.0, focal[1], 0.0], [0.0, 0.0, 1.0]], dtype=float
    )
    image[:2, 2] = _principal(figures, model.resolution)
    findings.same("K", model.K, image, whose, _PIXELS)
    # Rings are drawn as if a projector's lens were straight.
    bent = figures.distortion if kind == "camera" else None
    terms = 5 * [0.0] if bent is None else list(bent)
    findings.same("distortion", model.distortion, terms, whose, _ROUNDING)
    low, high = figures.range_mm or (0.0, math.inf)
    near, far = 0.0, math.inf
    if figures.focus is not None:
        sharp = _sharp_m(figures, math.sqrt(focal[0] * focal[1]))
        if not findings.holds(sharp, "figures.focus", "makes no image"):
            return
        near, far = cast(tuple[float, float], sharp)
    ends = [max(1e-3 * low, near), min(1e-3 * high, far)]
    findings.same("range_m", model.range_m, ends, whose, _ROUNDING)


def _audit_body(model: ModelRecord, findings: AuditFindings) -> None:
    """Compare the housing: written by its middle and its sides in millimetres."""
    written, body = model.figures.body or {}, model.body
    for name, key, scale in (
        ("centre_m", "centre_mm", 1e-3),
        ("half_m", "size_mm", 0.5e-3),
    ):
        used = None if body is None else getattr(body, name)
        stated = written.get(key)
        truth = None if stated is None else scale * np.array(stated)
        findings.same(f"body.{name}", used, truth, "by its figures", _ROUNDING)


def _focal_px(figures: FiguresRecord) -> tuple[float, float] | None:
    """Focal lengths along x and y; None where nothing says them."""
    if figures.focal_px is not None:
        return figures.focal_px
    if figures.throw_ratio is not None and figures.resolution_px is not None:
        focal = figures.throw_ratio * figures.resolution_px[0]
    elif figures.focal_mm is not None and figures.pixel_um:
        focal = 1e3 * figures.focal_mm / figures.pixel_um
    else:
        return None
    return (focal, focal) if focal > 0.0 else None


def _principal(figures: FiguresRecord, resolution: tuple[int, int]) -> Array:
    """Where the optical axis meets the image; an offset is of half the height."""
    if figures.principal_point_px is not None:
        return np.array(figures.principal_point_px)
    middle = 0.5 * (np.array(resolution) - 1.0)
    offset = (figures.vertical_offset_percent or 0.0) / 100.0
    return middle + [0.0, offset * 0.5 * resolution[1]]


def _sharp_m(figures: FiguresRecord, focal_px: float) -> tuple[float, float] | None:
    """Depths at which a lens set to one blurs by the circle c; None: it can't be set.

    The lens is v behind the panel, 1/v = 1/f - 1/s. A point at z is in focus at w,
    1/w = 1/f - 1/z, and the cone from the aperture A is |v - w| A / w wide at v: so
    1/z = 1/s -+ c / (A v).
    """
    focus, pixel_um = figures.focus, figures.pixel_um
    if focus is None or not pixel_um:
        return None
    focal = 1e-6 * pixel_um * focal_px
    distance, circle = 1e-3 * focus.distance_mm, 1e-6 * pixel_um * focus.blur_px
    if not (distance > focal > 0.0 and circle > 0.0):
        return None
    behind = 1.0 / (1.0 / focal - 1.0 / distance)
    off = circle * focus.f_number / (focal * behind)
    far = 1.0 / distance - off
    return 1.0 / (1.0 / distance + off), 1.0 / far if far > 0.0 else math.inf
