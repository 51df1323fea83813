"""From a file's bytes to raw vertices and triangles, whole or not at all.

Each format has a strict reader of its own. The general mesh libraries read some broken
files in part and others as something else, without an error: strips as points,
compressed or sparse data as zeros, mixed lists by the length of the first.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import PurePosixPath, PureWindowsPath
from types import MappingProxyType

import numpy as np

from geometry.arrays import Array, Ints
from geometry.mesh.file_origin import FileOrigin, Properties

from .gltf_format import read_glb, read_gltf
from .ply_format import ply_surface, read_ply
from .polygons import cut_polygons
from .reading import FormatError
from .stl_format import read_stl
from .text_formats import read_obj, read_off
from .three_mf_format import read_three_mf

SUPPORTED = ("obj", "ply", "stl", "off", "glb", "gltf", "3mf")

METRES = {"um": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254, "ft": 0.3048}
# As 3MF and, in the plural, mesh libraries name them; without the s of the plural.
_UNIT_NAMES = {
    **{"micron": "um", "micrometer": "um", "millimeter": "mm", "centimeter": "cm"},
    **{"meter": "m", "inch": "in", "inche": "in", "foot": "ft", "feet": "ft"},
}


@dataclass(frozen=True, eq=False)
class RawMesh:
    """What a file holds: positions in its own unit, triangles, and the stated unit.

    ``origin`` is None where each triangle is a polygon of the file, in its order.
    """

    vertices: Array
    faces: Ints
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
    raw = _raw(kind, data, fetch)
    if len(raw.vertices) == 0:
        raise FormatError("it is empty: no vertices")
    if len(raw.faces) == 0:
        raise FormatError(
            f"it holds {len(raw.vertices)} points and no faces; a surface is needed"
        )
    return raw


def _raw(kind: str, data: bytes, fetch: Callable[[str], bytes] | None) -> RawMesh:
    if kind in ("obj", "off"):
        return _of_polygons(*(read_obj if kind == "obj" else read_off)(data))
    if kind == "stl":
        return RawMesh(*read_stl(data), None)
    if kind == "ply":
        return _ply(data)
    if kind == "glb":
        vertices, faces, unit = read_glb(data)
    elif kind == "gltf":
        vertices, faces, unit = read_gltf(data, partial(_beside, fetch))
    else:
        vertices, faces, unit = read_three_mf(data)
    known = known_unit(unit)
    if known is None:
        raise FormatError(f"it states the unit '{unit}', which isn't known")
    return RawMesh(vertices, faces, known)


def known_unit(name: str) -> str | None:
    """Return the short name of a unit; None: not known."""
    unit = _UNIT_NAMES.get(name.lower().removesuffix("s"), name)
    return unit if unit in METRES else None


def _beside(fetch: Callable[[str], bytes] | None, name: str) -> bytes:
    rooted = PurePosixPath(name).is_absolute() or PureWindowsPath(name).drive
    missing = FormatError(f"it needs the file '{name}', which isn't beside it")
    if fetch is None or rooted or ".." in name:
        raise missing
    try:
        return fetch(name)
    except (FileNotFoundError, KeyError):
        raise missing from None


def _ply(data: bytes) -> RawMesh:
    elements = read_ply(data)
    points, polygons = ply_surface(elements)
    of_vertices = elements["vertex"].scalars.items()
    return _of_polygons(
        points,
        polygons.lengths,
        np.asarray(polygons.values, np.int64),
        {name: values for name, values in of_vertices if name not in ("x", "y", "z")},
        elements["face"].scalars if "face" in elements else {},
    )


def _of_polygons(
    points: Array,
    sizes: Ints,
    corners: Ints,
    of_vertices: Properties = MappingProxyType({}),
    of_faces: Properties = MappingProxyType({}),
) -> RawMesh:
    faces, polygon = cut_polygons(points, sizes, corners)
    origin = FileOrigin(polygon, faces, len(sizes), len(points), of_faces, of_vertices)
    return RawMesh(points, faces, None, origin)
