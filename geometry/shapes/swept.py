"""Where what turns about an axis meets what stands still, at any angle of a turn.

A point at height h along the axis and at radius r from it is taken to every other with
the same two. So what turns meets what stands still at some angle iff their profiles,
the sets of (r, h) that their solids have, share a point. Profiles are compared height
by height, where they are intervals of radii. Of two that overlap::

    depth = min(high_a - low_b, high_b - low_a)

Coordinates are along two directions square to the axis, and along it.
"""

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array, Ints

from .axis_sections import Sections

# Heights over the size of what turns; and so near to each other at least [m].
_HEIGHTS, _FINEST_M = 4000, 1e-4


@dataclass(frozen=True)
class Meeting:
    """Where two solids meet.

    Attributes:
        depth: How far they reach into each other along the radius, or the axis if that
            is less [m].
        angle: How far what turns has turned when they do, at a least [rad].
    """

    depth: float
    angle: float


def spacing_m(turning: Array) -> float:
    """Return the distance of the heights at which what turns, (n, 3), is compared [m].

    What reaches into each other by less isn't told from what touches.
    """
    return max(_FINEST_M, float(np.ptp(turning, axis=0).max()) / _HEIGHTS)


def in_frame(corners: Array, point: Array, axis: Array) -> Array:
    """Return corners (..., 3) across and along a unit axis through a point."""
    side = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    side /= np.linalg.norm(side)
    rows: Array = np.array([side, np.cross(axis, side), axis], dtype=np.float64)
    return (corners - point) @ rows.T


def deepest_meeting(turning: Array, still: Array, step: float) -> Meeting | None:
    """Return the deepest meeting of faces (n, 3, 3) in the axis's frame; None: none.

    Heights are a `step` apart [m]; less deep or less high than that is contact.
    """
    low = max(faces[..., 2].min() for faces in (turning, still)) - step
    high = min(faces[..., 2].max() for faces in (turning, still)) + step
    # Faces are level at heights of corners, which these aren't.
    heights = np.arange(low + 0.381966 * step, high, step)
    every, others = _between(turning, low, high), _between(still, low, high)
    if not (len(heights) and len(every) and len(others) and _may_meet(every, others)):
        return None
    a, b = Sections.of(every, heights), Sections.of(others, heights)
    # A level face that both have is contact; of one alone it may be a thin sheet.
    met = [_deepest(a, b, step, of_a=True), _deepest(a, b, step, of_a=False)]
    found = [one for one in met if one is not None]
    return max(found, key=lambda one: one.depth, default=None)


def _between(faces: Array, low: float, high: float) -> Array:
    heights = faces[..., 2]
    return faces[(heights.max(axis=1) >= low) & (heights.min(axis=1) <= high)]


def _may_meet(faces: Array, others: Array) -> bool:
    """Whether the one begins nearer to the axis than the other ends, both ways.

    A solid about the axis has all that is nearer.
    """
    farthest = [
        float(np.linalg.norm(each[..., :2], axis=2).max()) for each in (faces, others)
    ]
    return _nearest(faces) <= farthest[1] and _nearest(others) <= farthest[0]


def _nearest(faces: Array) -> float:
    """A radius that is at most that of any point of a solid."""
    middle = faces[..., :2].mean(axis=(0, 1))
    reach = np.linalg.norm(faces[..., :2] - middle, axis=2).max()
    return max(0.0, float(np.linalg.norm(middle) - reach))


def _deepest(a: Sections, b: Sections, step: float, *, of_a: bool) -> Meeting | None:
    """The deepest meeting that is at two neighbouring heights at least.

    Level faces count of the one or of the other.
    """
    apart = 2.0 * max(a.reach, b.reach) + 1.0
    (low_a, high_a), (low_b, high_b) = (
        a.profile(apart, level=of_a),
        b.profile(apart, level=not of_a),
    )
    i, j = _overlapping(low_a, high_a, low_b, high_b)
    outwards = high_a[i] - low_b[j] <= high_b[j] - low_a[i]
    at_a, at_b = (
        np.where(outwards, out, inn)
        for out, inn in ((high_a[i], low_a[i]), (low_b[j], high_b[j]))
    )
    deep = np.abs(at_a - at_b) > step
    at_a, at_b = at_a[deep], at_b[deep]
    depth = np.abs(at_a - at_b)
    height = (0.5 * (at_a + at_b) // apart).astype(np.int64)
    best: tuple[float, int] | None = None
    for among in _runs(height):
        k = int(among[np.argmax(depth[among])])
        by = min(float(depth[k]), step * float(np.ptp(height[among])))
        if by > 0.0 and (best is None or by > best[0]):
            best = by, k
    if best is None:
        return None
    by, k = best
    at = int(height[k])
    turned, stands = (
        one.azimuths(at, float(radius[k]) - apart * at)
        for one, radius in ((a, at_a), (b, at_b))
    )
    # Where one is solid about the axis it is so at every angle.
    angles = (stands[:, None] - turned) % (2.0 * np.pi)
    return Meeting(by, float(angles.min(initial=2.0 * np.pi) % (2.0 * np.pi)))


def _overlapping(
    low_a: Array, high_a: Array, low_b: Array, high_b: Array
) -> tuple[Ints, Ints]:
    """Pairs of intervals, of either apart and in order, that overlap."""
    first = np.searchsorted(high_a, low_b, side="right")
    count = np.maximum(np.searchsorted(low_a, high_b, side="left") - first, 0)
    j = np.repeat(np.arange(len(low_b)), count)
    i = first[j] + np.arange(len(j)) - np.repeat(np.cumsum(count) - count, count)
    return i, j


def _runs(height: Ints) -> list[Ints]:
    """Places of heights that follow each other without a gap."""
    order = np.argsort(height, kind="stable")
    gaps = np.flatnonzero(np.diff(height[order]) > 1) + 1
    return [run for run in np.split(order, gaps) if len(run)]


def lowest(points: Array, normal: Array) -> tuple[float, float]:
    """Return how low points (n, 3) in the axis's frame come, and the angle then.

    Along a unit normal, that of a plane which stands still::

        least = h n_h - r |(n_x, n_y)|

    Returns:
        The least height [m], and how far they have turned [rad].
    """
    across = float(np.hypot(normal[0], normal[1]))
    radii = np.hypot(points[:, 0], points[:, 1])
    heights = points[:, 2] * normal[2] - radii * across
    k = int(np.argmin(heights))
    down = np.arctan2(-normal[1], -normal[0])
    angle = (down - np.arctan2(points[k, 1], points[k, 0])) % (2.0 * np.pi)
    return float(heights[k]), float(angle)
