"""How much grey levels of one frame are spread."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from planning.verify.reconstruction.arrays import Array, Grey


@dataclass(frozen=True)
class GreyNoise:
    """Variance of one frame's grey levels: read noise, and shot noise of light.

    Attributes:
        dark: In the dark.
        of_light: More of it for each grey level.
    """

    dark: float
    of_light: float

    @classmethod
    def fitted(cls, level: Array, variance: Array) -> "GreyNoise":
        """Return the line through variances at grey levels, neither part negative."""
        terms = np.column_stack([np.ones(len(level)), level])
        (dark, of_light), _ = nnls(terms, variance)
        return cls(max(float(dark), 1e-6), float(of_light))

    def at(self, level: Grey) -> Array:
        """Return the standard deviation at grey levels, any shape."""
        light = np.maximum(level.astype(np.float64), 0.0)
        return np.sqrt(self.dark + self.of_light * light)
