"""The part of an image that is worth rendering, and how samples make pixels of it."""

from dataclasses import dataclass

import numpy as np

from planning.verify.reconstruction.arrays import Grey, Indices

from .photometry import Photometry
from .view import RenderedView

# Blurred light reaches no further than this beyond the samples that are lit [px].
_MARGIN_PX = 6


@dataclass(frozen=True, eq=False)
class ImageCanvas:
    """The part of a view's window that a projector lights.

    Without its light a frame and its inverse are alike, so nothing is decoded there.

    Attributes:
        corner: Pixel (u, v) of the top-left pixel.
        shape: Rows and columns, in pixels.
        fold: Cells along a pixel.
        cells: Flat index of each sample's cell, senseless outside, shape (n,).
        weights: Share of the cell that each sample stands for, shape (n,).
        inside: Samples inside.
    """

    corner: tuple[int, int]
    shape: tuple[int, int]
    fold: int
    cells: Indices
    weights: Grey
    inside: Indices

    @classmethod
    def about(cls, seen: RenderedView, lit: Indices) -> "ImageCanvas":
        """Return the bounding box of samples and a margin; all where there is none."""
        fold, (rows, columns) = seen.fold, seen.shape
        y, x = np.divmod(seen.cells, fold * columns)
        v, u = y // fold, x // fold
        top, left, bottom, right = 0, 0, rows, columns
        if len(lit):
            top = max(0, int(v[lit].min()) - _MARGIN_PX)
            left = max(0, int(u[lit].min()) - _MARGIN_PX)
            bottom = min(rows, int(v[lit].max()) + 1 + _MARGIN_PX)
            right = min(columns, int(u[lit].max()) + 1 + _MARGIN_PX)
        inside = (v >= top) & (v < bottom) & (u >= left) & (u < right)
        return cls(
            (seen.corner[0] + left, seen.corner[1] + top),
            (bottom - top, right - left),
            fold,
            (y - fold * top) * (fold * (right - left)) + (x - fold * left),
            seen.weights,
            np.flatnonzero(inside),
        )

    def image(self, values: Grey, samples: Indices, lens: Photometry) -> Grey:
        """Return the image (h, w) that samples of these values make behind a lens."""
        rows, columns = (self.fold * side for side in self.shape)
        weighted = self.weights[samples] * values
        summed = np.bincount(self.cells[samples], weighted, rows * columns)
        cells = summed.astype(np.float32).reshape(rows, columns)
        return _binned(lens.blur(cells, self.fold), self.fold)


def _binned(cells: Grey, fold: int) -> Grey:
    """Return the mean of the cells of each pixel."""
    if fold == 1:
        return cells
    total = np.zeros((len(cells) // fold, cells.shape[1] // fold), dtype=np.float32)
    for i in range(fold):
        for j in range(fold):
            total += cells[i::fold, j::fold]
    return total / np.float32(fold * fold)
