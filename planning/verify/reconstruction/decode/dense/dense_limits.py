"""What is asked of points that a dense code measures."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class DenseLimits:
    """Limits of points of two rays.

    Attributes:
        min_angle: Least triangulation angle [rad].
        max_angle: Largest [rad].
        max_slant: Tangent of the incidence at a camera beyond which neighbouring pixels
            are of two surfaces.
        max_sigma_m: Largest standard deviation along the viewing ray [m].
        spacing_m: About how far points are apart on the object; 0: one a pixel [m].
        slack_px: How far two rays may pass each other beside what noise explains [px of
            the projector].
    """

    min_angle: float = 0.0
    max_angle: float = np.pi
    max_slant: float = 2.14
    max_sigma_m: float = np.inf
    spacing_m: float = 0.0
    slack_px: float = 2.0
