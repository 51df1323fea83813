"""Which pixels of a camera a projector lights, and which of its annuli each shows."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.verify.reconstruction.arrays import Array, Indices

# Pixels of a point and about it that must show an annulus.
_FEWEST = 6


@dataclass(frozen=True, eq=False)
class LitImage:
    """The set I_j of eq. (6): what a projector lights in a camera's image.

    Attributes:
        shown: Annulus of each pixel plus one; 0 where white is hardly brighter than
            black or the bits name none, shape (h, w).
        corner: Pixel (u, v) of the top-left pixel in the camera's image.
    """

    shown: NDArray[np.uint8 | np.uint16]
    corner: tuple[int, int]

    @classmethod
    def nothing(cls) -> "LitImage":
        """Return an image without light."""
        return cls(np.zeros((0, 0), dtype=np.uint8), (0, 0))

    @classmethod
    def of(cls, index: NDArray[np.int16], corner: tuple[int, int]) -> "LitImage":
        """Return what annulus indices, shape (h, w), -1 for none, say."""
        kind = np.uint8 if index.max(initial=0) < 255 else np.uint16
        return cls((index + 1).astype(kind), corner)

    def around(self, pixels: Array) -> tuple[Indices, Indices]:
        """Return the least and the largest annulus in 3 x 3 pixels about each, (n,).

        Both -1 where there is no light, or too little of it.
        """
        height, width = self.shown.shape
        at = np.rint(pixels).astype(np.int64) - np.array(self.corner)
        inside = np.all((at >= 1) & (at < np.array([width - 1, height - 1])), axis=1)
        u, v = at[inside].T
        every = np.array(
            [self.shown[v + i, u + j] for i in (-1, 0, 1) for j in (-1, 0, 1)],
            dtype=np.int64,
        )
        lit = every > 0
        enough = np.count_nonzero(lit, axis=0) >= _FEWEST
        low, high = (np.full(len(pixels), -1) for _ in range(2))
        least = np.where(lit, every, np.iinfo(np.int64).max).min(axis=0)
        low[inside] = np.where(enough, least - 1, -1)
        high[inside] = np.where(enough, every.max(axis=0) - 1, -1)
        return low, high
