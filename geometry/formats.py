"""From a file's bytes to raw vertices and triangles, whole or not at all.

PLY, STL, glTF and 3MF go through trimesh, which reads some broken files in part and
others as something else, without an error. What a file declares is therefore compared
with what came out.
"""

import io
import json
import logging
import re
import struct
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from trimesh.resolvers import Resolver

from .text_formats import FormatError, decode, read_obj, read_off

SUPPORTED = ("obj", "ply", "stl", "off", "glb", "gltf", "3mf")

# Without a handler of its own, Python prints the library's log records on stderr.
logging.getLogger("trimesh").addHandler(logging.NullHandler())

_COMPRESSED = ("KHR_draco_mesh_compression", "EXT_meshopt_compression")
_UNITS = {
    "micron": "um",
    "micrometer": "um",
    "micrometers": "um",
    "millimeter": "mm",
    "millimeters": "mm",
    "centimeter": "cm",
    "centimeters": "cm",
    "meter": "m",
    "meters": "m",
    "inch": "in",
    "inches": "in",
    "foot": "ft",
    "feet": "ft",
}


@dataclass(frozen=True, eq=False)
class RawMesh:
    """What a file holds: positions in its own unit, triangles, and the stated unit."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    unit: str | None


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
    if kind == "obj":
        raw = RawMesh(*read_obj(data), None)
    elif kind == "off":
        raw = RawMesh(*read_off(data), None)
    else:
        if kind == "stl" and not _is_binary_stl(data):
            # For other encodings the library wants a package that guesses them.
            data = decode(data).encode()
        _CHECKS[kind](data)
        raw = _through_library(kind, data, fetch)
        _compare(kind, data, raw)
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


class _Fetch(Resolver):
    """Hands the library the files named by a .gltf, and nothing else."""

    def __init__(self, fetch: Callable[[str], bytes] | None) -> None:
        self._fetch = fetch

    def get(self, key: str) -> bytes:
        if self._fetch is None or PurePath(key).is_absolute() or ".." in key:
            raise FormatError(f"it needs the file '{key}', which isn't beside it")
        return self._fetch(key)

    def write(self, name: str, data: bytes) -> None:
        raise NotImplementedError

    def namespaced(self, namespace: str) -> "_Fetch":
        raise NotImplementedError

    def keys(self) -> list[str]:
        return []


def _through_library(
    kind: str, data: bytes, fetch: Callable[[str], bytes] | None
) -> RawMesh:
    options: dict[str, Any] = {"process": False}
    if kind in ("glb", "gltf", "ply"):
        options["skip_materials"] = True
    if kind == "ply":
        options["fix_texture"] = False
    with warnings.catch_warnings():
        # numpy warns where text numbers break off, and the library goes on with less.
        warnings.simplefilter("error")
        scene = trimesh.load_scene(
            io.BytesIO(data), file_type=kind, resolver=_Fetch(fetch), **options
        )
    vertices, faces = _joined(scene)
    stated = None if kind in ("ply", "stl") else scene.units
    unit = _UNITS.get(str(stated).lower(), stated) if stated else None
    return RawMesh(vertices, faces, unit)


def _joined(scene: trimesh.Scene) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return every body of a scene, placed by its transforms, as one mesh."""
    vertices, faces, n = [np.empty((0, 3))], [np.empty((0, 3), np.int64)], 0
    for node in sorted(scene.graph.nodes_geometry):
        world_from_part, name = scene.graph[node]
        part = scene.geometry[name]
        at = np.asarray(part.vertices, dtype=np.float64)
        if at.ndim != 2 or at.shape[1] != 3:
            continue
        # Infinite coordinates are counted and removed later; here they may become NaN.
        with np.errstate(invalid="ignore", over="ignore"):
            at = at @ world_from_part[:3, :3].T + world_from_part[:3, 3]
        corners = np.asarray(getattr(part, "faces", ()), dtype=np.int64).reshape(-1, 3)
        if len(corners) and not (corners.min() >= 0 and corners.max() < len(at)):
            raise FormatError(f"a face names a vertex that isn't there, of {len(at)}")
        if np.linalg.det(world_from_part[:3, :3]) < 0:
            corners = corners[:, ::-1]
        vertices.append(at)
        faces.append(corners + n)
        n += len(at)
    return np.concatenate(vertices), np.concatenate(faces)


def _check_ply(data: bytes) -> None:
    header = _ply_header(data)
    if "tristrips" in header:
        raise FormatError("it stores triangle strips, which aren't read; store faces")
    if "vertex" not in header:
        raise FormatError("its header declares no vertices")


def _ply_header(data: bytes) -> dict[str, int]:
    """Return how many of each element a PLY header declares."""
    end = data.find(b"end_header")
    if not data.startswith(b"ply") or end < 0:
        raise FormatError("it has no PLY header")
    found = re.findall(
        r"^\s*element\s+(\w+)\s+(\d+)", data[:end].decode("latin-1"), re.M
    )
    return {name: int(count) for name, count in found}


def _check_gltf_json(text: bytes) -> None:
    try:
        tree = json.loads(text)
    except ValueError as error:
        raise FormatError(f"its JSON can't be read ({error})") from None
    if not isinstance(tree, dict):
        raise FormatError("its JSON isn't an object")
    for name in _COMPRESSED:
        if name in tree.get("extensionsRequired", ()):
            raise FormatError(f"it is compressed with {name}; export it uncompressed")
    for mesh in tree.get("meshes", ()):
        for part in mesh.get("primitives", ()):
            if part.get("mode", 4) == 6:
                raise FormatError("it stores triangle fans, which aren't read")
            used = [part.get("indices"), part.get("attributes", {}).get("POSITION")]
            stored = [tree["accessors"][i] for i in used if i is not None]
            if any("sparse" in accessor for accessor in stored):
                raise FormatError("it stores sparse accessors, which aren't read")


def _check_glb(data: bytes) -> None:
    if len(data) < 20 or not data.startswith(b"glTF"):
        raise FormatError("it has no GLB header")
    _, length, size, _ = struct.unpack("<4I", data[4:20])
    if length > len(data):
        raise FormatError(f"it is cut short: {len(data)} of {length} bytes")
    _check_gltf_json(data[20 : 20 + size])


def _accept(data: bytes) -> None:
    """Nothing to look for before reading."""


_CHECKS: dict[str, Callable[[bytes], None]] = {
    "ply": _check_ply,
    "glb": _check_glb,
    "gltf": _check_gltf_json,
    "stl": _accept,
    "3mf": _accept,
}


def _compare(kind: str, data: bytes, raw: RawMesh) -> None:
    """Refuse a file of which the library returned less than it declares."""
    n_vertices, n_faces = len(raw.vertices), len(raw.faces)
    if kind == "ply":
        header = _ply_header(data)
        declared = header["vertex"], header.get("face", 0)
        if n_vertices < declared[0] or n_faces < declared[1]:
            raise FormatError(
                f"its header promises {declared[0]} vertices and {declared[1]} faces, "
                f"{n_vertices} and {n_faces} could be read"
            )
    if kind == "stl" and not _is_binary_stl(data):
        declared_faces = len(re.findall(rb"^\s*facet\b", data, re.M | re.I))
        if n_faces != declared_faces:
            raise FormatError(f"{n_faces} of {declared_faces} facets could be read")
        if n_faces == 0 and not re.match(rb"\s*solid\b", data, re.I):
            raise FormatError(
                "it is neither ASCII STL nor binary STL of the stated length"
            )
    if n_faces and not np.any(raw.vertices):
        raise FormatError("every coordinate is zero: its compression isn't supported")


def _is_binary_stl(data: bytes) -> bool:
    return (
        len(data) >= 84 and len(data) == 84 + 50 * struct.unpack("<I", data[80:84])[0]
    )
