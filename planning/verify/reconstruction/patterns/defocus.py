"""How the lenses of a plan's devices are focused, and what that blurs."""

from dataclasses import dataclass

import numpy as np

from planning.model.document.input_records import ModelRecord
from planning.verify.reconstruction.arrays import Array


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
        depth z [m], whose standard deviation along any line is c / 4::

            c = A |z / z_0 - 1|
        """
        return 0.25 * self.aperture_m * np.abs(depth / self.focus_m - 1.0)


def defocus_of(model: ModelRecord) -> Defocus | None:
    """Return how a model of the rig is focused; None: nobody says."""
    focus, pixel_um = model.figures.focus, model.figures.pixel_um
    if focus is None or pixel_um is None or model.K is None:
        return None
    focal_m = model.K[0][0] * pixel_um * 1e-6
    return Defocus(focus.distance_mm * 1e-3, focal_m / focus.f_number)
