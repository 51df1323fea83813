"""Claims about devices: number, poses, ring frames, models; existing ones."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from geometry.arrays import Array
from geometry.devices import PinholeModel
from planning.model.devices.bodies import Existing
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.document.device_records import CameraRecord, ProjectorRecord
from planning.model.document.input_records import RigRecord
from planning.model.document.plan_document import PlanDocument
from planning.model.plan import RigPlan
from planning.model.requirements import Workspace
from planning.verify.audit.audit_case import AuditCase, DeviceKind
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.predicates.audit_optics import pixels_of

from .workspace_claims import (
    POSITION_M,
    SAME_POSE,
    audit_poses,
    audit_ring_frames,
    in_room,
    outside_by,
)
from .zone_claims import origin_of

_MODEL = ("resolution", "range_m", "K", "distortion", "pixel_pitch_m", "beam_radius")
# Positions are written to 0.01 mm, typed rotations to four digits or more.
_POSITION_M = 1e-5
_TYPED = 1e-3
_PIXEL = 1e-3
_ROLL_RAD = 1e-6

_Device = PlannedProjector | PlannedCamera


def audit_devices(case: AuditCase, findings: AuditFindings) -> None:
    """Check ids, poses, ring frames and models of the devices, and their number."""
    document, space = case.plan.document, case.plan.requirements.workspace
    for kind in case.kinds:
        key, names = f"{kind.name}s", [record.id for record in kind.records]
        findings.holds(len(set(names)) == len(names), key, f"ids repeat: {names}")
        findings.holds(
            kind.most is None or len(names) <= kind.most,
            key,
            f"{len(names)} devices, requirements.max_{key} allows {kind.most}",
        )
        for record in kind.records:
            _audit_model(kind, record, document.rig, findings.at(record.id))
            poses, below = np.array([record.world_from_device]), findings.at(record.id)
            audit_poses("world_from_device", poses, below)
            position = in_room(case.plan, record.station, poses[:, :3, 3])
            excess = float(outside_by(position, kind.shell, space)[0])
            # An existing device stands where it stands: `audit_existing` checks that.
            below.holds(
                record.existing or excess <= POSITION_M,
                "world_from_device",
                f"position {np.round(position[0], 6).tolist()} m lies "
                f"{1e3 * excess:.3g} mm outside requirements.workspace",
            )
    for record, projector in zip(document.projectors, case.projectors, strict=True):
        below = findings.at(record.id)
        audit_poses("world_from_ring", np.array([record.world_from_ring]), below)
        ring = projector.world_from_ring
        audit_ring_frames("world_from_ring", projector.light, ring, below)
        if record.code is None:
            _audit_last_ring(record, document, space, below)
        below.same("light", record.light, document.rig.light, "rig.light")


def _audit_last_ring(
    record: ProjectorRecord,
    document: PlanDocument,
    space: Workspace,
    findings: AuditFindings,
) -> None:
    """Check the outermost ring, shown or not: the reference, less if centred.

    Rings that stay are those of an existing device.
    """
    rings, axes = record.rings, document.ring_axes
    if rings is not None and rings.spacing == "kept":
        return
    hidden = () if rings is None else rings.left_out
    last, stated = max(*record.ring_radii, *hidden), space.reference_ring_radius
    if axes is None or axes.taken == "free" or last > stated:
        findings.number("ring_radii (last)", last, stated, 1e-9, "")


def _audit_model(
    kind: DeviceKind,
    record: ProjectorRecord | CameraRecord,
    rig: RigRecord,
    findings: AuditFindings,
) -> None:
    names = [model.name for model in kind.models] if len(kind.models) > 1 else [""]
    findings.holds(
        record.model in names, "model", f"{record.model!r} is none of the rig's {names}"
    )
    model = rig.model_of(kind.name, record.model)
    for name in _MODEL:
        if name in type(record).model_fields:
            claimed, truth = getattr(record, name), getattr(model, name)
            slack = 1e-9 * float(np.abs(np.array(claimed or 0.0)).max(initial=0.0))
            findings.same(name, claimed, truth, f"rig.{kind.name}.{name}", slack)


def audit_existing(case: AuditCase, findings: AuditFindings) -> None:
    """Check existing devices against requirements, certificates and the rig."""
    tables = {
        str(table.get("name")): table for table in case.plan.document.rig.existing
    }
    names = sorted(device.name for device in case.plan.requirements.existing)
    findings.holds(
        sorted(tables) == names,
        "requirements.existing",
        f"holds {names}, but rig.existing has {sorted(tables)}",
    )
    for kind in case.kinds:
        stated = case.plan.requirements.existing_of(kind.name)
        marked = {d.existing: d for d in kind.devices if d.existing}
        names = sorted(device.name for device in stated)
        findings.holds(
            sorted(marked) == names,
            f"{kind.name}s",
            f"{sorted(marked)} are marked existing, but requirements.existing has "
            f"{names}",
        )
        for device in stated:
            if device.name in marked:
                planned = marked[device.name]
                findings.same(
                    f"{planned.id}.world_from_device",
                    planned.world_from_device.tolist(),
                    device.world_from_device,
                    f"that of the existing {device.name!r}",
                    SAME_POSE,
                )
                if device.ring_radii:
                    _audit_kept_rings(planned, device, findings.at(planned.id))
        findings.holds(
            kind.proof.given == len(stated),
            f"certificates.{kind.name}s.given",
            f"{kind.proof.given} is claimed, but {len(stated)} {kind.name}s are "
            f"existing devices",
        )
        for name, device in marked.items():
            if name in tables:
                table, below = tables[name], findings.at(device.id)
                below.holds(
                    table["kind"] == kind.name,
                    "existing",
                    f"is a {kind.name}, but rig.existing {name!r} is a {table['kind']}",
                )
                _audit_pose(device, table, case.plan, below.at("world_from_device"))


def _audit_kept_rings(
    planned: _Device, device: Existing, findings: AuditFindings
) -> None:
    """Compare the rings of a projector with those that were to stay."""
    if not findings.holds(
        isinstance(planned, PlannedProjector), "rings", "stay, but a camera has none"
    ):
        return
    for name in ("world_from_ring", "ring_radii"):
        claimed, truth = getattr(planned, name).tolist(), getattr(device, name)
        whose = f"that of the existing {device.name!r}"
        findings.same(name, claimed, truth, whose, SAME_POSE)


def _audit_pose(
    device: _Device, table: Mapping[str, Any], plan: RigPlan, findings: AuditFindings
) -> None:
    """Compare a pose with the one that was typed, or with position, aim and roll."""
    pose = device.world_from_device
    typed = None if table.get("pose_mm") is None else np.array(table["pose_mm"])
    place = np.array(table["position_mm"]) if typed is None else typed[:3, 3]
    own = np.zeros(3) if table.get("origin") == "mesh" else origin_of(plan)
    off = float(np.linalg.norm(pose[:3, 3] - (own + 1e-3 * place)))
    findings.holds(
        off <= _POSITION_M,
        "",
        f"stands {1e3 * off:.3g} mm from where rig.existing has {device.existing!r}",
    )
    if typed is None:
        space = plan.requirements.workspace
        _audit_aim(device, table, place, space, findings)
        return
    turned = float(np.abs(pose[:3, :3] - typed[:3, :3]).max())
    findings.holds(
        turned <= _TYPED,
        "",
        f"its rotation differs from rig.existing's by {turned:.2g}",
    )


def _audit_aim(
    device: _Device,
    table: Mapping[str, Any],
    place: Array,
    space: Workspace,
    findings: AuditFindings,
) -> None:
    """The image is turned by the roll, and the aim is its middle.

    Angles are of the optical axis: pan about up from the world axis after it, tilt
    over the horizon.
    """
    turn, roll_deg = device.world_from_device[:3, :3], table["roll_deg"]
    of_axis = table.get("aim_mm") is None
    if of_axis:
        up, first = np.array(space.up), int(np.argmax(np.abs(space.up))) + 1
        pan, tilt = np.radians(table["pan_deg"]), np.radians(table["tilt_deg"])
        ahead = np.roll(np.eye(3)[0], first)
        level = np.cos(pan) * ahead + np.sin(pan) * np.cross(up, ahead)
        towards = np.cos(tilt) * level + np.sin(tilt) * up
    else:
        towards = np.array(table["aim_mm"]) - place
        towards = towards / np.linalg.norm(towards)
    middle = turn.T @ towards
    model = device.device
    if isinstance(model, PinholeModel) and not of_axis:
        centre = 0.5 * (np.array(model.resolution) - 1.0)
        off = float(np.linalg.norm(pixels_of(model, middle[None])[0] - centre))
        aimed = off <= _PIXEL and middle[2] > 0.0
    else:
        off, middle = float(np.linalg.norm(middle - [0.0, 0.0, 1.0])), np.eye(3)[2]
        aimed = off <= _ROLL_RAD
    if not findings.holds(
        aimed,
        "",
        f"the aim of {device.existing!r} misses "
        f"{'the optical axis' if of_axis else 'the image centre'}, {off:.3g}",
    ):
        return
    level = np.cross(towards, space.up)
    if np.linalg.norm(level) < 1e-6:
        return
    level /= np.linalg.norm(level)
    # The image's x axis, had the middle ray been the optical axis.
    both = middle + [0.0, 0.0, 1.0]
    side = turn @ (np.array([1.0, 0.0, 0.0]) - middle[0] / (1.0 + middle[2]) * both)
    roll = np.arctan2(side @ np.cross(towards, level), side @ level)
    wrong = (roll - np.radians(roll_deg) + np.pi) % (2.0 * np.pi) - np.pi
    findings.holds(
        abs(wrong) <= _ROLL_RAD,
        "",
        f"is rolled by {np.degrees(roll):.4g} degrees, rig.existing says {roll_deg:g}",
    )
