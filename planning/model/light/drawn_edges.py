"""What blurs the ring edges that a projector draws, where they fall on the object."""

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array

# Blur of a drawn edge in focus at the object, as a standard deviation [m].
IN_FOCUS_M = 0.25e-3
# Blur of a camera's lens, and of its lens and its square pixels together, likewise.
LENS_PX = 0.6
CAMERA_PX = float(np.hypot(LENS_PX, np.sqrt(1.0 / 12.0)))


@dataclass(frozen=True)
class DrawnEdges:
    """Blur of light and image, as standard deviations across an edge.

    Attributes:
        in_focus_m: Of the light at the object where it is in focus [m].
        camera_px: Of the image, by lens and pixels of the camera [px].
        focus_m: Depth that a projector of diverging light is focused at [m]; None: it
            is equally sharp everywhere.
        aperture_m: Diameter of its pupil, f / N [m].
    """

    in_focus_m: float = IN_FOCUS_M
    camera_px: float = CAMERA_PX
    focus_m: float | None = None
    aperture_m: float = 0.0

    def __post_init__(self) -> None:
        for name in ("in_focus_m", "camera_px", "aperture_m"):
            if not getattr(self, name) >= 0.0:
                raise ValueError(f"drawn_edges.{name} must be 0 or more")
        if self.focus_m is not None and not self.focus_m > 0.0:
            raise ValueError("drawn_edges.focus_m must be positive")

    def light_m(self, depths: Array) -> Array:
        """Return the blur of the light at depths [m], any shape.

        By similar triangles a point in focus is a disc of diameter c at depth z, whose
        standard deviation along any line is c / 4::

            c = A |z / z_0 - 1|
        """
        if self.focus_m is None:
            return np.full_like(depths, self.in_focus_m)
        off = 0.25 * self.aperture_m * (depths / self.focus_m - 1.0)
        return np.hypot(self.in_focus_m, off)
