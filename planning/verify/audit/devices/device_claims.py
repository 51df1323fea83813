"""Claims about devices: poses, ring frames, models, and how many there are."""

import numpy as np

from planning.model.document.device_records import CameraRecord, ProjectorRecord
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings

from .workspace_claims import POSITION_M, audit_poses, audit_ring_frames, outside_by

_MODEL = ("resolution", "range_m", "K", "distortion", "pixel_pitch_m", "beam_radius")


def audit_devices(case: AuditCase, findings: AuditFindings) -> None:
    """Check ids, poses, ring frames and models of the devices, and their number."""
    document, limits = case.plan.document, case.plan.requirements
    space = limits.workspace
    for kind, records, most, shell in (
        (
            "projector",
            document.projectors,
            limits.max_projectors,
            space.projector_radius_m,
        ),
        ("camera", document.cameras, limits.max_cameras, space.camera_radius_m),
    ):
        key, names = f"{kind}s", [record.id for record in records]
        findings.holds(len(set(names)) == len(names), key, f"ids repeat: {names}")
        findings.holds(
            most is None or len(names) <= most,
            key,
            f"{len(names)} devices, requirements.max_{key} allows {most}",
        )
        for record in records:
            key, pose = f"{record.id}.world_from_device", record.world_from_device
            audit_poses(key, np.array([pose]), findings)
            _audit_model(kind, record, case, findings)
            position = np.array([pose])[:, :3, 3]
            excess = float(outside_by(position, shell, space)[0])
            # An existing device stands where it stands: `audit_existing` checks that.
            findings.holds(
                record.existing or excess <= POSITION_M,
                key,
                f"position {np.round(position[0], 6).tolist()} m lies "
                f"{1e3 * excess:.3g} mm outside requirements.workspace",
            )
    for record, projector in zip(document.projectors, case.projectors, strict=True):
        key = f"{record.id}.world_from_ring"
        audit_poses(key, np.array([record.world_from_ring]), findings)
        ring = projector.world_from_ring
        audit_ring_frames(key, projector.light, ring, findings)
        last, stated = float(projector.radii[-1]), space.reference_ring_radius
        findings.number(f"{record.id}.ring_radii (last)", last, stated, 1e-9, "")
        light = document.rig.light
        findings.holds(
            record.light == light,
            f"{record.id}.light",
            f"claimed {record.light!r}, but rig.light is {light!r}",
        )


def _audit_model(
    kind: str,
    record: ProjectorRecord | CameraRecord,
    case: AuditCase,
    findings: AuditFindings,
) -> None:
    """Check that a device's model is the rig's."""
    rig = case.plan.document.rig
    model = rig.projector if kind == "projector" else rig.camera
    for name in _MODEL:
        if name not in type(record).model_fields:
            continue
        key, whose = f"{record.id}.{name}", f"rig.{kind}.{name}"
        claimed, truth = getattr(record, name), getattr(model, name)
        if claimed is None or truth is None:
            findings.holds(
                claimed is truth, key, f"claimed {claimed!r}, but {whose} is {truth!r}"
            )
            continue
        slack = 1e-9 * float(np.abs(np.array(claimed)).max(initial=0.0))
        findings.array(key, claimed, truth, slack, whose)
