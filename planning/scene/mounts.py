"""Where mounts stand in the world."""

import numpy as np
from numpy.typing import NDArray

from planning.model.mounts import Mount

_Array = NDArray[np.float64]
# Sine of the angle between axis and forward below which the right takes its place.
_ALONG = 1e-6


def device_from_mount(mount: Mount) -> _Array:
    """Return the frame of a mount in device coordinates, (4, 4) [m]."""
    z = np.array(mount.axis)
    forward = np.array([0.0, 0.0, 1.0]) - z[2] * z
    if np.linalg.norm(forward) < _ALONG:
        forward = np.array([1.0, 0.0, 0.0]) - z[0] * z
    x = forward / np.linalg.norm(forward)
    frame = np.eye(4)
    frame[:3, :3] = np.column_stack([x, np.cross(z, x), z])
    frame[:3, 3] = mount.offset_m
    return frame
