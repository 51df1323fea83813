"""The schema of `[workspace]`: the part of the shell in which devices may stand.

Lengths are in millimetres and places are relative to the object's centre, in the axes
of the mesh file.
"""

from collections.abc import Iterable
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from planning.model.table_types import Axis, Name, PositivePair, Sides, Table, UpName

# Cosine above which two directions span no plane.
_PARALLEL = 1.0 - 1e-9
# Length below which a vector is no direction.
_NO_DIRECTION = 1e-9


class KeepOutTable(Table):
    """A box in which no optical centre may stand, `[[workspace.keep_out]]`.

    Attributes:
        name: What messages call it.
        centre_mm: Its middle.
        size_mm: Its three sides.
        turn_deg: Turns about the x, then the y, then the z axis of the mesh file.
    """

    name: Name
    centre_mm: Axis
    size_mm: Sides
    turn_deg: Axis = Field(default=[0.0, 0.0, 0.0])


class MountingTable(Table):
    """A rectangle on which optical centres may lie, `[[workspace.mounting]]`.

    Attributes:
        name: What messages call it.
        centre_mm: Its middle.
        normal: Direction square to it.
        extent_mm: Its two sides.
        along: Direction of the first side, as far as it lies in the plane; absent:
            level, or where the plane itself is level the x axis (y if up is x).
        thickness_mm: How far apart the outermost admissible positions lie along the
            normal; half of it on either side.
    """

    name: Name
    centre_mm: Axis
    normal: Axis
    extent_mm: PositivePair
    along: Axis | None = None
    thickness_mm: Annotated[float, Field(ge=1.0)] = 10.0

    @model_validator(mode="after")
    def _check_directions(self) -> Self:
        for key in ("normal", "along"):
            value = getattr(self, key)
            if value is not None and not np.linalg.norm(value) > _NO_DIRECTION:
                raise ValueError(f"{key} = {value} must not be zero")
        if self.along is not None:
            lengths = np.linalg.norm(self.normal) * np.linalg.norm(self.along)
            if not abs(np.dot(self.normal, self.along)) < _PARALLEL * lengths:
                raise ValueError(
                    f"along = {self.along} is the direction of normal = "
                    f"{self.normal}; write one that lies in the plane"
                )
        return self


class WorkspaceTable(Table):
    """Which part of the shell of positions is admissible, `[workspace]`."""

    shape: Literal["shell", "cone", "box"] = "shell"
    axis: Axis | None = None
    half_angle_deg: Annotated[float, Field(gt=0.0, le=180.0)] | None = None
    min_mm: Axis | None = None
    max_mm: Axis | None = None
    floor_mm: float | None = None
    up: UpName = "z"
    keep_out: list[KeepOutTable] = Field(default=[])
    mounting: list[MountingTable] = Field(default=[])

    @model_validator(mode="after")
    def _check_cone(self) -> Self:
        both = self.axis is not None and self.half_angle_deg is not None
        neither = self.axis is None and self.half_angle_deg is None
        if self.shape == "cone" and not both:
            raise ValueError("shape = 'cone' needs axis and half_angle_deg")
        if self.shape != "cone" and not neither:
            raise ValueError("axis and half_angle_deg need shape = 'cone'")
        if self.axis is not None and not np.linalg.norm(self.axis) > _NO_DIRECTION:
            raise ValueError(f"axis = {self.axis} must not be zero")
        return self

    @model_validator(mode="after")
    def _check_box(self) -> Self:
        low, high = self.min_mm, self.max_mm
        if self.shape == "box" and (low is None or high is None):
            raise ValueError("shape = 'box' needs min_mm and max_mm, its two corners")
        if self.shape != "box" and not (low is None and high is None):
            raise ValueError("min_mm and max_mm need shape = 'box'")
        if low is not None and high is not None:
            if not all(a < b for a, b in zip(low, high, strict=True)):
                raise ValueError(
                    f"min_mm = {low} must be less than max_mm = {high} along each axis"
                )
        return self

    @model_validator(mode="after")
    def _check_names(self) -> Self:
        for key, tables in (("keep_out", self.keep_out), ("mounting", self.mounting)):
            if (name := _repeated(table.name for table in tables)) is not None:
                raise ValueError(f"{key} names {name!r} twice; name them apart")
        return self

    def to_document(self) -> dict[str, Any]:
        """Return plain values as written; zones that aren't given have no key."""
        document = self.model_dump(mode="json")
        zones = ("min_mm", "max_mm", "keep_out", "mounting")
        return {key: v for key, v in document.items() if v or key not in zones}


def _repeated(names: Iterable[str]) -> str | None:
    seen: set[str] = set()
    for name in names:
        if name in seen:
            return name
        seen.add(name)
    return None
