"""A triangle mesh in metres, and where it came from."""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from geometry.arrays import Array, Ints, Mask, lengths

from .diffusion import surface_laplacian
from .extent import enclosing_ball, main_bodies
from .file_origin import FileOrigin
from .tensors import area_normals
from .topology import MeshEdges, mesh_edges, used_vertices

_Scalar = TypeVar("_Scalar", bound=np.generic)


class MeshError(ValueError):
    """A mesh that can't be used: says what, the value, the rule and the remedy."""


@dataclass(frozen=True)
class Repair:
    """One kind of change made to a mesh while it was read, and how often."""

    kind: str
    count: int


@dataclass(frozen=True)
class MeshSource:
    """Provenance of a mesh.

    Attributes:
        path: File that was read, as it was given.
        sha256: Digest of that file's bytes, hexadecimal.
        unit: Length unit the file's numbers were taken in.
        scale_to_m: Metres in one file unit.
        n_vertices: Vertices in the file, before repairs.
        n_faces: Faces in the file, before repairs.
        repairs: What was changed, in the order it was done.
    """

    path: str
    sha256: str
    unit: str
    scale_to_m: float
    n_vertices: int
    n_faces: int
    repairs: tuple[Repair, ...] = ()


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """Oriented triangles in metres; faces are counter-clockwise seen from outside.

    Attributes:
        vertices: Positions in the world frame, in [m], shape (n_v, 3).
        faces: Vertex indices, shape (n_f, 3).
        source: Where it came from; None for meshes made in memory.
        origin: The faces' numbers in the file that it was read from; else None.

    Raises:
        MeshError: If an array has the wrong shape, a coordinate isn't finite, an index
            is out of range or there is no face.
    """

    vertices: Array
    faces: Ints
    source: MeshSource | None = None
    origin: FileOrigin | None = None

    def __post_init__(self) -> None:
        vertices = np.array(self.vertices, dtype=np.float64, order="C")
        faces = np.array(self.faces, dtype=np.int64, order="C")
        if vertices.ndim != 2 or vertices.shape[1] != 3:
            raise MeshError(f"vertices must be (n, 3), got {vertices.shape}")
        if faces.ndim != 2 or faces.shape[1] != 3 or len(faces) == 0:
            raise MeshError(f"faces must be (n, 3) with n >= 1, got {faces.shape}")
        if not np.all(np.isfinite(vertices)):
            bad = int(np.flatnonzero(~np.isfinite(vertices).all(axis=1))[0])
            raise MeshError(f"vertex {bad} is {vertices[bad]}: must be finite numbers")
        if not (faces.min() >= 0 and faces.max() < len(vertices)):
            raise MeshError(
                f"face indices span {faces.min()}..{faces.max()}, "
                f"must lie in 0..{len(vertices) - 1}"
            )
        if self.origin is not None and len(self.origin.face) != len(faces):
            raise MeshError(
                f"the origin tells of {len(self.origin.face)} faces, the mesh has "
                f"{len(faces)}"
            )
        for name, values in (("vertices", vertices), ("faces", faces)):
            values.setflags(write=False)
            object.__setattr__(self, name, values)

    @classmethod
    def joined(cls, meshes: Sequence["TriangleMesh"]) -> "TriangleMesh":
        """Return several meshes as one, their faces one after the other.

        What is a main body, and what a fragment, each of them says for itself.
        """
        ends = np.cumsum([len(mesh.vertices) for mesh in meshes])
        faces = [
            mesh.faces + end - len(mesh.vertices)
            for mesh, end in zip(meshes, ends, strict=True)
        ]
        vertices = np.concatenate([mesh.vertices for mesh in meshes])
        together = cls(vertices, np.concatenate(faces))
        together.__dict__["main"] = _read_only(
            np.concatenate([mesh.main for mesh in meshes])
        )
        return together

    def told_of(self, source: MeshSource, origin: FileOrigin) -> "TriangleMesh":
        """Return the mesh, with all that is known of it, as it came from a file."""
        told = copy(self)
        object.__setattr__(told, "source", source)
        object.__setattr__(told, "origin", origin)
        return told

    @cached_property
    def corners(self) -> Array:
        """Corner positions of each face in [m], shape (n_f, 3, 3)."""
        return _read_only(self.vertices[self.faces])

    @cached_property
    def _cross(self) -> Array:
        return area_normals(self.corners)

    @cached_property
    def face_areas(self) -> Array:
        """Area of each face in [m²], shape (n_f,)."""
        return _read_only(0.5 * lengths(self._cross))

    @cached_property
    def face_normals(self) -> Array:
        """Outward unit normal of each face, (n_f, 3); zero where it has no area."""
        length = 2.0 * self.face_areas[:, None]
        return _read_only(
            np.divide(
                self._cross, length, out=np.zeros_like(self._cross), where=length > 0
            )
        )

    @cached_property
    def face_centroids(self) -> Array:
        """Centroid of each face in [m], shape (n_f, 3)."""
        a, b, c = self.corners[:, 0], self.corners[:, 1], self.corners[:, 2]
        return _read_only((a + b + c) / 3.0)

    @cached_property
    def edges(self) -> MeshEdges:
        """Undirected edges of the faces."""
        return mesh_edges(self.faces)

    @cached_property
    def vertex_areas(self) -> Array:
        """A third of the area of each vertex's faces in [m²], shape (n_v,)."""
        thirds = np.repeat(self.face_areas / 3.0, 3)
        areas = np.bincount(self.faces.ravel(), thirds, len(self.vertices))
        return _read_only(areas.astype(np.float64))

    @cached_property
    def laplacian(self) -> csr_array:
        """Stiffness of linear elements (`diffusion.surface_laplacian`), (n_v, n_v)."""
        return surface_laplacian(self.vertices, self.faces, self.edges)

    @cached_property
    def area(self) -> float:
        """Total area in [m²]."""
        return float(self.face_areas.sum())

    @cached_property
    def used(self) -> Mask:
        """Whether some face uses each vertex; others may lie anywhere, (n_v,)."""
        return _read_only(used_vertices(self.faces, len(self.vertices)))

    @cached_property
    def bounds(self) -> Array:
        """Lower and upper corner of the bounding box of the faces in [m], (2, 3)."""
        points = self.vertices[self.used]
        return _read_only(np.stack([points.min(axis=0), points.max(axis=0)]))

    @cached_property
    def main(self) -> Mask:
        """Whether each face belongs to a main body; small fragments don't, (n_f,)."""
        return _read_only(main_bodies(self.faces, self.face_areas))

    @cached_property
    def _ball(self) -> tuple[Array, float]:
        used = used_vertices(self.faces[self.main], len(self.vertices))
        centre, radius = enclosing_ball(self.vertices[used])
        return _read_only(centre), radius

    @cached_property
    def centre(self) -> Array:
        """Centre of the smallest ball that holds the main bodies in [m], shape (3,)."""
        return self._ball[0]

    @cached_property
    def radius(self) -> float:
        """Radius in [m] of the smallest ball that holds the main bodies."""
        return self._ball[1]

    @property
    def size(self) -> float:
        """Diameter in [m] of that ball; unlike a box's diagonal it turns with it."""
        return 2.0 * self.radius

    @cached_property
    def reach(self) -> float:
        """Largest distance in [m] of any face, fragments too, from `centre`."""
        return float(lengths(self.corners - self.centre).max())

    @cached_property
    def mean_edge(self) -> float:
        """Mean edge length over the faces in [m]."""
        return float(np.mean(self.edge_lengths))

    @cached_property
    def edge_lengths(self) -> Array:
        """Lengths of the three edges of each face in [m], shape (n_f, 3)."""
        edges = self.corners - self.corners[:, [2, 0, 1]]
        return np.sqrt(np.einsum("fki,fki->fk", edges, edges))


def _read_only(values: NDArray[_Scalar]) -> NDArray[_Scalar]:
    values.setflags(write=False)
    return values
