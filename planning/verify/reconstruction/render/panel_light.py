"""Light of a panel's pixels where it falls: squares under the blur of a lens."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.special import ndtr

from geometry.arrays import rows_of
from planning.verify.reconstruction.arrays import Array, Grey, Indices
from planning.verify.reconstruction.patterns.panel import PanelWindow

# Light beyond so many standard deviations of the blur isn't looked at.
_REACH = 2.8
# Pixels that are looked at in one go: what is between stays in the cache.
_AT_ONCE = 1 << 19


@dataclass(frozen=True, eq=False)
class PanelLight:
    """Where light falls on a panel, as blurred, along its rows and columns.

    Attributes:
        pixels: Places (u, v), shape (n, 2).
        spread: Standard deviation of the blur along u and v [px], shape (n, 2).
    """

    pixels: Array
    spread: Array

    @property
    def window(self) -> PanelWindow:
        """The pixels whose light may fall on some place, and at least one."""
        if not len(self.pixels):
            return PanelWindow(0, 0, 2, 2)
        reach = _halves(self.spread) + 1
        u, v = np.rint(self.pixels).T.astype(np.int64)
        left, top = (int((at - reach).min()) for at in (u, v))
        right, bottom = (int((at + reach).max()) for at in (u, v))
        return PanelWindow(left, top, right - left + 1, bottom - top + 1)

    def gathered(self, images: Grey, window: PanelWindow) -> Grey:
        """Return the light of images of a window's pixels at each place.

        A square pixel under a Gaussian is a difference of its integrals along each
        axis.

        Args:
            images: Light of pixels, row by row, shape (n_pixels, n_images).
            window: Which pixels these are.

        Returns:
            Shape (n, n_images).
        """
        light = np.empty((len(self.pixels), images.shape[1]), dtype=np.float32)
        for rows, half in _alike(_halves(self.spread)):
            light[rows] = self._taps(rows, half, window) @ images
        return light

    def _taps(self, rows: Indices, half: int, window: PanelWindow) -> csr_array:
        """Weights of so many pixels to either side, shape (n_rows, n_pixels)."""
        pixels, spread = rows_of(self.pixels, rows).T, rows_of(self.spread, rows).T
        middle = np.rint(pixels)
        borders = np.arange(-half, half + 2)[:, None] - 0.5
        # Pixel by pixel for all places: rows of a few numbers take numpy longer.
        across, down = (
            _normal(np.diff(ndtr((borders + away) / wide), axis=0))
            for away, wide in zip(middle - pixels, spread, strict=True)
        )
        u, v = (middle - np.array([[window.left], [window.top]])).astype(np.int32)
        steps = np.arange(-half, half + 1, dtype=np.int32)
        near = (steps[:, None] * np.int32(window.width) + steps).ravel()
        first = v * np.int32(window.width) + u
        weights = (down[:, None] * across).reshape(len(near), -1).T.ravel()
        ends = np.arange(len(rows) + 1, dtype=np.int32) * np.int32(len(near))
        shape = len(rows), window.width * window.height
        return csr_array((weights, (first[:, None] + near).ravel(), ends), shape=shape)


def _halves(spread: Array) -> Indices:
    """Pixels to either side whose light is looked at, shape (n,)."""
    return np.ceil(_REACH * np.maximum(*spread.T)).astype(np.int64)


def _alike(halves: Indices) -> Iterator[tuple[Indices, int]]:
    """Yield places, some at a time, that look at as many pixels."""
    for half in np.unique(halves).tolist():
        rows = np.flatnonzero(halves == half)
        some = max(1, _AT_ONCE // (2 * half + 1) ** 2)
        for first in range(0, len(rows), some):
            yield rows[first : first + some], half


def _normal(weights: Array) -> Grey:
    """Return weights whose columns add up to 1."""
    return (weights / weights.sum(axis=0)).astype(np.float32)
