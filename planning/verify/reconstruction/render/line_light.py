"""Light of a panel whose frames vary along one direction: its rows, or its columns.

A pixel b of light E_b under a Gaussian of standard deviation s gives at u::

    sum over b of E_b (Phi((b + 1/2 - u) / s) - Phi((b - 1/2 - u) / s))
"""

import numpy as np
from scipy.special import ndtr

from planning.verify.reconstruction.arrays import Array, Grey

# Light beyond so many standard deviations of the blur isn't looked at.
_REACH = 3.0
# No place is sharper than that: below it shares are those of the pixel [px].
_SHARPEST_PX = 1e-3
# Places that are looked at in one go: what is between stays in the cache.
_AT_ONCE = 1 << 15


def gathered_lines(lines: Grey, places: Array, spread: Array) -> Grey:
    """Return the light of lines of pixels as blurred at places along them.

    Beyond its ends a line is dark.

    Args:
        lines: Light of each pixel in every frame, shape (n_pixels, n_frames).
        places: Where, in pixels, shape (n,).
        spread: Standard deviation of the blur there [px], shape (n,).

    Returns:
        Shape (n, n_frames).
    """
    light = np.empty((len(places), lines.shape[1]), dtype=np.float32)
    spread = np.maximum(spread, _SHARPEST_PX)
    halves = np.ceil(_REACH * spread).astype(np.int64)
    # One pixel more: a place may lie half a pixel off the middle of its own.
    for half in np.unique(halves).tolist():
        rows = np.flatnonzero(halves == half)
        dark = np.zeros((half + 1, lines.shape[1]), dtype=np.float32)
        padded = np.concatenate([dark, lines, dark])
        for first in range(0, len(rows), _AT_ONCE):
            some = rows[first : first + _AT_ONCE]
            light[some] = _gathered(padded, places[some], spread[some], half)
    return light


def drawn_share(n_pixels: int, places: Array, spread: Array) -> Grey:
    """Return the share of the light at places that a line of pixels gives, (n,).

    1 but at its ends. Arguments are as of `gathered_lines`.
    """
    spread = np.maximum(spread, _SHARPEST_PX)
    ends = (ndtr((end - places) / spread) for end in (-0.5, n_pixels - 0.5))
    first, last = ends
    return (last - first).astype(np.float32)


def _gathered(padded: Grey, places: Array, spread: Array, half: int) -> Grey:
    """Light at places by so many pixels to either side, dark ones put before."""
    middle = np.rint(places).astype(np.int64)
    borders = np.arange(-half, half + 2) - 0.5
    below = ndtr((borders + (middle - places)[:, None]) / spread[:, None])
    weights = np.diff(below).astype(np.float32)
    weights /= weights.sum(axis=1, keepdims=True)
    last = len(padded) - 1
    light = np.zeros((len(places), padded.shape[1]), dtype=np.float32)
    for k in range(2 * half + 1):
        # Light comes from within the panel, so that the middle is hardly off it.
        pixel = np.clip(middle + k + 1, 0, last)
        light += weights[:, k, None] * padded[pixel]
    return light
