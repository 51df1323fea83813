"""A mesh file that was read and repaired before."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from geometry.files.archives import file_bytes
from geometry.files.readers import load_mesh, mesh_of_bytes
from geometry.mesh.file_origin import FileOrigin
from geometry.mesh.mesh import TriangleMesh
from planning.cache.cache import Cache

# Its buffers may be other files.
_SEVERAL_FILES = ".gltf"
# Fields of `FileOrigin`; mappings that nobody can change aren't kept as such.
_ORIGIN = ("face", "corners", "n_faces", "n_vertices")
_PROPERTIES = ("face_properties", "vertex_properties")


def recalled_mesh(
    path: Path, cache: Cache, *, unit: str | None, size_mm: float | None
) -> TriangleMesh:
    """Return what `load_mesh` does.

    Raises:
        MeshError: As `load_mesh`.
    """
    whole = path.is_file() and path.suffix.lower() != _SEVERAL_FILES
    if cache.entries is None or not whole:
        return load_mesh(path, unit=unit, size_mm=size_mm)
    # The file may be saved anew meanwhile: what is hashed is what is read.
    data = file_bytes(path)

    def parts() -> tuple[Any, ...]:
        mesh = mesh_of_bytes(path, data, unit=unit, size_mm=size_mm)
        assert mesh.origin is not None
        told = {name: getattr(mesh.origin, name) for name in _ORIGIN}
        told |= {name: dict(getattr(mesh.origin, name)) for name in _PROPERTIES}
        return mesh.vertices, mesh.faces, mesh.source, told

    inputs = data, path.suffixes, unit, size_mm
    vertices, faces, source, origin = cache.recall("load_mesh", inputs, parts)
    source = replace(source, path=str(path))
    return TriangleMesh(vertices, faces, source, FileOrigin(**origin))
