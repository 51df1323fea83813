"""Existing devices of a rig file, in the world."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from geometry.devices import ParallelModel, PinholeModel
from planning.model.bodies import Body
from planning.model.device_poses import rounded_pose
from planning.model.errors import InfeasibleLimitsError
from planning.model.requirements import Existing, Requirements, Workspace
from planning.scene.workspace.offered_poses import aimed_poses

from .existing_tables import ExistingTable


def build_existing(
    tables: Sequence[ExistingTable],
    workspace: Workspace,
    projector: PinholeModel | ParallelModel,
    camera: PinholeModel,
) -> tuple[Existing, ...]:
    """Return the devices of `[[existing]]` in the world, as the plan will hold them.

    Args:
        tables: As written.
        workspace: Its centre is where their places count from.
        projector: The rig's model.
        camera: The rig's model.
    """
    devices: list[Existing] = []
    for table in tables:
        device = projector if table.kind == "projector" else camera
        pose = rounded_pose(_pose(table, workspace, device))
        rows = tuple(tuple(row) for row in pose.tolist())
        devices.append(Existing(table.name, table.kind, rows, Body.of(table.body)))
    return tuple(devices)


def check_existing(required: Requirements) -> None:
    """Refuse more existing devices than are allowed, and two where one can stand.

    Raises:
        InfeasibleLimitsError: It names the limit, both numbers and what to do.
    """
    for kind, most in (
        ("projector", required.max_projectors),
        ("camera", required.max_cameras),
    ):
        n = len(required.existing_of(kind))
        if most is not None and n > most:
            raise InfeasibleLimitsError(
                f"max_{kind}s = {most} is less than the {n} {kind}s of [[existing]], "
                f"which stay; raise --max-{kind}s or take one out of the rig file"
            )
        places: dict[tuple[float, ...], str] = {}
        for device in required.existing_of(kind):
            place = tuple(row[3] for row in device.world_from_device[:3])
            if place in places:
                raise InfeasibleLimitsError(
                    f"existing {kind}s {places[place]!r} and {device.name!r} stand at "
                    f"the same place; take one out of the rig file or correct it"
                )
            places[place] = device.name


def _pose(
    table: ExistingTable,
    workspace: Workspace,
    device: PinholeModel | ParallelModel,
) -> NDArray[np.float64]:
    centre = np.array(workspace.centre)
    if table.pose_mm is not None:
        pose = np.array(table.pose_mm)
        # The rotation next to what was typed.
        u, _, vt = np.linalg.svd(pose[:3, :3])
        pose[:3, :3] = u @ vt
        pose[:3, 3] = centre + 1e-3 * pose[:3, 3]
        return pose
    position = centre + 1e-3 * np.array(table.position_mm)
    aim = centre + 1e-3 * np.array(table.aim_mm)
    up, roll = np.array(workspace.up), float(np.radians(table.roll_deg))
    return aimed_poses(position[None], aim, up, device, roll=roll)[0]
