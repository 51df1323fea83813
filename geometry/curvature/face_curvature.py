"""Curvature of faces: smoothed tensors in each face's plane."""

import numpy as np

from geometry.arrays import Array, Mask
from geometry.mesh.diffusion import diffused
from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.tensors import packed, principal, tangent_planes, unpacked

from .curvature import CurvatureField

# The field is averaged over this share of its scale, which makes 1.5 with its own half.
_SMOOTHING_SHARE = 1.4
# |k1 - k2| up to this share of the larger magnitude leaves the direction arbitrary.
_ISOTROPIC = 0.3
# Curvedness times the size of the mesh below this is flat: its order means nothing.
FLAT = 0.05


def steep_directions(mesh: TriangleMesh, field: CurvatureField) -> Array:
    """Return T1 of every face: unit and in its plane, shape (n_f, 3).

    The smoothed tensors of a face's corners are averaged and projected into its plane;
    the eigenvalues of that 2 x 2 form are its principal curvatures. Zero where
    |k1 - k2| <= 0.3 max(|k1|, |k2|), where the face is flat, and where its curvature
    isn't trusted.
    """
    six = packed((field.k_max, field.k_min), (field.direction_max, field.direction_min))
    tensors, trusted = averaged_on_faces(mesh, field, six, _SMOOTHING_SHARE)
    k, ways = principal(unpacked(tensors), tangent_planes(mesh.face_normals))
    magnitude = np.abs(k)
    largest = magnitude.max(axis=0)
    curvedness = np.sqrt(0.5 * (k**2).sum(axis=0))
    steep = np.where((magnitude[0] >= magnitude[1])[:, None], ways[0], ways[1])
    curved = trusted & (curvedness * mesh.size > FLAT)
    directed = (k[0] - k[1] > _ISOTROPIC * largest) & curved
    return np.where(directed[:, None], steep, 0.0)


def averaged_on_faces(
    mesh: TriangleMesh, field: CurvatureField, values: Array, share: float
) -> tuple[Array, Mask]:
    """Return values averaged on the faces, (n_f, m), and which have valid corners only.

    Diffusion averages the values of the vertices, (n_v, m), over a share of the field's
    scale. Vertices that aren't valid give nothing.

    Raises:
        ValueError: If the field is of another mesh.
    """
    if len(field.valid) != len(mesh.vertices):
        raise ValueError(
            f"the field has {len(field.valid)} vertices, the mesh {len(mesh.vertices)}"
        )
    edge = mesh.mean_edge
    mass = np.where(field.valid, mesh.vertex_areas / (edge * edge), 0.0)
    smooth = diffused(values, mass, mesh.laplacian, share * field.scale / edge)
    a, b, c = mesh.faces.T
    trusted = field.valid[a] & field.valid[b] & field.valid[c]
    return (smooth[a] + smooth[b] + smooth[c]) / 3.0, trusted
