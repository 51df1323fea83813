"""What was asked against what was used: pair by pair, and by the parts' digests."""

import math
from collections.abc import Iterator
from typing import Any

from planning.model.document.input_records import RigRecord
from planning.model.document.request_records import RequestRecord, asked_digest
from planning.model.plan import RigPlan

from .audit_case import AuditCase
from .audit_findings import AuditFindings

_ROUNDING = 1e-12
_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
# Keys of the rig's tables that nothing but themselves may replace.
_CHECK = ("max_rms", "max_p95", "max_bias")
_SHARES = ("min_completeness", "max_predicted_missing")
_CALIBRATION = (
    ("angle", "angle_deg", math.pi / 180.0),
    ("position_m", "position_mm", 1e-3),
    ("focal", "focal_percent", 1e-2),
    ("principal_px", "principal_px", 1.0),
)
_MOUNTING = (
    ("position_m", "position_mm", 1e-3),
    ("angle", "angle_deg", math.pi / 180.0),
    ("focal", "focal_percent", 1e-2),
)

# What a rig states in full wherever a plan says what was asked of it.
_STATED = {
    "requirements": (
        *("coverage", "dominant_coverage", "min_reachable"),
        *("region_coverage", "region_share"),
    ),
    "limits": (
        *("projector_max_incidence_deg", "min_tangent_angle_deg"),
        *("camera_max_incidence_deg", "max_sample_distance_mm", "min_conditioning"),
        *("noise_px", "min_ring_pitch_px", "max_sigma_mm", "ring_sigma_mm"),
        *("min_angle_deg", "max_angle_deg"),
    ),
    "workspace": ("shape", "axis", "half_angle_deg", "floor_mm", "up"),
    "rings": (
        *("tilt", "shift_m", "gap_m", "spacing", "axis", "margin_m", "outer_radius"),
    ),
    "calibration": tuple(stated for _, stated, _ in _CALIBRATION),
    "check": (*(f"{name}_mm" for name in _CHECK), *_SHARES, "ambient"),
}

# Key and value of what was used, key and value of what was asked or is available.
_Pair = tuple[str, Any, str, Any]


def audit_request(case: AuditCase, findings: AuditFindings) -> None:
    """Check that what was used is what was asked, of the rig that the plan names.

    Tables that a rig doesn't state bind nothing.
    """
    pairs = list(_of_rig(case.plan))
    request = case.plan.document.request
    if request is not None:
        pairs += [*_of_request(case.plan, request), *_defaults(case.plan, request)]
        _audit_stated(case.plan, findings.at("rig"))
        _audit_stations(case.plan, request, findings)
    for key, used, whose, asked in pairs:
        findings.same(key, used, asked, whose, _ROUNDING)
    _audit_digests(case.plan, findings)


def _audit_stated(plan: RigPlan, findings: AuditFindings) -> None:
    """Check that the rig states what is compared: a limit left out binds nothing."""
    rig = plan.document.rig
    for table, names in _STATED.items():
        stated = getattr(rig, table)
        for name in names:
            findings.holds(name in stated, f"{table}.{name}", "is missing")
    for name in ("standoff_m", "standoff_play_m"):
        findings.holds(getattr(rig, name) is not None, name, "is missing")
    for place, model in enumerate(rig.models("projector")):
        key = "projector" if place == 0 else f"more_projectors.{place - 1}"
        findings.same(f"{key}.light", model.light, rig.light, "rig.light")


def _audit_stations(
    plan: RigPlan, request: RequestRecord, findings: AuditFindings
) -> None:
    """No more heads stand than were asked for, and no more devices at any step.

    Before a turntable numbers are asked of a step, and used of all of them.
    """
    rig, told = plan.document.rig, plan.document.stations
    steps = () if told is None else told.stations
    if rig.turntable is None:
        for whose, most in (
            ("request.max_heads", request.max_heads),
            ("rig.stations.max", rig.stations and rig.stations.max),
        ):
            findings.holds(
                most is None or len(steps) <= most,
                "stations",
                f"{len(steps)} are planned, but {whose} is {most}",
            )
    for kind in ("projector", "camera"):
        name, (whose, most) = f"max_{kind}s", _most(rig, request, kind)
        if rig.turntable is not None and steps and most is not None:
            used = getattr(plan.requirements, name)
            there = max(len(getattr(step, f"{kind}s")) for step in steps)
            findings.holds(
                used is not None and used <= len(steps) * most and there <= most,
                f"requirements.{name}",
                f"{used} is claimed of {len(steps)} steps, and {there} {kind}s are at "
                f"one, but {whose} is {most}",
            )
        if rig.head is not None and request.max_heads is not None:
            each = sum(device.kind == kind for device in rig.head.devices)
            asked, truth = getattr(request, name), each * request.max_heads
            findings.same(f"request.{name}", asked, truth, "that of all heads")


def _most(rig: RigRecord, request: RequestRecord, kind: str) -> tuple[str, int | None]:
    """Return how many devices are allowed, and whose number that is.

    The fewer of what was asked and what the rig counts; of several models covers count
    each for itself.
    """
    models, name = rig.models(kind), f"max_{kind}s"
    asked = getattr(request, name)
    count = models[0].count if len(models) == 1 else None
    if count is None or (asked is not None and asked <= count):
        return f"request.{name}", asked
    return f"rig.{kind}.count", count


def _of_request(plan: RigPlan, request: RequestRecord) -> Iterator[_Pair]:
    """Yield what was used beside what was asked."""
    used, document = plan.requirements, plan.document
    # Tighter ones are used where drawn rigs must meet what was asked.
    as_asked: Any = used.robust or used
    sources = {
        "target": used,
        "pattern": used,
        "min_reachable": used,
        "coverage": as_asked,
        "dominant_coverage": as_asked,
        "region_coverage": as_asked,
    }
    turned = document.rig.turntable is not None
    if not turned or document.stations is None:
        for kind in ("projector", "camera"):
            key = f"max_{kind}s"
            most = _most(document.rig, request, kind)
            yield f"requirements.{key}", getattr(used, key), *most
    for name, source in sources.items():
        key = f"requirements.{name}"
        yield key, getattr(source, name), f"request.{name}", getattr(request, name)
    limits = used.triangulation
    sigma = used.robust.max_sigma_m if used.robust else limits.max_sigma_m
    asked = None if request.accuracy_mm is None else 1e-3 * request.accuracy_mm
    key = "requirements.triangulation"
    yield f"{key}.max_sigma_m", sigma, "request.accuracy_mm [m]", asked
    yield (
        f"{key}.accuracy_of",
        limits.accuracy_of,
        "request.accuracy_of",
        request.accuracy_of,
    )
    sign = -1.0 if request.up.startswith("-") else 1.0
    up = [sign * x for x in _AXES[request.up[-1]]]
    yield "requirements.workspace.up", used.workspace.up, "request.up", up
    quantile = None if used.robust is None else used.robust.quantile
    yield "requirements.robust.quantile", quantile, "request.robust", request.robust
    if used.pattern == "none":
        views = 2 if request.views is None else request.views
        yield "requirements.min_views", used.min_views, "request.views", views
    else:
        kept = used.survival
        have = (1, 0) if kept is None else (kept.views, kept.survive)
        asks = request.views or 1, request.survive
        yield "requirements.survival", have, "request.views, request.survive", asks
    heads, stations = request.max_heads is not None, document.stations is not None
    if turned:
        yield "request.max_heads (there)", heads, "that of a turntable", False
    else:
        yield "stations (there)", stations, "request.max_heads (there)", heads
    if not document.truncated:
        yield (
            "joint (there)",
            document.joint is not None,
            "request.joint",
            request.joint,
        )
    axes = document.ring_axes
    if axes is not None:
        yield "ring_axes.asked", axes.asked, "request.ring_axis", request.ring_axis
    routes = document.certificates.cameras.routes
    if routes is not None:
        key = "certificates.cameras.routes.asked"
        yield key, routes.asked, "request.cameras_by", request.cameras_by


def _defaults(plan: RigPlan, request: RequestRecord) -> Iterator[_Pair]:
    """Yield what was asked by nobody beside what the rig says."""
    rig = plan.document.rig
    for name in ("coverage", "dominant_coverage", "min_reachable", "region_coverage"):
        if name not in request.given and name in rig.requirements:
            value = getattr(request, name)
            yield (
                f"request.{name}",
                value,
                f"rig.requirements.{name}",
                rig.requirements[name],
            )
    for name, table, key in (
        ("accuracy_mm", rig.limits, "limits.max_sigma_mm"),
        ("up", rig.workspace, "workspace.up"),
        ("ring_axis", rig.rings, "rings.axis"),
    ):
        place = key.rpartition(".")[2]
        wants = name != "ring_axis" or request.pattern == "rings"
        if name not in request.given and place in table and wants:
            yield f"request.{name}", getattr(request, name), f"rig.{key}", table[place]


def _of_rig(plan: RigPlan) -> Iterator[_Pair]:
    """Yield what was used of limits that only the rig states."""
    used, rig = plan.requirements, plan.document.rig
    if "region_share" in rig.requirements:
        yield (
            "requirements.region_share",
            used.region_share,
            "rig.requirements.region_share",
            rig.requirements["region_share"],
        )
    for name in _CHECK:
        if (stated := rig.check.get(f"{name}_mm")) is not None:
            value, whose = getattr(used.check, f"{name}_m"), f"rig.check.{name}_mm [m]"
            yield f"requirements.check.{name}_m", value, whose, 1e-3 * stated
    for name in _SHARES:
        if name in rig.check:
            value, whose = getattr(used.check, name), f"rig.check.{name}"
            yield f"requirements.check.{name}", value, whose, rig.check[name]
    if "max_sample_distance_mm" in rig.limits:
        stated = _metres(rig.limits["max_sample_distance_mm"])
        whose = "rig.limits.max_sample_distance_mm [m]"
        value = used.camera.max_sample_distance_m
        yield "requirements.camera.max_sample_distance_m", value, whose, stated
        value = used.projector.max_sample_distance_m
        own = stated if used.pattern == "dense" else None
        yield "requirements.projector.max_sample_distance_m", value, whose, own
    if "ring_sigma_mm" in rig.limits and used.pattern == "rings":
        stated = _metres(rig.limits["ring_sigma_mm"])
        key = "requirements.triangulation.ring_sigma_m"
        value = used.triangulation.ring_sigma_m
        yield key, value, "rig.limits.ring_sigma_mm [m]", stated
    if used.robust is not None:
        for name, key, unit in _MOUNTING:
            value = getattr(used.robust.mounting, name)
            stated, whose = rig.mounting.get(key, 0.0), f"rig.mounting.{key}"
            where = f"requirements.robust.mounting.{name}"
            yield where, value, whose, unit * stated
    for name, key, unit in _CALIBRATION:
        if key in rig.calibration:
            stated = rig.calibration[key]
            errors = used.triangulation.calibration
            value = 0.0 if errors is None else getattr(errors, name)
            where = f"requirements.triangulation.calibration.{name}"
            whose = f"rig.calibration.{key}"
            number = isinstance(stated, int | float)
            yield where, value, whose, unit * stated if number else stated


def _metres(length_mm: float | None) -> float | None:
    return None if length_mm is None else 1e-3 * length_mm


def _audit_digests(plan: RigPlan, findings: AuditFindings) -> None:
    """Check that parts were derived from what stands in the plan, where they say so."""
    document = plan.document
    truth = asked_digest(document.request, document.requirements, document.rig)
    parts = {
        "coverage": document.coverage.asked,
        "certificates": document.certificates.asked,
    }
    if document.reconstruction is not None:
        parts["reconstruction"] = document.reconstruction.asked
        # Which plan it was of is compared where it is said (`contradictions`).
        findings.holds(
            document.reconstruction.plan is not None or document.request is None,
            "reconstruction.plan",
            "is missing: nothing says of which plan the check was",
        )
    for name, digest in parts.items():
        findings.holds(
            digest == truth or (digest is None and document.request is None),
            f"{name}.asked",
            f"is {(digest or 'missing')[:16]}, and request, requirements and rig have "
            f"{truth[:16]}: one of them was edited afterwards",
        )
