"""Read a mesh file into a repaired, oriented TriangleMesh in metres."""

import hashlib
from pathlib import Path

import numpy as np

from geometry.arrays import Ints
from geometry.mesh.file_origin import FileOrigin
from geometry.mesh.mesh import MeshError, MeshSource, Repair, TriangleMesh
from geometry.mesh.topology import numbered, used_vertices
from geometry.repair.orientation import orient
from geometry.repair.repair import clean

from .archives import file_bytes, unpacked
from .formats import SUPPORTED, read_format
from .reading import METRES, FormatError, RawMesh

UNITS = ("mm", "cm", "m", "in", "um")
# What stands for the unit where the size is given.
_BY_SIZE = "size_mm"
SIZE_RANGE_M = (1e-3, 100.0)

_DEFAULT_UNIT = "mm"
# A tabletop object, to pick the unit that would make sense of an implausible size.
_LIKELY_SIZE_M = 0.2
# Fragments that stand out by this share of the longest side are reported.
_STRAY = 0.01
# Radii from the centre of the main bodies. Rays are precise to about 1e-6 of all that
# there is, so to 0.1 mm on an object of 1 m.
_FAR = 100.0


def load_mesh(
    path: str | Path, *, unit: str | None = None, size_mm: float | None = None
) -> TriangleMesh:
    """Return the mesh of a file in metres, repaired and oriented outwards.

    The file's numbers are taken in ``unit`` (mm, cm, m, in or um), else in the one that
    the format states (3MF, glTF), else in millimetres; or so that the longest side of
    the bounding box is ``size_mm``, small floating fragments not counted. What was
    repaired is in ``mesh.source.repairs``. OBJ, PLY, STL, OFF, GLB, glTF and 3MF are
    read, also inside .gz, .bz2 or .zip.

    Raises:
        MeshError: If the file can't be read whole, holds no surface, or has a longest
            side outside 1 mm to 100 m.
    """
    # A slip in the words is told before a file is looked for.
    _check_scale(unit, size_mm)
    return mesh_of_bytes(path, file_bytes(path), unit=unit, size_mm=size_mm)


def mesh_of_bytes(
    path: str | Path,
    data: bytes,
    *,
    unit: str | None = None,
    size_mm: float | None = None,
) -> TriangleMesh:
    """Return the mesh of a file with these bytes, as `load_mesh` does."""
    _check_scale(unit, size_mm)
    digest = hashlib.sha256(data).hexdigest()
    return usable_mesh(_read(path, data), str(path), digest, unit, size_mm)


def _check_scale(unit: str | None, size_mm: float | None) -> None:
    if unit is not None and size_mm is not None:
        raise MeshError(
            f"unit {unit} and size {size_mm} mm both fix the scale: give one"
        )
    if unit is not None and unit not in UNITS:
        raise MeshError(f"unit '{unit}' isn't known, use one of {', '.join(UNITS)}")
    if size_mm is not None and not (size_mm > 0 and np.isfinite(size_mm)):
        raise MeshError(f"size must be a positive number of millimetres, got {size_mm}")


def usable_mesh(
    raw: RawMesh,
    path: str,
    sha256: str,
    unit: str | None = None,
    size_mm: float | None = None,
) -> TriangleMesh:
    """Return raw triangles of a file so named, as `load_mesh` does."""
    try:
        vertices, faces, kept, cleaned = clean(raw.vertices, raw.faces)
    except MeshError as error:
        raise MeshError(f"{path}: {error}") from None
    mesh, near, far = _without_far(TriangleMesh(vertices, faces))
    longest, stray = _longest_side(mesh)
    name = unit or raw.unit or _DEFAULT_UNIT
    scale = METRES[name]
    if size_mm is not None:
        name, scale = _BY_SIZE, 1e-3 * size_mm / longest
    _check_size(path, longest, name, scale)
    mesh = TriangleMesh(mesh.vertices * scale, mesh.faces)
    # Orientation turns faces and keeps their order, so that the origin stays theirs.
    faces, turned = orient(mesh)
    source = MeshSource(
        path=path,
        sha256=sha256,
        unit=name,
        scale_to_m=scale,
        n_vertices=len(raw.vertices),
        n_faces=len(raw.faces),
        repairs=(*cleaned, *far, *turned, *stray),
    )
    origin = raw.origin or FileOrigin.of_itself(raw.faces, len(raw.vertices))
    origin = origin.of_faces(kept[near])
    if np.array_equal(faces, mesh.faces):
        return mesh.told_of(source, origin)
    return TriangleMesh(mesh.vertices, faces, source, origin)


def _without_far(mesh: TriangleMesh) -> tuple[TriangleMesh, Ints, tuple[Repair, ...]]:
    """Drop what is too far for precise rays: what is left, of which faces, repairs."""
    vertices, faces = mesh.vertices, mesh.faces
    far = np.linalg.norm(vertices - mesh.centre, axis=1) > _FAR * mesh.radius
    near = np.flatnonzero(~far[faces].any(axis=1))
    if len(near) == len(faces):
        return mesh, near, ()
    used, local = numbered(faces[near], len(vertices))
    kind = "faces of fragments more than 100 radii away removed"
    removed = Repair(kind, len(faces) - len(near))
    return TriangleMesh(vertices[used], local), near, (removed,)


def _longest_side(mesh: TriangleMesh) -> tuple[float, tuple[Repair, ...]]:
    """Longest side of the box of the main bodies, and what lies well outside of it."""
    points = mesh.vertices[used_vertices(mesh.faces[mesh.main], len(mesh.vertices))]
    low, high = points.min(axis=0), points.max(axis=0)
    longest = float((high - low).max())
    # What stands out by less changes no size that anyone reads.
    low, high = low - _STRAY * longest, high + _STRAY * longest
    off = np.any((mesh.vertices < low) | (mesh.vertices > high), axis=1)
    outside = off[mesh.faces].any(axis=1)
    kind = "faces of fragments outside the rest, kept but left out of its size"
    count = int(outside.sum())
    repairs = (Repair(kind, count),) if count else ()
    return longest, repairs


def _check_size(path: str | Path, longest: float, unit: str, scale: float) -> None:
    low, high = SIZE_RANGE_M
    if low <= longest * scale <= high:
        return
    # Nobody models in micrometres by accident: the last resort.
    likely = min(
        UNITS,
        key=lambda name: (
            abs(np.log(longest * METRES[name] / _LIKELY_SIZE_M))
            + (3.0 if name == "um" else 0.0)
        ),
    )
    fits = low <= longest * METRES[likely] <= high
    remedy = (
        f"--unit {likely} would make it {_length(longest * METRES[likely])}"
        if fits and unit not in (likely, _BY_SIZE)
        else "state its true size with --size-mm"
    )
    by = "by --size-mm" if unit == _BY_SIZE else f"in unit {unit}"
    raise MeshError(
        f"{path}: the longest side is {_length(longest * scale)} {by}, "
        f"must be {_length(low)} to {_length(high)}; {remedy}"
    )


def _length(metres: float) -> str:
    """Return a length in the unit that reads best."""
    if metres >= 1.0:
        return f"{metres:.4g} m"
    return f"{1e3 * metres:.4g} mm"


def _read(path: str | Path, data: bytes) -> RawMesh:
    kind, data, fetch = unpacked(Path(path), data)
    if kind not in SUPPORTED:
        raise MeshError(
            f"{path}: format '.{kind}' isn't supported; convert it to one of "
            f"{', '.join(SUPPORTED)}"
        )
    try:
        return read_format(kind, data, fetch)
    except FormatError as error:
        raise MeshError(f"{path}: not a usable {kind.upper()} mesh: {error}") from None
    except Exception as error:
        # The reader library raises whatever its parsers meet on the way.
        reason = " ".join(str(error).split())[:160]
        raise MeshError(
            f"{path}: can't be read as {kind.upper()} "
            f"({type(error).__name__}: {reason}); export the mesh again"
        ) from error
