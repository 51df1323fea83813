"""How freely faces see out: rays from the surface itself, spread as light would be.

A face of area A whose side is seen over the share f of its cosine-weighted hemisphere
has, averaged over all directions, the visible projected area A f / 4 (Cauchy). So the
rays that leave a surface and escape count what an observer who walks all around would
see of it. Points and directions are laid out in the frame of each face (its corners in
the order of their indices), so that they move with a mesh that is turned, moved or
scaled, and don't depend on which way a face is wound.
"""

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array, Ints, Mask, lengths
from geometry.mesh.mesh import TriangleMesh
from geometry.rays.rays import CHUNK, RayCaster, equal_parts

_GOLDEN = np.pi * (3.0 - np.sqrt(5.0))
# Fractional parts of multiples of these fill a line, a square evenly (Roberts' R2).
_R1 = 0.6180339887498949
_R2 = (0.7548776662466927, 0.5698402909980532)
# In radii of the object: above the rounding of float32, below any wall.
_OFFSET = 2e-6


@dataclass(frozen=True, eq=False)
class Spots:
    """Points on faces, each with a frame that follows its face.

    Attributes:
        faces: Face of each spot, shape (n,).
        points: Positions in [m], shape (n, 3).
        frames: Two unit tangents and the unit normal as rows, shape (n, 3, 3).
        turns: Angle in [rad] by which each spot's rays are turned about its normal.
    """

    faces: Ints
    points: Array
    frames: Array
    turns: Array

    def __len__(self) -> int:
        return len(self.faces)

    def take(self, chosen: slice | Ints) -> "Spots":
        """Return some of the spots."""
        return Spots(
            self.faces[chosen],
            self.points[chosen],
            self.frames[chosen],
            self.turns[chosen],
        )

    @property
    def normals(self) -> Array:
        """Unit normals, shape (n, 3)."""
        return self.frames[:, 2]


def spots_on(
    mesh: TriangleMesh,
    n: int,
    *,
    group: Ints,
    least: int = 1,
    within: Mask | None = None,
) -> Spots:
    """Return about n spots spread over faces in proportion to their area.

    Only faces `within` (default: all) get any; every group of faces, by the number of
    each, (n_f,), gets at least so many, however small it is.
    """
    areas = mesh.face_areas
    used = areas > 0 if within is None else within & (areas > 0)
    faces = np.flatnonzero(used)
    faces = faces[np.argsort(group[faces], kind="stable")]
    _, start, count = np.unique(group[faces], return_index=True, return_counts=True)
    sums = np.add.reduceat(areas[faces], start)
    share = np.ceil(n * sums / sums.sum() - 1e-9).astype(np.int64)
    share = np.maximum(share, least)
    # Systematic sampling along the area, in every group on its own.
    owner = np.repeat(np.arange(len(start)), share)
    place = np.arange(len(owner)) - np.repeat(np.cumsum(share) - share, share) + 0.5
    cumulated = np.cumsum(areas[faces])
    ticks = (cumulated[start] - areas[faces][start])[owner]
    ticks += place * (sums / share)[owner]
    chosen = np.searchsorted(cumulated, ticks, side="right")
    chosen = np.clip(chosen, start[owner], (start + count - 1)[owner])
    faces = faces[chosen]
    a, b, c = _ordered_corners(mesh, faces)
    i = np.arange(len(faces)) + 0.5
    u, v = (np.modf(i * k)[0] for k in _R2)
    over = u + v > 1.0
    u, v = np.where(over, 1.0 - u, u), np.where(over, 1.0 - v, v)
    return spots_at(mesh, faces, a + u[:, None] * (b - a) + v[:, None] * (c - a))


def spots_at(mesh: TriangleMesh, faces: Ints, points: Array) -> Spots:
    """Return spots at given points (n, 3) of faces (n,), each with an area."""
    a, b, c = _ordered_corners(mesh, faces)
    e1 = b - a
    e1 = e1 / lengths(e1)[:, None]
    e2 = np.cross(np.cross(e1, c - a), e1)
    e2 = e2 / lengths(e2)[:, None]
    turns = 2.0 * np.pi * np.modf((np.arange(len(faces)) + 0.5) * _R1)[0]
    frames = np.stack([e1, e2, mesh.face_normals[faces]], axis=1)
    return Spots(faces, points, frames, turns)


def _ordered_corners(mesh: TriangleMesh, faces: Ints) -> tuple[Array, Array, Array]:
    order = np.argsort(mesh.faces[faces], axis=1)[:, :, None]
    corners = np.take_along_axis(mesh.corners[faces], order, axis=1)
    return corners[:, 0], corners[:, 1], corners[:, 2]


def look_out(
    caster: RayCaster,
    spots: Spots,
    n_rays: int,
    *,
    behind: bool = False,
    enough: int | None = None,
) -> Ints:
    """Return how many rays over each spot's cosine-weighted hemisphere escape, (n,).

    `behind`: from the back of the faces, inwards, instead of the front. Where `enough`
    have escaped of the first half, the others aren't cast: so many at least would.
    """
    half = n_rays if enough is None else n_rays // 2
    rays = np.arange(n_rays)
    escaped = _escaped(caster, spots, rays[:half], n_rays, behind=behind)
    if enough is not None:
        few = np.flatnonzero(escaped < enough)
        others = spots.take(few)
        escaped[few] += _escaped(caster, others, rays[half:], n_rays, behind=behind)
    return escaped


def _escaped(
    caster: RayCaster, spots: Spots, rays: Ints, n_rays: int, *, behind: bool
) -> Ints:
    """Return how many of some of the rays over each spot escape, (n,)."""
    side = -1.0 if behind else 1.0
    k = (rays + 0.5) / n_rays
    radius, height = np.sqrt(k), np.sqrt(1.0 - k)
    around = rays * _GOLDEN
    escaped = np.empty(len(spots), dtype=np.int64)
    offset = side * _OFFSET * caster.extent
    # Farther than this from a place on the surface there is none of it.
    beyond = 4.0 * caster.reach

    def look(part: slice) -> None:
        e1, e2, normal = np.moveaxis(spots.frames[part], 1, 0)
        angle = spots.turns[part, None] + around
        along = (
            (radius * np.cos(angle))[..., None] * e1[:, None]
            + (radius * np.sin(angle))[..., None] * e2[:, None]
            + (side * height)[:, None] * normal[:, None]
        ).reshape(-1, 3)
        start = caster.local(spots.points[part] + offset * normal)
        met = caster.blocked_local(
            np.repeat(start, len(rays), axis=0),
            along.astype(np.float32),
            np.full(len(along), beyond, dtype=np.float32),
        )
        escaped[part] = (~met).reshape(-1, len(rays)).sum(axis=1)

    caster.share(look, equal_parts(len(spots), max(CHUNK // n_rays, 1)))
    return escaped
