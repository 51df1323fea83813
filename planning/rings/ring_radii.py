"""The rings of a projector: their frame, their radii, and the gap between them.

The ring axis need not be the device's axis. Turned aside (parallel light: shifted), it
moves the curves on which a camera is blind (|r.m| = 0) off the object.
"""

import numpy as np
from numpy.typing import NDArray

from geometry.devices import ParallelModel, PinholeModel
from geometry.poses import inverse
from planning.model.device_poses import frame_along, ring_frame, shifted_frame
from planning.model.requirements import TriangulationLimits
from solvers.poses.axis_program import axis_direction

MIN_PROJECTOR_PX = 3.0
_MIN_PITCH_PX = 6.0
# The gap is chosen for a camera that meets the surface at 60 degrees.
_GAP_FACING = 0.5


def ring_frame_of_axis(
    world_from_device: NDArray[np.float64],
    device: PinholeModel | ParallelModel,
    axis: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return ``world_from_ring`` of an axis in the coordinates of `ring_axis`."""
    if isinstance(device, ParallelModel):
        return world_from_device @ shifted_frame(axis)
    middle = ring_frame(np.eye(4), device, 0.0, 0.0)[:3, :3]
    return world_from_device @ frame_along(middle @ axis_direction(axis))


def ring_axis(
    world_from_device: NDArray[np.float64],
    device: PinholeModel | ParallelModel,
    world_from_ring: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the ring axis as two numbers a, (0, 0) in the middle of the beam.

    Parallel: where it meets the device plane, in [m]. Diverging: tan(tilt/2) times the
    unit vector towards which it is turned against the ray of the image centre, so that
    `solvers.poses.axis_program.axis_direction` is its inverse.
    """
    middle = ring_frame(world_from_device, device, 0.0, 0.0)
    frame = inverse(middle) @ world_from_ring
    if isinstance(device, ParallelModel):
        return frame[:2, 3]
    return frame[:2, 2] / (1.0 + frame[2, 2])


def ring_gap(
    projector: PinholeModel | ParallelModel,
    camera: PinholeModel,
    limits: TriangulationLimits,
    distance: float,
) -> float:
    """Return the spacing of rings along m in [m] at a distance from the devices.

    The finest that a camera at 60 degrees of incidence still separates and that the
    projector draws with three pixels or more::

        h = max(pitch t / (f cos 60), 3 z / f_projector)

    Args:
        projector: Optics of the projector.
        camera: Optics of the cameras.
        limits: Its `min_ring_pitch_px`; 6 px where it doesn't bind.
        distance: From the devices to the surface [m].
    """
    for_camera = least_pitch_px(limits) * distance / (camera.focal_px * _GAP_FACING)
    return max(for_camera, MIN_PROJECTOR_PX * projector.pixel_m(distance))


def least_pitch_px(limits: TriangulationLimits) -> float:
    """Return the least pitch of rings in [px]; 6 where it doesn't bind."""
    return limits.min_ring_pitch_px or _MIN_PITCH_PX


def uniform_radii(outer: float, gap: float) -> NDArray[np.float64]:
    """Return equally spaced radii up to the outermost, increasing, shape (n,).

    The gap is shrunk so that equal steps end there.
    """
    n = max(2, int(np.ceil(outer / gap)))
    return outer * np.arange(1, n + 1) / n
