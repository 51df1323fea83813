"""Cut surface into connected pieces whose normals fit one cone."""

import numpy as np

from geometry.arrays import Array, Ints, Mask
from geometry.mesh.diffusion import diffused, graph_laplacian
from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.tensors import unit
from geometry.mesh.topology import grouped

from .cone_fragments import join_fragments
from .cone_sums import CONE_SHARE, Patch, merged, renumbered

_MAX_ROUNDS = 60
_SHIFTS = 5
# Length of the mean of unit normals below which it has no direction to speak of.
_AIMLESS = 0.25
# Normals are averaged over this share of the mesh's size before they are judged.
_AVERAGED_SHARE = 0.01
# Of the length of an edge over the distance across it.
_LARGEST_WEIGHT = 3.0
_AREA_DIGITS = 1e-9
# This share of what was chosen must be kept, if that takes no more pieces: where more
# is dropped, a small change of the mesh drops other parts, and the target is another.
_LEAST_KEPT, _MAX_PIECES = 0.9, 200
# Less than this share of the mesh is the rim of a plate: what fits no region isn't one.
_NO_REST = 0.05
_HALVINGS = (0.5, 0.25, 0.125, 0.0625)


def cone_pieces(
    mesh: TriangleMesh,
    chosen: Mask,
    pairs: Ints,
    least: float,
    half_angle: float,
    *,
    keep_all: bool = False,
) -> list[Ints]:
    """Connected pieces of chosen faces (n_f,) that fit the cone, largest area first.

    At least 95 % of a piece's area has its averaged normal (`averaged_normals`: a face
    that noise has turned is no feature) within the half angle of their mean. Of what
    doesn't fit, the part about its mean is taken as seen from its own front, then what
    is left on its sides. Parts below the least area [m²] join the adjacent piece that
    they fit best; what fits none is dropped, or with `keep_all` a piece of its own.
    Where more than a tenth would be dropped (a surface of many small parts, or of sharp
    corners that fit no cone), the least area is halved until that ends, down to a
    sixteenth and as long as that makes no more than 200 pieces; not so where what was
    chosen is less than a twentieth of the mesh, as the rim of a plate. Adjacent pieces
    (pairs of faces, (m, 2)) stay apart only if their union fits no cone.
    """
    faces = np.flatnonzero(chosen)
    if not len(faces):
        return []
    local = np.full(len(mesh.faces), -1, dtype=np.int64)
    local[faces] = np.arange(len(faces))
    links = local[pairs]
    links = links[links.min(axis=1, initial=0) >= 0]
    patch = Patch(
        averaged_normals(mesh, pairs)[faces],
        mesh.face_areas[faces],
        links,
        float(np.cos(half_angle)),
    )
    split = _split(patch, np.ones(patch.n, dtype=bool), least)
    piece = _pieces(patch, split, least, keep_all=keep_all)
    if not keep_all and patch.areas.sum() >= _NO_REST * mesh.area:
        piece = _more_kept(patch, piece, least)
    return [faces[members] for members in _by_area(patch, piece, mesh.area)]


def _more_kept(patch: Patch, piece: Ints, least: float) -> Ints:
    """The pieces for half the least area, and so on, until enough of it is kept."""
    enough = _LEAST_KEPT * float(patch.areas.sum())
    if patch.areas[piece >= 0].sum() >= enough:
        return piece
    # Cutting doesn't depend on the least area but for where it ends.
    split = _split(patch, np.ones(patch.n, dtype=bool), _HALVINGS[-1] * least)
    for halving in _HALVINGS:
        finer = _pieces(patch, split, halving * least)
        if finer.max(initial=-1) >= _MAX_PIECES:
            break
        piece = finer
        if patch.areas[piece >= 0].sum() >= enough:
            break
    return piece


def _pieces(patch: Patch, split: Ints, least: float, *, keep_all: bool = False) -> Ints:
    """Number the pieces that fit and have the least area; -1: dropped."""
    # The last entry is that of -1.
    areas = np.append(patch.sums(split)[1], 0.0)
    large = (split >= 0) & (areas[split] >= least)
    piece = merged(patch, renumbered(np.where(large, split, -1)), CONE_SHARE[0])
    piece = join_fragments(patch, piece)
    if keep_all and np.any(piece < 0):
        rest = _split(patch, piece < 0, 0.0)
        piece = np.where(piece < 0, rest + piece.max(initial=-1) + 1, piece)
    return renumbered(merged(patch, piece, CONE_SHARE[1]))


def averaged_normals(mesh: TriangleMesh, pairs: Ints) -> Array:
    """Return unit normals of the faces averaged over 1 % of the mesh's size, (n_f, 3).

    One implicit step of diffusion between adjacent faces (m, 2), weighted by the
    square root of their areas over the distance of their centroids, so that faces
    larger than that length keep their own.
    """
    a, b = pairs.T
    away = np.linalg.norm(mesh.face_centroids[a] - mesh.face_centroids[b], axis=1)
    shared = np.sqrt(np.sqrt(mesh.face_areas[a] * mesh.face_areas[b]))
    weight = np.clip(shared / np.maximum(away, 1e-300), 0.0, _LARGEST_WEIGHT)
    laplacian = graph_laplacian(pairs, weight, len(mesh.faces))
    edge = mesh.mean_edge
    length = _AVERAGED_SHARE * mesh.size / edge
    areas = mesh.face_areas / (edge * edge)
    normals = diffused(np.array(mesh.face_normals), areas, laplacian, length)
    return unit(normals)


def normal_cone(mesh: TriangleMesh, faces: Ints) -> tuple[Array, float]:
    """Mean normal, and the half angle about it that holds 98 % of the area."""
    normals, areas = mesh.face_normals[faces], mesh.face_areas[faces]
    axis = areas @ normals
    axis = axis / max(float(np.linalg.norm(axis)), 1e-300)
    angle = np.arccos(np.clip(normals @ axis, -1.0, 1.0))
    order = np.argsort(angle, kind="stable")
    held = np.cumsum(areas[order])
    at = np.searchsorted(held, CONE_SHARE[0] * held[-1])
    return axis, float(angle[order[at]])


def _split(patch: Patch, active: Mask, least: float) -> Ints:
    """Connected pieces that fit, of the active faces; -1: too small to be cut on."""
    piece = np.full(patch.n, -1, dtype=np.int64)
    part = np.where(active, 0, -1)
    n_done = 0
    for _ in range(_MAX_ROUNDS):
        if not np.any(part >= 0):
            break
        part = patch.connected(part)
        # What is too small to be a piece waits for a neighbour.
        small = (part >= 0) & (patch.sums(part)[1][part] < least)
        part[small] = -1
        if not np.any(part >= 0):
            break
        part = renumbered(part)
        fits = patch.shares(part) >= CONE_SHARE[0]
        core = _core(patch, part)
        inside = patch.sums(np.where(core, part, -1), len(fits))[1]
        fits |= (inside <= 0) | (inside >= patch.sums(part)[1])
        done = (part >= 0) & fits[part]
        piece[done] = part[done] + n_done
        n_done += len(fits)
        part = np.where(done | (part < 0), -1, 2 * part + core)
    return piece


def _core(patch: Patch, part: Ints) -> Mask:
    """Faces in the cone about the mean of their part's normals, moved to its middle."""
    sums, areas = patch.sums(part)
    axis = unit(sums)
    members = np.flatnonzero(part >= 0)
    first = np.full(len(areas), patch.n, dtype=np.int64)
    first[part[members][::-1]] = members[::-1]
    aimless = np.linalg.norm(sums, axis=1) < _AIMLESS * areas
    axis[aimless] = patch.normals[first[aimless]]
    core = part >= 0
    for _ in range(_SHIFTS):
        core = (part >= 0) & (patch.cosines(part, axis) >= patch.cos_half)
        sums, _ = patch.sums(np.where(core, part, -1), len(areas))
        axis = np.where(np.any(sums, axis=1, keepdims=True), unit(sums), axis)
    return core


def _by_area(patch: Patch, piece: Ints, total: float) -> list[Ints]:
    """Members of each piece, largest first; equal up to rounding, lowest face first."""
    areas = patch.sums(piece)[1]
    members = grouped(piece, len(areas))
    first = [own[0] for own in members]
    rank = np.lexsort((first, -np.round(areas / (_AREA_DIGITS * total))))
    return [members[i] for i in rank]
