"""Meshes to and from trimesh, for those who have theirs in memory already."""

import hashlib

import numpy as np
import trimesh

from geometry.mesh.mesh import MeshError, TriangleMesh

from .readers import UNITS, usable_mesh
from .reading import RawMesh, known_unit

_NAME = "a trimesh object"


def from_trimesh(
    mesh: trimesh.Trimesh | trimesh.Scene, *, unit: str | None = None
) -> TriangleMesh:
    """Return a trimesh object in metres, repaired and oriented like a file.

    A scene's transforms are applied. Coordinates are in ``unit``, else ``mesh.units``:
    in memory there is no customary unit, so one of the two must be given.

    Raises:
        MeshError: If the unit isn't known, or there is no usable surface.
    """
    stated = unit or mesh.units
    known = known_unit(str(stated))
    if known is None:
        raise MeshError(
            f"{_NAME}: its unit is {stated!r}, must be one of {', '.join(UNITS)}; "
            "state it with unit="
        )
    # A scene's `to_mesh` applies its transforms.
    whole = mesh.to_mesh() if isinstance(mesh, trimesh.Scene) else mesh
    vertices = np.array(whole.vertices, dtype=np.float64).reshape(-1, 3)
    faces = np.array(whole.faces, dtype=np.int64).reshape(-1, 3)
    if len(faces) == 0:
        raise MeshError(f"{_NAME}: it has no faces; a surface is needed")
    digest = hashlib.sha256(vertices.tobytes() + faces.tobytes()).hexdigest()
    return usable_mesh(RawMesh(vertices, faces, None), _NAME, digest, known)


def to_trimesh(mesh: TriangleMesh) -> trimesh.Trimesh:
    """Return a mesh as trimesh object: the same arrays, copied, unit metres."""
    result = trimesh.Trimesh(
        np.array(mesh.vertices), np.array(mesh.faces), process=False
    )
    result.units = "meters"
    return result
