"""Hollow or solid, how thick the wall is, and which part of a surface lies inside.

`docs/method/orientation.md` has the definitions. Nothing here depends on where a mesh
lies, how it is turned or scaled: rays start from the surface, and lengths are compared
with lengths of the object.
"""

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array, Ints, Mask
from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.topology import components, face_pairs
from geometry.rays.rays import RayCaster

from .openness import Spots, look_out, spots_at, spots_on

SOLID = "solid"
CAVITIES = "solid with cavities"
HOLLOW = "hollow shell"
OPEN = "open surface"

# Seeing less of the outside than this share, or than this part of what the other side
# of a thin wall sees, is to lie inside.
HIDDEN = 0.05
LESS_THAN_BEHIND = 1.0 / 3.0
# A wall is thin up to this share of the diameter of the object.
THIN = 0.05
# Least share of the area that lies inside: of a solid with cavities, of a shell.
_SOME = 0.01
_MUCH = 0.1
# A surface through whose back more light than this escapes encloses nothing.
_LEAK = 0.1

_SPOTS = 16_000
_RAYS = 64
_RAYS_BEHIND = 16
_MAX_BODIES = 4000
_OFFSET = 2e-6


@dataclass(frozen=True)
class MeshShell:
    """What kind of body a surface bounds.

    Attributes:
        kind: `solid`, `solid with cavities`, `hollow shell` or `open surface`.
        wall_m: Median thickness of the material under what lies inside, in [m]; None
            where nothing does.
        mean_wall_m: 2 V / A of the whole, in [m]: the same for a thin shell, whatever
            the rays say; None for an open surface.
        inside_m2: Area that lies inside.
        sealed_m2: Area of bodies of which nothing at all can be seen from outside.
    """

    kind: str
    wall_m: float | None
    mean_wall_m: float | None
    inside_m2: float
    sealed_m2: float


def measure_shell(caster: RayCaster) -> MeshShell:
    """Tell a hollow shell from a solid, from rays at spots all over the surface."""
    mesh = caster.mesh
    body = _bodies(mesh)
    spots = spots_on(mesh, _SPOTS, group=body, least=1)
    of = body[spots.faces]
    n_spots = np.bincount(of)
    areas = np.bincount(body, mesh.face_areas)
    weight = (areas[: len(n_spots)] / np.maximum(n_spots, 1))[of]
    leaks = look_out(caster, spots, _RAYS_BEHIND, behind=True)
    if weight @ leaks > _LEAK * _RAYS_BEHIND * mesh.area:
        return MeshShell(OPEN, None, None, 0.0, 0.0)
    openness, wall, inside = _sight(caster, spots)
    seen = np.bincount(of, openness) > 0
    inside_m2 = float(weight @ inside)
    lining = inside & np.isfinite(wall)
    wall_m = _weighted_median(wall[lining], weight[lining]) if lining.any() else None
    arm = mesh.face_centroids - mesh.centre
    height = np.einsum("ij,ij->i", arm, mesh.face_normals)
    return MeshShell(
        _kind(inside_m2 / mesh.area, wall_m, THIN * 2.0 * mesh.radius),
        wall_m,
        float(2.0 / 3.0 * (mesh.face_areas @ height) / mesh.area),
        inside_m2,
        float(weight @ ~seen[of]),
    )


def lies_inside(caster: RayCaster, faces: Ints, points: Array) -> Mask:
    """Return whether points (n, 3) [m] on faces (n,) of a surface lie inside it, (n,).

    A point does if less than a twentieth of its cosine-weighted hemisphere is free, or
    if it sees less than a third of what the other side of a thin wall sees.
    """
    return _sight(caster, spots_at(caster.mesh, faces, points))[2]


def outside_faces(caster: RayCaster) -> Mask:
    """Return whether each face's centroid lies outside, as `lies_inside`, (n_f,)."""
    mesh = caster.mesh
    inside = lies_inside(caster, np.arange(len(mesh.faces)), mesh.face_centroids)
    return ~inside


def _kind(share: float, wall_m: float | None, thin_m: float) -> str:
    if wall_m is None or not share >= _SOME:
        return SOLID
    return HOLLOW if share >= _MUCH and wall_m <= thin_m else CAVITIES


def _sight(caster: RayCaster, spots: Spots) -> tuple[Array, Array, Mask]:
    """Of each spot: free share of the hemisphere, wall below [m], whether inside."""
    # What sees a third of the outside doesn't lie inside, however much more it sees.
    third = int(np.ceil(LESS_THAN_BEHIND * _RAYS))
    openness = look_out(caster, spots, _RAYS, enough=third) / _RAYS
    wall = np.full(len(spots), np.inf)
    start = spots.points - _OFFSET * caster.extent * spots.normals
    behind, distance = caster.first_hits(start, -spots.normals)
    normals = caster.mesh.face_normals[behind]
    leaves = np.einsum("ij,ij->i", normals, spots.normals) < 0
    through = (behind >= 0) & leaves
    wall[through] = distance[through] + _OFFSET * caster.extent
    inside = openness < HIDDEN
    thin = wall <= THIN * 2.0 * caster.mesh.radius
    unsure = np.flatnonzero(thin & ~inside & (openness < LESS_THAN_BEHIND))
    points = spots.points[unsure] - wall[unsure, None] * spots.normals[unsure]
    other = spots_at(caster.mesh, behind[unsure], points)
    beyond = look_out(caster, other, _RAYS) / _RAYS
    inside[unsure] = openness[unsure] < LESS_THAN_BEHIND * beyond
    return openness, wall, inside


def _bodies(mesh: TriangleMesh) -> Ints:
    """The body of each face, connected over edges; one where there are too many."""
    pairs = face_pairs(mesh.edges, manifold_only=False)[0]
    count, body = components(pairs, len(mesh.faces))
    return body if count <= _MAX_BODIES else np.zeros_like(body)


def _weighted_median(values: Array, weights: Array) -> float:
    order = np.argsort(values, kind="stable")
    cumulated = np.cumsum(weights[order])
    middle = int(np.searchsorted(cumulated, 0.5 * cumulated[-1]))
    return float(values[order[min(middle, len(values) - 1)]])
