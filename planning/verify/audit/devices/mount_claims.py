"""Claims about mounts: whose they are, and where they stand."""

import numpy as np

from geometry.arrays import Array
from planning.model.mounts import Mount
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings

_ROUNDING = 1e-9
_FORWARD, _RIGHT = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])


def audit_mounts(case: AuditCase, findings: AuditFindings) -> None:
    """Check mounts against the rig's figures, and where those of devices stand."""
    for kind in case.kinds:
        mount = getattr(case.plan.requirements.workspace, f"{kind.name}_mount")
        stated, key = kind.model.figures.mount, f"{kind.name}_mount"
        below = findings.at(f"requirements.workspace.{key}")
        if (mount is None) != (stated is None):
            below.fail("", f"{mount!r} is claimed, but the rig file has {stated!r}")
        elif stated is not None:
            offset, axis = np.array(stated["offset_mm"]), np.array(stated["axis"])
            whose = f"rig.{kind.name}.figures.mount"
            below.same("offset_m", mount.offset_m, 1e-3 * offset, whose, _ROUNDING)
            unit = axis / np.linalg.norm(axis)
            below.same("axis", mount.axis, unit, whose, _ROUNDING)
        for record in kind.records:
            pose = np.array(record.world_from_device)
            findings.same(
                f"{record.id}.world_from_mount",
                record.world_from_mount,
                None if mount is None else pose @ _frame(mount),
                "the mount's pose",
                _ROUNDING,
            )


def _frame(mount: Mount) -> Array:
    """Origin in the middle, z out of the device, x next to its forward or right."""
    z = np.array(mount.axis) / np.linalg.norm(mount.axis)
    y = np.cross(z, _FORWARD)
    if np.linalg.norm(y) < 1e-6:
        y = np.cross(z, _RIGHT)
    y /= np.linalg.norm(y)
    frame = np.eye(4)
    frame[:3, :3] = np.stack([np.cross(y, z), y, z], axis=1)
    frame[:3, 3] = mount.offset_m
    return frame
