"""Claims that follow from others of the same document: rig, scales, rings and cost."""

import math
from typing import Any

import numpy as np

from planning.model.plan import RigPlan
from planning.verify.audit.ledger import Ledger, as_number, entries

_ROUNDING = 1e-9
_RELATIVE = 1e-6
# Metres of one file unit; a mesh that was scaled to a size names no such unit.
_METRES = {"um": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}
_DEGREE = math.pi / 180.0
# Largest s_N isn't among them: the command line may ask for another accuracy.
_LIMITS = (
    ("projector_max_incidence_deg", "projector", "max_incidence", _DEGREE),
    ("min_tangent_angle_deg", "projector", "min_tangent_angle", _DEGREE),
    ("camera_max_incidence_deg", "camera", "max_incidence", _DEGREE),
    ("min_conditioning", "triangulation", "min_conditioning", 1.0),
    ("noise_px", "triangulation", "noise_px", 1.0),
    ("min_ring_pitch_px", "triangulation", "min_ring_pitch_px", 1.0),
)


def audit_consistency(plan: RigPlan, ledger: Ledger) -> None:
    """Check what needs no recomputation: values that others of the plan determine."""
    _audit_rig(plan, ledger)
    _audit_workspace_values(plan, ledger)
    _audit_rings(plan, ledger)
    _audit_scales(plan, ledger)
    _audit_cost(plan, ledger)


def _audit_rig(plan: RigPlan, ledger: Ledger) -> None:
    """The rig's kind of light and limits are those of the devices and requirements."""
    light = ledger.read("rig", "light")
    for projector in plan.projectors:
        ledger.holds(
            projector.light == light,
            f"{projector.id}.light",
            f"claimed {projector.light!r}, but rig.light is {light!r}",
        )
    limits = ledger.read("rig", "limits")
    if not ledger.holds(isinstance(limits, dict), "rig.limits", "is missing"):
        return
    for name, part, wish, unit in _LIMITS:
        stated, asked = limits.get(name), ledger.read("requirements", part, wish)
        key = f"requirements.{part}.{wish}"
        if stated is None or as_number(stated) is None:
            ledger.holds(
                stated is None and asked is None,
                key,
                f"claimed {asked!r}, but rig.limits.{name} is {stated!r}",
            )
            continue
        value = unit * float(stated)
        ledger.number(key, asked, value, _ROUNDING, f"(rig.limits.{name})")


def _audit_workspace_values(plan: RigPlan, ledger: Ledger) -> None:
    space = plan.requirements.workspace
    key = "requirements.workspace"
    for name, vector in (("up", space.up), ("axis", space.axis)):
        length = float(np.linalg.norm(vector))
        ledger.holds(
            len(vector) == 3 and abs(length - 1.0) <= _RELATIVE,
            f"{key}.{name}",
            f"{list(vector)} must be a unit vector, its length is {length:.6g}",
        )
    ledger.holds(
        0.0 < space.half_angle <= math.pi + _ROUNDING,
        f"{key}.half_angle",
        f"{space.half_angle:.6g} rad must lie in (0, pi]",
    )
    for name, shell in (
        ("projector_radius_m", space.projector_radius_m),
        ("camera_radius_m", space.camera_radius_m),
    ):
        ledger.holds(
            0.0 < shell[0] <= shell[1],
            f"{key}.{name}",
            f"{list(shell)} m must be positive and rise",
        )


def _audit_rings(plan: RigPlan, ledger: Ledger) -> None:
    """Reference projectors and planned ones show the same outermost ring."""
    last = plan.requirements.workspace.reference_ring_radius
    for projector in plan.projectors:
        ledger.number(
            f"{projector.id}.ring_radii (last)",
            float(projector.ring_radii[-1]),
            last,
            _ROUNDING,
            "",
        )


def _audit_scales(plan: RigPlan, ledger: Ledger) -> None:
    for place, mesh in enumerate(entries(plan.to_document()["meshes"])):
        key = f"meshes.{place}.scale_to_m"
        unit, scale = mesh.get("unit"), as_number(mesh.get("scale_to_m"))
        if scale is None or not scale > 0.0:
            ledger.fail(key, f"{mesh.get('scale_to_m')!r} must be positive")
        elif isinstance(unit, str) and unit in _METRES:
            truth = _METRES[unit]
            ledger.number(key, scale, truth, _RELATIVE * truth, f"m ({unit})")
        else:
            ledger.holds(
                unit == "size_mm",
                f"meshes.{place}.unit",
                f"{unit!r} isn't one of {', '.join(_METRES)}, size_mm",
            )


def _audit_cost(plan: RigPlan, ledger: Ledger) -> None:
    """Eq. (8): C = pixels (t1 + t2) + t3 + t4 + t5, from the entry's own times."""
    cost = plan.to_document().get("cost")
    if not ledger.holds(isinstance(cost, dict), "cost", "is missing"):
        return
    assert isinstance(cost, dict)
    sizes = [camera.device.resolution for camera in plan.cameras]
    pixels = float(sum(width * height for width, height in sizes))
    if cost.get("pixels") is not None:
        ledger.number("cost.pixels", cost["pixels"], pixels, 0.0, "px")
    if cost.get("C") is not None:
        _audit_total("C", cost, pixels, ledger)
    before = as_number(cost.get("n_cameras_before"))
    greedy = ledger.read("certificates", "cameras", "greedy_count")
    ledger.holds(
        before is None or before == as_number(greedy),
        "cost.n_cameras_before",
        f"{cost.get('n_cameras_before')!r} is claimed, but "
        f"certificates.cameras.greedy_count is {greedy!r}",
    )
    if cost.get("C_before") is not None and before is not None and sizes:
        _audit_total("C_before", cost, pixels * before / len(sizes), ledger)


def _audit_total(
    name: str, cost: dict[str, Any], pixels: float, ledger: Ledger
) -> None:
    times = [as_number(cost.get(f"t{i}")) for i in range(1, 6)]
    known = [time for time in times if time is not None and time >= 0.0]
    if len(known) < len(times):
        ledger.fail(f"cost.{name}", f"is claimed with the times {times}")
        return
    t1, t2, t3, t4, t5 = known
    total = pixels * (t1 + t2) + t3 + t4 + t5
    ledger.number(f"cost.{name}", cost[name], total, _RELATIVE * (1.0 + total), "s")
