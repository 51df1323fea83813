"""Phase of shifted sinusoids, and where on the panel that is.

With ``I_k = A + B cos(phi - 2 pi k / N)``::

    B cos(phi) = 2/N sum I_k cos(2 pi k / N),   B sin(phi) = 2/N sum I_k sin(2 pi k / N)

and standard deviation ``sqrt(2 / N) s_I / B`` of the phase, s_I that of a frame at the
mean level A (Srinivasan, Liu and Halioua, 1984; Surrel, 1997).
"""

from dataclasses import dataclass

import numpy as np

from planning.verify.reconstruction.arrays import Array, Images, Mask
from planning.verify.reconstruction.decode.grey_noise import GreyNoise

from .gray_bits import GrayStripes

# A pixel lies this share of a stripe's width beyond the stripe that its bits name, at
# most: half of what would take it to another period.
_BEYOND = 0.25


@dataclass(frozen=True, eq=False)
class Phases:
    """Sinusoids at pixels, shape (n,) each.

    Attributes:
        turns: Phase in turns, 0 to 1.
        modulation: B [grey levels].
        sigma: Standard deviation of the phase [turns].
    """

    turns: Array
    modulation: Array
    sigma: Array

    @classmethod
    def of(cls, frames: Images, noise: GreyNoise) -> "Phases":
        """Return the phases of frames in the order of their shifts, shape (N, n)."""
        n = len(frames)
        angles = 2.0 * np.pi * np.arange(n) / n
        # A frame at a time: frames are bytes, and all of them as numbers wouldn't fit.
        across, along, mean = (np.zeros(frames.shape[1]) for _ in range(3))
        for image, angle in zip(frames, angles.tolist(), strict=True):
            along += np.cos(angle) * image
            across += np.sin(angle) * image
            mean += image
        modulation = 2.0 / n * np.hypot(across, along)
        spread = np.sqrt(2.0 / n) * noise.at((mean / n).astype(np.float32))
        turns = np.arctan2(across, along) / (2.0 * np.pi)
        return cls(
            turns % 1.0,
            modulation,
            spread / np.maximum(modulation, 1e-9) / (2.0 * np.pi),
        )

    def places(self, stripes: GrayStripes, period_px: int) -> tuple[Array, Mask]:
        """Return where on the panel pixels are [px], and which stripes contradict.

        The period is the one that brings the phase nearest to the stripe's middle, or
        to the border that the pixel lies on: stripes are half a period wide, so that a
        bit that is off beside a border is no error of a period.
        """
        within = self.turns * period_px
        periods = np.rint((stripes.middle - within) / period_px)
        places = within + period_px * periods
        half = np.where(stripes.on_border, 0.0, 0.5)
        most = (half + _BEYOND) * stripes.width_px
        return places, np.abs(places - stripes.middle) > most
