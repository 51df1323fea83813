"""Which polygon of its file each face of a mesh came from."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Ints

Properties = Mapping[str, NDArray[Any]]


@dataclass(frozen=True, eq=False)
class FileOrigin:
    """The file's own numbering of a mesh that was triangulated, welded and repaired.

    Polygons and vertices count from 0 in the order of the file; a polygon of any number
    of corners counts once. Of several bodies in a file, the polygons of the first come
    first, then those of the second, and so on.

    Attributes:
        face: Polygon that each face of the mesh came from, shape (n_f,).
        corners: Vertices of the file at the corners of each face, in no certain order,
            shape (n_f, 3). Welded vertices keep their own numbers here.
        n_faces: Polygons in the file.
        n_vertices: Vertices in the file.
        face_properties: By name, a number for each polygon (PLY), shape (n_faces,).
        vertex_properties: By name, a number for each vertex (PLY), shape (n_vertices,).
    """

    face: Ints
    corners: NDArray[np.integer]
    n_faces: int
    n_vertices: int
    face_properties: Properties = field(default_factory=dict[str, NDArray[Any]])
    vertex_properties: Properties = field(default_factory=dict[str, NDArray[Any]])

    def __post_init__(self) -> None:
        face = np.array(self.face, dtype=np.int64)
        corners = np.array(self.corners, dtype=np.int32)
        if face.ndim != 1 or corners.shape != (len(face), 3):
            raise ValueError(
                f"face must be (n,) and corners (n, 3), got {face.shape} and "
                f"{corners.shape}"
            )
        for name, values, count in (
            ("face", face, self.n_faces),
            ("corners", corners, self.n_vertices),
        ):
            if len(values) and not (values.min() >= 0 and values.max() < count):
                raise ValueError(
                    f"{name} spans {values.min()}..{values.max()}, must lie in "
                    f"0..{count - 1}"
                )
            values.setflags(write=False)
            object.__setattr__(self, name, values)
        for name, count in (
            ("face_properties", self.n_faces),
            ("vertex_properties", self.n_vertices),
        ):
            held = {key: values.view() for key, values in getattr(self, name).items()}
            for key, values in held.items():
                if values.shape != (count,):
                    raise ValueError(
                        f"{name}: '{key}' must be ({count},), got {values.shape}"
                    )
                values.setflags(write=False)
            object.__setattr__(self, name, MappingProxyType(held))

    @classmethod
    def of_itself(cls, faces: Ints, n_vertices: int) -> "FileOrigin":
        """Return the origin of a mesh of which each face is a polygon of its own."""
        return cls(np.arange(len(faces)), faces, len(faces), n_vertices)

    def of_faces(self, kept: Ints) -> "FileOrigin":
        """Return the origin of a mesh that keeps these of the faces."""
        return replace(self, face=self.face[kept], corners=self.corners[kept])
