"""Candidate viewpoints: devices over the workspace, upright and on their sides.

They look at its centre; over an object that is wider than the field also beside it, as
far as a `Site` says so (`view_tiles`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import lengths
from geometry.devices import DeviceModel, turned_to
from geometry.poses import fibonacci_cap, look_at
from planning.model.devices.device_poses import moved_to, poses_of
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.errors import InfeasibleLimitsError
from planning.model.requirements import Workspace
from planning.scene.placed_bodies import kind_of

from .mount_settings import settable
from .shell_positions import Range, shell_positions, towards
from .view_tiles import Site, poses_beside, tiled_poses
from .zone_conflicts import no_position

_Array = NDArray[np.float64]
_D = TypeVar("_D", PlannedProjector, PlannedCamera)

# Positions offered around a chosen one.
_AROUND = 60
# In tiled placement: poses for each that looks at the centre, and directions at least
# and for an estimate.
_BESIDE = 3
_LEAST_DIRECTIONS = 24
_PROBED = 48
# Off an end of the shell, so that rounding a pose keeps it inside.
_NUDGE_M = 1e-4
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


@dataclass(frozen=True, eq=False)
class Candidates(Generic[_D]):
    """Gives candidates of one kind of device.

    Attributes:
        template: Its optics and rings; the rings move along with its pose.
        workspace: Where devices may stand.
        site: What they stand over in tiled placement; None: all look at the centre.
    """

    template: _D
    workspace: Workspace
    site: Site | None = None

    def over(self, n: int) -> tuple[_D, ...]:
        """Return at least n candidates over the whole workspace.

        Raises:
            InfeasibleLimitsError: If the workspace holds no position.
        """
        rolls = self.rolls
        positions = shell_positions(self.workspace, self._shell, -(-n // len(rolls)))
        poses = self._aimed(positions)
        if self.site is not None:
            poses = np.concatenate([poses, _tiled(self.site, n, rolls)])
        if not len(poses):
            raise InfeasibleLimitsError(no_position(self.workspace, self._radius_m))
        candidates = self._at(poses)
        if not candidates:
            raise InfeasibleLimitsError(
                f"the mount of the {kind_of(self.template)} can be set to none of "
                f"{len(poses)} poses in the workspace; use a finer grid_mm, "
                f"pan_step_deg or tilt_step_deg, other roll_deg, or widen the workspace"
            )
        return candidates

    def towards(self, directions: _Array) -> tuple[_D, ...]:
        """Return admissible ones in directions from the centre, unit, shape (n, 3)."""
        poses = self._aimed(self._positions(directions))
        if self.site is not None:
            tiled, _ = tiled_poses(self.site, directions, self.rolls)
            poses = np.concatenate([poses, tiled])
        return self._at(poses)

    def nearest(self, n: int) -> tuple[_D, ...]:
        """Return about n candidates over the workspace, as near as the shell allows.

        What a turn leaves unknown of a point grows with the distance. In tiled
        placement all stand a standoff away anyway: none.
        """
        if self.site is not None:
            return ()
        positions = shell_positions(
            self.workspace, self._shell, -(-n // len(self.rolls))
        )
        offsets = positions - np.array(self.workspace.centre)
        offsets /= lengths(offsets)[:, None]
        near = min(0.5 * sum(self._shell), self._shell[0] + _NUDGE_M)
        return self._at(self._aimed(self._positions(offsets, near)))

    def around(
        self,
        chosen: Sequence[_D],
        n_lattice: int,
        scale: float = 1.0,
        *,
        far: bool = False,
    ) -> tuple[_D, ...]:
        """Return candidates between those of a lattice, close around chosen ones.

        Each chosen pose gets positions out to the lattice's spacing, as seen from the
        centre of the workspace (times `scale`), as far as they are admissible; laid out
        from the vertical through it, so that they turn with the workspace. If they may
        be `far`, every other one is at the far end of the shell, where more of the
        object is seen. In tiled placement, they are turned about what they look at and
        moved along with it.
        """
        if not chosen:
            return ()
        poses = poses_of(chosen)
        if self.site is not None:
            reach = scale * self._spacing(n_lattice // (1 + _BESIDE))
            return self._at(poses_beside(self.site, poses, _AROUND, reach=reach))
        reach = scale * self._spacing(n_lattice // len(self.rolls))
        positions: list[_Array] = []
        furthest = max(0.5 * sum(self._shell), self._shell[1] - _NUDGE_M)
        for pose in poses:
            outwards = pose[:3, 3] - np.array(self.workspace.centre)
            outwards = outwards / np.linalg.norm(outwards)
            level = np.cross(np.array(self.workspace.up), outwards)
            start = level if np.linalg.norm(level) > _LEVEL else None
            cap = fibonacci_cap(_AROUND, outwards, reach, start=start)
            near = slice(None, None, 2 if far else 1)
            positions.append(self._positions(cap[near]))
            if far:
                positions.append(self._positions(cap[1::2], furthest))
        return self._at(self._aimed(np.concatenate(positions)))

    @property
    def middle_radius_m(self) -> float:
        """How far from the centre they stand where nothing is in the way [m]."""
        if self.site is not None:
            # A standoff away from the ball about the object.
            return self.site.standoff_m + self.site.workspace.object_radius_m
        return 0.5 * (self._radius_m[0] + self._radius_m[1])

    @property
    def rolls(self) -> tuple[float, ...]:
        """Upright, and on its side if that shows more of the object [rad].

        Of the rolls that its mount allows all of them, or the first.
        """
        distance = 0.5 * (self._shell[0] + self._shell[1])
        radius = self.workspace.object_radius_m
        on_side = self.template.device.holds_more_on_side(radius, distance)
        mount = self.workspace.mount_of(kind_of(self.template))
        rolls = (0.0, 0.5 * np.pi)
        if mount is not None and mount.rolls:
            rolls = mount.rolls
        return rolls if on_side else rolls[:1]

    @property
    def _radius_m(self) -> Range:
        projects = isinstance(self.template, PlannedProjector)
        space = self.workspace
        return space.projector_radius_m if projects else space.camera_radius_m

    @property
    def _shell(self) -> Range:
        """The part of the shell a standoff away from the ball about the object."""
        low, high = self._radius_m
        return (low if self.site is None else 2.0 * self.middle_radius_m - high), high

    def _positions(self, directions: _Array, wanted_m: float | None = None) -> _Array:
        offsets = towards(self.workspace, self._shell, directions, wanted_m)
        return np.array(self.workspace.centre) + offsets

    def _aimed(self, positions: _Array) -> _Array:
        aim, up = np.array(self.workspace.centre), np.array(self.workspace.up)
        device = self.template.device
        return np.concatenate(
            [aimed_poses(positions, aim, up, device, roll=roll) for roll in self.rolls]
        )

    def _at(self, poses: _Array) -> tuple[_D, ...]:
        plain = replace(self.template, existing="")
        poses = settable(self.workspace, plain, poses)
        return tuple(moved_to(plain, pose) for pose in poses)

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
    return offsets / lengths(offsets)[:, None]
