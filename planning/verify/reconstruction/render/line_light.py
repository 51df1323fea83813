"""Light of a panel whose frames vary along one direction: its rows, or its columns.

A pixel b of light E_b under a Gaussian of standard deviation s gives at u::

    sum over b of E_b (Phi((b + 1/2 - u) / s) - Phi((b - 1/2 - u) / s))
"""

import numpy as np
from scipy.sparse import csr_array
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
    middle = np.rint(places).astype(np.int32)
    borders = np.arange(-half, half + 2)[:, None] - 0.5
    below = ndtr((borders + (middle - places)) / spread)
    weights = np.ascontiguousarray(np.diff(below, axis=0).T, dtype=np.float32)
    weights /= weights.sum(axis=1, keepdims=True)
    # Light comes from within the panel, so that the middle is hardly off it.
    near = middle[:, None] + np.arange(1, 2 * half + 2, dtype=np.int32)
    pixels = np.clip(near, 0, len(padded) - 1).ravel()
    ends = np.arange(len(places) + 1, dtype=np.int32) * np.int32(2 * half + 1)
    shape = len(places), len(padded)
    return csr_array((weights.ravel(), pixels, ends), shape=shape) @ padded
