"""Cells of poses: boxes of radius, polar angle and turn about the workspace's centre.

A cell lies within an angle a of its middle direction e. Seen from a sample at P, its
innermost places lie within rho = 2 r sin(a / 2) of r e, r its least radius, and its
outermost ones likewise; all others on the lines between. So, with u towards the middle,
all of it lies within psi of u where that is less than a right angle, since a ball of
directions that small holds every arc between two of its own::

    psi = max over both radii: angle(u, r e - P) + asin(rho / |r e - P|)

Parallel light comes from the direction of a cell, wherever its sample: psi = a.
"""

from typing import NamedTuple

import numpy as np

from geometry.arrays import Array, Ints

_ROUNDING = 1e-9


class Cells(NamedTuple):
    """Boxes, from and to, each (n,): radius [m], polar angle and turn [rad]."""

    low_m: Array
    high_m: Array
    polar: Array
    polar_end: Array
    turn: Array
    turn_end: Array

    @classmethod
    def of_shell(cls, low_m: float, high_m: float) -> "Cells":
        """Return eight cells that hold a shell."""
        place = np.arange(8, dtype=np.float64)
        polar: Array = 0.5 * np.pi * (place // 4)
        turn: Array = 0.5 * np.pi * (place % 4)
        ends = np.full(8, low_m), np.full(8, high_m)
        return cls(*ends, polar, polar + 0.5 * np.pi, turn, turn + 0.5 * np.pi)

    def take(self, chosen: Ints) -> "Cells":
        """Return some of the cells."""
        return Cells(*(column[chosen] for column in self))

    @property
    def middle(self) -> Array:
        """Unit direction e of each, (n, 3)."""
        polar, turn = self.polar + self.polar_end, self.turn + self.turn_end
        return _direction(0.5 * polar, 0.5 * turn)

    def shrunk(self) -> "Cells":
        """Return the pose in the middle of each, as a cell of no size."""
        low_m, high_m, polar, polar_end, turn, turn_end = self
        radius, polar = 0.5 * (low_m + high_m), 0.5 * (polar + polar_end)
        turn = 0.5 * (turn + turn_end)
        return Cells(radius, radius, polar, polar, turn, turn)

    @property
    def angle(self) -> Array:
        """Angle a about it that holds all directions [rad], (n,): a corner's.

        Along a side cos(angle to e) is a sine curve whose least value is at an end.
        """
        middle = self.middle
        corners = [_direction(p, self.turn) for p in (self.polar, self.polar_end)]
        off = [_angle(corner, middle) for corner in corners]
        return np.max(off, axis=0) + _ROUNDING

    def towards(self, points: Array | None, at: Ints, samples: Ints) -> Array:
        """Return unit directions from samples to the middles of cells, a pair each.

        `points` (n, 3) count from the centre; None: light is parallel.
        """
        middle = self.middle[at]
        if points is None:
            return middle
        radius = 0.5 * (self.low_m + self.high_m)[at]
        way = radius[:, None] * middle - points[samples]
        return way / np.linalg.norm(way, axis=1)[:, None]

    def widths(self, object_m: float) -> Array:
        """Return how much each side adds to psi, about, (n, 3) [rad]."""
        steepest = np.sin(np.clip(0.5 * np.pi, self.polar, self.polar_end))
        deep = (self.high_m - self.low_m) * object_m / self.low_m**2
        across = steepest * (self.turn_end - self.turn)
        return np.stack([deep, self.polar_end - self.polar, across], axis=1)

    def halves(self, object_m: float) -> "Cells":
        """Return both halves of each, cut across its longest side."""
        longest = np.argmax(self.widths(object_m), axis=1)
        columns = [np.repeat(column, 2) for column in self]
        at = np.arange(len(columns[0]))
        side, second = np.repeat(longest, 2), at % 2 == 1
        for k in range(3):
            begin, end = columns[2 * k], columns[2 * k + 1]
            middle, cut = 0.5 * (begin + end), side == k
            columns[2 * k] = np.where(cut & second, middle, begin)
            columns[2 * k + 1] = np.where(cut & ~second, middle, end)
        return Cells(*columns)


class Seen(NamedTuple):
    """How samples see cells, each (cells, samples).

    Attributes:
        along: u.N for each of some vectors N of the samples.
        psi: Angle about u that holds the cell [rad]; pi: it isn't known.
        nearest: Least distance of any place of the cell [m]; `farthest` likewise.
    """

    along: tuple[Array, ...]
    psi: Array
    nearest: Array
    farthest: Array


def seen_from(cells: Cells, points: Array, vectors: tuple[Array, ...]) -> Seen:
    """Return how cells look from points (n, 3) that count from the centre.

    Args:
        cells: Of positions.
        points: Of the samples [m].
        vectors: Of the samples, each (n, 3).
    """
    middle, angle = cells.middle, cells.angle[:, None]
    beside, square = middle @ points.T, np.sum(points**2, axis=1)
    off_axis = np.sqrt(np.maximum(square - beside**2, 0.0))

    def distance(radius: Array) -> Array:
        return np.hypot(radius - beside, off_axis)

    low, high = cells.low_m[:, None], cells.high_m[:, None]
    half = 0.5 * (low + high)
    away = distance(half)
    psi, farthest = np.zeros_like(away), np.zeros_like(away)
    for end in (low, high):
        there, rho = distance(end), 2.0 * end * np.sin(0.5 * angle)
        turned = np.arctan2(
            np.abs(end - half) * off_axis,
            (end - beside) * (half - beside) + off_axis**2,
        )
        share = np.divide(rho, there, out=np.ones_like(there), where=there > rho)
        psi = np.maximum(psi, turned + np.arcsin(share) + _ROUNDING)
        farthest = np.maximum(farthest, there + rho)
    psi[psi >= 0.5 * np.pi] = np.pi
    nearest = distance(np.clip(beside, low, high)) - 2.0 * high * np.sin(0.5 * angle)
    along = tuple(
        (half * (middle @ v.T) - np.sum(points * v, axis=1)) / away for v in vectors
    )
    return Seen(along, psi, np.maximum(nearest, 0.0), farthest)


def of_parallel(cells: Cells, vectors: tuple[Array, ...]) -> Seen:
    """Return the same of directions that light comes from; all distances are."""
    along = tuple(cells.middle @ v.T for v in vectors)
    psi = np.broadcast_to(cells.angle[:, None], along[0].shape)
    return Seen(along, psi, np.zeros_like(psi), np.full_like(psi, np.inf))


def _direction(polar: Array, turn: Array) -> Array:
    across = np.sin(polar)
    x, y = across * np.cos(turn), across * np.sin(turn)
    return np.stack([x, y, np.cos(polar)], axis=-1)


def _angle(a: Array, b: Array) -> Array:
    across = np.linalg.norm(np.cross(a, b), axis=1)
    return np.arctan2(across, np.einsum("ij,ij->i", a, b))
