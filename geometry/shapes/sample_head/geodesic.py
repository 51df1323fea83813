"""A geodesic grid: the faces of an icosahedron, each divided into n² triangles."""

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array, Ints
from geometry.shapes.primitives import icosahedron_faces


@dataclass(frozen=True, eq=False)
class GeodesicGrid:
    """Directions spread over the sphere, and the triangles between them.

    Attributes:
        frequency: Parts that each edge of the icosahedron is divided into, n.
        directions: Unit vectors, shape (10 n² + 2, 3); mirror images in all three
            coordinate planes.
        faces: Counter-clockwise seen from outside, shape (20 n², 3).
        home: Icosahedron face that each direction was made from, (10 n² + 2,).
        steps: Its integer barycentric coordinates there, sum n, (10 n² + 2, 3).
        lattice: Direction at each lattice point of each icosahedron face, by its last
            two barycentric coordinates, -1 outside, shape (20, n + 1, n + 1).
    """

    frequency: int
    directions: Array
    faces: Ints
    home: Ints
    steps: Ints
    lattice: Ints

    def interpolate(self, values: Array, onto: "GeodesicGrid") -> Array:
        """Return values (n, k) at this grid's directions for those of a finer one."""
        n = self.frequency
        place = onto.steps[:, 1:] * (n / onto.frequency)
        cell = np.minimum(place.astype(np.int64), n - 1)
        # A point on the third edge of its icosahedron face belongs to the cell before.
        beyond = cell.sum(axis=1) >= n
        cell[beyond, np.argmax(cell[beyond], axis=1)] -= 1
        (a, b), (i, j) = (place - cell).T, cell.T
        lower = (a + b <= 1.0) | (i + j == n - 1)
        step = np.where(lower, 0, 1)
        weights = np.where(lower, [1.0 - a - b, a, b], [a + b - 1.0, 1.0 - b, 1.0 - a])
        corners = (
            self.lattice[onto.home, i + step, j + step],
            self.lattice[onto.home, i + 1, j],
            self.lattice[onto.home, i, j + 1],
        )
        return np.sum(
            [w[:, None] * values[c] for w, c in zip(weights, corners, strict=True)],
            axis=0,
        )


def geodesic_grid(frequency: int) -> GeodesicGrid:
    """Return the geodesic grid of a frequency, at least 1."""
    n = frequency
    if not n >= 1:
        raise ValueError(f"frequency must be at least 1, got {n}")
    corners, triangles = _icosahedron()
    i, j = np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij")
    inside = i + j <= n
    steps = np.stack([n - i - j, i, j], axis=-1)[inside]
    point, first = _shared_points(triangles, steps, n)
    home, row = np.divmod(first, len(steps))
    lattice = np.full((20, n + 1, n + 1), -1)
    lattice[:, inside] = point
    weights = steps[row] / n
    directions = sum(
        weights[:, k, None] * corners[triangles[home, k]] for k in range(3)
    )
    length = np.sqrt(np.sum(directions**2, axis=1, keepdims=True))
    return GeodesicGrid(
        n, directions / length, _cells(lattice, i + j), home, steps[row], lattice
    )


def _shared_points(triangles: Ints, steps: Ints, n: int) -> tuple[Ints, Ints]:
    """Number of each face's points by whole-numbered names, and where each is first."""
    weights = np.broadcast_to(steps, (20, *steps.shape))
    names = np.broadcast_to(triangles[:, None, :], weights.shape)
    base = 13 * (n + 1)
    codes = np.sort(np.where(weights > 0, names * (n + 1) + weights, base - 1), axis=-1)
    keys = (codes[..., 0] * base + codes[..., 1]) * base + codes[..., 2]
    _, first, number = np.unique(keys.ravel(), return_index=True, return_inverse=True)
    return number.reshape(20, -1), first


def _cells(lattice: Ints, total: Ints) -> Ints:
    n = lattice.shape[1] - 1
    here, right, up, across = (
        lattice[:, :-1, :-1],
        lattice[:, 1:, :-1],
        lattice[:, :-1, 1:],
        lattice[:, 1:, 1:],
    )
    lower = np.stack([here, right, up], axis=-1)[:, total[:-1, :-1] < n]
    upper = np.stack([right, across, up], axis=-1)[:, total[:-1, :-1] < n - 1]
    return np.concatenate([lower.reshape(-1, 3), upper.reshape(-1, 3)])


def _icosahedron() -> tuple[Array, Ints]:
    golden = 0.5 * (1.0 + 5.0**0.5)
    signs = [(a, b) for a in (-1.0, 1.0) for b in (-1.0, 1.0)]
    corners = np.array(
        [(0.0, a, b * golden) for a, b in signs]
        + [(a, b * golden, 0.0) for a, b in signs]
        + [(b * golden, 0.0, a) for a, b in signs]
    )
    faces, outward = icosahedron_faces(corners)
    return corners, np.where(outward[:, None], faces, faces[:, [0, 2, 1]])
