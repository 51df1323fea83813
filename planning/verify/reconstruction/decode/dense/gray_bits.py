"""Stripes of a Gray code, told by frames against their inverses.

Neighbouring stripes differ in one bit. A pixel that is half bright in the frame of that
bit, and sure of all others, lies on their border; one that is half bright in two frames
shows two places at once. Flipping bit b of a Gray code turns the stripe g into
``g ^ (2^(b+1) - 1)``.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.verify.reconstruction.arrays import Array, Grey, Images, Indices, Mask

# A bit stands out if frame and inverse differ by so many deviations of noise, and by
# this share of the contrast.
_SIGMAS, _LEAST_SHARE = 4.0, 0.15
# A bit that stands out in fewer pixels is of stripes that the camera doesn't resolve.
_RESOLVED = 0.5


@dataclass(frozen=True, eq=False)
class GrayStripes:
    """Stripes that pixels show, of columns or rows of a panel, shape (n,) each.

    Attributes:
        stripe: Index of each, those of `width_px` pixels.
        width_px: Of a stripe [px of the projector].
        unsure: How many bits don't stand out.
        middle: Middle of the stripe, or the border that the pixel lies on [px].
        on_border: Which lie on a border between two stripes.
        least: How far the least clear bit stands out, as a share of the contrast.
        dropped: Bits finer than the camera resolves.
    """

    stripe: Indices
    width_px: int
    unsure: Indices
    middle: Array
    on_border: Mask
    least: Grey
    dropped: int

    @property
    def mixed(self) -> Mask:
        """Pixels that show two places, shape (n,)."""
        return (self.unsure > 1) | ((self.unsure == 1) & ~self.on_border)


def read_stripes(
    frames: Images, contrast: Grey, noise: Array, finest_px: int
) -> GrayStripes:
    """Return the stripes that pixels show.

    Args:
        frames: Each bit, the highest first, and its inverse, shape (2 n_bits, n).
        contrast: White - black, shape (n,).
        noise: Standard deviation of a half-bright frame, shape (n,).
        finest_px: Width of the finest stripes [px of the projector].
    """
    apart = frames[0::2].astype(np.float32) - frames[1::2]
    least = np.maximum(_SIGMAS * np.sqrt(2.0) * noise, _LEAST_SHARE * contrast)
    sure = np.abs(apart) >= least.astype(np.float32)
    n_bits = len(apart) - unresolved(sure)
    clear = np.abs(apart[:n_bits]) / np.maximum(contrast, 1.0)
    sure, dropped = sure[:n_bits], len(apart) - n_bits
    stripe = _binary(apart[:n_bits] > 0.0)
    unsure = np.count_nonzero(~sure, axis=0)
    width = finest_px << dropped
    # Bit of the first frame that doesn't stand out, from 0 for the finest.
    doubted = n_bits - 1 - np.argmin(sure, axis=0)
    other = stripe ^ ((2 << doubted) - 1)
    on_border = (unsure == 1) & (np.abs(other - stripe) == 1)
    middle = width * stripe + 0.5 * (width - 1)
    border = width * np.maximum(stripe, other) - 0.5
    return GrayStripes(
        stripe,
        width,
        unsure,
        np.where(on_border, border, middle),
        on_border,
        clear.min(axis=0).astype(np.float32),
        dropped,
    )


def unresolved(sure: Mask) -> int:
    """Return how many of the finest bits hardly any pixel is sure of.

    All but one at most. `sure` has shape (n_bits, n), the highest bit first.
    """
    shares = sure.mean(axis=1) if sure.shape[1] else np.ones(len(sure))
    resolved = np.flatnonzero(shares >= _RESOLVED)
    last = int(resolved[-1]) if len(resolved) else 0
    return len(sure) - 1 - last


def _binary(bits: NDArray[np.bool_]) -> Indices:
    """Return the numbers of Gray codes, shape (n_bits, n), the highest bit first."""
    stripe = np.zeros(bits.shape[1], dtype=np.int64)
    bright = np.zeros(bits.shape[1], dtype=bool)
    for bit in bits:
        bright = bright ^ bit
        stripe = (stripe << 1) | bright
    return stripe
