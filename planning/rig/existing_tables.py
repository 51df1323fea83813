"""Existing devices as a rig file writes them, `[[existing]]`, with their poses."""

from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from geometry.devices import DeviceModel
from geometry.poses import turns_of
from planning.model.devices.bodies import BodyTable
from planning.model.requirements import Workspace
from planning.model.table_types import Axis, Name, Table, WrittenPose, read_pose
from planning.scene.workspace.candidates import aimed_poses

Tilt = Annotated[float, Field(ge=-90.0, le=90.0)]
# Written where they aren't as for most.
_OF_ITS_OWN = ("pan_deg", "tilt_deg", "origin", "body", "model")


class ExistingTable(Table):
    """A projector or camera of a model of the rig, `[[existing]]`.

    Its pose comes in one of three ways; without a body of its own it has its model's.
    """

    name: Name
    kind: Literal["projector", "camera"]
    position_mm: Axis | None = None
    aim_mm: Axis | None = None
    pan_deg: float | None = None
    tilt_deg: Tilt | None = None
    roll_deg: float = 0.0
    pose_mm: WrittenPose | None = None
    origin: Literal["mesh"] | None = None
    body: BodyTable | None = None
    model: Name | None = None

    @model_validator(mode="after")
    def _check_pose(self) -> Self:
        angles = (self.pan_deg is not None, self.tilt_deg is not None)
        aimed = self.aim_mm is not None
        if self.pose_mm is None:
            if self.position_mm is None or not (aimed or all(angles)):
                raise ValueError(
                    "needs position_mm and aim_mm, or position_mm, pan_deg and "
                    "tilt_deg, or pose_mm"
                )
            if aimed and any(angles):
                raise ValueError("has aim_mm beside pan_deg or tilt_deg; keep one way")
            if self.position_mm == self.aim_mm:
                raise ValueError(f"aim_mm = {self.aim_mm} must not be its position_mm")
            return self
        typed = self.position_mm is not None or "roll_deg" in self.model_fields_set
        if typed or aimed or any(angles):
            raise ValueError(
                "has pose_mm beside position_mm, aim_mm or angles; keep one way"
            )
        read_pose(self.pose_mm, "pose_mm")
        return self

    def to_document(self) -> dict[str, Any]:
        """Return plain values as written; no key of its own for what is the rule."""
        document = self.model_dump(mode="json")
        return {
            key: value
            for key, value in document.items()
            if key not in _OF_ITS_OWN or value != type(self).model_fields[key].default
        }

    def pose(self, workspace: Workspace, device: DeviceModel) -> NDArray[np.float64]:
        """Return ``world_from_device`` of the rig's model in the world [m]."""
        # Without an origin of its own, its places count as those of the rig file.
        origin = np.zeros(3) if self.origin else np.array(workspace.origin_m)
        if self.pose_mm is not None:
            pose = read_pose(self.pose_mm, "pose_mm")
            pose[:3, 3] = origin + 1e-3 * pose[:3, 3]
            return pose
        position = origin + 1e-3 * np.array(self.position_mm)
        up, roll = np.array(workspace.up), float(np.radians(self.roll_deg))
        if self.aim_mm is not None:
            aim = origin + 1e-3 * np.array(self.aim_mm)
            return aimed_poses(position[None], aim, up, device, roll=roll)[0]
        pose = np.eye(4)
        degrees = self.pan_deg or 0.0, self.tilt_deg or 0.0, self.roll_deg
        pose[:3, :3], pose[:3, 3] = turns_of(np.radians(degrees), up), position
        return pose
