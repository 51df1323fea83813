"""What light meets in a scene for Mitsuba, and how long it is followed."""

from dataclasses import dataclass, field

import numpy as np

from planning.verify.reconstruction.arrays import Grey
from planning.verify.reconstruction.calibration import CameraCalibration

from .materials import MaterialName, Surface
from .scene_text import Window


@dataclass(frozen=True)
class Physics:
    """What is rendered, apart from the rig.

    Attributes:
        material: Of the object.
        surface: How much light it reflects.
        bounces: Times that light may go from surface to surface on its way.
        spp: Paths a pixel in each frame.
        vignetting: Share of the light that is lost in the corners of the image; towards
            them as the square of the distance from its middle.
    """

    material: MaterialName = "matt"
    surface: Surface = field(default_factory=Surface)
    bounces: int = 2
    spp: int = 48
    vignetting: float = 0.0

    def transmitted(self, camera: CameraCalibration, window: Window) -> Grey:
        """Return the share of the light that reaches the sensor, shape (h, w)."""
        columns, rows = camera.resolution
        u = window.left + np.arange(window.width) - 0.5 * (columns - 1)
        v = window.top + np.arange(window.height) - 0.5 * (rows - 1)
        square = (u**2 + v[:, None] ** 2) / (0.25 * (columns**2 + rows**2))
        return (1.0 - self.vignetting * square).astype(np.float32)
