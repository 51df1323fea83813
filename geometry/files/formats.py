"""From a file's bytes to raw vertices and triangles, whole or not at all.

Each format has a strict reader of its own. The general mesh libraries read some broken
files in part and others as something else, without an error: strips as points,
compressed or sparse data as zeros, mixed lists by the length of the first.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import PurePosixPath, PureWindowsPath

import numpy as np
from numpy.typing import NDArray

from geometry.mesh.file_origin import FileOrigin, Properties

from .gltf_format import read_glb, read_gltf
from .ply_format import ply_surface, read_ply
from .polygons import PolygonError, cut_polygons
from .stl_format import read_stl
from .text_formats import FormatError, read_obj, read_off
from .three_mf_format import read_three_mf

SUPPORTED = ("obj", "ply", "stl", "off", "glb", "gltf", "3mf")

# As 3MF names them, and in the plural, as glTF files of mesh libraries do.
_UNIT_NAMES = {
    name + plural: unit
    for name, unit in (
        ("micron", "um"),
        ("micrometer", "um"),
        ("millimeter", "mm"),
        ("centimeter", "cm"),
        ("meter", "m"),
        ("inch", "in"),
        ("foot", "ft"),
    )
    for plural in ("", "s")
} | {"inches": "in", "feet": "ft"}


@dataclass(frozen=True, eq=False)
class RawMesh:
    """What a file holds: positions in its own unit, triangles, and the stated unit.

    ``origin`` is None where each triangle is a polygon of the file, in its order.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    unit: str | None
    origin: FileOrigin | None = None


def read_format(
    kind: str, data: bytes, fetch: Callable[[str], bytes] | None = None
) -> RawMesh:
    """Return the whole content of a mesh file.

    Args:
        kind: One of ``SUPPORTED``.
        data: The file's bytes, decompressed.
        fetch: Returns the bytes of a file named by this one (buffers of a .gltf).

    Raises:
        FormatError: If it isn't whole, or holds no triangles.
    """
    raw = _READERS[kind](data, fetch)
    if len(raw.vertices) == 0:
        raise FormatError("it is empty: no vertices")
    if len(raw.faces) == 0:
        raise FormatError(
            f"it holds {len(raw.vertices)} points and no faces; a surface is needed"
        )
    if not (raw.faces.min() >= 0 and raw.faces.max() < len(raw.vertices)):
        raise FormatError(
            f"faces name vertices {raw.faces.min()}..{raw.faces.max()}, "
            f"there are {len(raw.vertices)}"
        )
    return raw


_Fetch = Callable[[str], bytes] | None


def _obj(data: bytes, fetch: _Fetch) -> RawMesh:
    return _of_polygons(*read_obj(data))


def _off(data: bytes, fetch: _Fetch) -> RawMesh:
    return _of_polygons(*read_off(data))


def _stl(data: bytes, fetch: _Fetch) -> RawMesh:
    return RawMesh(*read_stl(data), None)


def _ply(data: bytes, fetch: _Fetch) -> RawMesh:
    elements = read_ply(data)
    points, polygons = ply_surface(elements)
    corners = np.asarray(polygons.values, np.int64)
    _check_range(corners, len(points))
    face = elements.get("face")
    return _of_polygons(
        points,
        polygons.lengths,
        corners,
        vertex_properties={
            name: values
            for name, values in elements["vertex"].scalars.items()
            if name not in ("x", "y", "z")
        },
        face_properties={} if face is None else face.scalars,
    )


def _of_polygons(
    points: NDArray[np.float64],
    sizes: NDArray[np.int64],
    corners: NDArray[np.int64],
    *,
    vertex_properties: Properties | None = None,
    face_properties: Properties | None = None,
) -> RawMesh:
    try:
        faces, polygon = cut_polygons(points, sizes, corners)
    except PolygonError as error:
        raise FormatError(str(error)) from None
    origin = FileOrigin(
        polygon,
        faces,
        len(sizes),
        len(points),
        face_properties or {},
        vertex_properties or {},
    )
    return RawMesh(points, faces, None, origin)


def _glb(data: bytes, fetch: _Fetch) -> RawMesh:
    return _in_stated_unit(*read_glb(data))


def _gltf(data: bytes, fetch: _Fetch) -> RawMesh:
    def beside(name: str) -> bytes:
        rooted = PurePosixPath(name).is_absolute() or PureWindowsPath(name).drive
        missing = FormatError(f"it needs the file '{name}', which isn't beside it")
        if fetch is None or rooted or ".." in name:
            raise missing
        try:
            return fetch(name)
        except (FileNotFoundError, KeyError):
            raise missing from None

    return _in_stated_unit(*read_gltf(data, beside))


def _three_mf(data: bytes, fetch: _Fetch) -> RawMesh:
    return _in_stated_unit(*read_three_mf(data))


def _in_stated_unit(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], unit: str
) -> RawMesh:
    return RawMesh(vertices, faces, _UNIT_NAMES.get(unit.lower(), unit))


def _check_range(corners: NDArray[np.int64], n_vertices: int) -> None:
    if len(corners) and not (corners.min() >= 0 and corners.max() < n_vertices):
        raise FormatError(
            f"faces name vertices {corners.min()}..{corners.max()}, "
            f"there are {n_vertices}"
        )


_READERS: dict[str, Callable[[bytes, _Fetch], RawMesh]] = {
    "obj": _obj,
    "off": _off,
    "stl": _stl,
    "ply": _ply,
    "glb": _glb,
    "gltf": _gltf,
    "3mf": _three_mf,
}
