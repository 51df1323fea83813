"""How deep a solid that turns about an axis comes into one that stands.

Over a whole turn a solid fills all that is as far along the axis and from it as any of
its points. So both are drawn as pictures of (height, radius), and a cell that both have
is met at some angle. Between surfaces a picture is filled where a point of it is inside
of the solid. Surfaces that touch share cells at their edges alone: what counts is how
far from its edge the one has a cell that the other has as well.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt, label

from geometry.arrays import Array, Ints, Mask

# Cells along the longer side of a picture, and of what is shared at its rim. Depths of
# fewer than so many cells are contact; pockets of fewer aren't filled.
_CELLS, _RIM, _CONTACT, _POCKET = 500, 6, 3.0, 16
# Azimuths at which it is asked whether a point is inside; open surfaces don't agree.
_AZIMUTHS = (0.1, 1.7, 3.3, 4.9)


def depth_of_turn(turning: Array, still: Array, point: Array, axis: Array) -> float:
    """Return how deep faces (n, 3, 3) come into others at some angle, at least [m].

    0 where they don't, or only touch as far as pictures of 500 cells tell.
    """
    along = [_upright(faces, point, axis) for faces in (turning, still)]
    boxes = [_bounds(faces) for faces in along]
    low = np.max([box[0] for box in boxes], axis=0)
    high = np.min([box[1] for box in boxes], axis=0)
    if not np.all(high >= low):
        return 0.0
    cell = max(float((high - low).max()) / _CELLS, 1e-6)
    view = _Picture(np.maximum(low - _RIM * cell, [-np.inf, 0.0]), high, cell)
    one, other = (view.solid(faces) for faces in along)
    shared = one & other
    deepest = max(
        float(_depths(each)[shared].max(initial=0.0)) for each in (one, other)
    )
    return cell * deepest if deepest > _CONTACT else 0.0


def lowest_of_turn(points: Array, normal: Array, point: Array, axis: Array) -> float:
    """Return the least n.(P - p) of points (n, 3) over a turn about an axis [m]."""
    offset = points - point
    along = offset @ axis
    away = np.linalg.norm(offset - along[:, None] * axis, axis=1)
    tilt = float(normal @ axis)
    return float((along * tilt - away * np.sqrt(max(0.0, 1.0 - tilt**2))).min())


def _upright(faces: Array, point: Array, axis: Array) -> Array:
    """Faces as seen from the axis: two directions across, then along it."""
    _, _, rows = np.linalg.svd(axis[None])
    return (faces - point) @ np.stack([rows[1], rows[2], axis]).T


def _bounds(faces: Array) -> tuple[Array, Array]:
    """Least and largest height and radius that a solid may have."""
    heights, radii = faces[..., 2], np.linalg.norm(faces[..., :2], axis=2)
    middle = faces[..., :2].reshape(-1, 2).mean(axis=0)
    reach = np.linalg.norm(faces[..., :2] - middle, axis=2).max()
    nearest = max(0.0, float(np.linalg.norm(middle) - reach))
    return np.array([heights.min(), nearest]), np.array([heights.max(), radii.max()])


def _depths(solid: Mask) -> Array:
    """How many cells each one of a picture is from the nearest that is empty.

    Beyond the picture all is, but beside the axis, where it goes on.
    """
    depths: Array = np.asarray(distance_transform_edt(np.pad(solid, 1)))
    return depths[1:-1, 1:-1]


def _pockets(surface: Mask) -> Iterator[Mask]:
    """Yield the parts into which it cuts the rest of a picture."""
    numbers: Ints = np.zeros(surface.shape, dtype=np.int64)
    label(~surface, output=numbers)
    for number, size in enumerate(np.bincount(numbers.ravel())):
        if number and size >= _POCKET:
            yield numbers == number


@dataclass(frozen=True, eq=False)
class _Picture:
    """Cells of height and radius, from one corner to beyond another [m]."""

    low: Array
    high: Array
    cell: float

    @property
    def shape(self) -> tuple[int, int]:
        rows, columns = ((self.high - self.low) / self.cell).astype(np.int64)
        return int(rows) + _RIM, int(columns) + _RIM

    def solid(self, faces: Array) -> Mask:
        """Cells that a solid has at any azimuth."""
        surface = np.zeros(self.shape, dtype=bool)
        for row, low, high in self._intervals(faces):
            surface[row] |= self._columns(low, high)
        solid = surface.copy()
        for pocket in _pockets(surface):
            at = np.unravel_index(np.argmax(_depths(pocket)), self.shape)
            height, radius = self.low + (np.array(at) + 0.5) * self.cell
            if all(_is_inside(faces, height, radius, turn) for turn in _AZIMUTHS):
                solid |= pocket
        return solid

    def _intervals(self, faces: Array) -> Iterator[tuple[int, Array, Array]]:
        """Yield rows, and the radii from and to which faces are in each."""
        low, high = faces[..., 2].min(axis=1), faces[..., 2].max(axis=1)
        for row in range(self.shape[0]):
            begin, end = self.low[0] + self.cell * np.array([row, row + 1])
            near = faces[(low <= end) & (high >= begin)]
            if len(near):
                within = (near[..., 2] >= begin) & (near[..., 2] <= end)
                radii = np.linalg.norm(near[..., :2], axis=2)
                least, most = _cut(near, begin)
                also, beyond = _cut(near, end)
                least = np.minimum(least, also)
                least = np.minimum(least, np.where(within, radii, np.inf).min(axis=1))
                lying = within.all(axis=1)
                least[lying] = _nearest(near[lying][..., :2])
                most = np.maximum(most, beyond)
                most = np.maximum(most, np.where(within, radii, 0.0).max(axis=1))
                yield row, least, most

    def _columns(self, low: Array, high: Array) -> Mask:
        n = self.shape[1]
        edges = np.zeros(n + 1, dtype=np.int64)
        begin, end = (
            np.floor((radii - self.low[1]) / self.cell) for radii in (low, high)
        )
        seen = (end >= 0) & (begin < n)
        np.add.at(edges, np.clip(begin[seen], 0, n).astype(np.int64), 1)
        np.add.at(edges, np.clip(end[seen] + 1, 0, n).astype(np.int64), -1)
        return np.cumsum(edges[:-1]) > 0


def _cut(faces: Array, height: float) -> tuple[Array, Array]:
    """Least and largest radius of faces at a height; inf and 0 where they have none."""
    after = np.roll(faces, -1, axis=1)
    across = (faces[..., 2] <= height) != (after[..., 2] <= height)
    a, b = faces[across], after[across]
    share = (height - a[:, 2]) / (b[:, 2] - a[:, 2])
    points = (a + share[:, None] * (b - a))[:, :2].reshape(-1, 2, 2)
    least, most = np.full(len(faces), np.inf), np.zeros(len(faces))
    there = across.any(axis=1)
    least[there] = _from_axis(points[:, 0], points[:, 1])
    most[there] = np.linalg.norm(points, axis=2).max(axis=1)
    return least, most


def _from_axis(a: Array, b: Array) -> Array:
    """Distance from the origin of lines from a to b, (n, 2) each."""
    way = b - a
    length = np.linalg.norm(way, axis=1)
    passes = (np.sum(a * way, axis=1) < 0.0) & (np.sum(b * way, axis=1) > 0.0)
    area = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    ends = np.minimum(np.linalg.norm(a, axis=1), np.linalg.norm(b, axis=1))
    return np.where(passes, area / np.where(passes, length, 1.0), ends)


def _nearest(flat: Array) -> Array:
    """Distance from the origin of triangles of the plane (n, 3, 2), (n,)."""
    sides = [_from_axis(flat[:, k], flat[:, (k + 1) % 3]) for k in range(3)]
    return np.where(_holds_axis(flat), 0.0, np.min(sides, axis=0))


def _holds_axis(flat: Array) -> Mask:
    """Which triangles of the plane (n, 3, 2) hold the origin, (n,)."""
    after = np.roll(flat, -1, axis=1)
    side = flat[..., 0] * after[..., 1] - flat[..., 1] * after[..., 0]
    held: Mask = np.all(side > 0.0, axis=1) | np.all(side < 0.0, axis=1)
    return held


def _is_inside(faces: Array, height: float, radius: float, azimuth: float) -> bool:
    """Whether a line along the axis from a point meets an odd number, both ways."""
    spot = radius * np.array([np.cos(azimuth), np.sin(azimuth)])
    under = faces[_holds_axis(faces[..., :2] - spot)]
    normals = np.cross(under[:, 1] - under[:, 0], under[:, 2] - under[:, 0])
    off = under[:, 0, :2] - spot
    rise = np.einsum("ij,ij->i", normals[:, :2], off) / normals[:, 2]
    above: Ints = np.flatnonzero(under[:, 0, 2] + rise > height)
    return len(above) % 2 == 1 and (len(under) - len(above)) % 2 == 1
