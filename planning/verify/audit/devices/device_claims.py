"""Claims about devices: poses, models, the workspace and how many there are."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.devices import ParallelModel
from planning.model.plan import RigPlan
from planning.model.planned import PlannedCamera, PlannedProjector
from planning.model.requirements import Workspace
from planning.verify.audit.ledger import Ledger

from .existing_claims import planned_only
from .zone_claims import zone_excess

_ROUNDING = 1e-6
# Positions are written to 0.01 mm, so one on the border may lie outside by as much.
_POSITION_M = 2e-5


def audit_devices(plan: RigPlan, ledger: Ledger) -> None:
    """Check ids, poses, ring frames and models of the devices, and their number."""
    document, limits = plan.to_document(), plan.requirements
    for kind, entries, most in (
        ("projectors", document["projectors"], limits.max_projectors),
        ("cameras", document["cameras"], limits.max_cameras),
    ):
        names = [entry["id"] for entry in entries]
        ledger.holds(len(set(names)) == len(names), kind, f"ids repeat: {names}")
        ledger.holds(
            most is None or len(entries) <= most,
            kind,
            f"{len(entries)} devices, requirements.max_{kind} allows {most}",
        )
    for entry, projector in zip(document["projectors"], plan.projectors, strict=True):
        _audit_pose(entry, "world_from_device", ledger)
        _audit_pose(entry, "world_from_ring", ledger)
        _audit_ring_frame(projector, ledger)
        _audit_model(projector, ledger)
        _audit_position(
            projector, limits.workspace.projector_radius_m, limits.workspace, ledger
        )
    for entry, camera in zip(document["cameras"], plan.cameras, strict=True):
        _audit_pose(entry, "world_from_device", ledger)
        _audit_model(camera, ledger)
        _audit_position(
            camera, limits.workspace.camera_radius_m, limits.workspace, ledger
        )


def audit_workspace(plan: RigPlan, ledger: Ledger) -> None:
    """Check the workspace against the surface, and the reference poses against it."""
    space, surface = plan.requirements.workspace, plan.surface
    key = "requirements.workspace"
    slack = _ROUNDING * max(1.0, float(np.abs(surface.mesh.bounds).max()))
    ledger.array(
        f"{key}.centre",
        list(space.centre),
        surface.mesh.centre,
        slack,
        "the centre of the smallest ball that holds the surface",
    )
    ledger.number(
        f"{key}.object_radius_m", space.object_radius_m, surface.mesh.radius, slack, "m"
    )
    for kind, poses, stated, shell in (
        (
            "projectors",
            surface.reference_projectors,
            space.n_reference_projectors,
            space.projector_radius_m,
        ),
        (
            "cameras",
            surface.reference_cameras,
            space.n_reference_cameras,
            space.camera_radius_m,
        ),
    ):
        ledger.holds(
            len(poses) == stated,
            f"{key}.n_reference_{kind}",
            f"{stated} reference poses are claimed, surface.npz holds {len(poses)}",
        )
        movable = planned_only(poses, kind, plan)
        _audit_reference(movable, kind, shell, space, ledger)
    _audit_reference_rings(plan, ledger)


def outside_by(
    positions: NDArray[np.float64], shell: tuple[float, float], space: Workspace
) -> NDArray[np.float64]:
    """Return how far positions (n, 3) lie outside the workspace, <= 0 inside, (n,) [m].

    The largest of the amounts by which |Q - c| misses its range, Q stands behind the
    cone (times |Q - c|), below the floor, and where its zones don't let it.
    """
    offset = positions - np.array(space.centre)
    distance = np.linalg.norm(offset, axis=1)
    axis = np.array(space.axis) / np.linalg.norm(space.axis)
    along = offset @ axis
    across = np.linalg.norm(offset - along[:, None] * axis, axis=1)
    beyond = (np.arctan2(across, along) - space.half_angle) * distance
    excess = [shell[0] - distance, distance - shell[1], beyond]
    if space.floor_m is not None:
        excess.append(space.floor_m - offset @ np.array(space.up))
    excess += zone_excess(offset, space)
    return np.max(excess, axis=0)


def _audit_position(
    device: PlannedProjector | PlannedCamera,
    shell: tuple[float, float],
    space: Workspace,
    ledger: Ledger,
) -> None:
    if device.existing:
        # It stands where it stands: `audit_existing` checks that it does.
        return
    position = device.world_from_device[:3, 3]
    excess = float(outside_by(position[None], shell, space)[0])
    ledger.holds(
        excess <= _POSITION_M,
        f"{device.id}.world_from_device",
        f"position {np.round(position, 6).tolist()} m lies {1e3 * excess:.3g} mm "
        f"outside requirements.workspace",
    )


def _audit_pose(entry: dict[str, Any], name: str, ledger: Ledger) -> None:
    pose = np.array(entry[name], dtype=np.float64)
    key = f"{entry['id']}.{name}"
    error = float(np.abs(pose[:3, :3] @ pose[:3, :3].T - np.eye(3)).max())
    ledger.holds(
        error <= _ROUNDING and np.linalg.det(pose[:3, :3]) > 0.0,
        key,
        f"R R^T differs from the identity by {error:.2g} (tolerance {_ROUNDING:g}), "
        f"det R = {np.linalg.det(pose[:3, :3]):.6g}",
    )
    ledger.array(
        key, pose[3].tolist(), np.array([0.0, 0, 0, 1]), 0.0, "a rigid last row"
    )


def _audit_ring_frame(projector: PlannedProjector, ledger: Ledger) -> None:
    device, ring = projector.world_from_device, projector.world_from_ring
    key = f"{projector.id}.world_from_ring"
    shift = ring[:3, 3] - device[:3, 3]
    if projector.light == "diverging":
        ledger.holds(
            np.linalg.norm(shift) <= _ROUNDING,
            key,
            f"its origin is {1e3 * np.linalg.norm(shift):.3g} mm from the optical "
            f"centre, cones of rings must share it",
        )
        return
    turn = float(np.linalg.norm(ring[:3, 2] - device[:3, 2]))
    depth = float(shift @ device[:3, 2])
    ledger.holds(
        turn <= _ROUNDING,
        key,
        f"its axis is turned by {turn:.3g} rad against the light, "
        f"cylinders of rings must run along it",
    )
    ledger.holds(
        abs(depth) <= _ROUNDING,
        key,
        f"its origin is {1e3 * depth:.3g} mm in front of the panel, "
        f"must lie in its plane",
    )


def _audit_model(device: PlannedProjector | PlannedCamera, ledger: Ledger) -> None:
    kind = "camera" if isinstance(device, PlannedCamera) else "projector"
    rig = ledger.read("rig", kind)
    if not ledger.holds(isinstance(rig, dict), f"rig.{kind}", "is missing"):
        return
    model = device.device
    values: dict[str, Any] = {"resolution": model.resolution, "range_m": model.range_m}
    if isinstance(model, ParallelModel):
        values |= {
            "pixel_pitch_m": model.pixel_pitch_m,
            "beam_radius": model.beam_radius,
        }
    else:
        values["K"] = model.camera_matrix
    if isinstance(device, PlannedCamera):
        values["distortion"] = device.device.distortion
    for name, value in values.items():
        key, whose = f"{device.id}.{name}", f"rig.{kind}.{name}"
        if value is None or rig.get(name) is None:
            ledger.holds(
                value is None and rig.get(name) is None,
                key,
                f"claimed {value!r}, but {whose} is {rig.get(name)!r}",
            )
            continue
        truth = np.asarray(value, dtype=np.float64)
        claimed = rig[name]
        slack = 1e-9 * float(np.abs(truth).max(initial=0.0))
        _same_model(key, whose, truth, claimed, slack, ledger)


def _same_model(
    key: str,
    whose: str,
    value: NDArray[np.float64],
    rig: object,
    slack: float,
    ledger: Ledger,
) -> None:
    try:
        expected = np.asarray(rig, dtype=np.float64)
    except (TypeError, ValueError):
        ledger.fail(whose, f"{rig!r} isn't a number or a list of numbers")
        return
    ledger.array(key, value.tolist(), expected, slack, whose)


def _audit_reference(
    poses: NDArray[np.float64],
    kind: str,
    shell: tuple[float, float],
    space: Workspace,
    ledger: Ledger,
) -> None:
    key = f"surface.npz reference_{kind}"
    turn = poses[:, :3, :3]
    error = np.abs(turn @ np.swapaxes(turn, 1, 2) - np.eye(3)).max(initial=0.0)
    proper = np.all(np.linalg.det(turn) > 0.0)
    ledger.holds(
        error <= _ROUNDING and proper, key, f"not rotations (error {error:.2g})"
    )
    outside = outside_by(poses[:, :3, 3], shell, space)
    count = int((~(outside <= _POSITION_M)).sum())
    ledger.holds(
        count == 0,
        key,
        f"{count} of {len(poses)} poses lie outside requirements.workspace, "
        f"by up to {1e3 * float(outside.max(initial=0.0)):.3g} mm",
    )


def _audit_reference_rings(plan: RigPlan, ledger: Ledger) -> None:
    poses, rings = plan.surface.reference_projectors, plan.surface.reference_rings
    key = "surface.npz reference_rings"
    turn = rings[:, :3, :3]
    error = np.abs(turn @ np.swapaxes(turn, 1, 2) - np.eye(3)).max(initial=0.0)
    ledger.holds(error <= _ROUNDING, key, f"not rotations (error {error:.2g})")
    shift = rings[:, :3, 3] - poses[:, :3, 3]
    if plan.projectors and plan.projectors[0].light == "parallel":
        shift = np.einsum("ij,ij->i", shift, poses[:, :3, 2])[:, None]
        shift = np.hstack([shift, rings[:, :3, 2] - poses[:, :3, 2]])
    error = np.abs(shift).max(initial=0.0)
    ledger.holds(
        error <= _ROUNDING,
        key,
        f"ring frames leave the optical centre, the panel plane or the axis of the "
        f"light by up to {error:.3g}",
    )
