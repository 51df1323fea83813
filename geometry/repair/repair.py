"""Clean raw triangles: weld, and drop what isn't finite, has no area or is doubled."""

import numpy as np

from geometry.arrays import Array, Ints, Mask, lengths
from geometry.mesh.mesh import MeshError, Repair
from geometry.mesh.tensors import area_normals
from geometry.mesh.topology import numbered

# A triangle whose height is below this share of its longest side has no normal.
_FLAT = 1e-10
# Numbers from here on overflow where areas are squared: as good as infinite.
_HUGE = 1e60
# More broken faces than this share, and the rest can't be taken for the object.
_MAX_BROKEN = 0.1

# Vertices, faces, which of the faces handed in stayed (None: all), what was done.
_Step = tuple[Array, Ints, Mask | None, tuple[Repair, ...]]


def clean(vertices: Array, faces: Ints) -> tuple[Array, Ints, Ints, tuple[Repair, ...]]:
    """Return a mesh that every later stage can take, and what was changed.

    In this order: faces with a corner that isn't finite, and such vertices, are
    removed; vertices at identical positions are welded (texture seams, triangle soups);
    faces without area and faces with the corners of an earlier one are removed;
    vertices that no face uses are removed. Winding and order of what stays are kept.

    Returns:
        Vertices (n, 3), faces (m, 3), the index that each of these had among the faces
        handed in (m,), ascending, and the repairs.

    Raises:
        MeshError: If no face stays, or more than a tenth of them isn't finite.
    """
    n_faces = len(faces)
    steps = (_drop_non_finite, _weld, _drop_flat, _drop_doubled, _drop_unused)
    repairs: list[Repair] = []
    origin = np.arange(n_faces)
    for step in steps:
        vertices, faces, kept, made = step(vertices, faces)
        if kept is not None:
            origin = origin[kept]
        repairs += [repair for repair in made if repair.count]
        if len(faces) == 0:
            worded = ", ".join(f"{r.kind}: {r.count}" for r in repairs)
            raise MeshError(
                f"none of its {n_faces} faces is usable ({worded}); "
                "export the mesh again"
            )
    return vertices, faces, origin, tuple(repairs)


def _drop_non_finite(vertices: Array, faces: Ints) -> _Step:
    finite: Mask = np.all(np.abs(vertices) < _HUGE, axis=1)
    if finite.all():
        return vertices, faces, None, ()
    keep = np.all(finite[faces], axis=1)
    broken = len(faces) - int(keep.sum())
    if 0 < keep.sum() and not broken <= _MAX_BROKEN * len(faces):
        raise MeshError(
            f"{broken} of {len(faces)} faces have corners that aren't finite numbers, "
            f"at most {100 * _MAX_BROKEN:.0f} % may; export the mesh again"
        )
    faces = (np.cumsum(finite) - 1)[faces[keep]]
    repairs = (
        Repair("non-finite vertices removed", int((~finite).sum())),
        Repair("non-finite faces removed", broken),
    )
    return vertices[finite], faces, keep, repairs


def _weld(vertices: Array, faces: Ints) -> _Step:
    first, where = _equal_rows(vertices)
    repair = Repair("vertices welded", len(vertices) - len(first))
    return vertices[first], where[faces], None, (repair,)


def _equal_rows(rows: Array | Ints) -> tuple[Ints, Ints]:
    """Return the first of each group of equal rows, in order, and each row's group."""
    order = np.lexsort(rows.T)
    in_order = rows[order]
    leads = np.ones(len(rows), dtype=bool)
    leads[1:] = np.any(in_order[1:] != in_order[:-1], axis=1)
    # lexsort is stable, so the first of a group is the one that was stored first.
    first = order[leads]
    rank = np.empty(len(first), dtype=np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    group = np.empty(len(rows), dtype=np.int64)
    group[order] = rank[np.cumsum(leads) - 1]
    return np.sort(first), group


def _drop_flat(vertices: Array, faces: Ints) -> _Step:
    corners = vertices[faces]
    double_area = lengths(area_normals(corners))
    sides = corners - np.roll(corners, 1, axis=1)
    longest = np.einsum("ikj,ikj->ik", sides, sides).max(axis=1)
    keep = double_area > _FLAT * longest
    repair = Repair("zero-area faces removed", len(faces) - int(keep.sum()))
    return vertices, faces[keep], keep, (repair,)


def _drop_doubled(vertices: Array, faces: Ints) -> _Step:
    keep = np.zeros(len(faces), dtype=bool)
    keep[_equal_rows(np.sort(faces, axis=1))[0]] = True
    repair = Repair("duplicate faces removed", len(faces) - int(keep.sum()))
    return vertices, faces[keep], keep, (repair,)


def _drop_unused(vertices: Array, faces: Ints) -> _Step:
    used, local = numbered(faces, len(vertices))
    repair = Repair("unreferenced vertices removed", len(vertices) - len(used))
    return vertices[used], local, None, (repair,)
