"""Sections of a solid square to an axis: radii that each has, and azimuths there."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from geometry.arrays import Array, Ints, Mask

# What radii of all heights on one line lose of their digits [m], and shares of it.
_ROUNDING_M, _SHARE = 1e-9, 1e-6


@dataclass(frozen=True, eq=False)
class Segments:
    """Straight parts of sections, in the plane square to the axis.

    Attributes:
        height: Which section each is of, (n,).
        starts: One end, (n, 2) [m]; `ends` the other.
    """

    height: Ints
    starts: Array
    ends: Array

    @cached_property
    def radii(self) -> tuple[Array, Array]:
        """Least and largest radius of each, (n,)."""
        way = self.ends - self.starts
        square = np.einsum("ij,ij->i", way, way)
        share = -np.einsum("ij,ij->i", self.starts, way)
        share = np.clip(share / np.where(square > 0.0, square, 1.0), 0.0, 1.0)
        ends = (np.linalg.norm(each, axis=1) for each in (self.starts, self.ends))
        foot = self.starts + share[:, None] * way
        return np.linalg.norm(foot, axis=1), np.maximum(*ends)

    def crossed(self, turn: Array) -> tuple[Array, Ints]:
        """Radii at which they cross the first direction of a turn (2, 2), and where."""
        (u, v), (u_, v_) = (turn @ each.T for each in (self.starts, self.ends))
        across = np.flatnonzero((v < 0.0) != (v_ < 0.0))
        u, v, u_, v_ = u[across], v[across], u_[across], v_[across]
        at = u - v * (u_ - u) / (v_ - v)
        return at[at > 0.0], self.height[across[at > 0.0]]


@dataclass(frozen=True, eq=False)
class Sections:
    """Sections of a solid at many heights.

    Attributes:
        sides: Of faces that heights cut.
        level: Edges of faces between two heights, at either.
        through: Whether the axis runs through the face of each of these.
    """

    sides: Segments
    level: Segments
    through: Mask

    @classmethod
    def of(cls, faces: Array, heights: Array) -> "Sections":
        """Return the sections of faces (n, 3, 3) at ascending heights."""
        order = np.argsort(faces[..., 2], axis=1)
        a, b, c = np.moveaxis(np.take_along_axis(faces, order[..., None], axis=1), 1, 0)
        begin = np.searchsorted(heights, a[:, 2], side="right")
        count = np.searchsorted(heights, c[:, 2], side="left") - begin
        face = np.repeat(np.arange(len(faces)), count)
        at = np.arange(len(face)) - np.repeat(np.cumsum(count) - count, count)
        at += begin[face]
        z, upper = heights[at], (heights[at] >= b[face, 2])[:, None]
        starts = _at_height(a[face], c[face], z)
        low, high = np.where(upper, b[face], a[face]), np.where(upper, c[face], b[face])
        sides = Segments(at, starts, _at_height(low, high, z))
        flat = count == 0
        corner, after = faces[flat][..., :2], np.roll(faces[flat][..., :2], -1, axis=1)
        turns = corner[..., 0] * after[..., 1] - corner[..., 1] * after[..., 0]
        through = np.all(turns > 0.0, axis=1) | np.all(turns < 0.0, axis=1)
        above = np.repeat(begin[flat], 3)
        level = Segments(
            np.concatenate([above - 1, above]),
            np.tile(corner.reshape(-1, 2), (2, 1)),
            np.tile(after.reshape(-1, 2), (2, 1)),
        )
        return cls(sides, level, np.tile(np.repeat(through, 3), 2))

    @property
    def reach(self) -> float:
        """The largest radius [m]."""
        return max(
            float(segments.radii[1].max(initial=0.0))
            for segments in (self.sides, self.level)
        )

    def profile(self, apart: float, *, level: bool) -> tuple[Array, Array]:
        """Return intervals of radii that the solid has, apart and in order.

        On one line for all heights, a height `apart` after the one before [m]. Level
        faces count or not.
        """
        least, most = self.sides.radii
        begin = apart * self.sides.height
        low, high = joined(least + begin, most + begin)
        inner, outer = self._within(low, high, apart)
        low, high = np.concatenate([low, inner]), np.concatenate([high, outer])
        if level:
            least, most = self.level.radii
            least = least * ~self.through
            begin = apart * self.level.height
            low = np.concatenate([low, least + begin])
            high = np.concatenate([high, most + begin])
        return joined(low, high)

    def _within(self, low: Array, high: Array, apart: float) -> tuple[Array, Array]:
        """Gaps between the radii of its surface that are inside of the solid.

        No surface is between them, so one azimuth is as good as another, of an open
        surface: all of four.
        """
        begin = apart * (0.5 * (low + high) // apart)
        inner = np.maximum(np.append(0.0, high[:-1])[: len(low)], begin)
        middle, inside = 0.5 * (inner + low), low > inner
        for k in range(4):
            # In no plane in which parts like to have corners.
            azimuth = 0.381966 + 0.5 * np.pi * k
            c, s = np.cos(azimuth), np.sin(azimuth)
            radii, height = self.sides.crossed(np.array([[c, s], [-s, c]]))
            places = np.sort(radii + apart * height)
            beyond = np.searchsorted(places, [begin + apart, middle])
            inside &= (beyond[0] - beyond[1]) % 2 == 1
        return inner[inside], low[inside]

    def azimuths(self, height: int, radius: float) -> Array:
        """Return the azimuths of its surface at a height and radius [rad]."""
        found: list[Array] = []
        for segments in (self.sides, self.level):
            low, high = segments.radii
            here = (low <= radius + _ROUNDING_M) & (high >= radius - _ROUNDING_M)
            here &= segments.height == height
            starts = segments.starts[here]
            way = segments.ends[here] - starts
            square = np.maximum(np.einsum("ij,ij->i", way, way), 1e-30)
            foot = -np.einsum("ij,ij->i", starts, way) / square
            off = starts + foot[:, None] * way
            half = radius**2 - np.einsum("ij,ij->i", off, off)
            half = np.sqrt(np.maximum(half, 0.0) / square)
            for share in (foot - half, foot + half):
                on = np.abs(share - 0.5) <= 0.5 + _SHARE
                points = (starts + share[:, None] * way)[on]
                found.append(np.arctan2(points[:, 1], points[:, 0]))
        return np.concatenate(found)


def joined(low: Array, high: Array) -> tuple[Array, Array]:
    """Return intervals that are apart, in order, of any."""
    order = np.argsort(low)
    low, high = low[order], np.maximum.accumulate(high[order])
    new = np.append(True, low[1:] > high[:-1])[: len(low)]
    last = np.append(np.flatnonzero(new)[1:] - 1, len(low) - 1)[: int(new.sum())]
    return low[new], high[last]


def _at_height(a: Array, b: Array, z: Array) -> Array:
    """Where edges (n, 3) from a up to b are at heights (n,), (n, 2)."""
    rise = b[:, 2] - a[:, 2]
    share = (z - a[:, 2]) / np.where(rise > 0.0, rise, 1.0)
    return a[:, :2] + share[:, None] * (b - a)[:, :2]
