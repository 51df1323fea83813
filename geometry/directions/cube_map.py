"""Directions in cells: the six faces of a cube, each cut at equal angles.

Face k looks along world axis k // 2, towards minus where k is odd. On it, (x, y, 1) is
the direction whose gnomonic coordinates x and y lie in [-1, 1]; cell (row j, column i)
of n x n holds 4/pi atan x in [-1 + 2i/n, -1 + 2(i + 1)/n], and y likewise. Great
circles are straight there, so that cells are convex on the sphere and halving n
joins cells four by four.
"""

from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from geometry.arrays import Array, Ints, Mask, lengths

# Rows: the world axes that a face's x, y and z run along.
_AXES = np.array([[1, 2, 0], [1, 2, 0], [2, 0, 1], [2, 0, 1], [0, 1, 2], [0, 1, 2]])
_SIGNS = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
FACES = 6
# What rounding may move a direction by, in radians.
_ROUNDING = 1e-9


@dataclass(frozen=True)
class CubeMap:
    """Six times n x n cells of directions; cell (k n + j) n + i.

    Attributes:
        n: Cells along an edge of a face, at least 1.
    """

    n: int

    @property
    def size(self) -> int:
        """Number of cells."""
        return FACES * self.n * self.n

    @cached_property
    def lines(self) -> Array:
        """Gnomonic coordinates of the lines between cells, shape (n + 1,)."""
        return np.tan(np.linspace(-0.25 * np.pi, 0.25 * np.pi, self.n + 1))

    def cells_at(self, gnomonic: Array) -> Ints:
        """Return the row or column of each coordinate in [-1, 1], or a little beyond.

        What a binary search among the lines finds takes seven times as long.
        """
        steps = ((gnomonic + 1.0) * (2.0 * self.n)).astype(np.intp)
        cell = self._cells_of_steps.take(steps, mode="clip")
        return cell + (gnomonic >= self._upper_lines.take(cell))

    @cached_property
    def _cells_of_steps(self) -> Ints:
        """Return in which cell each of 4 n equal steps begins: it meets two at most."""
        begin = np.arange(4 * self.n) / (2.0 * self.n) - 1.0 - _ROUNDING
        return np.maximum(np.searchsorted(self.lines, begin, side="right") - 1, 0)

    @cached_property
    def _upper_lines(self) -> Array:
        return np.append(self.lines[1:-1], np.inf)

    @cached_property
    def corners(self) -> Array:
        """Unit directions of the corners of cells, shape (6, n + 1, n + 1, 3)."""
        return self._directions(self.lines)

    @cached_property
    def centres(self) -> Array:
        """Unit directions of the middles of cells, shape (size, 3)."""
        angles = np.linspace(-0.25 * np.pi, 0.25 * np.pi, 2 * self.n + 1)[1::2]
        return self._directions(np.tan(angles)).reshape(-1, 3)

    @cached_property
    def radii(self) -> Array:
        """Largest angle from the middle of each cell to its corners, shape (size,)."""
        n = self.n
        middle = self.centres.reshape(FACES, n, n, 3)
        radii = np.zeros((FACES, n, n))
        for j in (0, 1):
            for i in (0, 1):
                corner = self.corners[:, j : j + n, i : i + n]
                radii = np.maximum(radii, angle_between(middle, corner))
        return radii.reshape(-1) + _ROUNDING

    @property
    def clearance(self) -> float:
        """Angle within which no direction leaves its cell and those around it.

        Two lines a step apart meet at the face's poles; on a face they are nearest to
        each other at its edges, 45 degrees from there::

            sin w = sin(pi / 2n) cos 45
        """
        return float(np.arcsin(np.sin(0.5 * np.pi / self.n) * np.sqrt(0.5))) - _ROUNDING

    @cached_property
    def around_border(self) -> tuple[Ints, Ints]:
        """Cells at the borders of faces, (m,), and those around each, (m, k).

        Each itself among them; they may repeat. They are all whose circles about them
        come within `clearance` of the cell's. Inside a face the eight about a cell are
        those around it.
        """
        n = self.n
        _, j, i = np.unravel_index(np.arange(self.size), (FACES, n, n))
        inner = (i > 0) & (i < n - 1) & (j > 0) & (j < n - 1)
        border = np.flatnonzero(~inner)
        kept = self._within(self.centres[border], self.radii[border] + self.clearance)
        around = np.repeat(border[:, None], max(cells.size for cells in kept), axis=1)
        for row, cells in zip(around, kept, strict=True):
            row[: cells.size] = cells
        return border, around

    def _within(self, directions: Array, reach: Array) -> list[Ints]:
        """Return the cells whose circles come within an angle of each direction."""
        chords = 2.0 * np.sin(0.5 * np.minimum(reach + self.radii.max(), np.pi))
        near = KDTree(self.centres).query_ball_point(directions, chords + _ROUNDING)
        return [
            np.array(cells)[
                angle_between(self.centres[cells], direction)
                <= self.radii[cells] + own + _ROUNDING
            ]
            for cells, direction, own in zip(near, directions, reach, strict=True)
        ]

    def locate(self, directions: Array) -> Ints:
        """Return the cell that each direction lies in, shape (m,)."""
        return located(directions, self.n)

    def halved(self, rows: NDArray[Any]) -> NDArray[Any]:
        """Return the rows of bits for the map of n/2: those of four cells, joined."""
        n = self.n // 2
        across = np.bitwise_or.reduce(rows.reshape(FACES, n, 2, n, 2, -1), axis=4)
        return np.bitwise_or.reduce(across, axis=2).reshape(FACES * n * n, -1)

    def _directions(self, steps: Array) -> Array:
        n = steps.size
        directions = np.empty((FACES, n, n, 3))
        x, y = steps[None, :], steps[:, None]
        length = np.sqrt(1.0 + x * x + y * y)
        for face in range(FACES):
            for axis, value in zip(_AXES[face], (x, y, _SIGNS[face]), strict=True):
                directions[face, :, :, axis] = value / length
        return directions


@cache
def cube_map(n: int) -> CubeMap:
    """Return the map of n cells an edge, whose neighbourhoods are found once."""
    return CubeMap(n)


def located(directions: Array, n: Ints | int) -> Ints:
    """Return the cell of each direction (m, 3) on a map of n cells an edge, (m,).

    Directions may have any length but 0; `n` is one number, or each one's own.
    """
    face, across, upwards = _placed(directions)
    i, j = _steps(across, n), _steps(upwards, n)
    return (face * n + j) * n + i


def cells_within(directions: Array, angles: Array, n: int) -> tuple[Ints, Mask]:
    """Return the four cells that hold all within an angle of directions, (m, 4).

    They repeat where fewer do. And whether four do, (m,): the cone is no wider than a
    cell, and stays on its face. About a face's x axis, and its y axis, a cone of angle
    w [rad] at latitude l turns by at most asin(sin w / cos l), and on a face no
    latitude exceeds 45 degrees.
    """
    face, *places = _placed(directions)
    turn = np.arcsin(np.minimum(np.sqrt(2.0) * np.sin(angles), 1.0)) + _ROUNDING
    half = turn * (2.0 / np.pi) * n
    do = half <= 0.5
    steps: list[list[Ints]] = []
    for place in places:
        middle = (np.arctan(place) * (4.0 / np.pi) + 1.0) * (0.5 * n)
        low, high = middle - half, middle + half
        do &= (low >= 0.0) & (high < n)
        ends = [np.clip(end.astype(np.int64), 0, n - 1) for end in (low, high)]
        steps.append(ends)
    cells = [(face * n + row) * n + column for row in steps[1] for column in steps[0]]
    return np.stack(cells, axis=1), do


def _placed(directions: Array) -> tuple[Ints, Array, Array]:
    """Return the face of each direction, and its gnomonic x and y there, (m,) each."""
    # Column by column: rows of three are too short for numpy's loops.
    x, y, z = np.ascontiguousarray(directions.T, dtype=np.float64)
    of_x, of_y, of_z = np.abs(x), np.abs(y), np.abs(z)
    first = (of_x >= of_y) & (of_x >= of_z)
    second = ~first & (of_y >= of_z)
    # As `_AXES` has them.
    along = np.where(first, x, np.where(second, y, z))
    across = np.where(first, y, np.where(second, z, x))
    upwards = np.where(first, z, np.where(second, x, y))
    face = np.where(first, 0, np.where(second, 2, 4)) + (along < 0)
    length = np.abs(along)
    return face, across / length, upwards / length


def _steps(gnomonic: Array, n: Ints | int) -> Ints:
    steps = (np.arctan(gnomonic) * (4.0 / np.pi) + 1.0) / 2.0
    # No coordinate lies below -1, so none is less than the first cell's.
    return np.minimum((steps * n).astype(np.int64), n - 1)


def quarters(level: Ints, cells: Ints) -> Ints:
    """Return the four parts of cells on the map of the next level, shape (m, 4).

    A cell of level k is one of the map of 2^k cells an edge.
    """
    n = 1 << level
    face, rest = np.divmod(cells, n * n)
    j, i = np.divmod(rest, n)
    low = (face * 2 * n + 2 * j) * 2 * n + 2 * i
    return low[:, None] + np.stack([0 * n, 0 * n + 1, 2 * n, 2 * n + 1], axis=1)


def middles(level: Ints, cells: Ints) -> Array:
    """Return the unit direction of the middle of cells, shape (m, 3)."""
    return _directions(level, cells, 0.5, 0.5)


def circles(level: Ints, cells: Ints) -> tuple[Array, Array]:
    """Return the middles of cells (m, 3), and the angle about each that holds it, (m,).

    In [rad]; a cell of level k is one of the map of 2^k cells an edge.
    """
    middle = middles(level, cells)
    corners = [_directions(level, cells, j, i) for j in (0, 1) for i in (0, 1)]
    angles = [angle_between(middle, corner) for corner in corners]
    return middle, np.max(angles, axis=0) + _ROUNDING


def widest(levels: Ints) -> Array:
    """Return the largest angle of `circles` on each level: of cells in faces' corners.

    There lines cross at 60 degrees, and half the long diagonal is 0.816 of a step where
    it is 0.707 in the middle of a face.
    """
    up_to = np.arange(levels.max(initial=0) + 1)
    return circles(up_to, 0 * up_to)[1][levels]


def _directions(level: Ints, cells: Ints, down: float, across: float) -> Array:
    """Return unit directions in cells, at shares of their rows and columns, (m, 3)."""
    n = 1 << level
    face, rest = np.divmod(cells, n * n)
    j, i = np.divmod(rest, n)
    x, y = (
        np.tan(0.5 * np.pi * ((k + s) / n - 0.5)) for k, s in ((i, across), (j, down))
    )
    unit = 1.0 / np.sqrt(1.0 + x * x + y * y)
    directions = np.empty((cells.size, 3), order="F")
    of = np.arange(cells.size)
    for axis, value in zip(_AXES[face].T, (x, y, _SIGNS[face]), strict=True):
        directions[of, axis] = value * unit
    return directions


def face_coordinates(vectors: Array, face: int) -> tuple[Array, Array, Array]:
    """Return x, y, z of vectors in the frame of a face: direction (x/z, y/z, 1)."""
    axes = _AXES[face]
    z = _SIGNS[face] * vectors[..., axes[2]]
    return vectors[..., axes[0]], vectors[..., axes[1]], z


def in_faces(vectors: Array, chosen: Ints, faces: Ints) -> Array:
    """Return x, y, z of chosen vectors, each in the frame of a face, shape (3, m)."""
    columns = np.ascontiguousarray(vectors.T)
    places = _AXES.T.take(faces, axis=1) * len(vectors) + chosen
    found = columns.reshape(-1).take(places)
    found[2] *= _SIGNS.take(faces)
    return found


def angle_between(a: Array, b: Array) -> Array:
    """Return the angle between unit vectors, accurate for small ones too."""
    chord = lengths(a - b)
    return 2.0 * np.arcsin(np.clip(0.5 * chord, 0.0, 1.0))
