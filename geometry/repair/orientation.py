"""Turn faces so that they are counter-clockwise seen from outside.

A *patch* is connected across edges of exactly two faces: the largest piece whose
winding can be made consistent without a choice. Each patch is then decided on its own,
so that a floating fragment never decides for the rest. `docs/method/orientation.md` has
the rules.
"""

import igl
import numpy as np

from geometry.arrays import Array, Ints, Mask
from geometry.mesh.mesh import Repair, TriangleMesh
from geometry.mesh.tensors import summed
from geometry.mesh.topology import MeshEdges, components, face_pairs
from geometry.rays.rays import RayCaster

from .nesting import containers
from .openness import look_out, spots_on

# Rays of one spot, spots in all, and what even a single triangle gets.
_RAYS = 16
_SPOTS = 6000
_LEAST = 2
# Sides that are seen this much alike, relative to both, don't tell which is outside.
_CLEAR = 0.02
# A fragment, smaller than this share of the area, must show one side four times as
# much as the other; else it keeps its side relative to the rest.
_FRAGMENT = 0.01
_CLEAR_FRAGMENT = 0.6
_SIGMAS = 3.0
# Below this |volume| / area^1.5 a closed patch encloses nothing (a folded sheet).
_EMPTY = 1e-6
# An open patch above that may hold others; a sphere has 0.09, a half one 0.04.
_BULGY = 0.02
# A body that fills this share of the one around it is the inner wall of a shell.
_LINING = 0.5


def orient(mesh: TriangleMesh) -> tuple[Ints, tuple[Repair, ...]]:
    """Return the faces wound consistently and outwards, and what was changed.

    Winding is made consistent inside each patch, after its majority. Then:

    1. A closed patch is turned if its signed volume is negative.
    2. A closed patch wholly inside another may be the inner wall of a hollow shell.
       If it fills at least half of the one around it, it is one, and is turned to face
       the other way than that. If not, it is turned together with the outermost one.
       An open patch holds what is in it as well, if hardly a ray finds its opening.
    3. An open patch is turned if its back is seen from outside more than its front.
    4. A patch that nothing decides (flat, or never seen) is turned with the closed one
       that holds it, else if most of the decided area was.

    The mesh must be welded, without duplicate or zero-area faces.
    """
    wound, patch = _consistent(mesh)
    straight = mesh if wound is mesh.faces else TriangleMesh(mesh.vertices, wound)
    closed, one_sided = _closed_patches(straight, patch)
    area = np.asarray(np.bincount(patch, straight.face_areas), dtype=np.float64)
    volume = _volumes(straight, patch, area)
    closed &= np.abs(volume) > _EMPTY * area**1.5
    verdict = np.where(closed, np.sign(volume), 0.0).astype(np.int64)
    if len(closed) > 1 or not closed.all():
        caster = RayCaster(straight)
        if not closed.all():
            verdict = _by_visibility(caster, patch, closed, verdict)
        verdict = _by_holder(caster, patch, closed, volume, verdict)
    follows = verdict == 0
    undecided = -1 if float(verdict @ area) < 0 else 1
    turned = np.where(follows, undecided, verdict) < 0
    faces = np.where(turned[patch, None], wound[:, ::-1], wound)
    counts = {
        "faces rewound like their neighbours": np.any(wound != mesh.faces, axis=1),
        "faces turned outwards": turned[patch],
        "pieces turned outwards": turned,
        "of these turned like the rest, being too small or hidden": turned & follows,
        "edges where a one-sided surface can't be wound alike": one_sided,
    }
    repairs = (Repair(kind, int(np.sum(what))) for kind, what in counts.items())
    return faces, tuple(repair for repair in repairs if repair.count)


def _consistent(mesh: TriangleMesh) -> tuple[Ints, Ints]:
    """Faces wound alike within each patch, and the patch of each face."""
    if not _alike(mesh.faces, mesh.edges).any():
        pairs = face_pairs(mesh.edges)[0]
        return mesh.faces, components(pairs, len(mesh.faces))[1]
    wound, patch = igl.bfs_orient(mesh.faces)
    wound, patch = np.array(wound, np.int64), np.array(patch, np.int64)
    changed = np.any(wound != mesh.faces, axis=1)
    against = np.bincount(patch, mesh.face_areas * np.where(changed, 1.0, -1.0)) > 0
    back = against[patch]
    # Flipped faces come back with another first corner; start from the stored ones.
    flip = changed != back
    return np.where(flip[:, None], mesh.faces[:, ::-1], mesh.faces), patch


def _closed_patches(mesh: TriangleMesh, patch: Ints) -> tuple[Mask, Mask]:
    """Whether each patch bounds a volume, and which edges two faces run alike."""
    edges = mesh.edges
    alike = _alike(mesh.faces, edges)
    n = int(patch.max()) + 1
    closed = np.ones(n, dtype=bool)
    # Only edges of other than two faces can be met an odd number of times.
    other = np.flatnonzero((edges.n_faces != 2)[edges.of_face].ravel())
    key = edges.of_face.ravel()[other] * n + patch[other // 3]
    key, counts = np.unique(key, return_counts=True)
    closed[key[counts % 2 == 1] % n] = False
    # Where no winding is consistent (Moebius, Klein), two faces run an edge alike.
    closed[patch[alike[edges.of_face].any(axis=1)]] = False
    return closed, alike


def _alike(faces: Ints, edges: MeshEdges) -> Mask:
    """Whether the two faces at an edge run it the same way, shape (n_e,)."""
    forward = faces < faces[:, [1, 2, 0]]
    way = np.where(forward, 1, -1).ravel()
    balance = np.bincount(edges.of_face.ravel(), way, len(edges.n_faces))
    return (edges.n_faces == 2) & (balance != 0)


def _volumes(mesh: TriangleMesh, patch: Ints, area: Array) -> Array:
    """Signed volume of each patch in [m³]; it means something for closed ones."""
    weight = mesh.face_areas
    middle = summed(weight[:, None] * mesh.face_centroids, patch, len(area))
    middle /= np.maximum(area, 1e-300)[:, None]
    # A face, its centroid and its area normal make the volume to the middle.
    arm = mesh.face_centroids - middle[patch]
    height = np.einsum("ij,ij->i", arm, mesh.face_normals)
    return np.bincount(patch, weight * height) / 3.0


def _by_visibility(caster: RayCaster, patch: Ints, closed: Mask, verdict: Ints) -> Ints:
    """Decide open patches by which of their sides is seen more: 1 front, -1 back."""
    n = len(closed)
    spots = spots_on(
        caster.mesh, _SPOTS, group=patch, least=_LEAST, within=~closed[patch]
    )
    owner = patch[spots.faces]
    front, back = (
        np.bincount(owner, look_out(caster, spots, _RAYS, behind=side), n)
        for side in (False, True)
    )
    lead, total = front - back, front + back
    area = np.bincount(patch, caster.mesh.face_areas)
    needed = np.where(area < _FRAGMENT * area.sum(), _CLEAR_FRAGMENT, _CLEAR)
    clear = np.abs(lead) > np.maximum(needed * total, _SIGMAS * np.sqrt(total))
    return np.where(closed, verdict, np.where(clear, np.sign(lead), 0)).astype(np.int64)


def _by_holder(
    caster: RayCaster, patch: Ints, closed: Mask, volume: Array, verdict: Ints
) -> Ints:
    """Decide what lies inside a closed patch after those that hold it."""
    asked = closed | (verdict == 0)
    area = np.bincount(patch, caster.mesh.face_areas)
    # A wall with a crack holds what is in it just as well.
    cracked = ~closed & (verdict != 0) & (np.abs(volume) > _BULGY * area**1.5)
    held = containers(caster.mesh, patch, closed | cracked, asked, caster)
    result = verdict.copy()
    for row in sorted(
        (row for row in range(len(held)) if len(held[row])),
        key=lambda row: len(held[row]),
    ):
        outermost, around = held[row][0], held[row][-1]
        result[row] = verdict[outermost]
        if closed[row] and abs(volume[row]) >= _LINING * abs(volume[around]):
            # The normal of the stored winding points outwards where the volume is
            # positive; that of the wall around it does so after `result`.
            outwards = result[around] * np.sign(volume[around])
            result[row] = int(-outwards * np.sign(volume[row]))
    return result
