"""What texture and shading do to codes: a pixel gathers more of its brighter side.

Under a blur of standard deviation s, light W(x) and codes c(x) about a pixel give the
mean of the codes weighted by light, which is that of a place beside it::

    c(x + s^2 grad W / W),   to first order

A texture that changes by a twentieth from pixel to pixel moves codes by a fiftieth of a
pixel, as much as noise does.
"""

import numpy as np
from scipy.ndimage import convolve1d

from planning.model.light.drawn_edges import CAMERA_PX
from planning.verify.reconstruction.arrays import Grey

# Beyond that it isn't texture but a border of light, and no first order [px].
MOST_PX = 0.3
# What of the correction may be wrong, since blur is assumed: as a share of it.
UNSURE = 0.3


def places_lit(contrast: Grey) -> Grey:
    """Return how far aside of its centre each pixel looks, along u and v, (h, w, 2).

    `contrast` is the light of white over black, shape (h, w); s is `CAMERA_PX`.
    """
    light = np.maximum(contrast, np.float32(1.0))
    aside: list[Grey] = []
    for axis in (1, 0):
        # Across, neighbours are averaged: noise counts for less.
        level = np.empty_like(light)
        convolve1d(light, np.array([0.25, 0.5, 0.25]), axis=1 - axis, output=level)
        slope = np.float32(CAMERA_PX**2) * _slope(level, axis) / level
        aside.append(slope.astype(np.float32))
    return np.stack(aside, axis=-1)


def moved_by(aside: Grey, codes: Grey) -> Grey:
    """Return what looking aside adds to codes, shape (h, w, 2) [px of the projector].

    0 where no neighbour tells a code, NaN being codes that aren't told.
    """
    across, down = _slope(codes, 1), _slope(codes, 0)
    moved = across * aside[:, :, :1] + down * aside[:, :, 1:]
    return np.nan_to_num(moved).astype(np.float32)


def _slope(values: Grey, axis: int) -> Grey:
    """Differences over pixels along an axis, central where both neighbours are known.

    Of one neighbour where it alone is; NaN without any.
    """
    ahead, behind = (np.full(values.shape, np.nan, dtype=np.float32) for _ in range(2))
    one, other = ([slice(None)] * values.ndim for _ in range(2))
    one[axis], other[axis] = slice(1, None), slice(-1)
    step = values[tuple(one)] - values[tuple(other)]
    ahead[tuple(other)], behind[tuple(one)] = step, step
    either = np.where(np.isfinite(ahead), ahead, behind)
    both = np.isfinite(ahead) & np.isfinite(behind)
    return np.where(both, np.float32(0.5) * (ahead + behind), either)
