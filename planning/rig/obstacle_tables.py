"""The schema of `[[obstacle]]`, and where obstacles stand in the world.

Lengths are in millimetres; places count from where those of `[workspace]` do.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from geometry.files.readers import UNITS, load_mesh
from geometry.mesh.mesh import MeshError, TriangleMesh
from geometry.shapes import primitives
from planning.model.devices.bodies import Box, Obstacle
from planning.model.errors import InfeasibleLimitsError, RigError
from planning.model.requirements import Workspace
from planning.model.table_types import Axis, Name, Table

from .workspace_tables import LARGEST_MM, WorkspaceTable, turned

_Length = Annotated[float, Field(gt=0.0, le=LARGEST_MM)]
_Sides = Annotated[list[_Length], Field(min_length=3, max_length=3)]
# What each shape is told by, beside its place.
_KEYS = {
    "box": {"size_mm"},
    "table": {"size_mm"},
    "cylinder": {"radius_mm", "height_mm"},
    "mesh": {"file"},
}
# An object of which this share lies in a zone that blocks can't be measured.
_SWALLOWED = 0.5


class ObstacleTable(Table):
    """What stands in the way of light and views, `[[obstacle]]`.

    The place of a cylinder is its middle, of a table the middle of its top, of a mesh
    the origin of its file. A table without one is right under the object.
    """

    name: Name
    shape: Literal["box", "cylinder", "table", "mesh"]
    centre_mm: Axis | None = None
    turn_deg: Axis = Field(default=[0.0, 0.0, 0.0])
    size_mm: _Sides | None = None
    radius_mm: _Length | None = None
    height_mm: _Length | None = None
    file: Name | None = None
    unit: Annotated[str, Field(pattern=f"^({'|'.join(UNITS)})$")] | None = None

    @model_validator(mode="after")
    def _check_shape(self) -> Self:
        needed, known = _KEYS[self.shape], set().union(*_KEYS.values())
        given = {key for key in known if getattr(self, key) is not None}
        if given != needed:
            raise ValueError(
                f"shape = {self.shape!r} takes {' and '.join(sorted(needed))}, "
                f"has {' and '.join(sorted(given)) or 'none'}"
            )
        if self.unit is not None and self.file is None:
            raise ValueError("unit is of a file; write it beside file, or remove it")
        if self.centre_mm is None and self.shape != "table":
            raise ValueError(
                "centre_mm is missing; write its place, counted as in [workspace]"
            )
        return self

    def to_document(self) -> dict[str, Any]:
        """Return plain values as written."""
        return self.model_dump(mode="json", exclude_none=True)

    def placed(self, workspace: Workspace, lowest_m: float, folder: Path) -> Obstacle:
        """Return where it stands; tables lie square to up.

        `lowest_m` is the height of the object's lowest point over the centre [m].

        Raises:
            RigError: If its file can't be read in `folder`, or it has no surface.
        """
        turn = turned(self.turn_deg)
        up = np.array(workspace.up)
        origin, place = workspace.centre, lowest_m * up
        if self.centre_mm is not None:
            origin, place = workspace.origin_m, 1e-3 * np.array(self.centre_mm)
        try:
            local = self._local(folder)
        except MeshError as error:
            raise RigError(f"obstacle {self.name!r}: {error}") from None
        if self.shape == "table":
            turn = turn @ _upright(up)
        vertices = np.array(origin) + place + local.vertices @ turn.T
        return Obstacle(self.name, TriangleMesh(vertices, local.faces))

    def _local(self, folder: Path) -> TriangleMesh:
        if self.file is not None:
            return load_mesh(folder / self.file, unit=self.unit)
        if self.radius_mm is not None and self.height_mm is not None:
            return primitives.cylinder(1e-3 * self.radius_mm, 1e-3 * self.height_mm)
        x, y, z = (1e-3 * side for side in self.size_mm or ())
        box = primitives.box((x, y, z))
        if self.shape == "table":
            return TriangleMesh(box.vertices - [0.0, 0.0, 0.5 * z], box.faces)
        return box


def obstacles_of(
    tables: Sequence[ObstacleTable],
    zones: WorkspaceTable,
    workspace: Workspace,
    mesh: TriangleMesh,
    folder: Path,
) -> tuple[Obstacle, ...]:
    """Return what stands about the object: obstacles, then keep-out zones that block.

    Raises:
        RigError: If a file can't be read.
        InfeasibleLimitsError: If a zone that blocks holds the object.
    """
    offsets = mesh.corners.reshape(-1, 3) - np.array(workspace.centre)
    lowest = float((offsets @ np.array(workspace.up)).min())
    zoned = zip(zones.keep_out, workspace.keep_out, strict=True)
    return (
        *(table.placed(workspace, lowest, folder) for table in tables),
        *(_of_zone(zone, workspace, offsets) for table, zone in zoned if table.blocks),
    )


def _of_zone(zone: Box, workspace: Workspace, offsets: NDArray[np.float64]) -> Obstacle:
    _check_apart(zone, offsets)
    centre = np.array(workspace.centre)
    x, y, z = (2.0 * half for half in zone.half_m)
    plain = primitives.box((x, y, z))
    vertices = centre + np.array(zone.centre_m) + plain.vertices @ np.array(zone.axes)
    return Obstacle(zone.name, TriangleMesh(vertices, plain.faces))


def _check_apart(zone: Box, offsets: NDArray[np.float64]) -> None:
    local = (offsets - np.array(zone.centre_m)) @ np.array(zone.axes).T
    share = float(np.all(np.abs(local) <= zone.half_m, axis=1).mean())
    if share >= _SWALLOWED:
        raise InfeasibleLimitsError(
            f"workspace.keep_out {zone.name!r} holds {100.0 * share:.0f} % of the "
            f"object and blocks all light there; write blocks = false in it if it is "
            f"only ground where no device may stand"
        )


def _upright(up: NDArray[np.float64]) -> NDArray[np.float64]:
    """A rotation that takes z to up, one of the six directions of the axes."""
    axis = int(np.argmax(np.abs(up)))
    turn = np.roll(np.eye(3), axis - 2, axis=0)
    return turn if up[axis] > 0.0 else turn @ np.diag([1.0, -1.0, -1.0])
