"""Blur of what lies off the plane that a lens is focused on."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planning.model.plan import RigPlan

from .photometry import Photometry


@dataclass(frozen=True)
class Defocus:
    """A lens set to one distance.

    Attributes:
        focus_m: Distance of the plane in focus, along the axis [m].
        aperture_m: Diameter of the entrance pupil, f / N [m].
    """

    focus_m: float
    aperture_m: float

    def blur_m(self, depth: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the standard deviation of the blur at the object [m], any shape.

        By similar triangles a point of the plane in focus is a disc of diameter c at
        depth z, whose standard deviation along any line is c / 4::

            c = A |z / z_0 - 1|

        Args:
            depth: z [m].
        """
        return 0.25 * self.aperture_m * np.abs(depth / self.focus_m - 1.0)


def defocus_of(plan: RigPlan, role: str) -> Defocus | None:
    """Return how a plan's device model is focused; None if that isn't known.

    Args:
        plan: With the published figures of its rig.
        role: `projector` or `camera`.
    """
    device: Mapping[str, Any] = plan.document.get("rig", {}).get(role, {})
    figures = device.get("figures", {})
    focus, pixel_um = figures.get("focus"), figures.get("pixel_um")
    if not focus or not pixel_um or device.get("K") is None:
        return None
    focal_m = device["K"][0][0] * pixel_um * 1e-6
    return Defocus(focus["distance_mm"] * 1e-3, focal_m / focus["f_number"])


def through_lens(
    light: Photometry, defocus: Defocus | None, away_m: float, focal_px: float
) -> Photometry:
    """Return light as a camera records it whose object is so far away.

    One blur for the whole image, that of the object's middle: across 200 mm of depth
    it changes by less than the lens's own.

    Args:
        light: Simulated light and sensor.
        defocus: Of the camera.
        away_m: Depth of the object's middle [m].
        focal_px: Focal length [px].
    """
    if defocus is None or not away_m > 0.0:
        return light
    more = float(defocus.blur_m(np.array(away_m))) * focal_px / away_m
    return replace(light, camera_blur_px=float(np.hypot(light.camera_blur_px, more)))
