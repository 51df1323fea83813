"""Averages over a physical length, whatever the size and shape of the triangles."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, diags_array

# Share of the change that may be missing. A solve that has come this far moves nothing
# that is larger than rounding in what is made of it, and takes tens of steps.
_TOLERANCE = 1e-4
_MAX_STEPS = 300
# An angle's cotangent; keeps slivers from deafening the rest.
_LARGEST_WEIGHT = 3.0


def surface_laplacian(
    vertices: NDArray[np.float64], faces: NDArray[np.int64]
) -> csr_array:
    """Return the stiffness L of linear elements, (n, n), positive semi-definite.

    w_ij = (cot a + cot b) / 2 over the angles opposite the edge, no less than zero (an
    average must not leave the range of its values); L_ij = -w_ij, and rows sum to zero.
    Source: Pinkall and Polthier, "Computing discrete minimal surfaces", 1993.
    """
    n = len(vertices)
    corners = vertices[faces]
    rows: list[NDArray[np.int64]] = []
    columns: list[NDArray[np.int64]] = []
    values: list[NDArray[np.float64]] = []
    for k in range(3):
        a, b = corners[:, (k + 1) % 3], corners[:, (k + 2) % 3]
        u, v = a - corners[:, k], b - corners[:, k]
        sine = np.linalg.norm(np.cross(u, v), axis=1)
        cosine = np.einsum("ij,ij->i", u, v)
        rows.append(faces[:, (k + 1) % 3])
        columns.append(faces[:, (k + 2) % 3])
        values.append(0.5 * cosine / np.maximum(sine, 1e-300))
    pair = (np.concatenate(rows), np.concatenate(columns))
    weights = coo_array((np.concatenate(values), pair), (n, n)).tocsr()
    weights = (weights + weights.T).tocsr()
    weights.data = np.clip(weights.data, 0.0, _LARGEST_WEIGHT)
    return (diags_array(weights.sum(axis=1)) - weights).tocsr()


def vertex_areas(
    vertices: NDArray[np.float64], faces: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Return a third of the area of each vertex's faces, shape (n,)."""
    corners = vertices[faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(cross, axis=1) / 6.0
    corner = np.repeat(areas, 3)
    return np.bincount(faces.ravel(), corner, len(vertices)).astype(np.float64)


def diffused(
    values: NDArray[np.float64],
    mass: NDArray[np.float64],
    laplacian: csr_array,
    length: float,
) -> NDArray[np.float64]:
    """Return x of (M + length^2/2 L) x = M values: one implicit step of diffusion.

    The weights of the average fall off over about `length`; where the mass is zero the
    surroundings are carried on. All columns are one system to the conjugate gradients,
    so that turning the values turns every step alike.

    Args:
        values: Shape (n, m).
        mass: Weight of each node, not negative, shape (n,).
        laplacian: Positive semi-definite with zero row sums, shape (n, n).
        length: In the unit of the mass's square root.
    """
    stiffness = (0.5 * length * length) * laplacian
    system = (diags_array(mass) + stiffness).tocsr()
    diagonal = system.diagonal()
    inverse = np.divide(1.0, diagonal, out=np.zeros_like(diagonal), where=diagonal > 0)
    # The change is what is solved for: it is small, so its digits are worth more.
    x = np.zeros_like(values)
    rest = -(stiffness @ values)
    ready = inverse[:, None] * rest
    way = ready.copy()
    power = float(np.einsum("ij,ij->", rest, ready))
    enough = _TOLERANCE**2 * power
    for _ in range(_MAX_STEPS):
        if not power > enough:
            break
        image = system @ way
        step = power / float(np.einsum("ij,ij->", way, image))
        np.multiply(way, step, out=ready)
        x += ready
        image *= step
        rest -= image
        np.multiply(rest, inverse[:, None], out=ready)
        before, power = power, float(np.einsum("ij,ij->", rest, ready))
        way *= power / before
        way += ready
    x += values
    return x
