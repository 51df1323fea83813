"""Blur of what lies off the plane that a lens is focused on."""

from dataclasses import dataclass

import numpy as np

from planning.model.plan import RigPlan

from .arrays import Array


@dataclass(frozen=True)
class Defocus:
    """A lens set to one distance.

    Attributes:
        focus_m: Distance of the plane in focus, along the axis [m].
        aperture_m: Diameter of the entrance pupil, f / N [m].
    """

    focus_m: float
    aperture_m: float

    def blur_m(self, depth: Array) -> Array:
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
    rig = plan.document.rig
    device = rig.projector if role == "projector" else rig.camera
    focus, pixel_um = device.figures.focus, device.figures.pixel_um
    if focus is None or pixel_um is None or device.K is None:
        return None
    focal_m = device.K[0][0] * pixel_um * 1e-6
    return Defocus(focus.distance_mm * 1e-3, focal_m / focus.f_number)
