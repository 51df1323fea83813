"""What a user wants measured: faces that he chose, or a weight that he painted.

A file counts polygons and vertices as the mesh file does, before repair; arrays handed
over in Python count as the `TriangleMesh` does.
"""

import hashlib
import io
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.files.file_content import file_content
from geometry.mesh.file_origin import FileOrigin
from geometry.mesh.mesh import TriangleMesh
from geometry.regions.selected_regions import heaviest_faces
from planning.model.errors import InputError

_PROPERTY = "ply:"
_NUMPY = b"\x93NUMPY"
_SEPARATORS = re.compile(r"[\s,;\[\]]+")
_WHOLE = re.compile(r"[+-]?\d{1,18}", re.ASCII)


@dataclass(frozen=True, eq=False)
class Interest:
    """The faces of the mesh that are to be the target, and who said so.

    Attributes:
        kind: `faces`, or `vertex_weight` (the faces of highest weight).
        chosen: Whether each is, shape (n_f,).
        source: The file or `ply:NAME` it came from; None: an array in memory.
        sha256: Digest of that file, if it is one.
        n_removed: Chosen polygons of the file of which repair left nothing.
    """

    kind: str
    chosen: NDArray[np.bool_]
    source: str | None = None
    sha256: str | None = None
    n_removed: int = 0

    def on_parts(self, parent: NDArray[np.int64]) -> "Interest":
        """Return the same choice on a mesh whose faces are parts of the chosen."""
        return replace(self, chosen=self.chosen[parent])


Select = Interest | NDArray[Any] | Sequence[int]
Weight = Interest | NDArray[Any] | Sequence[float]


def interest_of(
    mesh: TriangleMesh, select: Select | None, weight: Weight | None
) -> Interest | None:
    """Return the user's own target; None: he gave none.

    Args:
        mesh: The surface.
        select: One bool a face, or indices of faces of ``mesh``.
        weight: One number a vertex of ``mesh``, at least 0.

    Raises:
        InputError: If both are given, or one can't be used.
    """
    if select is not None and weight is not None:
        raise InputError("a selection and a weight both fix the target: give one")
    given = weight if select is None else select
    if given is None:
        return None
    if isinstance(given, Interest):
        if len(given.chosen) != len(mesh.faces):
            raise InputError(
                f"the selection is of {len(given.chosen)} faces, the mesh has "
                f"{len(mesh.faces)}: read it for this mesh"
            )
        return given
    values, origin = np.asarray(given), _in_memory(mesh)
    if select is None:
        chosen = _weighted(mesh, values, origin, "weight", "vertex")
        return Interest("vertex_weight", chosen)
    return Interest("faces", _mask(values, origin.n_faces, "the selection"))


def read_selection(where: str, mesh: TriangleMesh) -> Interest:
    """Return the faces that a file or a property of the mesh file chooses.

    Args:
        where: A file of polygon indices from 0 (text with any separators and `#`
            comments, a JSON list, or .npy, there also one bool a polygon), or
            `ply:NAME`: the polygons where that property isn't zero; where it is one of
            vertices, the triangles at whose corners it is zero nowhere.
        mesh: The surface, from `load_mesh`.

    Raises:
        InputError: If it can't be read, names what isn't there, or chooses nothing.
    """
    origin = mesh.origin or _in_memory(mesh)
    named = where.startswith(_PROPERTY)
    name = where.removeprefix(_PROPERTY)
    if named and name in origin.vertex_properties.keys() - origin.face_properties:
        values = _finite(origin.vertex_properties[name], where)
        chosen = np.all(values[origin.corners] != 0, axis=1)
        if not chosen.any():
            raise InputError(
                f"{where}: no face has three corners where the property isn't "
                "zero; paint whole faces"
            )
        return Interest("faces", chosen, where)
    values, sha256 = _given(where, origin, _index, faces=True)
    if named:
        values = _finite(values, where) != 0
    polygons = _mask(values, origin.n_faces, where)
    chosen = polygons[origin.face]
    removed = len(np.setdiff1d(np.flatnonzero(polygons), origin.face))
    if not chosen.any():
        raise InputError(
            f"{where}: all {removed} faces that it chooses were removed by repair "
            "(no area, doubled or not finite); choose others"
        )
    return Interest("faces", chosen, where, sha256, removed)


def read_weight(where: str, mesh: TriangleMesh) -> Interest:
    """Return the faces of highest weight by a file or a property of the mesh file.

    Args:
        where: A file with one number for each vertex of the mesh file (text, JSON list
            or .npy), or `ply:NAME`, a property of the vertices.
        mesh: The surface, from `load_mesh`.

    Raises:
        InputError: If it can't be read, holds another number of weights, or one that is
            negative or not finite, or none above zero.
    """
    origin = mesh.origin or _in_memory(mesh)
    values, sha256 = _given(where, origin, _weight, faces=False)
    chosen = _weighted(mesh, values, origin, where, "vertex of the mesh file")
    return Interest("vertex_weight", chosen, where, sha256)


def _in_memory(mesh: TriangleMesh) -> FileOrigin:
    n = len(mesh.faces)
    return FileOrigin(np.arange(n), mesh.faces, n, len(mesh.vertices))


def _mask(values: NDArray[Any], n: int, name: str) -> NDArray[np.bool_]:
    """Return bools or indices as one bool for each of n faces."""
    mask = np.zeros(n, dtype=bool)
    if values.dtype == np.bool_:
        if values.shape != (n,):
            raise InputError(
                f"{name}: holds {_count(values)} bools, must hold {n}, one for each "
                "face"
            )
        mask |= values
    else:
        if values.ndim != 1 or (len(values) and values.dtype.kind not in "iu"):
            raise InputError(
                f"{name}: holds {values.dtype} {values.shape}, must be a list of face "
                "indices (whole numbers from 0)"
            )
        outside = (values < 0) | (values >= n)
        if np.any(outside):
            raise InputError(
                f"{name}: face {values[outside][0]} isn't there, indices must lie in "
                f"0..{n - 1}; the first face counts as 0"
            )
        mask[values.astype(np.int64)] = True
    if not mask.any():
        raise InputError(f"{name}: chooses no face; name at least one")
    return mask


def _weighted(
    mesh: TriangleMesh, values: NDArray[Any], origin: FileOrigin, name: str, one: str
) -> NDArray[np.bool_]:
    if values.shape != (origin.n_vertices,):
        raise InputError(
            f"{name}: holds {_count(values)} weights, must hold {origin.n_vertices}, "
            f"one for each {one}"
        )
    if values.dtype.kind not in "biuf":
        raise InputError(f"{name}: holds {values.dtype}, must hold numbers")
    try:
        return heaviest_faces(mesh, values, origin.corners)
    except ValueError as error:
        raise InputError(f"{name}: {error}") from None


def _given(
    where: str, origin: FileOrigin, parse: Callable[[str], float], *, faces: bool
) -> tuple[NDArray[Any], str | None]:
    """Return the numbers of a property or a file, and the digest of the file."""
    if where.startswith(_PROPERTY):
        return _property(origin, where.removeprefix(_PROPERTY), faces=faces), None
    try:
        data = file_content(where)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{where}: can't be read ({reason}); check the path") from None
    return _values(data, where, parse), hashlib.sha256(data).hexdigest()


def _property(origin: FileOrigin, name: str, *, faces: bool) -> NDArray[Any]:
    wanted, other = origin.face_properties, origin.vertex_properties
    kind, remedy = "face", ""
    if not faces:
        wanted, other, kind = other, wanted, "vertex"
        if name in other:
            remedy = f"; '{name}' is one of faces: use --select ply:{name}"
    if name in wanted:
        return wanted[name]
    if not wanted and not other:
        raise InputError(
            f"{_PROPERTY}{name}: the mesh file has no properties, only PLY files with "
            "further columns do; give a file instead"
        )
    held = ", ".join(wanted) or "none"
    if faces:
        held += f"; of vertices: {', '.join(other) or 'none'}"
    raise InputError(
        f"{_PROPERTY}{name}: the mesh file has no {kind} property '{name}'{remedy}; "
        f"it has: {held}"
    )


def _finite(values: NDArray[Any], name: str) -> NDArray[Any]:
    if not np.all(np.isfinite(values)):
        at = int(np.flatnonzero(~np.isfinite(values))[0])
        raise InputError(f"{name}: value {at} is {values[at]}, must be a finite number")
    return values


def _values(data: bytes, where: str, parse: Callable[[str], float]) -> NDArray[Any]:
    """Return the numbers of a .npy file, or of text by a parser of its words."""
    if data.startswith(_NUMPY):
        try:
            return np.load(io.BytesIO(data), allow_pickle=False)
        except (ValueError, EOFError, OSError, MemoryError) as error:
            raise InputError(f"{where}: isn't a usable .npy file ({error})") from None
    try:
        lines = [line.split("#")[0] for line in data.decode("utf-8-sig").splitlines()]
        words = _SEPARATORS.split(" ".join(lines))
        return np.array([parse(word) for word in words if word])
    except UnicodeDecodeError:
        raise InputError(f"{where}: isn't text, nor .npy; give numbers") from None
    except ValueError as error:
        raise InputError(f"{where}: {error}") from None


def _index(word: str) -> int:
    if _WHOLE.fullmatch(word) is None:
        raise ValueError(
            f"'{word[:40]}' isn't a face index, must be a whole number from 0"
        )
    return int(word)


def _weight(word: str) -> float:
    try:
        return float(word)
    except ValueError as error:
        raise ValueError(f"{error}; a weight must be a number") from None


def _count(values: NDArray[Any]) -> str:
    return " x ".join(str(n) for n in values.shape) or "1"
