"""Principal curvatures at a physical scale, and where they can be trusted."""

from dataclasses import dataclass
from functools import cached_property

import igl
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from .mesh import TriangleMesh
from .topology import Edges, components, mesh_edges

DEFAULT_RADIUS_SHARE = 0.02
# A quadric needs two rings; the cost of a ring grows with its square, so a mesh that
# would need more than the last is fitted at a smaller radius, which the field states.
_MIN_RINGS, _MAX_RINGS = 2, 10


@dataclass(frozen=True, eq=False)
class CurvatureField:
    """Principal curvatures per vertex; an outward-oriented sphere has positive ones.

    Attributes:
        radius: Radius of the fitted neighbourhood that was asked for, in [m].
        rings: Rings of edges that stand for it.
        k_max: Larger principal curvature in [1/m], shape (n_v,); 0 where not valid.
        k_min: Smaller one, signed, k_min <= k_max.
        direction_max: Unit direction of k_max, shape (n_v, 3).
        direction_min: Unit direction of k_min.
        valid: Whether the vertex could be fitted, isn't on an edge of more than two
            faces, and lies farther than ``radius`` and ``rings`` from an open border,
            shape (n_v,).
    """

    radius: float
    rings: int
    k_max: NDArray[np.float64]
    k_min: NDArray[np.float64]
    direction_max: NDArray[np.float64]
    direction_min: NDArray[np.float64]
    valid: NDArray[np.bool_]

    @cached_property
    def steep(self) -> NDArray[np.float64]:
        """Unit direction T1 of the curvature of larger magnitude, shape (n_v, 3)."""
        larger = np.abs(self.k_max) >= np.abs(self.k_min)
        return np.where(larger[:, None], self.direction_max, self.direction_min)

    @cached_property
    def curvedness(self) -> NDArray[np.float64]:
        """sqrt((k_max^2 + k_min^2) / 2) in [1/m], shape (n_v,)."""
        return np.sqrt(0.5 * (self.k_max**2 + self.k_min**2))

    @cached_property
    def tensors(self) -> NDArray[np.float64]:
        """k_max d_max d_max^T + k_min d_min d_min^T in [1/m], shape (n_v, 3, 3)."""
        a, b = self.direction_max, self.direction_min
        return (
            self.k_max[:, None, None] * a[:, :, None] * a[:, None, :]
            + self.k_min[:, None, None] * b[:, :, None] * b[:, None, :]
        )


def principal_curvatures(
    mesh: TriangleMesh, radius: float | None = None
) -> CurvatureField:
    """Return principal curvatures and directions from a quadric fitted at each vertex.

    The neighbourhood has a physical radius, so that a finer mesh of the same object
    gives the same curvatures; it is turned into rings of the mean edge, since libigl's
    neighbourhoods in rings never crash while its balls do. Source: Panozzo, Puppo and
    Rocca, "Efficient multi-scale curvature and crease estimation", 2010.

    Args:
        mesh: Repaired and oriented outwards.
        radius: Of the neighbourhood in [m]; default 2 % of the bounding box's diagonal.

    Raises:
        ValueError: If the radius isn't positive.
    """
    if radius is None:
        diagonal = np.linalg.norm(mesh.bounds[1] - mesh.bounds[0])
        radius = DEFAULT_RADIUS_SHARE * float(diagonal)
    if not (radius > 0 and np.isfinite(radius)):
        raise ValueError(f"radius must be a positive number of metres, got {radius}")
    n = len(mesh.vertices)
    rings = _MIN_RINGS
    valid = np.zeros(n, dtype=bool)
    k, directions = np.zeros((2, n)), np.zeros((2, n, 3))
    directions[0], directions[1] = [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]
    # libigl reads out of bounds at faces without area and at vertices without a face.
    solid = mesh.faces[mesh.face_areas > 0]
    if len(solid):
        # Unit mean edge about the origin: libigl's thresholds are absolute numbers.
        edge = mesh.mean_edge
        rings = int(np.clip(round(radius / edge), _MIN_RINGS, _MAX_RINGS))
        used, local_faces = np.unique(solid, return_inverse=True)
        vertices = np.ascontiguousarray((mesh.vertices[used] - mesh.centre) / edge)
        faces = np.ascontiguousarray(local_faces.reshape(-1, 3), dtype=np.int64)
        found, ways, fitted = _fit(vertices, faces, rings)
        fitted &= ~_near_border(vertices, mesh_edges(faces), radius / edge, rings)
        valid[used] = fitted
        k[:, valid] = found[:, fitted] / edge
        # An exactly flat neighbourhood has no direction of its own.
        directed = fitted & np.all(np.linalg.norm(ways, axis=2) > 0.5, axis=0)
        directions[:, used[directed]] = _unit(ways[:, directed])
    for values in (k, directions, valid):
        values.setflags(write=False)
    return CurvatureField(
        radius, rings, k[0], k[1], directions[0], directions[1], valid
    )


def _fit(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], rings: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Curvatures (2, n), larger first, their directions (2, n, 3), and success (n,)."""
    first, second, k_first, k_second, bad = igl.principal_curvature(
        vertices, faces, radius=rings, useKring=True
    )
    k, ways = np.stack([k_first, k_second]), np.stack([first, second])
    fitted = np.all(np.isfinite(k), axis=0) & np.all(np.isfinite(ways), axis=(0, 2))
    fitted[list(bad)] = False
    return k, ways, fitted


def _near_border(
    vertices: NDArray[np.float64], edges: Edges, reach: float, rings: int
) -> NDArray[np.bool_]:
    """Vertices on a border or branching edge, or in reach or rings of a long border.

    A neighbourhood that a border cuts in two is fitted on one side only, and the
    border's own teeth look like curvature. A pinhole, whose rim is shorter than the
    circumference of the neighbourhood, spoils no more than its rim.
    """
    n = len(vertices)
    near = np.zeros(n, dtype=bool)
    near[edges.ends[edges.n_faces != 2]] = True
    rim = edges.ends[edges.border]
    if len(rim) == 0:
        return near
    count, loop = components(rim, n)
    ends = vertices[rim]
    lengths = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)
    long = np.bincount(loop[rim[:, 0]], lengths, count) > 2.0 * np.pi * reach
    sources = np.unique(rim[long[loop[rim[:, 0]]]])
    if len(sources) == 0:
        return near
    a, b = edges.ends.T
    lengths = np.linalg.norm(vertices[a] - vertices[b], axis=1)
    graph = coo_array((lengths, (a, b)), (n, n)).tocsr()
    distance = dijkstra(
        graph, directed=False, indices=sources, min_only=True, limit=reach
    )
    touched = np.zeros(n, dtype=bool)
    touched[sources] = True
    for _ in range(rings):
        touched[edges.ends[touched[edges.ends].any(axis=1)]] = True
    return near | touched | np.isfinite(distance)


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
