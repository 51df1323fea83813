"""Dominant regions: where the surface is curved most, in pieces one projector can serve."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, diags_array

from .curvature import CurvatureField
from .mesh import TriangleMesh
from .topology import adjacent_faces, components, mesh_edges

# Curvature is averaged over a length that is this share of its radius.
_SMOOTHING_SHARE = 1.0
_MAX_SMOOTHING_STEPS = 60
# |k1 - k2| up to this share of the larger magnitude leaves the direction arbitrary.
_ISOTROPIC = 0.3
# Curvedness times the diagonal below this is flat: its order means nothing.
_FLAT = 0.05
# The cut must not run through a plateau: this share of area within this relative band.
_PLATEAU_BAND, _PLATEAU_SHARE = 0.05, 0.12
# Share of a region's area whose normals must lie in its cone.
_CONE_SHARE = 0.98
_MAX_SPLITS = 12


@dataclass(frozen=True, eq=False)
class Region:
    """Connected surface of high curvedness whose normals fit one cone.

    Attributes:
        id: Its number, from 0, largest area first.
        faces: Indices of its faces, ascending.
        area_m2: Its area.
        mean_normal: Unit axis of its cone, the area-weighted mean of its normals, (3,).
        cone_angle: Half angle in [rad] about it that holds 98 % of the area's normals.
        mean_curvedness: Area-weighted mean of the curvedness in [1/m].
    """

    id: int
    faces: NDArray[np.int64]
    area_m2: float
    mean_normal: NDArray[np.float64]
    cone_angle: float
    mean_curvedness: float


@dataclass(frozen=True, eq=False)
class DominantRegions:
    """Regions of a mesh, and what each face needs to know of them; iterates regions.

    Attributes:
        regions: Largest first.
        face_region: Region of each face, -1 for none, shape (n_f,).
        steep: Unit direction T1 of largest |curvature| in each face's plane, (n_f, 3);
            zero where it is arbitrary or not trusted, in a region or not.
        dominant_share: Area of the regions over the area of the mesh.
        trusted: Whether the curvature of each face is trusted, shape (n_f,).
    """

    regions: tuple[Region, ...]
    face_region: NDArray[np.int64]
    steep: NDArray[np.float64]
    dominant_share: float
    trusted: NDArray[np.bool_]

    def __iter__(self) -> Iterator[Region]:
        return iter(self.regions)

    def __len__(self) -> int:
        return len(self.regions)

    def __getitem__(self, index: int) -> Region:
        return self.regions[index]


def dominant_regions(
    mesh: TriangleMesh,
    field: CurvatureField,
    *,
    area_share: float = 0.2,
    min_region_share: float = 0.002,
    cone_half_angle: float = np.deg2rad(50.0),
) -> DominantRegions:
    """Return the share of the trusted area with the highest curvedness, in regions.

    Trusted faces have three valid vertices, so the rim of an open border is left out;
    where nothing is trusted, the surface counts as uniform. Curvature tensors are
    averaged over the radius they were fitted at. If the cut at ``area_share``
    would run through a plateau of equal curvedness, the plateau is taken whole: a
    sphere, a cylinder or a plate is dominant as a whole. Islands and holes below
    ``min_region_share`` of the area vanish; what stays is split by its normals until
    each piece fits a cone.

    Args:
        mesh: The surface.
        field: Its curvatures.
        area_share: Share of the trusted area that is dominant, in (0, 1].
        min_region_share: Smallest region, as a share of the mesh's area, in [0, 1).
        cone_half_angle: Half angle in [rad] that a region's normals must fit, below
            60 degrees of incidence by what position and perspective need.

    Raises:
        ValueError: If a share or angle is out of range, or the field is of another mesh.
    """
    if not 0 < area_share <= 1:
        raise ValueError(f"area_share must lie in (0, 1], got {area_share}")
    if not 0 <= min_region_share < 1:
        raise ValueError(f"min_region_share must lie in [0, 1), got {min_region_share}")
    if not 0 < cone_half_angle < np.pi:
        raise ValueError(
            f"cone_half_angle must lie in (0, pi) rad, got {cone_half_angle}"
        )
    curvedness, steep, trusted = face_curvature(mesh, field)
    judged = trusted if trusted.any() else np.ones(len(mesh.faces), dtype=bool)
    dominant = judged & (curvedness >= _cut(mesh, curvedness, judged, area_share))
    pairs = adjacent_faces(mesh_edges(mesh.faces), manifold_only=False)
    least = min_region_share * mesh.area
    dominant = _without_specks(mesh, dominant, judged, pairs, least)
    pieces = _pieces(mesh, dominant, pairs, least, cone_half_angle)
    regions = tuple(
        _region(i, mesh, faces, curvedness) for i, faces in enumerate(pieces)
    )
    face_region = np.full(len(mesh.faces), -1, dtype=np.int64)
    for region in regions:
        face_region[region.faces] = region.id
    share = float(mesh.face_areas[face_region >= 0].sum() / mesh.area)
    for values in (face_region, steep, trusted):
        values.setflags(write=False)
    return DominantRegions(regions, face_region, steep, share, trusted)


def steep_directions(mesh: TriangleMesh, field: CurvatureField) -> NDArray[np.float64]:
    """Return T1 of every face, for a target that is the whole surface.

    Shape (n_f, 3): unit and in the face's plane; zero where |k1 - k2| <= 0.3
    max(|k1|, |k2|), where the face is flat, and where its curvature isn't trusted.
    """
    return face_curvature(mesh, field)[1]


def face_curvature(
    mesh: TriangleMesh, field: CurvatureField
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Return curvedness [1/m], steep direction and trust of each face.

    The smoothed tensors of a face's corners are averaged and projected into its plane;
    the eigenvalues of that 2 x 2 form are its principal curvatures.

    Returns:
        Shapes (n_f,), (n_f, 3) and (n_f,).

    Raises:
        ValueError: If the field is of another mesh.
    """
    if len(field.valid) != len(mesh.vertices):
        raise ValueError(
            f"the field has {len(field.valid)} vertices, the mesh {len(mesh.vertices)}"
        )
    trusted = field.valid[mesh.faces].all(axis=1)
    tensors = _smoothed(mesh, field)[mesh.faces].mean(axis=1)
    first = mesh.corners[:, 1] - mesh.corners[:, 0]
    first = first / np.maximum(np.linalg.norm(first, axis=1, keepdims=True), 1e-300)
    plane = np.stack([first, np.cross(mesh.face_normals, first)], axis=2)
    form = np.swapaxes(plane, 1, 2) @ tensors @ plane
    half_sum = 0.5 * (form[:, 0, 0] + form[:, 1, 1])
    half_gap = 0.5 * (form[:, 0, 0] - form[:, 1, 1])
    twist = 0.5 * (form[:, 0, 1] + form[:, 1, 0])
    spread = np.hypot(half_gap, twist)
    largest = np.abs(half_sum) + spread
    curvedness = np.sqrt(half_sum**2 + spread**2)
    # Angle of the eigenvector of half_sum + spread; the other one is across.
    angle = 0.5 * np.arctan2(twist, half_gap) + np.where(half_sum < 0, 0.5 * np.pi, 0.0)
    steep = plane @ np.stack([np.cos(angle), np.sin(angle)], axis=1)[..., None]
    diagonal = float(np.linalg.norm(mesh.bounds[1] - mesh.bounds[0]))
    curvedness = np.where(trusted & (curvedness * diagonal > _FLAT), curvedness, 0.0)
    directed = (2.0 * spread > _ISOTROPIC * largest) & (curvedness > 0)
    return curvedness, np.where(directed[:, None], steep[..., 0], 0.0), trusted


def _smoothed(mesh: TriangleMesh, field: CurvatureField) -> NDArray[np.float64]:
    """Curvature tensors averaged along edges over a physical length, (n_v, 3, 3).

    One step averages a vertex with its neighbours, weighted by area; n steps reach
    about sqrt(n) mean edges. Vertices that aren't valid neither give nor take.
    """
    length = _SMOOTHING_SHARE * field.radius / mesh.mean_edge
    steps = int(np.clip(round(length**2), 1, _MAX_SMOOTHING_STEPS))
    n = len(mesh.vertices)
    a, b = mesh_edges(mesh.faces).ends.T
    links = coo_array((np.ones(len(a)), (a, b)), (n, n)).tocsr()
    links = links + links.T + diags_array(np.ones(n))
    weight = np.bincount(mesh.faces.ravel(), np.repeat(mesh.face_areas, 3), n)
    weight = np.where(field.valid, weight, 0.0)
    total = links @ weight
    scale = np.divide(1.0, total, out=np.zeros(n), where=total > 0)
    average = (diags_array(scale) @ links @ diags_array(weight)).tocsr()
    upper = np.triu_indices(3)
    values = field.tensors[:, upper[0], upper[1]]
    for _ in range(steps):
        values = average @ values
    values[~field.valid] = 0.0
    tensors = np.empty((n, 3, 3))
    tensors[:, upper[0], upper[1]] = values
    tensors[:, upper[1], upper[0]] = values
    return tensors


def _cut(
    mesh: TriangleMesh,
    curvedness: NDArray[np.float64],
    judged: NDArray[np.bool_],
    area_share: float,
) -> float:
    """Curvedness from which a face is dominant; below a plateau, never through it."""
    faces = np.flatnonzero(judged)
    order = faces[np.argsort(-curvedness[faces], kind="stable")]
    area = np.cumsum(mesh.face_areas[order])
    cut = float(curvedness[order[np.searchsorted(area, area_share * area[-1])]])
    while True:
        low, high = cut * (1.0 - _PLATEAU_BAND), cut * (1.0 + _PLATEAU_BAND)
        near = judged & (curvedness >= low) & (curvedness <= high)
        if mesh.face_areas[near].sum() < _PLATEAU_SHARE * area[-1]:
            return cut
        lowest = float(curvedness[near].min())
        if lowest == cut:
            return cut
        cut = lowest


def _without_specks(
    mesh: TriangleMesh,
    dominant: NDArray[np.bool_],
    judged: NDArray[np.bool_],
    pairs: NDArray[np.int64],
    least: float,
) -> NDArray[np.bool_]:
    """Fill small holes of trusted surface, then drop small islands."""
    for state in (False, True):
        same = pairs[
            (dominant[pairs[:, 0]] == state) & (dominant[pairs[:, 1]] == state)
        ]
        count, label = components(same, len(dominant))
        area = np.bincount(label, mesh.face_areas, count)
        small = (dominant == state) & judged & (area[label] < least)
        if not state:
            # A hole has a dominant rim; a whole small body hasn't.
            mixed = pairs[dominant[pairs[:, 0]] != dominant[pairs[:, 1]]]
            rimmed = np.zeros(count, dtype=bool)
            rimmed[label[mixed.ravel()]] = True
            open_ended = np.zeros(count, dtype=bool)
            open_ended[label[~judged]] = True
            small &= rimmed[label] & ~open_ended[label]
        dominant = dominant ^ small
    return dominant


def _pieces(
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
        fits = _cone(mesh, faces)[1] <= half_angle
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
    """Give pieces below the least area to the neighbour with which they fit best."""
    owner = np.full(len(mesh.faces), -1, dtype=np.int64)
    for i, faces in enumerate(pieces):
        owner[faces] = i
    met = owner[pairs]
    met = np.unique(
        np.sort(met[(met.min(axis=1) >= 0) & (met[:, 0] != met[:, 1])]), axis=0
    )
    neighbours: list[set[int]] = [set() for _ in pieces]
    for a, b in met.tolist():
        neighbours[a].add(b)
        neighbours[b].add(a)
    areas = [float(mesh.face_areas[faces].sum()) for faces in pieces]
    kept = list(pieces)
    for i in sorted(range(len(pieces)), key=lambda i: (areas[i], i)):
        if areas[i] >= least or not neighbours[i]:
            continue
        unions = {j: np.sort(np.concatenate([kept[i], kept[j]])) for j in neighbours[i]}
        angle, j = min((_cone(mesh, faces)[1], j) for j, faces in unions.items())
        if angle > half_angle:
            continue
        kept[j], areas[j] = unions[j], areas[j] + areas[i]
        kept[i] = kept[i][:0]
        for k in neighbours[i] - {j}:
            neighbours[k].discard(i)
            neighbours[k].add(j)
            neighbours[j].add(k)
        neighbours[j].discard(i)
    return [faces for faces in kept if len(faces)]


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


def _cone(
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


def _region(
    number: int,
    mesh: TriangleMesh,
    faces: NDArray[np.int64],
    curvedness: NDArray[np.float64],
) -> Region:
    axis, angle = _cone(mesh, faces)
    areas = mesh.face_areas[faces]
    axis.setflags(write=False)
    return Region(
        id=number,
        faces=faces,
        area_m2=float(areas.sum()),
        mean_normal=axis,
        cone_angle=angle,
        mean_curvedness=float(np.average(curvedness[faces], weights=areas)),
    )
