"""Housings and mounts, which move with a device; zones and obstacles, which don't.

Only values, as rig files and plans hold them; what follows from them the planner
(`placed_bodies`, `mount_settings`, `admissible`) and the checkers each work out alone.
"""

import math
from dataclasses import dataclass, replace
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from geometry.arrays import Array
from geometry.mesh.mesh import TriangleMesh
from planning.model.table_types import Axis, Positive, Sides, Table

# How far from a whole number the steps of a turn may be.
_WHOLE = 1e-6

Triple = tuple[float, float, float]
Axes = tuple[Triple, Triple, Triple]


class BodyTable(Table):
    """A body in a rig file, `[camera.body]` and so on.

    Attributes:
        size_mm: Width, height and depth: its extent along the device's x, y and z.
        centre_mm: Its middle in device coordinates.
    """

    size_mm: Sides
    centre_mm: Axis


@dataclass(frozen=True)
class Body:
    """A box in device coordinates: x right, y down, z forward from the optical centre.

    Parallel light: from the middle of the panel.

    Attributes:
        centre_m: Its middle [m].
        half_m: Half of its extent along x, y and z [m].

    Raises:
        ValueError: If a side isn't positive.
    """

    centre_m: Triple
    half_m: Triple

    @classmethod
    def of(cls, table: BodyTable | None) -> Self | None:
        """Return the body of a rig file's table; None where there is none."""
        if table is None:
            return None
        x, y, z = (1e-3 * value for value in table.centre_mm)
        width, height, depth = (0.5e-3 * value for value in table.size_mm)
        return cls((x, y, z), (width, height, depth))

    def __post_init__(self) -> None:
        if not min(self.half_m) > 0.0:
            raise ValueError(f"body: half_m = {self.half_m} must be positive")


class MountTable(Table):
    """The mount of a device in a rig file, `[camera.mount]` and so on.

    Attributes:
        offset_mm: Middle of its thread or flange in device coordinates.
        axis: Direction out of the device, square to the face that is fastened.
        roll_deg: Rolls of the housing that are allowed; None: any.
        pan_step_deg: Pan is a whole number of these; None: any. Tilt likewise.
        grid_mm: Its place is on a grid of this step along each axis.
    """

    offset_mm: Axis | None = None
    axis: Axis | None = None
    roll_deg: Annotated[list[float], Field(min_length=1)] | None = None
    pan_step_deg: Annotated[float, Field(gt=0.0, le=180.0)] | None = None
    tilt_step_deg: Annotated[float, Field(gt=0.0, le=90.0)] | None = None
    grid_mm: Positive | None = None

    @model_validator(mode="after")
    def _check_thread(self) -> Self:
        if (self.offset_mm is None) != (self.axis is None):
            raise ValueError("offset_mm and axis of a thread go together; write both")
        if self.axis is not None and not np.linalg.norm(self.axis) > 0.0:
            raise ValueError(f"axis = {self.axis} must not be zero")
        return self

    @model_validator(mode="after")
    def _check_steps(self) -> Self:
        turn = 360.0 / (self.pan_step_deg or 360.0)
        if abs(turn - round(turn)) > _WHOLE:
            raise ValueError(
                f"pan_step_deg = {self.pan_step_deg:g} must divide 360, so that steps "
                f"meet after a turn"
            )
        return self


@dataclass(frozen=True)
class Mount:
    """A thread or flange in device coordinates: x right, y down, z forward.

    Its frame has its origin in the middle and z along the axis, out of the device; x is
    the device's forward as far as that is square to z, or where it isn't its right.

    Attributes:
        offset_m: Its middle [m]; None: it isn't said.
        axis: Unit direction out of the device; None: it isn't said.
        rolls: Rolls of the housing that are allowed [rad]; none: any.
        pan_step: Pan of the housing is a whole number of these [rad]; None: any.
        tilt_step: The same of tilt.
        grid_m: Step of the grid that its middle, or else the optical centre, is on;
            None: it may be anywhere.
    """

    offset_m: Triple | None = None
    axis: Triple | None = None
    rolls: tuple[float, ...] = ()
    pan_step: float | None = None
    tilt_step: float | None = None
    grid_m: float | None = None

    @property
    def free(self) -> "Mount":
        """The same thread or flange, set to anything."""
        return Mount(self.offset_m, self.axis)

    @property
    def is_stepped(self) -> bool:
        """Whether there are poses that it can't be set to."""
        return bool(self.rolls or self.pan_step or self.tilt_step or self.grid_m)

    @property
    def place_m(self) -> Triple:
        """What the grid binds, in device coordinates [m]."""
        return self.offset_m or (0.0, 0.0, 0.0)

    @classmethod
    def of(cls, table: MountTable | None) -> Self | None:
        """Return the mount of a rig file's table; None where there is none."""
        if table is None:
            return None
        offset, axis = table.offset_mm, table.axis
        return cls(
            None if offset is None else _triple(1e-3 * np.array(offset)),
            None if axis is None else _triple(np.array(axis) / np.linalg.norm(axis)),
            tuple(math.radians(roll) for roll in table.roll_deg or ()),
            _radians(table.pan_step_deg),
            _radians(table.tilt_step_deg),
            None if table.grid_mm is None else 1e-3 * table.grid_mm,
        )


@dataclass(frozen=True)
class Box:
    """A box, of any turn. A mounting plane is a thin one.

    Position Q is in it iff |a_i . (Q - workspace centre - centre_m)| <= half_m_i for
    its three directions a_i.

    Attributes:
        name: What messages call it.
        centre_m: Its middle, from the object's centre [m].
        half_m: Half of each side [m].
        axes: Unit directions of the sides in the world, right-handed.
    """

    name: str
    centre_m: Triple
    half_m: Triple
    axes: Axes

    def moved(self, by_m: Triple) -> "Box":
        """Return the box displaced."""
        (a, b, c), (x, y, z) = self.centre_m, by_m
        return replace(self, centre_m=(a + x, b + y, c + z))

    def grown(self, by_m: float) -> "Box":
        """Return the box with every face moved outwards, or inwards if negative."""
        x, y, z = (max(half + by_m, 0.0) for half in self.half_m)
        return replace(self, half_m=(x, y, z))


def _triple(vector: Array) -> Triple:
    x, y, z = vector.tolist()
    return x, y, z


def _radians(degrees: float | None) -> float | None:
    return None if degrees is None else math.radians(degrees)


@dataclass(frozen=True)
class Existing:
    """A device that stands already and stays where it is.

    Attributes:
        name: As in the rig file.
        kind: `projector` or `camera`.
        world_from_device: Its pose, rows of a 4 x 4 matrix [m].
        body: Its own, or that of its kind; None: it has none.
        world_from_ring: Ring frame of a projector whose rings stay, rows [m]; None:
            its rings are planned.
        ring_radii: Of these rings, as in `PlannedProjector`.
        model: Which of the rig's models it is; empty: the first.

    Raises:
        ValueError: If a pose isn't 4 x 4.
    """

    name: str
    kind: str
    world_from_device: tuple[tuple[float, ...], ...]
    body: Body | None = None
    world_from_ring: tuple[tuple[float, ...], ...] | None = None
    ring_radii: tuple[float, ...] = ()
    model: str = ""

    def __post_init__(self) -> None:
        for rows in (self.world_from_device, self.world_from_ring or ((0.0,) * 4,) * 4):
            if [len(row) for row in rows] != [4] * 4:
                raise ValueError("existing: poses must be 4 x 4")
        if (self.world_from_ring is None) != (not self.ring_radii):
            raise ValueError("existing: world_from_ring and ring_radii go together")


@dataclass(frozen=True, eq=False)
class Obstacle:
    """A surface through which no light and no view passes: robot, table, clamp.

    Attributes:
        name: As in the rig file; of one that stands still, with its step in brackets.
        mesh: Where it stands, in the world [m].
        station: The step of a turntable at which the part sees it there: it is in the
            way of devices of that step alone. Empty: it turns with the part.
    """

    name: str
    mesh: TriangleMesh
    station: str = ""

    @property
    def rig_name(self) -> str:
        """Its name in the rig file."""
        return self.name.removesuffix(f" ({self.station})")
