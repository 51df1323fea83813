"""Cut surface into connected pieces whose normals fit one cone."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, diags_array

from .diffusion import diffused
from .mesh import TriangleMesh
from .topology import components

# Share of a piece's area whose normals must lie in its cone.
_CONE_SHARE = 0.98
_MAX_SPLITS = 12
# Normals are averaged over this share of the mesh's size before they are judged.
_AVERAGED_SHARE = 0.01
# Of the length of an edge over the distance across it.
_LARGEST_WEIGHT = 3.0


def cone_pieces(
    mesh: TriangleMesh,
    dominant: NDArray[np.bool_],
    pairs: NDArray[np.int64],
    least: float,
    half_angle: float,
) -> list[NDArray[np.int64]]:
    """Connected pieces that fit the cone, largest area first.

    The normals that are judged are averaged (`averaged_normals`): a face that noise has
    turned is no feature. Adjacent pieces stay apart only if their union fits no cone.
    """
    normals = averaged_normals(mesh, pairs)
    inside = pairs[dominant[pairs].all(axis=1)]
    waiting = [(part, 0) for part in _connected(np.flatnonzero(dominant), inside)]
    done: list[NDArray[np.int64]] = []
    while waiting:
        (faces, links), depth = waiting.pop()
        fits = _cone(mesh, normals, faces)[1] <= half_angle
        if fits or len(faces) == 1 or depth == _MAX_SPLITS:
            done.append(faces)
            continue
        side = _halves(mesh, normals, faces, links, least)
        if side.all() or not side.any():
            done.append(faces)
            continue
        for half in (faces[side], faces[~side]):
            waiting += [(part, depth + 1) for part in _connected(half, links)]
    done = _merged(mesh, normals, done, pairs, least, half_angle)
    done = _merged(mesh, normals, done, pairs, np.inf, half_angle)
    areas = [float(mesh.face_areas[faces].sum()) for faces in done]
    order = sorted(range(len(done)), key=lambda i: (-areas[i], int(done[i][0])))
    return [done[i] for i in order]


def averaged_normals(
    mesh: TriangleMesh, pairs: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Return unit normals of the faces averaged over 1 % of the mesh's size, (n_f, 3).

    One implicit step of diffusion between adjacent faces (m, 2), weighted by the
    square root of their areas over the distance of their centroids, so that faces
    larger than that length keep their own.
    """
    n, (a, b) = len(mesh.faces), pairs.T
    away = np.linalg.norm(mesh.face_centroids[a] - mesh.face_centroids[b], axis=1)
    shared = np.sqrt(np.sqrt(mesh.face_areas[a] * mesh.face_areas[b]))
    weight = np.clip(shared / np.maximum(away, 1e-300), 0.0, _LARGEST_WEIGHT)
    links = coo_array((weight, (a, b)), (n, n)).tocsr()
    links = links + links.T
    laplacian = (diags_array(links.sum(axis=1)) - links).tocsr()
    unit = mesh.mean_edge
    length = _AVERAGED_SHARE * mesh.size / unit
    areas = mesh.face_areas / (unit * unit)
    normals = diffused(np.array(mesh.face_normals), areas, laplacian, length)
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)


def _merged(
    mesh: TriangleMesh,
    normals: NDArray[np.float64],
    pieces: list[NDArray[np.int64]],
    pairs: NDArray[np.int64],
    least: float,
    half_angle: float,
) -> list[NDArray[np.int64]]:
    """Give pieces below the least area to the neighbour with which they fit best.

    Passes over the small ones, smallest first, until none fits any neighbour.
    """
    neighbours = _neighbours(pieces, pairs, len(mesh.faces))
    pieces = list(pieces)
    areas = [float(mesh.face_areas[faces].sum()) for faces in pieces]
    waiting = True
    while waiting:
        waiting = False
        small = [i for i in range(len(pieces)) if neighbours[i] and areas[i] < least]
        for i in sorted(small, key=lambda i: (areas[i], i)):
            if not neighbours[i] or areas[i] >= least:
                continue
            unions = {
                j: np.sort(np.concatenate([pieces[i], pieces[j]]))
                for j in neighbours[i]
            }
            angle, j = min(
                (_cone(mesh, normals, faces)[1], j) for j, faces in unions.items()
            )
            if angle > half_angle:
                continue
            pieces[j], areas[j] = unions[j], areas[j] + areas[i]
            pieces[i] = pieces[i][:0]
            for k in neighbours[i]:
                neighbours[k].discard(i)
                if k != j:
                    neighbours[k].add(j)
                    neighbours[j].add(k)
            neighbours[i] = set()
            waiting = True
    return [faces for faces in pieces if len(faces)]


def _neighbours(
    pieces: list[NDArray[np.int64]], pairs: NDArray[np.int64], n_faces: int
) -> list[set[int]]:
    """For each piece, the pieces that it shares an edge with."""
    owner = np.full(n_faces, -1, dtype=np.int64)
    for i, faces in enumerate(pieces):
        owner[faces] = i
    met = owner[pairs]
    met = np.unique(met[(met.min(axis=1) >= 0) & (met[:, 0] != met[:, 1])], axis=0)
    neighbours: list[set[int]] = [set() for _ in pieces]
    for a, b in met.tolist():
        neighbours[a].add(b)
        neighbours[b].add(a)
    return neighbours


_Part = tuple[NDArray[np.int64], NDArray[np.int64]]


def _connected(faces: NDArray[np.int64], pairs: NDArray[np.int64]) -> list[_Part]:
    """Split faces (ascending) into connected parts, each with its own pairs."""
    if len(faces) == 0:
        return []
    where = np.searchsorted(faces, pairs)
    known = np.minimum(where, len(faces) - 1)
    held = np.all(faces[known] == pairs, axis=1)
    pairs, where = pairs[held], known[held]
    count, label = components(where, len(faces))
    by_face = np.split(
        faces[np.argsort(label, kind="stable")],
        np.cumsum(np.bincount(label, minlength=count))[:-1],
    )
    of_pair = label[where[:, 0]] if len(where) else np.empty(0, dtype=np.int64)
    by_pair = np.split(
        pairs[np.argsort(of_pair, kind="stable")],
        np.cumsum(np.bincount(of_pair, minlength=count))[:-1],
    )
    return list(zip(by_face, by_pair, strict=True))


def _halves(
    mesh: TriangleMesh,
    all_normals: NDArray[np.float64],
    faces: NDArray[np.int64],
    links: NDArray[np.int64],
    least: float,
) -> NDArray[np.bool_]:
    """Two clusters of normals by Lloyd's steps from the axis they vary along most."""
    normals, areas = all_normals[faces], mesh.face_areas[faces]
    centred = normals - np.average(normals, axis=0, weights=areas)
    axis = np.linalg.eigh((centred * areas[:, None]).T @ centred)[1][:, -1]
    # An eigenvector has no sign of its own: fix one, so that every run cuts alike.
    axis = axis * np.sign(axis[np.argmax(np.abs(axis))])
    side = centred @ axis > 0
    for _ in range(20):
        if side.all() or not side.any():
            return side
        poles = [areas[s] @ normals[s] for s in (side, ~side)]
        poles = [pole / max(float(np.linalg.norm(pole)), 1e-300) for pole in poles]
        moved = normals @ poles[0] > normals @ poles[1]
        if np.array_equal(moved, side):
            break
        side = moved
    for _ in range(2):
        where = np.searchsorted(faces, links)
        same = where[side[where[:, 0]] == side[where[:, 1]]]
        count, label = components(same, len(faces))
        small = np.bincount(label, areas, count) < 0.5 * least
        flipped = side ^ small[label]
        if flipped.all() or not flipped.any():
            break
        side = flipped
    return side


def normal_cone(
    mesh: TriangleMesh, faces: NDArray[np.int64]
) -> tuple[NDArray[np.float64], float]:
    """Mean normal, and the half angle about it that holds most of the area."""
    return _cone(mesh, mesh.face_normals, faces)


def _cone(
    mesh: TriangleMesh, all_normals: NDArray[np.float64], faces: NDArray[np.int64]
) -> tuple[NDArray[np.float64], float]:
    normals, areas = all_normals[faces], mesh.face_areas[faces]
    axis = areas @ normals
    axis = axis / max(float(np.linalg.norm(axis)), 1e-300)
    angle = np.arccos(np.clip(normals @ axis, -1.0, 1.0))
    order = np.argsort(angle, kind="stable")
    held = np.cumsum(areas[order])
    return axis, float(angle[order[np.searchsorted(held, _CONE_SHARE * held[-1])]])
