"""Claims about devices that stand already: all are in the plan, where the rig says."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.devices import PinholeModel
from planning.model.plan import RigPlan
from planning.model.planned import PlannedCamera, PlannedProjector
from planning.verify.audit.ledger import Ledger, entries
from planning.verify.audit.predicates.audit_optics import pixels_of

_POSE = 1e-9
# Positions are written to 0.01 mm, typed rotations to four digits or more.
_POSITION_M = 1e-5
_TYPED = 1e-3
_PIXEL = 1e-3
_ROLL_RAD = 1e-6

_Device = PlannedProjector | PlannedCamera


def audit_existing(plan: RigPlan, ledger: Ledger) -> None:
    """Check existing devices against requirements, certificates and the rig."""
    for kind, devices in (("projector", plan.projectors), ("camera", plan.cameras)):
        stated = plan.requirements.existing_of(kind)
        marked = {d.existing: d for d in devices if d.existing}
        names = [device.name for device in stated]
        ledger.holds(
            sorted(marked) == sorted(names),
            f"{kind}s",
            f"{sorted(marked)} are marked existing, but requirements.existing has "
            f"{sorted(names)}",
        )
        for device in stated:
            if device.name in marked:
                ledger.array(
                    f"{marked[device.name].id}.world_from_device",
                    marked[device.name].world_from_device.tolist(),
                    np.array(device.world_from_device),
                    _POSE,
                    f"that of the existing {device.name!r}",
                )
        given = ledger.read("certificates", f"{kind}s", "given") or 0
        ledger.holds(
            given == len(stated),
            f"certificates.{kind}s.given",
            f"{given} is claimed, but {len(stated)} {kind}s stand already",
        )
    _audit_rig(plan, ledger)


def planned_only(
    poses: NDArray[np.float64], kind: str, plan: RigPlan
) -> NDArray[np.float64]:
    """Return the poses (n, 4, 4) that aren't those of existing devices."""
    left = np.ones(len(poses), dtype=bool)
    for device in plan.requirements.existing_of(kind.removesuffix("s")):
        off = np.abs(poses - np.array(device.world_from_device)).max(axis=(1, 2))
        left &= off > _POSE
    return poses[left]


def droppable(devices: Sequence[_Device]) -> list[int]:
    """Return the places of devices without which a plan may be."""
    return [place for place, device in enumerate(devices) if not device.existing]


def _audit_rig(plan: RigPlan, ledger: Ledger) -> None:
    stated = {str(table.get("name")): table for table in _tables(ledger)}
    names = [device.name for device in plan.requirements.existing]
    ledger.holds(
        sorted(stated) == sorted(names),
        "requirements.existing",
        f"holds {sorted(names)}, but rig.existing has {sorted(stated)}",
    )
    for device in (*plan.projectors, *plan.cameras):
        table = stated.get(device.existing)
        if table is None:
            continue
        kind = "camera" if isinstance(device, PlannedCamera) else "projector"
        ledger.holds(
            table["kind"] == kind,
            f"{device.id}.existing",
            f"is a {kind}, but rig.existing {device.existing!r} is a {table['kind']}",
        )
        if table.get("pose_mm") is None:
            _audit_aimed(plan, device, table, ledger)
        else:
            _audit_typed(plan, device, np.array(table["pose_mm"]), ledger)


def _tables(ledger: Ledger) -> Sequence[Mapping[str, Any]]:
    return entries(ledger.read("rig", "existing"))


def _audit_typed(
    plan: RigPlan, device: _Device, typed: NDArray[np.float64], ledger: Ledger
) -> None:
    pose, key = device.world_from_device, f"{device.id}.world_from_device"
    _audit_place(plan, device, typed[:3, 3], ledger)
    off = float(np.abs(pose[:3, :3] - typed[:3, :3]).max())
    ledger.holds(
        off <= _TYPED, key, f"its rotation differs from rig.existing's by {off:.2g}"
    )


def _audit_place(
    plan: RigPlan, device: _Device, place_mm: NDArray[np.float64], ledger: Ledger
) -> None:
    stated = np.array(plan.requirements.workspace.centre) + 1e-3 * place_mm
    off = float(np.linalg.norm(device.world_from_device[:3, 3] - stated))
    ledger.holds(
        off <= _POSITION_M,
        f"{device.id}.world_from_device",
        f"stands {1e3 * off:.3g} mm from where rig.existing has {device.existing!r}",
    )


def _audit_aimed(
    plan: RigPlan, device: _Device, table: Mapping[str, Any], ledger: Ledger
) -> None:
    """The aim is the middle of the image, and the image is turned by the roll."""
    place, aim = np.array(table["position_mm"]), np.array(table["aim_mm"])
    _audit_place(plan, device, place, ledger)
    key, turn = f"{device.id}.world_from_device", device.world_from_device[:3, :3]
    towards = (aim - place) / np.linalg.norm(aim - place)
    middle = turn.T @ towards
    model = device.device
    if isinstance(model, PinholeModel):
        centre = 0.5 * (np.array(model.resolution) - 1.0)
        off = float(np.linalg.norm(pixels_of(model, middle[None])[0] - centre))
        aimed = off <= _PIXEL and middle[2] > 0.0
    else:
        off, middle = float(np.linalg.norm(middle - [0.0, 0.0, 1.0])), np.eye(3)[2]
        aimed = off <= _ROLL_RAD
    if not ledger.holds(
        aimed, key, f"the aim of {device.existing!r} misses the image centre, {off:.3g}"
    ):
        return
    level = np.cross(towards, plan.requirements.workspace.up)
    if np.linalg.norm(level) < 1e-6:
        return
    level /= np.linalg.norm(level)
    # The image's x axis, had the middle ray been the optical axis.
    both = middle + [0.0, 0.0, 1.0]
    side = turn @ (np.array([1.0, 0.0, 0.0]) - middle[0] / (1.0 + middle[2]) * both)
    roll = np.arctan2(side @ np.cross(towards, level), side @ level)
    wrong = (roll - np.radians(table["roll_deg"]) + np.pi) % (2.0 * np.pi) - np.pi
    ledger.holds(
        abs(wrong) <= _ROLL_RAD,
        key,
        f"is rolled by {np.degrees(roll):.4g} degrees, rig.existing says "
        f"{table['roll_deg']:g}",
    )
