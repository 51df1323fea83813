"""Principal curvatures at a physical scale, and where they can be trusted."""

from dataclasses import dataclass
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components, dijkstra

from geometry.arrays import Array, Ints, Mask, cross, lengths
from geometry.mesh.diffusion import diffused
from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.tensors import principal, tangent_planes, unpacked
from geometry.mesh.topology import MeshEdges, components, face_pairs, numbered

from .quadric import RINGS, fit_quadrics

DEFAULT_RADIUS_SHARE = 0.02
# Tensors are averaged over this share of the scale, but no less than some neighbours:
# a quadric leaves out what is cubic, which on irregular triangles is as good as noise.
_AVERAGED_SHARE, _LEAST_EDGES = 0.5, 0.6
# Positions are averaged over the same before, less the edge that a fit reaches over
# anyway: where triangles are that large, moving vertices costs more than it wins.
_FITTED_EDGES = 1.0
# Turns sharper than this between two faces are creases of the object, not facets.
SHARPEST_FACET = np.deg2rad(40.0)
_LEAST_TURN = 1e-6


@dataclass(frozen=True, eq=False)
class CurvatureField:
    """Principal curvatures per vertex; an outward-oriented sphere has positive ones.

    Attributes:
        radius: Radius of the neighbourhood that was asked for, in [m].
        scale: The one that holds: `radius`, or the size of the facets where none was
            asked for and those of a coarse mesh are larger, in [m].
        k_max: Larger principal curvature in [1/m], shape (n_v,); 0 where not valid.
        k_min: Smaller one, signed, k_min <= k_max.
        direction_max: Unit direction of k_max, shape (n_v, 3).
        direction_min: Unit direction of k_min.
        valid: Whether the vertex could be fitted, isn't on an edge of more than two
            faces, and lies farther than ``radius`` and two rings from an open border,
            shape (n_v,).
    """

    radius: float
    scale: float
    k_max: Array
    k_min: Array
    direction_max: Array
    direction_min: Array
    valid: Mask

    @cached_property
    def curvedness(self) -> Array:
        """sqrt((k_max^2 + k_min^2) / 2) in [1/m], shape (n_v,)."""
        return np.sqrt(0.5 * (self.k_max**2 + self.k_min**2))


# By the mesh itself: a plan and its report ask for the same.
_KNOWN: WeakKeyDictionary[TriangleMesh, CurvatureField] = WeakKeyDictionary()
_FACETS: WeakKeyDictionary[TriangleMesh, float] = WeakKeyDictionary()


def principal_curvatures(
    mesh: TriangleMesh, radius: float | None = None
) -> CurvatureField:
    """Return principal curvatures and directions at a physical scale.

    A quadric is fitted to two rings about each vertex, and the curvature tensors are
    averaged by diffusion over half the scale. On meshes finer than that, positions are
    averaged over it before, since noise is large beside short edges. So other triangles
    on the same object give the same curvatures, and noise shorter than the scale is
    averaged out. Both averages vanish with the radius, down to 0.6 edges for tensors
    and none for positions: a radius below an edge is the route for clean meshes.

    The scale is a radius [m] that is given; else it is 2 % of the mesh's size, or the
    size of the facets (`facet_size`) of a coarse mesh where those are larger, since the
    mesh knows nothing smaller of the shape. Edges should not be longer than it
    (`refinement` cuts them). Source of the fit: Panozzo, Puppo and Rocca, "Efficient
    multi-scale curvature and crease estimation", 2010.

    Raises:
        ValueError: If the radius isn't positive.
    """
    if radius is None:
        field = _KNOWN.get(mesh)
        if field is None:
            radius = DEFAULT_RADIUS_SHARE * mesh.size
            field = _curvatures(mesh, radius, max(radius, facet_size(mesh)))
            know_curvatures(mesh, field)
        return field
    if not (radius > 0 and np.isfinite(radius)):
        raise ValueError(f"radius must be a positive number of metres, got {radius}")
    return _curvatures(mesh, radius, radius)


def know_curvatures(mesh: TriangleMesh, field: CurvatureField) -> None:
    """Let `principal_curvatures` return a field that was kept of the same mesh."""
    _KNOWN[mesh] = field


def facet_size(mesh: TriangleMesh) -> float:
    """Return the length in [m] over which the mesh turns from face to face.

    sum(turn (A1 + A2)) / sum(turn edge) over the edges of two faces with areas A1, A2
    that turn by less than 40 degrees; sharper ones are creases of the object, and flat
    surface counts nothing, however large its triangles. 0 without such an edge.
    """
    if mesh not in _FACETS:
        _FACETS[mesh] = _facet_size(mesh)
    return _FACETS[mesh]


def _facet_size(mesh: TriangleMesh) -> float:
    edges = mesh.edges
    pairs, edge = face_pairs(edges)
    normals = mesh.face_normals[pairs]
    sine = lengths(cross(normals[:, 0], normals[:, 1]))
    turn = np.arctan2(sine, np.einsum("ij,ij->i", normals[:, 0], normals[:, 1]))
    # Below, it is the rounding of flat surface.
    turn[(turn > SHARPEST_FACET) | (turn < _LEAST_TURN)] = 0.0
    ends = mesh.vertices[edges.ends[edge]]
    length = turn @ lengths(ends[:, 1] - ends[:, 0])
    area = turn @ mesh.face_areas[pairs].sum(axis=1)
    return float(area / length) if length > 0 else 0.0


def _curvatures(mesh: TriangleMesh, radius: float, scale: float) -> CurvatureField:
    n = len(mesh.vertices)
    valid = np.zeros(n, dtype=bool)
    k, directions = np.zeros((2, n)), np.zeros((2, n, 3))
    directions[0], directions[1] = [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]
    solid = mesh.faces[mesh.face_areas > 0]
    if len(solid):
        # Unit mean edge about the origin: libigl's thresholds are absolute numbers.
        edge = mesh.mean_edge
        used, faces = numbered(solid, n)
        part = mesh
        if len(used) < n or len(solid) < len(mesh.faces):
            part = TriangleMesh(mesh.vertices[used], faces)
        whole = ~_near_border(part.vertices, part.edges, radius, RINGS)
        vertices = (part.vertices - mesh.centre) / edge
        mass = part.vertex_areas / (edge * edge)
        curvatures, ways, fitted = _averaged_fit(
            vertices, faces, mass, part.laplacian, whole, scale / edge
        )
        valid[used] = fitted
        k[:, valid] = curvatures[:, fitted] / edge
        directions[:, valid] = ways[:, fitted]
    for values in (k, directions, valid):
        values.setflags(write=False)
    return CurvatureField(
        radius, scale, k[0], k[1], directions[0], directions[1], valid
    )


def _averaged_fit(
    vertices: Array,
    faces: Ints,
    mass: Array,
    laplacian: csr_array,
    whole: Mask,
    scale: float,
) -> tuple[Array, Array, Mask]:
    beyond = (_AVERAGED_SHARE * scale) ** 2 - _FITTED_EDGES**2
    if beyond > 0:
        vertices = diffused(vertices, mass, laplacian, np.sqrt(beyond))
    tensors, normals, fitted, sensible = fit_quadrics(vertices, faces)
    fitted, sensible = fitted & whole, sensible & whole
    if np.any(fitted & ~sensible):
        # Those take over what is around them; where nothing is, they aren't known.
        fitted &= _joined_to(sensible, laplacian)
    tensors = diffused(
        tensors,
        np.where(sensible, mass, 0.0),
        laplacian,
        max(_AVERAGED_SHARE * scale, _LEAST_EDGES),
    )
    return *principal(unpacked(tensors), tangent_planes(normals)), fitted


def _joined_to(chosen: Mask, laplacian: csr_array) -> Mask:
    count, label = connected_components(laplacian, directed=False)
    held = np.zeros(count, dtype=bool)
    held[label[chosen]] = True
    return held[label]


def _near_border(vertices: Array, edges: MeshEdges, reach: float, rings: int) -> Mask:
    """Vertices on a border or branching edge, or near a long border."""
    # A pinhole, shorter than the neighbourhood's rim, spoils no more than its own rim.
    n = len(vertices)
    near = np.zeros(n, dtype=bool)
    near[edges.ends[edges.n_faces != 2]] = True
    rim = edges.ends[edges.border]
    if len(rim) == 0:
        return near
    count, loop = components(rim, n)
    a, b = edges.ends.T
    run = lengths(vertices[a] - vertices[b])
    around = np.bincount(loop[rim[:, 0]], run[edges.border], count)
    long = around > 2.0 * np.pi * reach
    sources = np.unique(rim[long[loop[rim[:, 0]]]])
    if len(sources) == 0:
        return near
    graph = coo_array((run, (a, b)), (n, n)).tocsr()
    distance = dijkstra(
        graph, directed=False, indices=sources, min_only=True, limit=reach
    )
    touched = np.zeros(n, dtype=bool)
    touched[sources] = True
    for _ in range(rings):
        touched[edges.ends[touched[edges.ends].any(axis=1)]] = True
    return near | touched | np.isfinite(distance)
