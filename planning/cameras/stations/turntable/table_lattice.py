"""Candidate places about a turntable, on circles about its axis.

When the table has turned the part by an angle, the part sees the devices turned back
by it. A whole number of places to a turn are laid out on each circle, so that every
step of the table takes the lattice to itself.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from geometry.arrays import Array, Ints, Mask
from planning.model.devices.device_poses import moved_to
from planning.model.devices.heads import Turntable
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.errors import InfeasibleLimitsError
from planning.model.requirements import Workspace
from planning.scene.placed_bodies import Device
from planning.scene.workspace.admissible import admissible
from planning.scene.workspace.candidates import aimed_poses
from planning.scene.workspace.shell_positions import Range

_D = TypeVar("_D", PlannedProjector, PlannedCamera)

# Places to a turn at least, and where the table may stand at any angle; and at most so
# many of the angles are planned with, where it may stand at more that so many divide.
_FREE, _FEWEST, _MOST = 24, 12, 36
# Circles of latitude between the ends of the axis.
_CIRCLES = 9
# Devices that stand more than a share of a turn apart meet badly.
_ASIDE = 0.25


def axis_point(table: Turntable, space: Workspace) -> Array:
    """Return the point of the axis nearest to the object's centre, (3,) [m]."""
    point, axis = np.array(table.point_m), np.array(table.axis)
    return point + axis * float((np.array(space.centre) - point) @ axis)


def off_axis_m(table: Turntable, space: Workspace) -> float:
    """Return how far from the axis the object's centre is [m]."""
    return float(np.linalg.norm(axis_point(table, space) - np.array(space.centre)))


def about_axis(space: Workspace, table: Turntable) -> Workspace:
    """Return the room's workspace with play for the object's own way about the axis."""
    play = off_axis_m(table, space)

    def wider(radius: Range) -> Range:
        return max(1e-3, radius[0] - play), radius[1] + play

    return replace(
        space,
        projector_radius_m=wider(space.projector_radius_m),
        camera_radius_m=wider(space.camera_radius_m),
    )


def planned_angles(steps: int | None) -> int:
    """Return how many angles of a table are planned with, evenly over a turn.

    Of many steps as many as divide their number, 36 at most; all where none do.
    """
    if steps is None:
        return _FREE
    if steps <= _MOST:
        return steps
    shared = [n for n in range(_FEWEST, _MOST + 1) if steps % n == 0]
    return max(shared, default=steps)


@dataclass(frozen=True, eq=False)
class TableLattice:
    """Places of devices about a table, in the room at angle 0.

    Attributes:
        table: The turntable, in the world.
        space: Where devices may stand in the room.
        projectors: One on each circle, at its place 0; `cameras` likewise.
    """

    table: Turntable
    space: Workspace
    projectors: tuple[PlannedProjector, ...]
    cameras: tuple[PlannedCamera, ...]

    @classmethod
    def about(
        cls,
        table: Turntable,
        space: Workspace,
        projectors: Sequence[PlannedProjector],
        cameras: Sequence[PlannedCamera],
    ) -> "TableLattice":
        """Return the circles of each model on which the room leaves a place.

        Raises:
            InfeasibleLimitsError: If it leaves none to projectors, or to cameras.
        """
        empty = cls(table, space, (), ())
        lamps = tuple(
            d for t in projectors for d in empty.circles(t) if empty.room(d).any()
        )
        eyes = tuple(
            d for t in cameras for d in empty.circles(t) if empty.room(d).any()
        )
        for kind, left in (("projector", lamps), ("camera", eyes)):
            if not left:
                raise InfeasibleLimitsError(
                    f"no place on {_CIRCLES} circles about the turntable's axis, in "
                    f"the middle of the standoff and its play, is left to a {kind} by "
                    f"the workspace; widen it, thicken its mounting planes, or change "
                    f"standoff_mm"
                )
        return cls(table, space, lamps, eyes)

    @property
    def n_angles(self) -> int:
        """Angles of the table that are planned with."""
        return planned_angles(self.table.steps)

    @property
    def stride(self) -> int:
        """How many places the table turns by from one angle to the next."""
        return -(-_FREE // self.n_angles)

    @property
    def n_places(self) -> int:
        """Places on a circle."""
        return self.stride * self.n_angles

    @property
    def offsets(self) -> Ints:
        """How many places on from a projector a camera may stand."""
        most = int(_ASIDE * self.n_places)
        return np.arange(-most, most + 1)

    def angle(self, places: int) -> float:
        """Return the angle of so many places [rad]."""
        return 2.0 * np.pi * places / self.n_places

    def placed(self, device: _D, place: int) -> _D:
        """Return a device of place 0 at another."""
        turn = self.table.turn(self.angle(place))
        return moved_to(device, turn @ device.world_from_device)

    def circles(self, template: _D) -> Iterator[_D]:
        """Yield a device on each circle, in the middle of the shell."""
        axis = np.array(self.table.axis)
        aim = axis_point(self.table, self.space)
        side = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
        side /= np.linalg.norm(side)
        radius = 0.5 * sum(self._shell(template))
        # Which way the part turns doesn't turn devices over.
        up = axis if axis @ np.array(self.space.up) >= 0.0 else -axis
        for k in range(1, _CIRCLES + 1):
            latitude = np.pi * (k / (_CIRCLES + 1) - 0.5)
            out = np.cos(latitude) * side + np.sin(latitude) * axis
            place = (aim + radius * out)[None]
            (pose,) = aimed_poses(place, aim, up, template.device)
            yield moved_to(template, pose)

    def room(self, device: Device) -> Mask:
        """Return which places of a device's circle the room leaves, (n_places,)."""
        low, high = self._shell(device)
        play = off_axis_m(self.table, self.space)
        turns = [self.table.turn(self.angle(k)) for k in range(self.n_places)]
        places = (np.stack(turns) @ device.world_from_device)[:, :3, 3]
        offsets = places - np.array(self.space.centre)
        return admissible(self.space, (low - play, high + play), offsets)

    def _shell(self, device: Device) -> Range:
        lights = isinstance(device, PlannedProjector)
        space = self.space
        return space.projector_radius_m if lights else space.camera_radius_m
