"""Which pixel of a projector each pixel of a camera shows."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planning.verify.reconstruction.arrays import Array, Grey, Indices


@dataclass(frozen=True, eq=False)
class CodeMap:
    """Codes of a camera's pixels under one projector, at their centres.

    Attributes:
        codes: Pixels (u, v) of the projector; NaN: not told, shape (h, w, 2).
        sigma: Their standard deviations [px of the projector], shape (h, w, 2).
        corner: Pixel (u, v) of the top-left pixel in the camera's image.
        moved: What uneven light had added to them, and was taken off, (h, w, 2).
        step: Of every so many pixels along rows and columns a point is made.
    """

    codes: Grey
    sigma: Grey
    moved: Grey
    corner: tuple[int, int]
    step: int = 1

    @property
    def told(self) -> Indices:
        """Flat indices of the pixels whose codes are known, shape (n,)."""
        return np.flatnonzero(np.isfinite(self.codes[:, :, 0]))

    @cached_property
    def per_pixel(self) -> float:
        """By how many pixels of the projector codes differ in neighbours, median.

        0 where no two neighbours tell a code.
        """
        steps = np.linalg.norm(np.diff(self.codes, axis=1), axis=2)
        known = steps[np.isfinite(steps)]
        return float(np.median(known)) if len(known) else 0.0

    def pixels(self, places: Indices) -> Array:
        """Return (u, v) in the camera's image of flat indices, shape (n, 2)."""
        rows, columns = np.divmod(places, self.codes.shape[1])
        return np.column_stack([columns, rows]) + np.array(self.corner, np.float64)
