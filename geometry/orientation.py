"""Turn faces so that they are counter-clockwise seen from outside.

A *patch* is connected across edges of exactly two faces: the largest piece whose
winding can be made consistent without a choice. Each patch is then decided on its own,
so that a floating fragment never decides for the rest.
"""

import igl
import numpy as np
from numpy.typing import NDArray

from .mesh import Repair, TriangleMesh
from .poses import fibonacci_cap
from .rays import RayCaster
from .topology import mesh_edges

_VIEWS = 48
_ROWS = 120
# Fewer hits, or a front share this near a half, say nothing about a patch.
_MIN_HITS = 24
_CLEAR = 0.05
# Below this |volume| / area^1.5 a closed patch encloses nothing (a folded sheet).
_HOLLOW = 1e-6
_MAX_LAYERS = 400


def orient(mesh: TriangleMesh) -> tuple[NDArray[np.int64], tuple[Repair, ...]]:
    """Return the faces wound consistently and outwards, and what was changed.

    Winding is made consistent inside each patch, after its majority. A closed patch is
    turned if its signed volume is negative, unless it lies inside another closed one:
    then it may be the inner wall of a hollow shell, and is turned only together with
    the one that holds it. An open patch is turned if rays from all around hit more of
    its back than of its front. Patches that neither decides (flat, or never seen) are
    turned if most of the decided area was.

    Args:
        mesh: Welded, without duplicate or zero-area faces.

    Returns:
        Faces (n_f, 3), and the repairs: rewound and turned faces.
    """
    wound, patch = _consistent(mesh)
    closed = _closed_patches(wound, patch)
    straight = TriangleMesh(mesh.vertices, wound)
    verdict = np.zeros(len(closed), dtype=np.int64)
    caster = None
    if closed.sum() > 1 or not closed.all():
        caster = RayCaster(straight)
    if closed.any():
        verdict[closed] = _by_volume(straight, patch, closed, caster)[closed]
    if caster is not None and not closed.all():
        verdict[~closed] = _by_visibility(straight, patch, caster)[~closed]
    area = np.bincount(patch, straight.face_areas)
    undecided = -1 if float(verdict @ area) < 0 else 1
    turned = (np.where(verdict == 0, undecided, verdict) < 0)[patch]
    faces = np.where(turned[:, None], wound[:, ::-1], wound)
    rewound = np.any(wound != mesh.faces, axis=1)
    repairs = (
        Repair("faces rewound like their neighbours", int(rewound.sum())),
        Repair("faces turned outwards", int(turned.sum())),
    )
    return faces, tuple(repair for repair in repairs if repair.count)


def _consistent(
    mesh: TriangleMesh,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Faces wound alike within each patch, and the patch of each face."""
    wound, patch = igl.bfs_orient(mesh.faces)
    wound, patch = np.array(wound, np.int64), np.array(patch, np.int64)
    changed = np.any(wound != mesh.faces, axis=1)
    against = np.bincount(patch, mesh.face_areas * np.where(changed, 1.0, -1.0)) > 0
    back = against[patch]
    # Flipped faces come back with another first corner; start from the stored ones.
    flip = changed != back
    return np.where(flip[:, None], mesh.faces[:, ::-1], mesh.faces), patch


def _closed_patches(
    faces: NDArray[np.int64], patch: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """Whether each patch meets every one of its edges an even number of times."""
    of_face = mesh_edges(faces).of_face
    n = int(patch.max()) + 1
    _, first, counts = np.unique(
        (of_face * n + patch[:, None]).ravel(), return_index=True, return_counts=True
    )
    odd = patch[first[counts % 2 == 1] // 3]
    closed = np.ones(n, dtype=bool)
    closed[odd] = False
    return closed


def _by_volume(
    mesh: TriangleMesh,
    patch: NDArray[np.int64],
    closed: NDArray[np.bool_],
    caster: RayCaster | None,
) -> NDArray[np.int64]:
    """1 outwards, -1 inwards, 0 undecided, for each patch."""
    area = np.bincount(patch, mesh.face_areas)
    middle = (
        np.stack(
            [
                np.bincount(patch, mesh.face_areas * mesh.face_centroids[:, k])
                for k in range(3)
            ],
            axis=1,
        )
        / np.maximum(area, 1e-300)[:, None]
    )
    a, b, c = (mesh.corners[:, k] - middle[patch] for k in range(3))
    volume = np.bincount(patch, np.einsum("ij,ij->i", a, np.cross(b, c))) / 6.0
    sign = np.where(np.abs(volume) > _HOLLOW * area**1.5, np.sign(volume), 0.0)
    holder = np.arange(len(closed))
    if caster is not None and closed.sum() > 1:
        holder = _outermost(mesh, patch, closed, caster)
    return sign[holder].astype(np.int64)


def _outermost(
    mesh: TriangleMesh,
    patch: NDArray[np.int64],
    closed: NDArray[np.bool_],
    caster: RayCaster,
) -> NDArray[np.int64]:
    """For each patch the closed one that holds it and is held by none, else itself.

    A point lies inside a closed patch if a ray from it crosses the patch an odd number
    of times; three rays vote, since one may pass through an edge.
    """
    n = len(closed)
    largest = np.lexsort((mesh.face_areas, patch))
    largest = largest[np.append(patch[largest][1:] != patch[largest][:-1], True)]
    seeds = mesh.face_centroids[largest[closed]]
    inner = np.flatnonzero(closed)
    votes = np.zeros((len(inner), n), dtype=np.int8)
    for direction in fibonacci_cap(3, np.array([0.31, 0.52, 0.8]), 1.2):
        votes += _crossed(mesh, patch, seeds, direction, caster) % 2
    inside = votes >= 2
    inside[:, ~closed] = False
    inside[np.arange(len(inner)), inner] = False
    depth = np.zeros(n, dtype=np.int64)
    depth[inner] = inside.sum(axis=1)
    holder = np.arange(n)
    for row in np.flatnonzero(inside.any(axis=1)):
        held_by = np.flatnonzero(inside[row])
        holder[inner[row]] = held_by[np.argmin(depth[held_by])]
    return holder


def _crossed(
    mesh: TriangleMesh,
    patch: NDArray[np.int64],
    seeds: NDArray[np.float64],
    direction: NDArray[np.float64],
    caster: RayCaster,
) -> NDArray[np.int64]:
    """How often a ray from each seed crosses each patch, shape (seeds, patches)."""
    crossed = np.zeros((len(seeds), int(patch.max()) + 1), dtype=np.int64)
    step = 1e-6 * mesh.radius
    alive = np.arange(len(seeds))
    at = seeds + step * direction
    for _ in range(_MAX_LAYERS):
        along = np.broadcast_to(direction, at.shape)
        faces, distances = caster.first_hits(at, along)
        hit = faces >= 0
        alive, at = alive[hit], at[hit]
        if len(alive) == 0:
            break
        crossed[alive, patch[faces[hit]]] += 1
        forward = np.maximum(distances[hit], 0.0) + step
        at = at + forward[:, None] * direction
    return crossed


def _by_visibility(
    mesh: TriangleMesh, patch: NDArray[np.int64], caster: RayCaster
) -> NDArray[np.int64]:
    """1 front, -1 back, 0 undecided, by what parallel beams from all around hit first.

    Every ray stands for the same projected area, so the votes are area-weighted.
    """
    n = int(patch.max()) + 1
    front, back = np.zeros(n), np.zeros(n)
    ticks = (np.arange(_ROWS) + 0.5) / _ROWS * 2.0 - 1.0
    u, v = (k.ravel() for k in np.meshgrid(ticks, ticks))
    keep = u * u + v * v <= 1.0
    u, v = u[keep, None] * mesh.radius, v[keep, None] * mesh.radius
    for view in fibonacci_cap(_VIEWS, np.array([0.0, 0.0, 1.0]), np.pi):
        side = np.cross(view, np.eye(3)[np.argmin(np.abs(view))])
        side /= np.linalg.norm(side)
        origins = mesh.centre + 1.5 * mesh.radius * view + u * side
        origins = origins + v * np.cross(view, side)
        faces, _ = caster.first_hits(origins, np.broadcast_to(-view, origins.shape))
        faces = faces[faces >= 0]
        facing = mesh.face_normals[faces] @ view > 0
        front += np.bincount(patch[faces], facing, n)
        back += np.bincount(patch[faces], ~facing, n)
    total = front + back
    lean = (front - back) / np.maximum(total, 1.0)
    clear = (total >= _MIN_HITS) & (np.abs(lean) > 2.0 * _CLEAR)
    return np.where(clear, np.sign(lean), 0.0).astype(np.int64)
