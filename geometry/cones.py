"""Cut surface into connected pieces whose normals fit one cone."""

import numpy as np
from numpy.typing import NDArray

from .mesh import TriangleMesh
from .topology import components

# Share of a piece's area whose normals must lie in its cone.
_CONE_SHARE = 0.98
_MAX_SPLITS = 12


def cone_pieces(
    mesh: TriangleMesh,
    dominant: NDArray[np.bool_],
    pairs: NDArray[np.int64],
    least: float,
    half_angle: float,
) -> list[NDArray[np.int64]]:
    """Connected pieces that fit the cone, largest area first."""
    inside = pairs[dominant[pairs].all(axis=1)]
    waiting = [(part, 0) for part in _connected(np.flatnonzero(dominant), inside)]
    done: list[NDArray[np.int64]] = []
    while waiting:
        (faces, links), depth = waiting.pop()
        fits = normal_cone(mesh, faces)[1] <= half_angle
        if fits or len(faces) == 1 or depth == _MAX_SPLITS:
            done.append(faces)
            continue
        side = _halves(mesh, faces, links, least)
        if side.all() or not side.any():
            done.append(faces)
            continue
        for half in (faces[side], faces[~side]):
            waiting += [(part, depth + 1) for part in _connected(half, links)]
    done = _merged(mesh, done, pairs, least, half_angle)
    areas = [float(mesh.face_areas[faces].sum()) for faces in done]
    order = sorted(range(len(done)), key=lambda i: (-areas[i], int(done[i][0])))
    return [done[i] for i in order]


def _merged(
    mesh: TriangleMesh,
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
                (normal_cone(mesh, faces)[1], j) for j, faces in unions.items()
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
    faces: NDArray[np.int64],
    links: NDArray[np.int64],
    least: float,
) -> NDArray[np.bool_]:
    """Two clusters of normals by Lloyd's steps from the axis they vary along most."""
    normals, areas = mesh.face_normals[faces], mesh.face_areas[faces]
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
    normals, areas = mesh.face_normals[faces], mesh.face_areas[faces]
    axis = areas @ normals
    axis = axis / max(float(np.linalg.norm(axis)), 1e-300)
    angle = np.arccos(np.clip(normals @ axis, -1.0, 1.0))
    order = np.argsort(angle, kind="stable")
    held = np.cumsum(areas[order])
    return axis, float(angle[order[np.searchsorted(held, _CONE_SHARE * held[-1])]])
