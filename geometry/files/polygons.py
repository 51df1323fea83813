"""Cut polygons into triangles: fans where convex, ear clipping where not."""

from collections.abc import Sequence
from itertools import chain
from types import MappingProxyType

import numpy as np

from geometry.arrays import Array, Ints, Mask
from geometry.mesh.file_origin import FileOrigin, Properties

from .reading import FormatError, RawMesh

# Corners closer than this share of the outline's width are one place.
_SAME = 1e-12
# Ear clipping takes time that grows with the square of the corners.
_MOST_CORNERS = 3000


def end_to_end(polygons: Sequence[Sequence[int]]) -> tuple[Ints, Ints]:
    """Return the number of corners of each polygon, and all corners in one array."""
    sizes = np.fromiter(map(len, polygons), np.int64, len(polygons))
    corners = chain.from_iterable(polygons)
    return sizes, np.fromiter(corners, np.int64, int(sizes.sum()))


def strip_triangles(corners: Ints) -> Ints:
    """Return the triangles of strips, (m, 3): each corner with the two before it.

    Every other triangle of a strip is turned, from its second on; -1 ends a strip.
    Triangles of no area, which join strips to one another, are left out.

    Raises:
        FormatError: If a strip has one or two corners.
    """
    ends = np.concatenate([[-1], np.flatnonzero(corners == -1), [len(corners)]])
    lengths = np.diff(ends) - 1
    if np.any((lengths == 1) | (lengths == 2)):
        short = int(lengths[(lengths == 1) | (lengths == 2)][0])
        raise FormatError(
            f"a triangle strip has {short} corners, must have three or more"
        )
    faces = np.stack([corners[:-2], corners[1:-1], corners[2:]], axis=1)
    place = np.arange(len(faces)) - np.repeat(ends[:-1] + 1, lengths + 1)[: len(faces)]
    turned = place % 2 == 1
    faces[turned, :2] = faces[turned, 1::-1]
    return with_area(faces[np.all(faces != -1, axis=1)])


def with_area(faces: Ints) -> Ints:
    """Return the triangles (m, 3) that don't name a corner twice."""
    a, b, c = faces.T
    return faces[(a != b) & (b != c) & (c != a)]


def triangulated(
    points: Array,
    sizes: Ints,
    corners: Ints,
    of_vertices: Properties = MappingProxyType({}),
    of_faces: Properties = MappingProxyType({}),
) -> RawMesh:
    """Return the triangles of `cut_polygons` with their origin."""
    faces, polygon = cut_polygons(points, sizes, corners)
    origin = FileOrigin(polygon, faces, len(sizes), len(points), of_faces, of_vertices)
    return RawMesh(points, faces, None, origin)


def cut_polygons(points: Array, sizes: Ints, corners: Ints) -> tuple[Ints, Ints]:
    """Return the triangles of polygons, in their order and with their winding.

    A fan about the first corner of a concave polygon would leave its outline, so
    concave ones are cut ear by ear in the plane of their vector area. Polygons of less
    than three corners (points and lines in some formats) give none.

    Args:
        points: Positions, shape (n, 3).
        sizes: Number of corners of each polygon, shape (n_p,).
        corners: Vertex indices of all polygons, end to end.

    Returns:
        Vertex indices, shape (m, 3), and the polygon each was cut from, shape (m,).
    """
    outside = np.flatnonzero((corners < 0) | (corners >= len(points)))
    if len(outside):
        at = int(np.searchsorted(np.cumsum(sizes), outside[0], side="right"))
        raise FormatError(
            f"face {at + 1} names a vertex that isn't there, of {len(points)}"
        )
    starts = np.cumsum(sizes) - sizes
    cut: list[Ints] = []
    owner: list[Ints] = []
    for size in np.unique(sizes[sizes >= 3]).tolist():
        which = np.flatnonzero(sizes == size)
        outline = corners[starts[which, None] + np.arange(size)]
        if size > 3:
            outline = _twins_alike(points, outline)
        fans = np.stack(
            [
                np.stack([outline[:, 0], outline[:, k], outline[:, k + 1]], axis=1)
                for k in range(1, size - 1)
            ],
            axis=1,
        )
        if size > 3:
            concave = np.flatnonzero(_concave(points, fans))
            if len(concave) and size > _MOST_CORNERS:
                raise FormatError(
                    f"polygon {which[concave[0]] + 1} is concave and has {size} "
                    f"corners, at most {_MOST_CORNERS} can be cut; export triangles"
                )
            for i in concave:
                fans[i] = _ears(points, outline[i])
        cut.append(fans.reshape(-1, 3))
        owner.append(np.repeat(which, size - 2))
    if not cut:
        return np.empty((0, 3), dtype=np.int64), np.empty(0, dtype=np.int64)
    owners = np.concatenate(owner)
    order = np.argsort(owners, kind="stable")
    return np.concatenate(cut)[order], owners[order]


def _twins_alike(points: Array, outline: Ints) -> Ints:
    """Let polygons (n, k) stored twice begin at one corner, to be cut alike."""
    used, index = np.unique(outline, return_inverse=True)
    place = np.unique(points[used], axis=0, return_inverse=True)[1]
    at = place.ravel()[index.reshape(outline.shape)]
    _, first, twin = np.unique(
        np.sort(at, axis=1), axis=0, return_index=True, return_inverse=True
    )
    model = first[twin.ravel()]
    shift = np.argmax(at == at[model, :1], axis=1)
    shift[model == np.arange(len(model))] = 0
    turned = (shift[:, None] + np.arange(outline.shape[1])) % outline.shape[1]
    return np.take_along_axis(outline, turned, axis=1)


def _concave(points: Array, fans: Ints) -> Mask:
    """Whether some triangle of each fan (n, k, 3) is turned against the whole."""
    a, b, c = (points[fans[..., k]] for k in range(3))
    areas = np.cross(b - a, c - a)
    total = areas.sum(axis=1, keepdims=True)
    along = np.einsum("ijk,ijk->ij", areas, np.broadcast_to(total, areas.shape))
    return np.any(along < 0, axis=1)


def _ears(points: Array, corners: Ints) -> Ints:
    flat = _in_plane(points[corners])
    outline = list(range(len(corners)))
    triangles: list[tuple[int, int, int]] = []
    while len(outline) > 3:
        at = next((i for i in range(len(outline)) if _is_ear(flat, outline, i)), None)
        if at is None:
            # Self-crossing outline: no cut is right; keep every corner in use.
            at = 0
        n = len(outline)
        triangles.append((outline[at - 1], outline[at], outline[(at + 1) % n]))
        del outline[at]
    triangles.append((outline[0], outline[1], outline[2]))
    return corners[np.array(triangles)]


def _in_plane(polygon: Array) -> Array:
    """Coordinates (n, 2), counter-clockwise, in the plane of the vector area."""
    local = polygon - polygon.mean(axis=0)
    normal = np.cross(local, np.roll(local, -1, axis=0)).sum(axis=0)
    first = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    frame = np.stack([first, np.cross(normal, first)], axis=1)
    return local @ (frame / np.maximum(np.linalg.norm(frame, axis=0), 1e-300))


def _is_ear(flat: Array, outline: list[int], at: int) -> bool:
    n = len(outline)
    a, b, c = outline[at - 1], outline[at], outline[(at + 1) % n]
    if not _turn(flat[a], flat[b], flat[c]) > 0:
        return False
    others = flat[[i for i in outline if i not in (a, b, c)]]
    # A hole is tied to the outline by an edge there and back, whose ends come twice.
    apart = np.abs(others[:, None] - flat[[a, b, c]]).max(axis=2).min(axis=1)
    inside = apart > _SAME * np.ptp(flat)
    for p, q in ((a, b), (b, c), (c, a)):
        inside &= _turn(flat[p], flat[q], others) >= 0
    return not inside.any()


def _turn(p: Array, q: Array, r: Array) -> Array:
    along, to = q - p, r - p
    return along[0] * to[..., 1] - along[1] * to[..., 0]
