"""Lens models that fold the image: a few coefficients, taken beyond where they hold."""

import math

import numpy as np

from geometry.arrays import lengths
from geometry.devices import PinholeModel
from geometry.distortion import least_at

# Of the pixel that a viewing ray was told of, where it is imaged.
_SAME_PX = 1.0


def lens_fault(device: PinholeModel) -> str:
    """Return why pixels see nothing, or what others see, and a remedy; empty: none do.

    All within `least_at` of the fold have one ray each; the corners are the farthest.
    """
    if not any(device.distortion):
        return ""
    matrix, corners = device.camera_matrix, device.corners
    flat = (corners - matrix[:2, 2]) / np.diag(matrix)[:2]
    farthest = float(lengths(flat).max())
    where = ", or nearly so: no ray is found that its corners see"
    with np.errstate(all="ignore"):
        reach = math.inf
        if device.fold < math.inf:
            reach = least_at(device.fold, device.distortion)
        if not reach >= farthest:
            where = (
                f" {math.degrees(math.atan(device.fold)):.1f} degrees off the axis, "
                f"{reach * device.focal_px:.0f} px from the principal point, and its "
                f"corners are {farthest * device.focal_px:.0f} px from it"
            )
        elif np.abs(device.project(device.rays(corners)) - corners).max() <= _SAME_PX:
            return ""
    terms = ", ".join(f"{term:g}" for term in device.distortion)
    return (
        f"distortion = [{terms}] folds the image{where}; write more coefficients of "
        f"the calibration, or a smaller image"
    )
