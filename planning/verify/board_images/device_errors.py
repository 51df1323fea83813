"""What errors of a device's pose and optics do to its image, and images to points.

A point P appears at u. If the device is turned by d and displaced by x, its focal
length off by the share e, its principal point by c and its k1 by k, it appears at u +
du; with L the footprint of a pixel at P (what a pixel moves the ray by, in [m/px]), p
the undistorted image point and s = |p|^2::

    du = L^+ ((P - O) x d - x) + e (u - u_0) + c + f k s p

Who takes the device to be where it isn't sees P along the ray of u + du, which passes
it by L du.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array
from geometry.devices import PinholeModel
from planning.model.devices.calibration_errors import CalibrationErrors
from planning.model.devices.planned import PlannedCamera, PlannedProjector

Device = PlannedCamera | PlannedProjector
# Three of the turn [rad], three of the displacement [m], share of the focal length,
# two of the principal point [px], k1.
N_ERRORS = 10
# What is known of a rig before it is calibrated: brackets to ISO 2768-1 m, and lenses
# by their data sheets. It decides where marks leave something open, else nothing.
_BEFORE = CalibrationErrors(np.radians(0.33), 1.2e-3, 0.03, 20.0)
_K1_BEFORE = 0.1


@dataclass(frozen=True, eq=False)
class Shifts:
    """What errors do at n points.

    Attributes:
        footprints: L, displacement of rays by pixels, in the world, (n, 3, 2) [m/px].
        inverses: L^+, (n, 2, 3) [px/m].
        pixels: du by each error, (n, 2, 10).
    """

    footprints: Array
    inverses: Array
    pixels: Array

    @property
    def rays(self) -> Array:
        """Displacement of rays by each error, (n, 3, 10) [m]."""
        return self.footprints @ self.pixels


def shifts_of(device: Device, points: Array) -> Shifts:
    """Return what a device's errors do at points of its field (n, 3) in the world."""
    turn, optics = device.world_from_device[:3, :3], device.device
    offsets = points - device.world_from_device[:3, 3]
    local = offsets @ turn
    pixels = np.zeros((len(points), 2, N_ERRORS))
    if isinstance(optics, PinholeModel):
        reach = np.linalg.norm(offsets, axis=1)
        footprints = turn @ optics.ray_jacobian(local) * reach[:, None, None]
        principal = optics.camera_matrix[:2, 2]
        pixels[:, :, 6] = optics.project(local) - principal
        p = local[:, :2] / local[:, 2:]
        focal = np.diag(optics.camera_matrix)[:2]
        pixels[:, :, 9] = focal * p * np.sum(p * p, axis=1, keepdims=True)
    else:
        one = turn[:, :2] * optics.pixel_pitch_m
        footprints = np.broadcast_to(one, (len(points), 3, 2))
        pixels[:, :, 6] = local[:, :2] / optics.pixel_pitch_m
    across = np.swapaxes(footprints, 1, 2)
    inverses = np.linalg.inv(across @ footprints) @ across
    pixels[:, :, :3] = inverses @ crosses(offsets)
    pixels[:, :, 3:6] = -inverses
    pixels[:, :, 7:9] = np.eye(2)
    return Shifts(footprints, inverses, pixels)


def crosses(vectors: Array) -> Array:
    """Return the matrices of v x, (n, 3) to (n, 3, 3)."""
    return -np.cross(vectors[:, None, :], np.eye(3))


def known_before(devices: Sequence[Device]) -> Array:
    """Return the information on all errors before a calibration, (10 d, 10 d)."""
    known = np.repeat(
        [
            *(_BEFORE.about_axis, _BEFORE.along_axis_m, _BEFORE.focal),
            *(_BEFORE.along_line_px, _K1_BEFORE),
        ],
        [3, 3, 1, 2, 1],
    )
    return np.diag(np.tile(known**-2.0, len(devices)))
