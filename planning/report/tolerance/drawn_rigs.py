"""Rigs as they may be built: devices beside their poses, and not quite where taken.

A drawn rig differs from the plan twice. Its devices stand beside their planned poses
by the mounting, which is known once the rig is calibrated: light and views are those of
the devices as they stand. What the calibration leaves is unknown: points are computed
as if the devices stood where the calibration says, and are off by it.

Of every device, in its own axes (x across, y down, z along): the mounting is a
displacement and a turn about each axis and the focal length, uniform within their
bounds; the calibration's errors are these and the principal point, normal deviates.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from geometry.devices import ParallelModel
from planning.model.devices.calibration_errors import CalibrationErrors, Mounting
from planning.model.devices.device_poses import moved_to
from planning.model.devices.planned import PlannedCamera, PlannedProjector

_Array = NDArray[np.float64]
_D = TypeVar("_D", PlannedProjector, PlannedCamera)

# Random streams beside those of samples.
DRAWN, CONFIRMING, PLANNING = 970, 971, 972
# Numbers of a device: displacement and turn about x, y, z, focal length; then the
# principal point.
N_MOUNTED, N_UNKNOWN = 7, 9


@dataclass(frozen=True, eq=False)
class Rig:
    """Devices that stand somewhere."""

    projectors: tuple[PlannedProjector, ...]
    cameras: tuple[PlannedCamera, ...]

    @property
    def devices(self) -> tuple[PlannedProjector | PlannedCamera, ...]:
        """Projectors, then cameras."""
        return (*self.projectors, *self.cameras)

    def moved(self, by: _Array) -> "Rig":
        """Return the rig with its devices moved by (n_devices, 7) numbers.

        Existing devices stay: where they stand is known when the rig is planned.
        """
        n = len(self.projectors)
        return Rig(
            _moved(self.projectors, by[:n]),
            _moved(self.cameras, by[n:]),
        )


@dataclass(frozen=True, eq=False)
class Deviates:
    """One drawn rig, in units of what is stated.

    Attributes:
        mounted: In [-1, 1], of the mounting's bounds, shape (n_devices, 7).
        unknown: Of what the calibration leaves, shape (n_devices, 9).
        edges: Of the edge's place in the image and of the ring's, shape (n, 3).
    """

    mounted: _Array
    unknown: _Array
    edges: _Array

    @classmethod
    def drawn(
        cls, n_devices: int, n_samples: int, *, seed: int, stream: int, index: int
    ) -> "Deviates":
        """Return the draw of an index, which no other draw has to come before."""
        rng = np.random.default_rng([seed, stream, index])
        return cls(
            rng.uniform(-1.0, 1.0, (n_devices, N_MOUNTED)),
            rng.standard_normal((n_devices, N_UNKNOWN)),
            rng.standard_normal((n_samples, 3)),
        )


def bounds_of(mounting: Mounting) -> _Array:
    """Return the bound of each of a device's seven numbers, shape (7,)."""
    position, angle = mounting.position_m, mounting.angle
    return np.array([position] * 3 + [angle] * 3 + [mounting.focal])


def deviations_of(errors: CalibrationErrors) -> _Array:
    """Return the standard deviation of each of a device's nine errors, shape (9,)."""
    turn, place, pixel = errors.about_axis, errors.along_axis_m, errors.along_line_px
    return np.array([place] * 3 + [turn] * 3 + [errors.focal] + [pixel] * 2)


def moved_pose(pose: _Array, by: _Array) -> _Array:
    """Return a pose displaced and then turned in its own axes by (6,) numbers."""
    motion = np.eye(4)
    motion[:3, 3] = by[:3]
    motion[:3, :3] = Rotation.from_rotvec(by[3:6]).as_matrix()
    return pose @ motion


def _moved(devices: Sequence[_D], by: _Array) -> tuple[_D, ...]:
    return tuple(
        device if device.existing else _with_focal(_stood(device, move), move[6])
        for device, move in zip(devices, by, strict=True)
    )


def _stood(device: _D, by: _Array) -> _D:
    return moved_to(device, moved_pose(device.world_from_device, by))


def _with_focal(device: _D, share: float) -> _D:
    """A device of another focal length; its rings are drawn for it."""
    model = device.device
    if isinstance(model, ParallelModel):
        pitch = model.pixel_pitch_m * (1.0 + share)
        return replace(device, device=replace(model, pixel_pitch_m=pitch))
    matrix = model.camera_matrix.copy()
    matrix[[0, 1], [0, 1]] *= 1.0 + share
    return replace(device, device=replace(model, camera_matrix=matrix))
