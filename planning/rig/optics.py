"""Published figures of lenses and projectors, turned into pinhole parameters.

Everything here is thin-lens optics in closed form: makers publish millimetres, percent
and f-numbers, the planner wants pixels and the range of distances that is sharp.
"""

import math
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

_Length = TypeVar("_Length", float, NDArray[np.float64])


def principal_row(height_px: int, offset_percent: float) -> float:
    """Return the row of the optical axis of a projector with a vertical offset.

    The offset counts from the image centre to the optical axis in percent of *half*
    the image height (Optoma, Christie, Barco, TI): at 0 % the axis meets the centre,
    at 100 % the lower edge of the image (lens level with it), above 100 % it passes
    below the image. With h rows, the centre of the top one at v = 0::

        c_y = (h - 1) / 2 + (offset / 100) h / 2

    A maker that counts percent of the *whole* height (Vidikron, Runco) publishes half
    this number. The offset is positive with the lens below the image centre.
    """
    return 0.5 * (height_px - 1) + 0.005 * offset_percent * height_px


def depth_of_field(
    focal_m: float, f_number: float, blur_m: float, focus_m: float
) -> tuple[float, float]:
    """Return the nearest and farthest distance that a focused lens renders sharp.

    With focus distance s and hyperfocal distance H, focused at which everything from
    H / 2 to infinity images within the circle c::

        H = f^2 / (N c) + f
        near = s (H - f) / (H + s - 2 f)
        far  = s (H - f) / (H - s)             infinite for s >= H

    Both follow from the thin lens equation 1/f = 1/s + 1/s' and the width of the cone
    of light that the aperture f / N lets onto the sensor; the blur is c at both ends
    and zero at s. The same holds for a projector, whose light runs the other way. The
    blur is the diameter of the circle of confusion on the panel or sensor.

    Raises:
        ValueError: If an argument isn't positive or s <= f, where no image forms.
    """
    if not (focal_m > 0.0 and f_number > 0.0 and blur_m > 0.0):
        raise ValueError(
            f"focal {focal_m} m, f/{f_number} and blur {blur_m} m must be positive"
        )
    h = focal_m * focal_m / (f_number * blur_m) + focal_m
    if not focus_m > focal_m:
        raise ValueError(
            f"focus {focus_m} m must lie beyond the focal length {focal_m} m"
        )
    near = focus_m * (h - focal_m) / (h + focus_m - 2.0 * focal_m)
    far = focus_m * (h - focal_m) / (h - focus_m) if focus_m < h else math.inf
    return near, far


def least_stop(
    focal_m: float, blur_m: float, near_m: float, far_m: float
) -> tuple[float, float]:
    """Return the least f-number that is sharp from near to far, and its focus distance.

    Both ends of `depth_of_field`, solved for N and s::

        s = 2 near far / (near + far)
        N = f^2 (far - near) / (c (s - f) (far + near))

    Raises:
        ValueError: If the near end isn't beyond the focal length, or not the nearer.
    """
    if not focal_m < near_m <= far_m:
        raise ValueError(
            f"sharp from {near_m} to {far_m} m: must rise, beyond the focal length of "
            f"{focal_m} m"
        )
    focus = 2.0 * near_m * far_m / (near_m + far_m)
    beyond = blur_m * (focus - focal_m) * (far_m + near_m)
    return focal_m * focal_m * (far_m - near_m) / beyond, focus


def longest_sharp(f_number: float, blur_m: float, near_m: float, far_m: float) -> float:
    """Return the longest focal length that is sharp from near to far, in [m].

    `least_stop` solved for f, with k = N c (far + near) / (far - near)::

        f^2 + k f - k s = 0
    """
    focus = 2.0 * near_m * far_m / (near_m + far_m)
    k = f_number * blur_m * (far_m + near_m) / (far_m - near_m)
    return 0.5 * (math.sqrt(k * k + 4.0 * k * focus) - k)


def blur_diameter(
    focal_m: float, f_number: float, focus_m: float, distance_m: _Length
) -> _Length:
    """Return the diameter of the blur circle of points out of focus in [m].

    With focus distance s, point distance d, aperture f / N and magnification
    f / (s - f)::

        c = (f / N) (f / (s - f)) |d - s| / d
    """
    aperture = focal_m / f_number
    magnification = focal_m / (focus_m - focal_m)
    return aperture * magnification * abs(distance_m - focus_m) / distance_m
