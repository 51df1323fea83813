"""Mounts: where a device is fastened.

Only values, as rig files and plans hold them; what follows from them the planner
(`planning.scene.mounts`) and the checkers each work out alone.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from pydantic import model_validator

from .bodies import Triple
from .table_types import Axis, Table


class MountTable(Table):
    """The thread or flange of a device in a rig file, `[camera.mount]` and so on.

    Attributes:
        offset_mm: Its middle in device coordinates.
        axis: Direction out of the device, square to the face that is fastened.
    """

    offset_mm: Axis
    axis: Axis

    @model_validator(mode="after")
    def _check_axis(self) -> Self:
        if not np.linalg.norm(self.axis) > 0.0:
            raise ValueError(f"axis = {self.axis} must not be zero")
        return self


@dataclass(frozen=True)
class Mount:
    """A thread or flange in device coordinates: x right, y down, z forward.

    Its frame has its origin in the middle and z along the axis, out of the device; x is
    the device's forward as far as that is square to z, or where it isn't its right.

    Attributes:
        offset_m: Its middle [m].
        axis: Unit direction out of the device.
    """

    offset_m: Triple
    axis: Triple

    @classmethod
    def of(cls, table: MountTable | None) -> Self | None:
        """Return the mount of a rig file's table; None where there is none."""
        if table is None:
            return None
        x, y, z = (1e-3 * value for value in table.offset_mm)
        a, b, c = (np.array(table.axis) / np.linalg.norm(table.axis)).tolist()
        return cls((x, y, z), (a, b, c))
