"""Averages over a physical length, whatever the size and shape of the triangles."""

import numpy as np
from scipy.sparse import coo_array, csr_array

from geometry.arrays import Array, Ints, cross
from geometry.parallel import mapped

from .topology import MeshEdges

# Share of the change that may be missing. A solve that has come this far moves nothing
# that is larger than rounding in what is made of it, and takes tens of steps.
_TOLERANCE = 1e-4
_MAX_STEPS = 300
# Numbers in a block that a thread works on at a time: they stay in the cache, and it
# takes long enough that handing over the interpreter doesn't count.
_BLOCK = 1 << 17
# An angle's cotangent; keeps slivers from deafening the rest.
_LARGEST_WEIGHT = 3.0


def surface_laplacian(vertices: Array, faces: Ints, edges: MeshEdges) -> csr_array:
    """Return the stiffness L of linear elements, (n, n), positive semi-definite.

    w_ij = (cot a + cot b) / 2 over the angles opposite the edge, no less than zero (an
    average must not leave the range of its values); L_ij = -w_ij, and rows sum to zero.
    Source: Pinkall and Polthier, "Computing discrete minimal surfaces", 1993.
    """
    corners = vertices[faces]
    # The side opposite to corner k runs from corner k + 1 to k + 2.
    sides = [corners[:, (k + 2) % 3] - corners[:, (k + 1) % 3] for k in range(3)]
    double_area = np.linalg.norm(cross(sides[0], sides[1]), axis=1)
    double_area = np.maximum(double_area, 1e-300)
    # Edge k of a face is opposite to corner k + 2.
    weights = sum(
        np.bincount(
            edges.of_face[:, k],
            -0.5 * np.einsum("ij,ij->i", sides[k], sides[k - 2]) / double_area,
            len(edges.ends),
        )
        for k in range(3)
    )
    return graph_laplacian(
        edges.ends, np.clip(weights, 0.0, _LARGEST_WEIGHT), len(vertices)
    )


def graph_laplacian(ends: Ints, weights: Array, n: int) -> csr_array:
    """Return L of n nodes, L_ij = -w_ij on links (m, 2), rows sum to zero; (n, n)."""
    a, b = ends.T
    nodes = np.arange(n)
    total = np.bincount(a, weights, n) + np.bincount(b, weights, n)
    values = np.concatenate([-weights, -weights, total])
    rows, columns = np.concatenate([a, b, nodes]), np.concatenate([b, a, nodes])
    return coo_array((values, (rows, columns)), (n, n)).tocsr()


def diffused(values: Array, mass: Array, laplacian: csr_array, length: float) -> Array:
    """Return x of (M + length^2/2 L) x = M values: an implicit step of diffusion.

    The weights of the average fall off over about `length`, in the unit of the root of
    the mass (n,). Where that is zero the surroundings are carried on. All columns are
    one system to the conjugate gradients, so that turning the values turns every step
    alike.
    """
    columns, starts = laplacian.indices, laplacian.indptr
    entries = (0.5 * length * length) * laplacian.data
    stiffness = csr_array((entries.copy(), columns, starts), laplacian.shape)
    rows = np.repeat(np.arange(len(mass)), np.diff(starts))
    # Every node has an entry of its own (`graph_laplacian`), zero as it may be.
    diagonals = np.flatnonzero(columns == rows)
    entries[diagonals] += mass
    diagonal = entries[diagonals]
    root = np.sqrt(
        np.divide(1.0, diagonal, out=np.zeros_like(diagonal), where=diagonal > 0)
    )
    # Scaled from both sides to a diagonal of ones, it needs no preconditioner.
    entries *= root[rows] * root[columns]
    system = csr_array((entries, columns, starts), laplacian.shape)
    # The change is what is solved for: it is small, so its digits are worth more.
    change = _conjugate_gradients(system, -root[:, None] * (stiffness @ values))
    return values + root[:, None] * change


def _conjugate_gradients(system: csr_array, rest: Array) -> Array:
    """Return x of A x = b, shape (n, m), up to the tolerance; b is used up."""
    # In blocks that stay in the cache, whose sums don't depend on the cores.
    n, m = rest.shape
    rows = max(1, _BLOCK // m)
    parts = [slice(i, min(i + rows, n)) for i in range(0, n, rows)]
    blocks = [system[part] for part in parts]
    x, way, image = np.zeros_like(rest), rest.copy(), np.empty_like(rest)
    step = turn = 0.0

    def bent(i: int) -> float:
        part = parts[i]
        image[part] = blocks[i] @ way
        return _product(way[part], image[part])

    def reduced(i: int) -> float:
        part = parts[i]
        image[part] *= step
        rest[part] -= image[part]
        return _product(rest[part], rest[part])

    def moved(i: int) -> None:
        part = parts[i]
        x[part] += step * way[part]
        way[part] *= turn
        way[part] += rest[part]

    power = sum(_product(rest[part], rest[part]) for part in parts)
    enough = _TOLERANCE**2 * power
    for _ in range(_MAX_STEPS):
        if not power > enough:
            break
        step = power / sum(mapped(bent, range(len(parts))))
        before, power = power, sum(mapped(reduced, range(len(parts))))
        turn = power / before
        mapped(moved, range(len(parts)))
    return x


def _product(a: Array, b: Array) -> float:
    return float(np.einsum("ij,ij->", a, b))
