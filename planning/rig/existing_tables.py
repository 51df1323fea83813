"""Existing devices, `[[existing]]`: as a rig file writes them, and in the world."""

from collections.abc import Mapping, Sequence
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import model_validator

from geometry.devices import DeviceModel
from planning.model.bodies import Body, BodyTable
from planning.model.device_poses import rounded_pose
from planning.model.errors import InfeasibleLimitsError
from planning.model.requirements import Existing, Requirements, Workspace
from planning.model.table_types import Axis, Name, Table, WrittenPose, read_pose
from planning.scene.workspace.candidates import aimed_poses


class ExistingTable(Table):
    """A projector or camera of the rig's own model, `[[existing]]`.

    Its pose comes in one of two ways; without a body of its own it has its kind's.
    """

    name: Name
    kind: Literal["projector", "camera"]
    position_mm: Axis | None = None
    aim_mm: Axis | None = None
    roll_deg: float = 0.0
    pose_mm: WrittenPose | None = None
    body: BodyTable | None = None

    @model_validator(mode="after")
    def _check_pose(self) -> Self:
        aimed = (self.position_mm is not None, self.aim_mm is not None)
        if self.pose_mm is None:
            if not all(aimed):
                raise ValueError("needs position_mm and aim_mm, or pose_mm")
            if self.position_mm == self.aim_mm:
                raise ValueError(f"aim_mm = {self.aim_mm} must not be its position_mm")
            return self
        if any(aimed) or "roll_deg" in self.model_fields_set:
            raise ValueError(
                "has pose_mm beside position_mm, aim_mm or roll_deg; keep one way"
            )
        read_pose(self.pose_mm, "pose_mm")
        return self

    def to_document(self) -> dict[str, Any]:
        """Return plain values as written; without a body of its own no key for it."""
        document = self.model_dump(mode="json")
        return {key: v for key, v in document.items() if key != "body" or v}

    def pose(self, workspace: Workspace, device: DeviceModel) -> NDArray[np.float64]:
        """Return ``world_from_device`` of the rig's model in the world [m]."""
        origin = np.array(workspace.origin_m)
        if self.pose_mm is not None:
            pose = read_pose(self.pose_mm, "pose_mm")
            pose[:3, 3] = origin + 1e-3 * pose[:3, 3]
            return pose
        position = origin + 1e-3 * np.array(self.position_mm)
        aim = origin + 1e-3 * np.array(self.aim_mm)
        up, roll = np.array(workspace.up), float(np.radians(self.roll_deg))
        return aimed_poses(position[None], aim, up, device, roll=roll)[0]


def build_existing(
    tables: Sequence[ExistingTable],
    workspace: Workspace,
    devices: Mapping[str, tuple[DeviceModel, Body | None]],
) -> tuple[Existing, ...]:
    """Return the devices of `[[existing]]` in the world, as the plan will hold them.

    `devices` are the rig's model of each kind, and its body.
    """

    def placed(table: ExistingTable) -> Existing:
        device, body = devices[table.kind]
        pose = rounded_pose(table.pose(workspace, device)).tolist()
        rows = tuple(tuple(row) for row in pose)
        return Existing(table.name, table.kind, rows, Body.of(table.body) or body)

    return tuple(placed(table) for table in tables)


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
