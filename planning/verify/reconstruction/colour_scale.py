"""A perceptual colour scale: viridis, dark for small values."""

import numpy as np
from numpy.typing import NDArray

from .arrays import Array

# Every seventeenth of the 256 colours of viridis (S. van der Walt, N. Smith, CC0);
# lightness rises evenly, so that colour blindness loses nothing.
_VIRIDIS = np.array(
    [
        [68, 1, 84],
        [72, 26, 108],
        [71, 47, 125],
        [65, 68, 135],
        [57, 86, 140],
        [49, 104, 142],
        [42, 120, 142],
        [35, 136, 142],
        [31, 152, 139],
        [34, 168, 132],
        [53, 183, 121],
        [84, 197, 104],
        [122, 209, 81],
        [165, 219, 54],
        [210, 226, 27],
        [253, 231, 37],
    ],
    dtype=np.float64,
)
_NAMES = ((0.0, "violet"), (0.5, "teal"), (1.0, "yellow"))
# Values beyond these quantiles take the colours of the ends.
_ENDS = (0.02, 0.98)


def colour_range(values: Array) -> tuple[float, float]:
    """Return what the ends of the scale stand for: the 2nd and 98th percentile."""
    low, high = np.quantile(values, _ENDS).tolist() if len(values) else (0.0, 1.0)
    return low, high


def colours(values: Array, limits: tuple[float, float]) -> NDArray[np.uint8]:
    """Return the colour of each value, red, green and blue of 255, shape (n, 3)."""
    low, high = limits
    share = np.clip((values - low) / max(high - low, 1e-300), 0.0, 1.0)
    place = share * (len(_VIRIDIS) - 1)
    steps = np.arange(len(_VIRIDIS))
    mixed = [np.interp(place, steps, channel) for channel in _VIRIDIS.T]
    return np.rint(np.column_stack(mixed)).astype(np.uint8)


def legend(limits: tuple[float, float], unit: str) -> str:
    """Return what the colours mean, in one line."""
    low, high = limits
    return ", ".join(
        f"{name} {low + share * (high - low):.4g} {unit}" for share, name in _NAMES
    )
