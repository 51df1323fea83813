"""The schema of `[[existing]]`: devices that stand already and stay where they are."""

from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from planning.model.bodies import BodyTable
from planning.model.table_types import Axis, Name, Table

_Row = Annotated[list[float], Field(min_length=4, max_length=4)]
_Rows = Annotated[list[_Row], Field(min_length=4, max_length=4)]
# How far a typed rotation may be from one.
_ROTATION = 1e-4


class ExistingTable(Table):
    """A projector or camera of the rig's own model, `[[existing]]`.

    Its pose comes in one of two ways. Places are relative to the object's centre, in
    the axes of the mesh file.

    Attributes:
        name: What plan and messages call it.
        kind: Which of the rig's models it is.
        position_mm: Optical centre (parallel light: middle of the panel).
        aim_mm: What the middle of the image looks at.
        roll_deg: Turn of the image about that line, clockwise as the device sees it.
        pose_mm: ``world_from_device``, 4 x 4, its last column in millimetres.
        body: Its own body; absent: that of its kind.
    """

    name: Name
    kind: Literal["projector", "camera"]
    position_mm: Axis | None = None
    aim_mm: Axis | None = None
    roll_deg: float = 0.0
    pose_mm: _Rows | None = None
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
        pose = np.array(self.pose_mm)
        turn = pose[:3, :3]
        off = float(np.abs(turn @ turn.T - np.eye(3)).max())
        if not (off <= _ROTATION and np.linalg.det(turn) > 0.0):
            raise ValueError(
                f"pose_mm: its first three columns must be a rotation (R R^T differs "
                f"from the identity by {off:.2g}); write more digits"
            )
        if self.pose_mm[3] != [0.0, 0.0, 0.0, 1.0]:
            raise ValueError(f"pose_mm: its last row {self.pose_mm[3]} must be 0 0 0 1")
        return self

    def to_document(self) -> dict[str, Any]:
        """Return plain values as written; without a body of its own no key for it."""
        document = self.model_dump(mode="json")
        return {key: v for key, v in document.items() if key != "body" or v}
