"""Curvature tensors from quadrics fitted to two rings about each vertex."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array

from .parallel import mapped
from .tensors import packed_tensors, tangent_planes

# Vertices that a thread works on at a time: it takes long enough that handing over the
# interpreter does not count.
_ROWS = 32768
# A quadric through its vertex has five coefficients; the vertex itself says nothing.
_LEAST_POINTS = 6
# Of normal equations in units of the neighbours' distance: less isn't determined.
_PIVOT = 1e-10
# Over its shortest edge a surface can't turn by more than half a turn: what is more
# comes of neighbours that hardly determine a quadric, and may be anything.
_MOST_TURN = np.pi
_ROOT_2 = np.sqrt(2.0)


def fit_quadrics(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int64],
    normals: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_]]:
    """Fit z = a x^2 + b x y + c y^2 + d x + e y to two rings about each vertex.

    z runs along the vertex's normal. Neighbours that face the other way, as on the far
    side of a thin wall, take no part, as long as five are left. The tensor is
    k1 d1 d1^T + k2 d2 d2^T of the quadric at the vertex, turned into the plane across
    its normal, where an outward-oriented sphere is positive. Source: Panozzo, Puppo and
    Rocca, "Efficient multi-scale curvature and crease estimation", 2010.

    Args:
        vertices: Shape (n, 3), of about unit edges.
        faces: Shape (m, 3).
        normals: Unit normals of the vertices, (n, 3).

    Returns:
        Tensors as six numbers each (`tensors.packed`), (n, 6); whether there are five
        neighbours or more to fit, (n,); and where the fit makes sense: the curvature
        times the shortest edge is no more than pi, (n,). Tensors are zero elsewhere.
    """
    n = len(vertices)
    near = _adjacency(faces, n)
    planes = tangent_planes(normals)
    tensors = np.zeros((n, 6))
    fitted, sensible = np.zeros((2, n), dtype=bool)

    def fit(rows: slice) -> None:
        # Two rings: the neighbours' neighbours, and the vertex.
        rings = near[rows] @ near
        counts = np.diff(rings.indptr)
        for count in np.unique(counts[counts >= _LEAST_POINTS]).tolist():
            mine = np.flatnonzero(counts == count)
            around = rings.indices[rings.indptr[mine, None] + np.arange(count)]
            at = rows.start + mine
            fitted[at] = True
            tensors[at], sensible[at] = _fit_alike(
                vertices, normals, planes[at], at, around
            )

    mapped(fit, [slice(i, min(i + _ROWS, n)) for i in range(0, n, _ROWS)])
    return tensors, fitted, sensible


def _adjacency(faces: NDArray[np.int64], n: int) -> csr_array:
    """Which vertices share a face, and each itself; ascending, shape (n, n)."""
    a, b, c = faces.T
    own = np.arange(n)
    rows = np.concatenate([a, b, c, b, c, a, own])
    columns = np.concatenate([b, c, a, a, b, c, own])
    # Counts of paths would overflow; that there is one is all that is asked.
    near = coo_array((np.ones(len(rows), np.float32), (rows, columns)), (n, n)).tocsr()
    near.data[:] = 1.0
    return near


def _fit_alike(
    vertices: NDArray[np.float64],
    normals: NDArray[np.float64],
    plane: NDArray[np.float64],
    at: NDArray[np.int64],
    around: NDArray[np.int64],
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Tensors at vertices (m,) with those around (m, k), and if they make sense."""
    own = normals[at]
    facing = np.matmul(normals.take(around, axis=0), own[:, :, None])[:, :, 0] > 0.0
    facing |= (facing.sum(axis=1) < _LEAST_POINTS)[:, None]
    offsets = vertices.take(around, axis=0)
    offsets -= vertices[at][:, None]
    offsets *= facing[:, :, None]
    squared = np.einsum("mki,mki->mk", offsets, offsets)
    # About unit length, whatever the size of these triangles.
    reach = np.sqrt(np.maximum(squared.sum(axis=1) / facing.sum(axis=1), 1e-300))
    frame = np.concatenate([plane, own[:, :, None]], axis=2) / reach[:, None, None]
    local = np.matmul(offsets, frame)
    x, y, z = local[:, :, 0], local[:, :, 1], local[:, :, 2]
    columns = np.stack([x, y, x * x, _ROOT_2 * x * y, y * y, z], axis=1)
    moments = np.matmul(columns, np.swapaxes(columns, 1, 2))
    form = _shape_form(_solved(moments))
    form /= reach[:, None, None]
    nearest = np.sqrt(np.where(squared > 0.0, squared, np.inf).min(axis=1))
    largest = np.sqrt(np.einsum("mij,mij->m", form, form))
    sensible = largest * nearest <= _MOST_TURN
    form = np.where(sensible[:, None, None], form, 0.0)
    return packed_tensors(plane @ form @ np.swapaxes(plane, 1, 2)), sensible


def _solved(moments: NDArray[np.float64]) -> NDArray[np.float64]:
    """Solve normal equations (m, 6, 6) of five unknowns, the last being the right.

    By Cholesky's factors, all at a time. What the neighbours don't determine is zero.

    Returns:
        Shape (5, m).
    """
    size = len(moments[0]) - 1
    factor: list[list[NDArray[np.float64]]] = []
    definite = np.ones(len(moments), dtype=bool)
    for i in range(size + 1):
        row: list[NDArray[np.float64]] = []
        for j in range(min(i, size - 1) + 1):
            other = row if i == j else factor[j]
            rest = moments[:, i, j].copy()
            for k in range(j):
                rest -= row[k] * other[k]
            if i == j:
                definite &= rest > _PIVOT
                row.append(np.sqrt(np.where(definite, rest, 1.0)))
            else:
                row.append(rest / other[j])
        factor.append(row)
    right = factor.pop()
    for i in reversed(range(size)):
        for k in range(i + 1, size):
            right[i] = right[i] - factor[k][i] * right[k]
        right[i] = right[i] / factor[i][i]
    solution = np.stack(right)
    if not definite.all():
        left = moments[~definite]
        values, ways = np.linalg.eigh(left[:, :size, :size])
        known = values > _PIVOT * values[:, -1:]
        inverse = np.divide(1.0, values, out=np.zeros_like(values), where=known)
        along = np.einsum("mji,mj->mi", ways, left[:, :size, size])
        solution[:, ~definite] = np.einsum("mij,mj->im", ways, inverse * along)
    return solution


def _shape_form(solution: NDArray[np.float64]) -> NDArray[np.float64]:
    """Curvature of z = d x + e y + (a x^2 + 2^0.5 b x y + c y^2) at 0, (m, 2, 2).

    G^-1/2 II G^-1/2 with G = I + (d, e)(d, e)^T: that of the surface's own tangent
    plane, turned into the plane of x and y, with the same eigenvalues.
    """
    d, e, a, b, c = solution
    root = np.sqrt(1.0 + d * d + e * e)
    shrink = 1.0 / (root * (root + 1.0))
    xx, xy, yy = 1.0 - shrink * d * d, -shrink * d * e, 1.0 - shrink * e * e
    metric = np.stack([xx, xy, xy, yy], axis=1).reshape(-1, 2, 2)
    b = _ROOT_2 * b
    second = np.stack([2.0 * a, b, b, 2.0 * c], axis=1).reshape(-1, 2, 2)
    return metric @ (second / -root[:, None, None]) @ metric
