"""A projector's light as its plan exposes it: grey levels instead of shares of one."""

from dataclasses import dataclass

import numpy as np

from planning.model.light.light_budget import LightBudget
from planning.verify.reconstruction.arrays import Array
from planning.verify.reconstruction.calibration import ProjectorCalibration


@dataclass(frozen=True)
class Lamp:
    """Light, sensor and exposure of a projector's frames.

    Attributes:
        light: Of devices, surface and room.
        exposure_s: Of each frame [s].
    """

    light: LightBudget
    exposure_s: float

    @property
    def leak(self) -> float:
        """What a black image is of the light by which a white one is brighter."""
        return 1.0 / (self.light.contrast - 1.0)

    def lux(self, projector: ProjectorCalibration, pixel_m: float) -> float:
        """Return the illuminance of a white image whose pixels are so wide [lux]."""
        return self.light.lumens / (float(np.prod(projector.resolution)) * pixel_m**2)

    def gain(self, projector: ProjectorCalibration, depths: Array) -> float:
        """Return grey levels of mean albedo, lit squarely at the median of depths."""
        light, depth = self.light, np.median(depths) if len(depths) else 1.0
        axis = projector.centre + depth * projector.axis
        lux = self.lux(projector, float(projector.pixel_m(axis[None])[0]))
        electrons = light.electrons_per_lux_s * self.exposure_s * lux
        return float(np.mean(light.albedo)) * electrons * light.grey_per_electron
