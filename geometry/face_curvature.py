"""Curvature of faces: smoothed tensors in each face's plane."""

import numpy as np
from numpy.typing import NDArray

from .curvature import CurvatureField
from .diffusion import diffused, surface_laplacian, vertex_areas
from .mesh import TriangleMesh

# Curvature is averaged over a length that is this share of its scale.
_SMOOTHING_SHARE = 1.5
# |k1 - k2| up to this share of the larger magnitude leaves the direction arbitrary.
_ISOTROPIC = 0.3
# Curvedness times the diagonal below this is flat: its order means nothing.
_FLAT = 0.05


def steep_directions(mesh: TriangleMesh, field: CurvatureField) -> NDArray[np.float64]:
    """Return T1 of every face, for a target that is the whole surface.

    Shape (n_f, 3): unit and in the face's plane; zero where |k1 - k2| <= 0.3
    max(|k1|, |k2|), where the face is flat, and where its curvature isn't trusted.
    """
    return face_curvature(mesh, field)[1]


def face_curvature(
    mesh: TriangleMesh, field: CurvatureField
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Return curvedness [1/m], steep direction and trust of each face.

    The smoothed tensors of a face's corners are averaged and projected into its plane;
    the eigenvalues of that 2 x 2 form are its principal curvatures.

    Returns:
        Shapes (n_f,), (n_f, 3) and (n_f,).

    Raises:
        ValueError: If the field is of another mesh.
    """
    if len(field.valid) != len(mesh.vertices):
        raise ValueError(
            f"the field has {len(field.valid)} vertices, the mesh {len(mesh.vertices)}"
        )
    tensors, trusted = _face_tensors(mesh, field)
    first = mesh.corners[:, 1] - mesh.corners[:, 0]
    first = first / np.maximum(np.linalg.norm(first, axis=1, keepdims=True), 1e-300)
    plane = np.stack([first, np.cross(mesh.face_normals, first)], axis=2)
    form = np.swapaxes(plane, 1, 2) @ tensors @ plane
    half_sum = 0.5 * (form[:, 0, 0] + form[:, 1, 1])
    half_gap = 0.5 * (form[:, 0, 0] - form[:, 1, 1])
    twist = 0.5 * (form[:, 0, 1] + form[:, 1, 0])
    spread = np.hypot(half_gap, twist)
    largest = np.abs(half_sum) + spread
    curvedness = np.sqrt(half_sum**2 + spread**2)
    # Angle of the eigenvector of half_sum + spread; the other one is across.
    angle = 0.5 * np.arctan2(twist, half_gap) + np.where(half_sum < 0, 0.5 * np.pi, 0.0)
    steep = plane @ np.stack([np.cos(angle), np.sin(angle)], axis=1)[..., None]
    curvedness = np.where(trusted & (curvedness * mesh.size > _FLAT), curvedness, 0.0)
    directed = (2.0 * spread > _ISOTROPIC * largest) & (curvedness > 0)
    return curvedness, np.where(directed[:, None], steep[..., 0], 0.0), trusted


def _face_tensors(
    mesh: TriangleMesh, field: CurvatureField
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Averaged tensors (n_f, 3, 3), and the faces whose corners are valid, (n_f,)."""
    trusted: NDArray[np.bool_] = np.all(field.valid[mesh.faces], axis=1)
    return _smoothed(mesh, field)[mesh.faces].mean(axis=1), trusted


def _smoothed(mesh: TriangleMesh, field: CurvatureField) -> NDArray[np.float64]:
    """Curvature tensors averaged over the field's scale, (n_v, 3, 3).

    Vertices that aren't valid give nothing.
    """
    edge = mesh.mean_edge
    vertices = (mesh.vertices - mesh.centre) / edge
    mass = np.where(field.valid, vertex_areas(vertices, mesh.faces), 0.0)
    upper = np.triu_indices(3)
    # Entries beside the diagonal stand for two: with the root of two, the sum of
    # squares is the tensor's own, which no turn changes.
    doubled = np.where(upper[0] == upper[1], 1.0, np.sqrt(2.0))
    values = diffused(
        field.tensors[:, upper[0], upper[1]] * doubled,
        mass,
        surface_laplacian(vertices, mesh.faces),
        _SMOOTHING_SHARE * field.scale / edge,
    )
    values = values / doubled
    tensors = np.empty((len(vertices), 3, 3))
    tensors[:, upper[0], upper[1]] = values
    tensors[:, upper[1], upper[0]] = values
    return tensors
