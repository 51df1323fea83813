"""How surely an image edge of a ring is found: the s_px of s_N, from optics and sensor.

For planning one constant serves, s_px = s_0 / (-N.L): `noise_px` of a rig. Where s_N is
to be compared with errors, s_0 is measured on a plane, and what differs between that
plane and the object is known: how wide edges are in the image, and how much of the
noise is shot noise. `docs/method/accuracy.md`.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_Array = NDArray[np.float64]

# Variance of a unit square, the area over which a pixel gathers light [px^2].
_PIXEL = 1.0 / 12.0


@dataclass(frozen=True)
class EdgeNoise:
    """What makes an edge's position uncertain, known of devices and not of objects.

    Attributes:
        camera_blur_px: Standard deviation of the camera's blur [px].
        projector_blur_m: Standard deviation of a drawn edge's blur, across the ring
            surface at the object [m].
        shot_share: Share of shot noise in the variance of a half-bright pixel under
            frontal light.
    """

    camera_blur_px: float
    projector_blur_m: float
    shot_share: float

    def __post_init__(self) -> None:
        """Refuse what is no blur or no share.

        Raises:
            ValueError: If a blur is negative or the share isn't between 0 and 1.
        """
        for name in ("camera_blur_px", "projector_blur_m"):
            if not 0.0 <= getattr(self, name) < np.inf:
                raise ValueError(f"{name} is {getattr(self, name)}, must be 0 or more")
        if not 0.0 <= self.shot_share <= 1.0:
            raise ValueError(f"shot_share is {self.shot_share}, must lie in [0, 1]")

    def relative(self, light_cos: _Array, px_per_m: _Array) -> _Array:
        """Return s_px up to a factor that one plane fixes, shape (n,).

        With w the width of the edge in the image and c = -N.L, noise over the slope of
        the level at its middle::

            s_px ~ w sqrt(share c + 1 - share) / c
            w^2 = camera_blur^2 + 1/12 + (projector_blur |N.r| / (t |g|))^2

        Args:
            light_cos: c = -N.L, shape (n,).
            px_per_m: |N.r| / (t |g|), the ring pitch over h: pixels that a metre
                across the ring surface takes in the image, shape (n,).
        """
        square = self.camera_blur_px**2 + _PIXEL
        width = np.sqrt(square + (self.projector_blur_m * px_per_m) ** 2)
        grey = np.sqrt(self.shot_share * light_cos + 1.0 - self.shot_share)
        return width * grey / light_cos
