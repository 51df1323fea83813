"""The outline of an object as it is seen: of all its triangles, holes included."""

from collections.abc import Iterator

import numpy as np
from PIL import Image, ImageDraw

from geometry.arrays import Array, Ints, Mask, rows_of

# Side of a cell, in the units that are drawn: far less than a line is wide.
_CELL = 0.2


def outlines(points: Array, faces: Ints, sides: Ints) -> list[Array]:
    """Return the closed curves about all that triangles cover, each (k, 2).

    Cells that triangles touch, their border through the middles of its cells' sides.
    Of points on a line the middle ones are left out.

    Args:
        points: Corners on the sheet, shape (n, 2).
        faces: Those of each triangle, which each are of one or more, shape (n_f, 3).
        sides: Both ends of each side of them, shape (n_s, 2).
    """
    low = points.min(axis=0) - 2.0 * _CELL
    covered = _covered((points - low) / _CELL, faces, sides)
    return [low + _CELL * curve for curve in _borders(covered)]


def _covered(places: Array, faces: Ints, sides: Ints) -> Mask:
    """Cells (rows, columns) that triangles touch, with empty ones about them."""
    columns, rows = np.ceil(places.max(axis=0)).astype(int) + 3
    picture = Image.new("1", (columns, rows))
    draw = ImageDraw.Draw(picture)
    # A pixel's middle is at whole numbers there.
    wide = np.zeros(len(faces), dtype=bool)
    for along in np.ascontiguousarray(places.T):
        a, b, c = (along[corner] for corner in faces.T)
        reach = np.maximum(np.maximum(a, b), c) - np.minimum(np.minimum(a, b), c)
        wide |= reach > 2.0
    for corners in places[faces[wide]].reshape(-1, 6) - 0.5:
        draw.polygon(corners.tolist(), fill=1)
    cells = np.array(picture)
    # A smaller one lies in the cells of its corners and the middles of its sides.
    first, last = (rows_of(places, ends) for ends in sides.T)
    for touched in (places, 0.5 * (first + last)):
        column, row = np.floor(touched).astype(int).T
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
