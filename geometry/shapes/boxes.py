"""Boxes of any turn: what they touch, and which straight lines they stand across.

Two convex bodies are apart iff some plane lies between them. For boxes, and for a box
and a triangle, it is enough to try the planes square to their faces and to the cross
products of their edges (the separating axes; Gottschalk, Lin and Manocha 1996).
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import lsq_linear

from geometry.arrays import Array, Mask

# Squared length below which a cross product of unit edges gives no direction.
_PARALLEL = 1e-18


@dataclass(frozen=True, eq=False)
class OrientedBox:
    """A solid box: all x with ``|axes (x - centre)| <= half``.

    Attributes:
        centre: Its middle [m], shape (3,).
        axes: Unit directions of its sides, rows of a rotation, shape (3, 3).
        half: Half of each side [m], shape (3,).
    """

    centre: Array
    axes: Array
    half: Array

    @property
    def corners(self) -> Array:
        """The eight corners, shape (8, 3)."""
        signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1], indexing="ij"))
        return self.centre + (signs.reshape(3, -1).T * self.half) @ self.axes

    @property
    def radius(self) -> float:
        """Half of the diagonal [m]."""
        return float(np.linalg.norm(self.half))

    def grown(self, by_m: float) -> "OrientedBox":
        """Return the box with every face moved outwards."""
        return replace(self, half=self.half + by_m)

    def local(self, points: Array) -> Array:
        """Return points (..., 3) along the box's axes, from its middle."""
        return (points - self.centre) @ self.axes.T


def boxes_overlap(a: OrientedBox, b: OrientedBox) -> bool:
    """Return whether two boxes share a point."""
    if np.linalg.norm(a.centre - b.centre) > a.radius + b.radius:
        return False
    across = np.cross(a.axes[:, None], b.axes[None]).reshape(-1, 3)
    tried = np.concatenate([a.axes, b.axes, across])
    reach = np.abs(tried @ a.axes.T) @ a.half + np.abs(tried @ b.axes.T) @ b.half
    apart = np.abs(tried @ (b.centre - a.centre)) > reach
    # Of parallel edges the cross product is rounding, and separates nothing.
    return not np.any(apart & (np.einsum("ij,ij->i", tried, tried) > _PARALLEL))


def box_gap(a: OrientedBox, b: OrientedBox) -> float:
    """Return the distance of two boxes [m]: between their nearest points, 0 if any."""
    # Places u in a and v in b are bounded in the boxes' own axes: least squares.
    between, half = np.hstack([a.axes.T, -b.axes.T]), np.concatenate([a.half, b.half])
    nearest = lsq_linear(between, b.centre - a.centre, (-half, half), tol=1e-14)
    return float(np.linalg.norm(nearest.fun))


def lines_cross(box: OrientedBox, starts: Array, ends: Array) -> Mask:
    """Return which straight lines from starts to ends share a point with a box, (n,).

    A line is in the slab between two opposite faces on an interval of its length; it
    meets the box iff the three intervals have a point in common. Starts are (n, 3) [m],
    or (3,) for a common one.
    """
    begin = box.local(np.broadcast_to(starts, ends.shape))
    way = box.local(ends) - begin
    with np.errstate(divide="ignore", invalid="ignore"):
        one, two = (-box.half - begin) / way, (box.half - begin) / way
    still = way == 0.0
    held = np.abs(begin) <= box.half
    enter = np.where(still, np.where(held, 0.0, np.inf), np.minimum(one, two))
    leave = np.where(still, 1.0, np.maximum(one, two))
    first = np.maximum(enter.max(axis=1), 0.0)
    return first <= np.minimum(leave.min(axis=1), 1.0)


def triangles_touch(box: OrientedBox, corners: Array) -> Mask:
    """Return which triangles (n, 3, 3) [m] share a point with a box, (n,)."""
    touching = np.zeros(len(corners), dtype=bool)
    local = box.local(corners)
    low, high = local.min(axis=1), local.max(axis=1)
    near = np.flatnonzero(np.all((low <= box.half) & (high >= -box.half), axis=1))
    local = local[near]
    edges = np.roll(local, -1, axis=1) - local
    normals = np.cross(edges[:, 0], edges[:, 1])
    crossed = np.cross(np.eye(3)[None, :, None], edges[:, None]).reshape(-1, 9, 3)
    tried = np.concatenate([normals[:, None], crossed], axis=1)
    along = np.einsum("nij,nkj->nik", tried, local)
    reach = np.abs(tried) @ box.half
    apart = (along.min(axis=2) > reach) | (along.max(axis=2) < -reach)
    touching[near] = ~apart.any(axis=1)
    return touching
