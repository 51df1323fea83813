"""The outline of an object as it is seen: of all its triangles, holes included."""

from collections.abc import Iterator

import numpy as np
from PIL import Image, ImageDraw

from geometry.arrays import Array, Mask

# Side of a cell, in the units that are drawn: far less than a line is wide.
_CELL = 0.2


def outlines(triangles: Array) -> list[Array]:
    """Return the closed curves about all that triangles cover, each (k, 2).

    Cells that triangles touch, their border through the middles of its cells' sides.
    Of points on a line the middle ones are left out.

    Args:
        triangles: Corners on the sheet, shape (n, 3, 2).
    """
    low = triangles.min(axis=(0, 1)) - 2.0 * _CELL
    return [low + _CELL * curve for curve in _borders(_covered(triangles - low))]


def _covered(triangles: Array) -> Mask:
    """Cells (rows, columns) that triangles touch, with empty ones about them."""
    places = triangles / _CELL
    columns, rows = np.ceil(places.max(axis=(0, 1))).astype(int) + 3
    picture = Image.new("1", (columns, rows))
    draw = ImageDraw.Draw(picture)
    # A pixel's middle is at whole numbers there.
    a, b, c = places.transpose(1, 2, 0)
    wide = np.maximum(np.maximum(a, b), c) - np.minimum(np.minimum(a, b), c)
    for corners in places[np.maximum(*wide) > 2.0].reshape(-1, 6) - 0.5:
        draw.polygon(corners.tolist(), fill=1)
    cells = np.array(picture)
    # A smaller one lies in the cells of its corners and the middles of its sides.
    for points in (places, 0.5 * (places + np.roll(places, 1, axis=1))):
        column, row = np.floor(points.reshape(-1, 2)).astype(int).T
        cells[row, column] = True
    return cells


def _borders(cells: Mask) -> Iterator[Array]:
    """Closed curves between covered cells and others, in cells, (k, 2)."""
    ahead = dict[tuple[int, int], list[tuple[int, int]]]()
    # Sides of cells, run through with what is covered on the same hand.
    for axis, turn in ((0, 1), (1, -1)):
        change = np.diff(cells.astype(np.int8), axis=axis)
        for row, column in np.argwhere(change).tolist():
            start = (column, row + 1) if axis == 0 else (column + 1, row)
            end = (column + 1, row + 1)
            if change[row, column] * turn < 0:
                start, end = end, start
            ahead.setdefault(start, []).append(end)
    while ahead:
        first = at = next(iter(ahead))
        curve: list[tuple[int, int]] = []
        while not curve or at != first:
            curve.append(at)
            ends = ahead[at]
            at = ends.pop()
            if not ends:
                del ahead[curve[-1]]
        corners = np.array(curve, dtype=np.float64)
        middles = 0.5 * (corners + np.roll(corners, -1, axis=0))
        before, after = middles - np.roll(middles, 1, 0), np.roll(middles, -1, 0)
        after -= middles
        turns = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
        yield middles[np.abs(turns) > 1e-9]
