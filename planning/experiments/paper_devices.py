"""The devices of section VII, placed by hand."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from geometry.poses import look_at
from planning.verify.reconstruction.arrays import Array
from planning.verify.reconstruction.calibration import (
    CameraCalibration,
    ProjectorCalibration,
)
from planning.verify.reconstruction.light_laws import LIGHTS, LightName
from planning.verify.reconstruction.patterns.ring_patterns import DrawnRings

UP = np.array([0.0, 0.0, 1.0])
# Both projectors of the paper have 1024 x 768 px, the cameras 1280 x 720 px.
PROJECTOR_PX = (1024, 768)
CAMERA_PX = (1280, 720)
STANDOFF_M = 1.0
# Ours; the paper gives none. The panel of the parallel beam is 307 x 230 mm, so that
# the ring of 4 inches fits; the diverging one throws 1 m wide at 2 m.
PIXEL_PITCH_M = 0.3e-3
THROW_RATIO = 2.0


@dataclass(frozen=True)
class Optics:
    """A camera's interior, and what a user should know of it.

    Attributes:
        focal_px: Focal length in [px].
        centre_px: Principal point (u, v) in [px].
        distortion: k1 of the lens.
    """

    focal_px: float
    centre_px: tuple[float, float]
    distortion: float = 0.0

    @property
    def field_m(self) -> tuple[float, float]:
        """Width and height that are seen at the standoff [m]."""
        width, height = (side * STANDOFF_M / self.focal_px for side in CAMERA_PX)
        return width, height


# "The estimated focal length here is about 8000 pixels", "(u0, v0) = (174, 68)".
PRINTED = Optics(8000.0, (174.0, 68.0))
# Ours: 457 x 257 mm at 1 m hold the ring of 4 inches, 203 mm across.
FITTING = Optics(2800.0, (639.5, 359.5))


def bearing(azimuth_deg: float, elevation_deg: float) -> Array:
    """Return the direction (3,) from the object to a device.

    Azimuth 0 is before the object, on the side of -y; positive is towards +x.
    """
    a, e = np.deg2rad([azimuth_deg, elevation_deg])
    return np.array([np.cos(e) * np.sin(a), -np.cos(e) * np.cos(a), np.sin(e)])


def placed_projector(
    name: str, light: LightName, direction: Array, target: Array, radii_m: Array
) -> ProjectorCalibration:
    """Return a projector whose rings are centred on a point of the object.

    Direction from the target to the device, unit, (3,); target [m], (3,). Radii [m] are
    those on the object or, in diverging light, at the standoff.
    """
    width, height = PROJECTOR_PX
    pose = look_at(target + STANDOFF_M * direction, target, UP)
    diverging = light == "diverging"
    scale = THROW_RATIO * width if diverging else 1.0 / PIXEL_PITCH_M
    matrix = np.diag([scale, scale, 1.0])
    matrix[:2, 2] = 0.5 * (width - 1), 0.5 * (height - 1)
    radii = radii_m / STANDOFF_M if diverging else radii_m
    drawn = DrawnRings(LIGHTS[light], radii)
    return ProjectorCalibration(name, pose, matrix, PROJECTOR_PX, pose, None, drawn)


def placed_camera(
    name: str, optics: Optics, direction: Array, target: Array
) -> CameraCalibration:
    """Return a camera with the target in the middle of its image.

    A principal point off the middle turns the optical axis past the target. Direction
    from the target to the device, unit, (3,); target [m], (3,).
    """
    (width, height), (cx, cy), f = CAMERA_PX, optics.centre_px, optics.focal_px
    pose = look_at(target + STANDOFF_M * direction, target, UP)
    middle = np.array([0.5 * (width - 1) - cx, 0.5 * (height - 1) - cy, f])
    # Device axes such that the ray of the middle pixel is where look_at's +z is.
    turn = Rotation.align_vectors([0.0, 0.0, 1.0], middle)[0].as_matrix()
    pose[:3, :3] = pose[:3, :3] @ turn
    matrix = np.array([[f, 0.0, cx], [0.0, f, cy], [0.0, 0.0, 1.0]])
    lens = (optics.distortion, 0.0, 0.0, 0.0, 0.0)
    return CameraCalibration(name, pose, matrix, CAMERA_PX, lens)
