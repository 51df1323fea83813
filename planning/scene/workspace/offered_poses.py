"""Poses of one kind of device over its workspace, upright and on their sides.

They look at its centre; over an object that is wider than the field also beside it, as
far as a `Site` says so (`view_tiles`).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.devices import DeviceModel, turned_to
from geometry.poses import fibonacci_cap, look_at
from planning.model.errors import InfeasibleLimitsError
from planning.model.requirements import Workspace

from .shell_positions import Range, shell_positions, towards
from .view_tiles import Site, poses_beside, tiled_poses
from .zone_conflicts import no_position

_Array = NDArray[np.float64]

# Positions offered around a chosen one.
_AROUND = 60
# In tiled placement: poses for each that looks at the centre, and directions at least
# and for an estimate.
_BESIDE = 3
_LEAST_DIRECTIONS = 24
_PROBED = 48
# Sine of the angle to the vertical below which a direction has no level across it.
_LEVEL = 1e-6


def aimed_poses(
    positions: _Array,
    aim: _Array,
    up: _Array,
    device: DeviceModel,
    *,
    roll: float = 0.0,
) -> _Array:
    """Return ``world_from_device`` with the middle of the image on the aim, (n, 4, 4).

    With lens shift the middle of the image is off the optical axis, so the device is
    turned against its line of sight by that angle.
    """
    world_from_aim = look_at(positions, aim, up, roll=roll)
    aim_from_device = np.eye(4)
    aim_from_device[:3, :3] = turned_to(device.middle_ray)
    return world_from_aim @ aim_from_device


def rolls_for(
    device: DeviceModel, object_radius: float, distance: float
) -> tuple[float, ...]:
    """Return the rolls worth offering: upright, and on its side if that helps.

    Args:
        device: Optics.
        object_radius: Radius of the sphere that holds the object [m].
        distance: From the device to the centre of that sphere [m].
    """
    on_side = device.holds_more_on_side(object_radius, distance)
    return (0.0, 0.5 * np.pi) if on_side else (0.0,)


def middle_radius_m(radius_m: Range, site: Site | None) -> float:
    """Return how far from the centre offered devices stand where nothing is in the way.

    Args:
        radius_m: Least and largest distance of this kind of device.
        site: What they stand over in tiled placement; None: all look at the centre.
    """
    if site is not None:
        # A standoff away from the ball about the object.
        return site.standoff_m + site.workspace.object_radius_m
    return 0.5 * (radius_m[0] + radius_m[1])


@dataclass(frozen=True, eq=False)
class OfferedPoses:
    """Poses of one kind of device, by what it looks at."""

    device: DeviceModel
    workspace: Workspace
    radius_m: Range
    site: Site | None

    def over(self, n: int) -> _Array:
        """At least n poses over the workspace, shape (m, 4, 4)."""
        rolls = self._rolls
        positions = shell_positions(self.workspace, self._shell, -(-n // len(rolls)))
        poses = self._aimed(positions)
        if self.site is not None:
            poses = np.concatenate([poses, _tiled(self.site, n, rolls)])
        if not len(poses):
            raise InfeasibleLimitsError(no_position(self.workspace, self.radius_m))
        return poses

    def towards(self, directions: _Array) -> _Array:
        """Poses in directions from the centre (n, 3), shape (m, 4, 4)."""
        poses = self._aimed(self._positions(directions))
        if self.site is None:
            return poses
        tiled, _ = tiled_poses(self.site, directions, self._rolls)
        return np.concatenate([poses, tiled])

    def around(self, poses: _Array, n_lattice: int, scale: float) -> _Array:
        """Poses close around those of a lattice, shape (m, 4, 4)."""
        if self.site is not None:
            reach = scale * self._spacing(n_lattice // (1 + _BESIDE))
            return poses_beside(self.site, poses, _AROUND, reach=reach)
        reach = scale * self._spacing(n_lattice // len(self._rolls))
        positions: list[_Array] = []
        for pose in poses:
            outwards = pose[:3, 3] - np.array(self.workspace.centre)
            outwards = outwards / np.linalg.norm(outwards)
            level = np.cross(np.array(self.workspace.up), outwards)
            start = level if np.linalg.norm(level) > _LEVEL else None
            cap = fibonacci_cap(_AROUND, outwards, reach, start=start)
            positions.append(self._positions(cap))
        return self._aimed(np.concatenate(positions))

    @property
    def _shell(self) -> Range:
        """The part of the shell a standoff away from the ball about the object."""
        if self.site is None:
            return self.radius_m
        middle = middle_radius_m(self.radius_m, self.site)
        return 2.0 * middle - self.radius_m[1], self.radius_m[1]

    @property
    def _rolls(self) -> tuple[float, ...]:
        distance = 0.5 * (self._shell[0] + self._shell[1])
        return rolls_for(self.device, self.workspace.object_radius_m, distance)

    def _positions(self, directions: _Array) -> _Array:
        offsets = towards(self.workspace, self._shell, directions)
        return np.array(self.workspace.centre) + offsets

    def _aimed(self, positions: _Array) -> _Array:
        aim, up = np.array(self.workspace.centre), np.array(self.workspace.up)
        return np.concatenate(
            [aimed_poses(positions, aim, up, self.device, roll=r) for r in self._rolls]
        )

    def _spacing(self, n_positions: int) -> float:
        """Angle between neighbours of a lattice of so many positions [rad]."""
        # Each position of the lattice has this much of the solid angle.
        solid_angle = 2 * np.pi * (1 - np.cos(self.workspace.half_angle))
        return float(np.sqrt(solid_angle / max(1, n_positions)))


def _tiled(site: Site, n: int, rolls: Sequence[float]) -> _Array:
    """About three times n poses over tiles: the more tiles, the fewer directions."""
    lattice = _directions(site, _PROBED)
    if not len(lattice):
        return np.empty((0, 4, 4))
    each = len(tiled_poses(site, lattice, rolls)[0]) / len(lattice)
    wanted = max(_LEAST_DIRECTIONS, int(min(n, _BESIDE * n / max(each, 1.0))))
    return tiled_poses(site, _directions(site, wanted), rolls)[0]


def _directions(site: Site, n: int) -> _Array:
    """Directions from the centre of n positions or more, if there are as many."""
    offsets = shell_positions(site.workspace, site.radius_m, n)
    offsets = offsets - np.array(site.workspace.centre)
    return offsets / np.linalg.norm(offsets, axis=1, keepdims=True)
