"""Images halved again and again, and the pixels of them whose windows are sought."""

from dataclasses import dataclass

import numpy as np

from planning.verify.reconstruction.arrays import Array, Grey, Indices


@dataclass(frozen=True, eq=False)
class LevelImage:
    """An image, halved so many times.

    Attributes:
        grey: Shape (h, w).
        corner: Pixel (u, v) of its top-left pixel, in the pixels of this level, (2,).
        fold: Pixels of the camera along one of its own.
    """

    grey: Grey
    corner: Array
    fold: int = 1

    def halved(self) -> "LevelImage":
        """Return the image of half as many rows and columns."""
        rows, columns = (n // 2 for n in self.grey.shape)
        quarters = self.grey[: 2 * rows, : 2 * columns].reshape(rows, 2, columns, 2)
        return LevelImage(quarters.mean(axis=(1, 3)), 0.5 * self.corner, 2 * self.fold)

    def places(self, u: Array, v: Array) -> tuple[Array, Array]:
        """Return row and column of pixels of the camera."""
        shift = 0.5 * (self.fold - 1)
        column = (u - shift) / self.fold - self.corner[0]
        return (v - shift) / self.fold - self.corner[1], column

    def pixels(self, rows: Indices, columns: Indices) -> Array:
        """Return pixels (u, v) of the camera of places, shape (n, 2)."""
        at = np.column_stack([columns, rows]) + self.corner
        return self.fold * at + 0.5 * (self.fold - 1)

    def at(self, u: Array, v: Array) -> Grey:
        """Return grey levels between pixels of the camera; 0 outside."""
        return between_pixels(self.grey, *self.places(u, v))


def between_pixels(image: Grey, row: Array, column: Array) -> Grey:
    """Return what lies between four pixels of an image, bilinearly; 0 outside."""
    h, w = image.shape
    inside = (row >= 0.0) & (row < h - 1.0) & (column >= 0.0) & (column < w - 1.0)
    y = np.where(inside, row, 0.0).astype(np.float32)
    x = np.where(inside, column, 0.0).astype(np.float32)
    # Rounded to single precision a place may have come to lie on the last row.
    top = np.minimum(y.astype(np.int32), np.int32(h - 2))
    left = np.minimum(x.astype(np.int32), np.int32(w - 2))
    down, right = y - top, x - left
    first = top * np.int32(w) + left
    flat = image.ravel()
    above = flat.take(first)
    above += right * (flat.take(first + 1) - above)
    first += np.int32(w)
    below = flat.take(first)
    below += right * (flat.take(first + 1) - below)
    above += down * (below - above)
    above *= inside
    return above


def halved_images(grey: Grey, corner: tuple[int, int], n: int) -> list[LevelImage]:
    """Return an image and its halves, n in all, the finest first."""
    images = [LevelImage(grey, np.array(corner, dtype=np.float64))]
    while len(images) < n:
        images.append(images[-1].halved())
    return images


@dataclass(frozen=True, eq=False)
class Grid:
    """Pixels of a first image whose windows are sought in a second one.

    Attributes:
        index: Number of each place of the grid, -1: none, shape (h, w).
        pixels: Of the camera (u, v), shape (n, 2).
        step: Pixels of the camera between places.
    """

    index: Indices
    pixels: Array
    step: int

    @classmethod
    def over(cls, image: LevelImage, step: int, dark: float) -> "Grid":
        """Return every so many pixels of an image that aren't dark."""
        bright = image.grey[::step, ::step] > dark
        rows, columns = np.nonzero(bright)
        index = np.full(bright.shape, -1, dtype=np.int64)
        index[rows, columns] = np.arange(len(rows))
        pixels = image.pixels(step * rows, step * columns)
        return cls(index, pixels, step * image.fold)

    def neighbours(self, down: int, right: int) -> tuple[Indices, Indices]:
        """Return numbers of places and of those so many on, where there are both."""
        h, w = self.index.shape
        here = self.index[
            max(-down, 0) : h - max(down, 0), max(-right, 0) : w - max(right, 0)
        ]
        there = self.index[
            max(down, 0) : h - max(-down, 0), max(right, 0) : w - max(-right, 0)
        ]
        both = (here >= 0) & (there >= 0)
        return here[both], there[both]

    def nearest(self, pixels: Array, known: Array) -> Indices:
        """Return the place of a coarser grid for pixels of a finer one, -1: none.

        `known` is the coarser grid's first pixel (u, v).
        """
        column, row = np.rint((pixels - known) / self.step).astype(np.int64).T
        h, w = self.index.shape
        inside = (row >= 0) & (row < h) & (column >= 0) & (column < w)
        found = np.full(len(pixels), -1, dtype=np.int64)
        found[inside] = self.index[row[inside], column[inside]]
        return found
