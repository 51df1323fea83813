"""Claims about mounts: whose they are, where they stand, and what they are set to."""

import numpy as np

from geometry.arrays import Array
from planning.model.devices.bodies import Mount
from planning.model.plan import RigPlan
from planning.verify.audit.audit_case import AuditCase, DeviceKind
from planning.verify.audit.audit_findings import AuditFindings

from .workspace_claims import movable_references
from .zone_claims import origin_of

_ROUNDING = 1e-9
_ANGLE = 1e-6
# Optical centres are written to 0.01 mm.
_PLACE_M = 1e-5
_VERTICAL = 1e-9
_TURN = 2.0 * np.pi
_FORWARD, _RIGHT = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])


def audit_mounts(case: AuditCase, findings: AuditFindings) -> None:
    """Check mounts against the rig's figures, and the devices against their mounts.

    What existing devices are set to is nobody's claim.
    """
    for kind in case.kinds:
        mount = case.plan.requirements.workspace.mount_of(kind.name)
        below = findings.at(f"requirements.workspace.{kind.name}_mount")
        _audit_figures(kind, mount, below)
        for record in kind.records:
            pose = np.array(record.world_from_device)
            findings.same(
                f"{record.id}.world_from_mount",
                record.world_from_mount,
                None if mount is None or mount.axis is None else pose @ _frame(mount),
                "the mount's pose",
                _ROUNDING,
            )
            if mount is not None and not record.existing:
                key = findings.at(record.id)
                _audit_settings(mount, pose[None], case.plan, key)
        if mount is not None:
            below = findings.at(f"surface.npz reference_{kind.name}s")
            poses = movable_references(kind, case.plan)
            _audit_settings(mount, poses, case.plan, below)


def _audit_figures(
    kind: DeviceKind, mount: Mount | None, findings: AuditFindings
) -> None:
    stated, whose = kind.models[0].figures.mount, f"rig.{kind.name}.figures.mount"
    if mount is None or stated is None:
        findings.holds(
            mount is None and stated is None,
            "",
            f"{mount!r} is claimed, but the rig file has {stated!r}",
        )
        return
    axis = stated.get("axis")
    unit = None if axis is None else np.array(axis) / np.linalg.norm(axis)
    findings.same("axis", mount.axis, unit, whose, _ROUNDING)
    for name, key, scale in (
        ("offset_m", "offset_mm", 1e-3),
        ("grid_m", "grid_mm", 1e-3),
        ("rolls", "roll_deg", np.pi / 180.0),
        ("pan_step", "pan_step_deg", np.pi / 180.0),
        ("tilt_step", "tilt_step_deg", np.pi / 180.0),
    ):
        value = stated.get(key)
        truth = None if value is None else scale * np.array(value)
        findings.same(name, getattr(mount, name) or None, truth, whose, _ROUNDING)


def _audit_settings(
    mount: Mount, poses: Array, plan: RigPlan, findings: AuditFindings
) -> None:
    """Check that poses (n, 4, 4) have an allowed roll, whole steps, and stand on it."""
    turns, up = poses[:, :3, :3], np.array(plan.requirements.workspace.up)
    for name, off in _off_steps(mount, turns, up).items():
        findings.holds(
            np.all(off <= _ANGLE),
            name,
            f"is {np.degrees(off.max(initial=0.0)):.4g} degrees off what the mount "
            f"can be set to",
        )
    if mount.grid_m is not None:
        offset = np.array(mount.offset_m or np.zeros(3))
        places = poses[:, :3, 3] + turns @ offset - origin_of(plan)
        steps = places / mount.grid_m
        off = mount.grid_m * np.abs(steps - np.rint(steps)).max(initial=0.0)
        findings.holds(
            off <= _PLACE_M, "mount", f"stands {1e3 * off:.4g} mm off the grid"
        )


def _off_steps(mount: Mount, turns: Array, up: Array) -> dict[str, Array]:
    """How far pan, tilt and roll of housings are off what is allowed, (n,) [rad]."""
    third = int(np.argmax(np.abs(up)))
    first = np.eye(3)[(third + 1) % 3]
    second = np.cross(up, first)
    x, z = turns[:, :, 0], turns[:, :, 2]
    across = np.hypot(z @ first, z @ second)
    tilt = np.arctan2(z @ up, across)
    pan = np.arctan2(z @ second, z @ first)
    # The turn from the level line at the device's right to its x axis, clockwise.
    right = np.column_stack([np.sin(pan), -np.cos(pan)]) @ np.stack([first, second])
    below = np.cross(z, right)
    roll = np.arctan2((x * below).sum(axis=1), (x * right).sum(axis=1))
    upright = across <= _VERTICAL
    # Up or down, pan and roll are one turn: x, less any roll that is allowed.
    one = np.arctan2(x @ first, -(x @ second))
    rolls = np.array(mount.rolls) if mount.rolls else roll[:, None]
    off: dict[str, Array] = {"tilt": _off(tilt, mount.tilt_step)}
    off["roll"] = np.where(upright, 0.0, _off(roll[:, None] - rolls, _TURN).min(axis=1))
    shared = one[:, None] - np.sign(tilt)[:, None] * rolls
    both = _off(shared, mount.pan_step if mount.rolls else None).min(axis=1)
    off["pan"] = np.where(upright, both, _off(pan, mount.pan_step))
    return off


def _off(angles: Array, step: float | None) -> Array:
    """Distance from the next whole step; nothing where any angle will do."""
    if step is None:
        return np.zeros_like(angles)
    return np.abs(angles - step * np.rint(angles / step))


def _frame(mount: Mount) -> Array:
    """Origin in the middle, z out of the device, x next to its forward or right."""
    z = np.array(mount.axis or _FORWARD)
    y = np.cross(z, _FORWARD)
    if np.linalg.norm(y) < 1e-6:
        y = np.cross(z, _RIGHT)
    y /= np.linalg.norm(y)
    frame = np.eye(4)
    frame[:3, :3] = np.stack([np.cross(y, z), y, z], axis=1)
    frame[:3, 3] = mount.offset_m or np.zeros(3)
    return frame
