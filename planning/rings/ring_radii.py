"""The rings of a projector: their radii, and the gap between them."""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from geometry.devices import DeviceModel, PinholeModel
from planning.model.requirements import TriangulationLimits

MIN_PROJECTOR_PX = 3.0
_MIN_PITCH_PX = 6.0
# The gap is chosen for a camera that meets the surface at 60 degrees.
_GAP_FACING = 0.5


def ring_gap(
    projector: DeviceModel,
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


def widest_ring_gap(
    projectors: Iterable[DeviceModel],
    cameras: Sequence[PinholeModel],
    limits: TriangulationLimits,
    distance: float,
) -> float:
    """Return the spacing that every camera separates and every projector draws [m]."""
    return max(
        ring_gap(projector, camera, limits, distance)
        for projector in projectors
        for camera in cameras
    )


def least_pitch_px(limits: TriangulationLimits) -> float:
    """Return the least pitch of rings in [px]; 6 where it doesn't bind."""
    return limits.min_ring_pitch_px or _MIN_PITCH_PX


def uniform_radii(outer: float, gap: float) -> NDArray[np.float64]:
    """Return equally spaced radii up to the outermost, increasing, shape (n,).

    The gap is shrunk so that equal steps end there.
    """
    n = max(2, int(np.ceil(outer / gap)))
    return outer * np.arange(1, n + 1) / n
