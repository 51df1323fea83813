"""Directions from which a sample may be lit, as cells of a cube map: a superset.

A cell stays open unless no direction in it passes: each is beyond the incidence limit,
too near to the line of the steep direction, or blocked. With u the direction from the
sample to the device, N and T1 as in eq. (2)::

    N . u >= cos(theta_max),    |T1 . u| <= cos(tau_min),    nothing in between

Whether something is in between changes only across silhouettes (`silhouettes`). They
are marked on the map; of the other cells, those that hang together are all blocked or
all free, and one ray says which. A cell isn't closed because the ray to its middle is
blocked. The same is asked of the faces near the sample alone: they have none of the
silhouettes that they hide, and what they block is blocked.

The mesh must be nearer than the device in every direction asked about.
"""

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array, Ints, Mask, cross, lengths
from geometry.rays.rays import CHUNK, equal_parts
from geometry.rays.visibility import Visibility

from .cube_cells import mark_segments, pieces
from .cube_map import CubeMap
from .silhouettes import Silhouettes

# Cosines are exact to this.
_ROUNDING = 1e-9
# Lengths along rays of single precision are exact to this, with much to spare.
_SINGLE = 1e-4
# A sample to which another face comes nearer than this, in slacks of its rays, or whose
# own face is as narrow, is taken to be free: what is near it counts for some rays only.
_SLACKS = 16.0
# How near, in shares of the mesh's size, faces are that are looked at alone.
_NEAR = (0.01, 0.03, 0.1)
# Cells over which caps of samples are laid at a time: they stay in the cache.
_CAPS = 1 << 16


@dataclass(frozen=True)
class DirectionLimits:
    """Limits on the direction from a sample to a device.

    Attributes:
        max_incidence: Largest angle to the normal [rad], below pi/2.
        min_tangent_angle: Least angle to the line of the steep direction [rad]; 0:
            there is no such limit.
        closely: Whether the cells at the edge of the cap of incidence are looked at
            closely; else they are open.
    """

    max_incidence: float
    min_tangent_angle: float
    closely: bool = True


class OpenDirections:
    """Makes the maps of samples on one mesh.

    Args:
        visibility: The occluder; its rays are those that the planner believes.
        limits: Of incidence and tangent angle.
        cube: The map.
        occlusion: Whether blocked cells are closed.
    """

    def __init__(
        self,
        visibility: Visibility,
        limits: DirectionLimits,
        cube: CubeMap,
        *,
        occlusion: bool = True,
    ) -> None:
        self._visibility, self._limits, self._cube = visibility, limits, cube
        # Cells that reach beyond the limit belong to it as a whole.
        reach = limits.max_incidence + 2.0 * float(cube.radii.max())
        self._cone = min(reach, 0.5 * np.pi)
        mesh = visibility.caster.mesh
        self._edges = Silhouettes(mesh) if occlusion else None
        size = float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))
        self._near = [share * size for share in _NEAR]
        longest = mesh.edge_lengths.max(axis=1)
        width = 2.0 * mesh.face_areas / np.where(longest > 0, longest, 1.0)
        self._narrow = width <= _SLACKS * visibility.slack

    def maps(self, points: Array, normals: Array, steep: Array, faces: Ints) -> Mask:
        """Return which cells are open to each sample, shape (n, cube.size).

        At most `POINTS` on the mesh [m] with the unit normals of their faces; `steep`
        is unit T1, or zero where it doesn't bind; (n, 3) each.
        """
        cells = self._within_incidence(normals)
        cells = np.greater(cells, self._along_steep(steep))
        if self._edges is not None:
            # Rays leave out what is within the slack of a sample, as the planner's do.
            slack = _SLACKS * self._visibility.slack
            sides = self._edges.sides(points, normals, slack)
            blocked, close = np.zeros(cells.shape, dtype=bool), None
            for reach in (*self._near, np.inf):
                among = None
                if reach < np.inf:
                    among = close = self._edges.faces_within(sides, reach)
                crossing = self._edges.seen_from(sides, self._cone, among)
                asked = np.greater(cells, blocked)
                blocked |= self._blocked(crossing, points, normals, asked, reach)
            doubtful = self._edges.touched(sides, faces, slack, self._cone, close)
            doubtful |= self._narrow[faces]
            cells &= ~blocked | doubtful[:, None]
        return cells

    def _within_incidence(self, normals: Array) -> Mask:
        """Return the cells that the cap about each normal meets."""
        cube, limit = self._cube, self._limits.max_incidence
        within = np.empty((len(normals), cube.size), dtype=bool)
        near = np.empty_like(within)
        reached = np.cos(np.minimum(limit + cube.radii, np.pi))
        for part in equal_parts(len(normals), _at_once(cube)):
            cosine = normals[part] @ cube.centres.T
            np.greater_equal(cosine, reached, out=near[part])
            if self._limits.closely:
                np.greater_equal(cosine, np.cos(limit), out=within[part])
        if not self._limits.closely:
            return near
        near = np.greater(near, within)
        row, cell = np.divmod(np.flatnonzero(near), cube.size)
        meets = _arcs_come_within(cube, normals[row], cell, np.cos(limit) - _ROUNDING)
        within[row[meets], cell[meets]] = True
        within[np.arange(len(normals)), cube.locate(normals)] = True
        return within

    def _along_steep(self, steep: Array) -> Mask:
        """Return the cells that lie in a cap about +T1 or -T1 as a whole."""
        cube, n = self._cube, self._cube.n
        if self._limits.min_tangent_angle <= 0.0:
            return np.zeros((len(steep), cube.size), dtype=bool)
        least = np.cos(self._limits.min_tangent_angle) + _ROUNDING
        whole = np.zeros((len(steep), 6, n, n), dtype=bool)
        corners = cube.corners.reshape(-1, 3).T
        for part in equal_parts(len(steep), _at_once(cube)):
            cosine = (steep[part] @ corners).reshape(-1, 6, n + 1, n + 1)
            for inside in (cosine > least, cosine < -least):
                pairs = inside[:, :, :-1] & inside[:, :, 1:]
                whole[part] |= pairs[..., :-1] & pairs[..., 1:]
        return whole.reshape(len(steep), -1)

    def _blocked(
        self,
        silhouettes: tuple[Ints, Array, Array],
        points: Array,
        normals: Array,
        cells: Mask,
        reach: float,
    ) -> Mask:
        """Return the cells that are blocked as a whole; only those given are asked."""
        cube = self._cube
        touched = np.zeros(cells.shape, dtype=bool)
        owners, begin, end = silhouettes
        mark_segments(cube, begin, end, owners, touched)
        if self._cone >= 0.5 * np.pi:
            # Silhouettes below the horizon weren't asked for: nothing hangs together
            # across it.
            touched |= normals @ cube.centres.T <= np.sin(cube.radii)
        joined = pieces(np.greater(cells, touched), cube.n)
        row, cell = np.divmod(joined.first, cube.size)
        answer = self._meets(points[row], normals[row], cube.centres[cell], reach)
        return joined.cells(answer)

    def _meets(
        self, points: Array, normals: Array, directions: Array, reach: float
    ) -> Mask:
        """Return whether rays from samples outwards meet the mesh within reach [m]."""
        caster, slack = self._visibility.caster, self._visibility.slack
        rise = np.einsum("ij,ij->i", normals, directions)
        # The planner's rays end where they are `slack` above the sample's face.
        up = rise > 0.0
        offset = slack / np.where(up, rise, 1.0)
        start = points + directions * offset[:, None]
        local, along = caster.local(start), directions.astype(np.float32)
        # What is left of the reach, less what rounding may add.
        rest = np.maximum(reach - offset, 0.0) * (caster.scale * (1.0 - _SINGLE))
        rest = np.minimum(rest, 4.0 * caster.reach).astype(np.float32)
        met = np.zeros(len(points), dtype=bool)
        # In the caller's own thread: maps are made in several.
        for part in equal_parts(len(points), CHUNK):
            met[part] = caster.blocked_local(local[part], along[part], rest[part])
        return up & met


def _at_once(cube: CubeMap) -> int:
    return max(1, _CAPS // cube.size)


def _arcs_come_within(cube: CubeMap, axes: Array, cells: Ints, cosine: float) -> Mask:
    """Return whether the border of each cell comes within an angle of its axis."""
    face, rest = np.divmod(cells, cube.n * cube.n)
    j, i = np.divmod(rest, cube.n)
    across = cube.n + 1
    first = (face * across + j) * across + i
    corners = [
        cube.corners.reshape(-1, 3).take(first + step, axis=0)
        for step in (0, 1, across + 1, across)
    ]
    near = np.zeros(cells.size, dtype=bool)
    for start, end in zip(corners, corners[1:] + corners[:1], strict=True):
        pole = cross(start, end)
        pole /= lengths(pole)[:, None]
        off = np.einsum("ij,ij->i", pole, axes)
        # The nearest point of the great circle lies between the ends.
        between = np.einsum("ij,ij->i", cross(pole, start), axes) > 0.0
        between &= np.einsum("ij,ij->i", cross(end, pole), axes) > 0.0
        best = np.where(between, np.sqrt(np.maximum(1.0 - off * off, 0.0)), -1.0)
        near |= np.maximum(best, np.einsum("ij,ij->i", start, axes)) >= cosine
    return near
