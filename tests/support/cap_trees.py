"""Trees of cells whose optimum is known: arcs on a circle, caps on a sphere.

A pose is a point of the circle or the sphere; it serves the sample points within an
angle of it. A cell serves at most what lies within that angle plus its own radius of
its centre. Cells are made when asked for; `flatten` makes arrays of a whole tree.
"""

import numpy as np

from solvers.bit_rows import pack_rows
from solvers.cells.cell_tree import CellBatch
from support.array_trees import ArrayTree

# Added to angles, so that rounding can only make a cell's row larger.
SLACK = 1e-9


class CapTree:
    """Cells around centres; subclasses say which."""

    units = 0.0

    def __init__(self, points, radius, depth):
        self.points = np.asarray(points, dtype=float)
        self.radius, self.depth = radius, depth
        self.made = set()

    @property
    def n_rows(self):
        return len(self.points)

    def roots(self):
        cells = np.arange(self.n_roots)
        return CellBatch(cells, np.full(cells.size, -1), pack_rows(self.serves(cells)))

    def children(self, cells, /):
        cells = np.asarray(cells)
        of = np.flatnonzero(self.level(cells) < self.depth)
        found = self.split(cells[of])
        self.made.update(found.tolist())
        rows = pack_rows(self.serves(found))
        return CellBatch(found, np.repeat(of, self.arity), rows)

    def serves(self, cells):
        """Return what each cell may serve, within what its parent may serve."""
        centres, radii = self.caps(cells)
        widened = np.minimum(self.radius + radii[:, None] + SLACK, np.pi)
        near = centres @ self.points.T >= np.cos(widened)
        below = self.level(cells) > 0
        if np.any(below):
            parents, which = np.unique(self.parent(cells[below]), return_inverse=True)
            near[below] &= self.serves(parents)[which]
        return near


class CircleTree(CapTree):
    """Dyadic arcs of the circle; cell 0 is all, 2 i + 1 and 2 i + 2 halves of i."""

    n_roots, arity = 1, 2

    def level(self, cells):
        return np.floor(np.log2(cells + 1.0)).astype(int)

    def parent(self, cells):
        return (cells - 1) // 2

    def split(self, cells):
        return (2 * cells[:, None] + [1, 2]).ravel()

    def spans(self, cells):
        """Return the middle and the half width of each arc."""
        number = 2.0 ** self.level(cells)
        half = np.pi / number
        return (2.0 * (cells + 1 - number) + 1.0) * half, half

    def caps(self, cells):
        middle, half = self.spans(cells)
        return circle(middle), half

    def inside(self, cell, rng, n):
        """Return poses drawn inside a cell."""
        middle, half = self.spans(np.array([cell]))
        return circle(middle + half * rng.uniform(-1, 1, n))


class SphereTree(CapTree):
    """Quadtrees on the six faces of an equiangular cube map."""

    n_roots, arity = 6, 4

    def level(self, cells):
        firsts = 2 * (4 ** np.arange(self.depth + 2) - 1)
        return np.searchsorted(firsts, cells, side="right") - 1

    def place(self, cells):
        """Return face, column and row of each cell, and the cells along an edge."""
        level = self.level(cells)
        within = cells - 2 * (4**level - 1)
        face, rest = np.divmod(within, 4**level)
        return face, *np.divmod(rest, 2**level), 2**level

    def cell(self, face, i, j, n):
        return 2 * (n * n - 1) + (face * n + i) * n + j

    def parent(self, cells):
        face, i, j, n = self.place(cells)
        return self.cell(face, i // 2, j // 2, n // 2)

    def split(self, cells):
        face, i, j, n = (x[:, None] for x in self.place(cells))
        return self.cell(
            face, 2 * i + [0, 0, 1, 1], 2 * j + [0, 1, 0, 1], 2 * n
        ).ravel()

    def at(self, cells, s, t):
        """Return the directions at shares s, t in [0, 1] of each cell."""
        face, i, j, n = self.place(cells)
        u, v = (np.tan(np.pi / 2 * ((k + x) / n - 0.5)) for k, x in ((i, s), (j, t)))
        one = np.where(face % 2 == 0, 1.0, -1.0) * np.ones_like(u)
        axis = face // 2
        found = np.stack([one, u, v], axis=-1)
        turned = np.stack([np.roll(found, k, axis=-1) for k in range(3)])
        chosen = turned[axis, np.arange(cells.size)]
        return chosen / np.linalg.norm(chosen, axis=-1, keepdims=True)

    def caps(self, cells):
        centres = self.at(cells, 0.5, 0.5)
        corners = [self.at(cells, s, t) for s in (0.0, 1.0) for t in (0.0, 1.0)]
        cosines = [np.sum(centres * corner, axis=1) for corner in corners]
        return centres, np.arccos(np.clip(np.min(cosines, axis=0), -1.0, 1.0))

    def inside(self, cell, rng, n):
        return self.at(np.full(n, cell), rng.random(n), rng.random(n))


def circle(angles):
    """Return the points of the unit circle at some angles."""
    return np.stack([np.cos(angles), np.sin(angles)], axis=-1)


def spread(n):
    """Return n points spread over the sphere (Fibonacci lattice)."""
    z = 1.0 - (2.0 * np.arange(n) + 1.0) / n
    turn = np.pi * (1.0 + np.sqrt(5.0)) * np.arange(n)
    return np.stack([*(np.sqrt(1 - z * z) * f(turn) for f in (np.cos, np.sin)), z], -1)


def flatten(tree):
    """Return the whole of a tree as arrays, and its names of the cells."""
    names, parents, rows = [], [], []
    batch, first = tree.roots(), 0
    above = np.full(batch.cells.size, -1)
    while batch.cells.size:
        names.append(batch.cells)
        parents.append(above)
        rows.append(batch.rows)
        batch = tree.children(batch.cells)
        above = first + batch.parents
        first += names[-1].size
    arrays = ArrayTree(np.concatenate(parents), np.concatenate(rows), tree.n_rows)
    return arrays, np.concatenate(names)
