"""The schema of `[workspace]`: the part of the shell in which devices may stand.

Lengths are in millimetres and places are relative to the object's centre or, with
`origin = "mesh"`, to the origin of the mesh file; in its axes either way.
"""

from typing import Annotated, Any, Literal, Self, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, model_validator
from scipy.spatial.transform import Rotation

from planning.model.devices.bodies import Axes, Box, Triple
from planning.model.table_types import Axis, Name, PositivePair, Sides, Table, UpName

# Cosine above which two directions span no plane.
_PARALLEL = 1.0 - 1e-9
# Length below which a vector is no direction, and a cross product no level line.
_NO_DIRECTION = 1e-9
# Which keys a shape takes, and what they are.
_SHAPES = (
    ("cone", ("axis", "half_angle_deg"), ""),
    ("box", ("min_mm", "max_mm"), ", its two corners"),
)
# Rays are exact to a tenth of a micrometre for each metre of what they meet.
LARGEST_MM = 1e5
_IDENTITY: Axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


class KeepOutTable(Table):
    """A box in which no optical centre may stand, `[[workspace.keep_out]]`.

    Something solid stands there, unless `blocks` says that it is only forbidden ground.
    """

    name: Name
    centre_mm: Axis
    size_mm: Sides
    turn_deg: Axis = Field(default=[0.0, 0.0, 0.0])
    blocks: bool = True

    @model_validator(mode="after")
    def _check_blocks(self) -> Self:
        if self.blocks and max(self.size_mm) > LARGEST_MM:
            raise ValueError(
                f"size_mm = {self.size_mm}: what stands in the way of light has sides "
                f"of at most {LARGEST_MM:g} mm; write smaller ones, or blocks = false"
            )
        return self

    def box(self) -> Box:
        """Return the box in metres."""
        axes = _rows(turned(self.turn_deg).T)
        return _box(self.name, self.centre_mm, self.size_mm, axes)


class MountingSurfaceTable(Table):
    """A rectangle on which optical centres may lie, `[[workspace.mounting]]`.

    Its first side runs `along`, as far as that lies in the plane; absent: level, or
    where the plane itself is level along x (y if up is x).
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

    def box(self, up: Triple) -> Box:
        """Return the admissible positions as a box in metres, thin along its z."""
        normal = np.array(self.normal) / np.linalg.norm(self.normal)
        first = np.array(self.along or _level(normal, np.array(up)))
        first = first - (first @ normal) * normal
        first /= np.linalg.norm(first)
        axes = np.stack([first, np.cross(normal, first), normal])
        sizes = [*self.extent_mm, self.thickness_mm]
        return _box(self.name, self.centre_mm, sizes, _rows(axes))


class WorkspaceTable(Table):
    """Which part of the shell of positions is admissible, `[workspace]`."""

    shape: Literal["shell", "cone", "box"] = "shell"
    axis: Axis | None = None
    half_angle_deg: Annotated[float, Field(gt=0.0, le=180.0)] | None = None
    min_mm: Axis | None = None
    max_mm: Axis | None = None
    floor_mm: float | None = None
    up: UpName = "z"
    origin: Literal["centre", "mesh"] = "centre"
    keep_out: list[KeepOutTable] = Field(default=[])
    mounting: list[MountingSurfaceTable] = Field(default=[])

    @model_validator(mode="after")
    def _check_shape(self) -> Self:
        for shape, keys, what in _SHAPES:
            given, both = [getattr(self, key) for key in keys], " and ".join(keys)
            if self.shape == shape and None in given:
                raise ValueError(f"shape = {shape!r} needs {both}{what}")
            if self.shape != shape and given != [None, None]:
                raise ValueError(f"{both} need shape = {shape!r}")
        if self.axis is not None and not np.linalg.norm(self.axis) > _NO_DIRECTION:
            raise ValueError(f"axis = {self.axis} must not be zero")
        low, high = self.min_mm or [], self.max_mm or []
        if not all(a < b for a, b in zip(low, high, strict=True)):
            raise ValueError(
                f"min_mm = {low} must be less than max_mm = {high} along each axis"
            )
        return self

    @model_validator(mode="after")
    def _check_names(self) -> Self:
        for key, tables in (("keep_out", self.keep_out), ("mounting", self.mounting)):
            check_names(key, [table.name for table in tables])
        return self

    def to_document(self) -> dict[str, Any]:
        """Return plain values as written; zones that aren't given have no key."""
        document = self.model_dump(mode="json")
        zones = ("min_mm", "max_mm", "keep_out", "mounting")
        if self.origin == "centre":
            del document["origin"]
        return {key: v for key, v in document.items() if v or key not in zones}

    def zones(self, up: Triple) -> dict[str, Any]:
        """Return `box`, `keep_out` and `mounting` of `Workspace` as written, in metres.

        `up` is for planes that don't say where they run.
        """
        room = None
        if self.min_mm is not None and self.max_mm is not None:
            low, high = np.array(self.min_mm), np.array(self.max_mm)
            room = _box("box", 0.5 * (low + high), high - low, _IDENTITY)
        return {
            "box": room,
            "keep_out": tuple(zone.box() for zone in self.keep_out),
            "mounting": tuple(plane.box(up) for plane in self.mounting),
        }


def turned(turn_deg: list[float]) -> NDArray[np.float64]:
    """Return the rotation about the x, then the y, then the z axis of the world."""
    # Lower-case letters turn about the fixed axes, in this order.
    return Rotation.from_euler("xyz", turn_deg, degrees=True).as_matrix()


def check_names(key: str, names: list[str]) -> None:
    """Refuse tables of one name.

    Raises:
        ValueError: It names the first that comes twice.
    """
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"{key} names {name!r} twice; name them apart")


def _box(name: str, centre_mm: ArrayLike, size_mm: ArrayLike, axes: Axes) -> Box:
    centre, half = (
        cast(Triple, tuple((factor * np.array(mm)).tolist()))
        for factor, mm in ((1e-3, centre_mm), (1e-3 * 0.5, size_mm))
    )
    return Box(name, centre, half, axes)


def _level(normal: NDArray[np.float64], up: NDArray[np.float64]) -> list[float]:
    """A level direction in a plane; where the plane is level, x, or y if up is x."""
    level = np.cross(up, normal)
    if np.linalg.norm(level) > _NO_DIRECTION:
        return level.tolist()
    return [0.0, 1.0, 0.0] if up[0] else [1.0, 0.0, 0.0]


def _rows(axes: NDArray[np.float64]) -> Axes:
    # Sines of right angles are zero but for rounding; a plan should say so.
    return cast(Axes, tuple(tuple(row) for row in (np.round(axes, 15) + 0.0).tolist()))
