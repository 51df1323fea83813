"""Sums over the pieces of a patch of faces, and the merging of pieces."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from geometry.arrays import Array, Ints, rows_of
from geometry.mesh.tensors import summed, unit
from geometry.mesh.topology import components, grouped

# Share of a piece's area whose normals must lie in its cone: while it is cut and
# merged, and after fragments have joined it.
CONE_SHARE = (0.98, 0.95)
_SLACK = 1e-12


@dataclass(frozen=True, eq=False)
class Patch:
    """Faces that are to be cut into pieces.

    Attributes:
        normals: Unit normals, shape (n, 3).
        areas: Shape (n,).
        links: Adjacent faces, (m, 2).
        cos_half: Cosine of the half angle of the cone.
    """

    normals: Array
    areas: Array
    links: Ints
    cos_half: float

    @property
    def n(self) -> int:
        """Number of faces."""
        return len(self.areas)

    def sums(self, piece: Ints, count: int = 0) -> tuple[Array, Array]:
        """Return area-weighted sums of normals (k, 3) and areas (k,) of pieces."""
        count = max(count, int(piece.max(initial=-1)) + 1)
        # What is in no piece is counted too, before the first.
        sums = summed(self._weighted, piece + 1, count + 1)[1:]
        return sums[:, :3].copy(), sums[:, 3].copy()

    @cached_property
    def _weighted(self) -> Array:
        columns = np.column_stack([self.normals * self.areas[:, None], self.areas])
        # They are summed column by column.
        return np.asfortranarray(columns)

    def connected(self, part: Ints) -> Ints:
        """Number the connected faces of parts; -1 stays."""
        a, b = part[self.links].T
        label = components(rows_of(self.links, (a == b) & (a >= 0)), self.n)[1]
        return renumbered(np.where(part < 0, -1, label))

    def cosines(self, piece: Ints, axis: Array) -> Array:
        """Return each face's normal times the axis (k, 3) of its piece, or 0, (n,)."""
        axes = rows_of(np.append(axis, np.zeros((1, 3)), axis=0), piece)
        return np.einsum("ij,ij->i", self.normals, axes)

    def shares(self, piece: Ints) -> Array:
        """Return the share of each piece's area in the cone about its mean, (k,)."""
        sums, areas = self.sums(piece)
        axis = unit(sums)
        inside = (piece >= 0) & (self.cosines(piece, axis) >= self.cos_half - _SLACK)
        held = self.sums(np.where(inside, piece, -1), len(areas))[1]
        return np.divide(held, areas, out=np.ones_like(areas), where=areas > 0)


def renumbered(piece: Ints) -> Ints:
    """Return numbers without gaps in the same order; -1 stays."""
    used = np.zeros(int(piece.max(initial=-1)) + 2, dtype=bool)
    used[piece] = True
    # The last entry is that of -1.
    number = np.cumsum(used) - 1
    number[-1] = -1
    return number[piece]


def merged(patch: Patch, piece: Ints, share: float) -> Ints:
    """Join adjacent pieces as long as some union has the share of its area in a cone.

    The smallest goes first, and to the neighbour with which its mean normal is longest.
    """
    met = piece[patch.links]
    met = met[(met.min(axis=1, initial=0) >= 0) & (met[:, 0] != met[:, 1])]
    if not len(met):
        return piece
    count = int(piece.max()) + 1
    key = np.unique(met.min(axis=1) * count + met.max(axis=1))
    met = np.stack(np.divmod(key, count), axis=1)
    sums, areas = patch.sums(piece)
    work = _Merging(patch, share, sums, areas, grouped(piece, len(areas)))
    for a, b in met.tolist():
        work.near.setdefault(a, set()).add(b)
        work.near.setdefault(b, set()).add(a)
    waiting = set(work.near)
    while waiting:
        i = min(waiting, key=lambda i: (work.rank(i), i))
        waiting.discard(i)
        j = work.partner(i)
        if j is not None:
            work.join(i, j)
            waiting.discard(i)
            waiting |= {j} | work.near[j]
    result = np.full_like(piece, -1)
    for i, faces in enumerate(work.faces):
        result[faces] = i
    return result


class _Merging:
    """Pieces while they are merged: sums, faces and neighbours of each."""

    def __init__(
        self, patch: Patch, share: float, sums: Array, areas: Array, faces: list[Ints]
    ) -> None:
        self._patch, self._share = patch, share
        self._sums, self._areas, self.faces = sums, areas, faces
        self._total = float(areas.sum())
        self._refused: dict[int, set[int]] = {}
        self.near: dict[int, set[int]] = {}

    def rank(self, i: int) -> float:
        return round(float(self._areas[i]) / self._total, 9)

    def partner(self, i: int) -> int | None:
        """The neighbour that fits best with it in one cone; None: none does."""
        near = np.array(sorted(self.near[i]), dtype=np.int64)
        if not len(near):
            return None
        sums = self._sums[near] + self._sums[i]
        areas = self._areas[near] + self._areas[i]
        mean = np.linalg.norm(sums, axis=1) / areas
        # With this share within the angle the mean of the cosines can't be less.
        possible = mean >= self._share * (1.0 + self._patch.cos_half) - 1.0
        order = np.argsort(-np.round(mean, 9), kind="stable")
        for k in order[possible[order]]:
            j = int(near[k])
            if j in self._refused.get(i, ()):
                continue
            if self._fits(i, j):
                return j
            self._refused.setdefault(i, set()).add(j)
            self._refused.setdefault(j, set()).add(i)
        return None

    def join(self, i: int, j: int) -> None:
        """Make one piece, j, of two."""
        self.faces[j] = np.concatenate([self.faces[i], self.faces[j]])
        self.faces[i] = self.faces[i][:0]
        self._sums[j] += self._sums[i]
        self._areas[j] += self._areas[i]
        for k in self.near.pop(i):
            self.near[k].discard(i)
            if k != j:
                self.near[k].add(j)
                self.near[j].add(k)
        for k in (i, j):
            for other in self._refused.pop(k, set()):
                self._refused[other].discard(k)

    def _fits(self, i: int, j: int) -> bool:
        axis = self._sums[i] + self._sums[j]
        axis = axis / max(float(np.linalg.norm(axis)), 1e-300)
        held = 0.0
        for k in (i, j):
            inside = self._patch.normals[self.faces[k]] @ axis >= self._patch.cos_half
            held += float(self._patch.areas[self.faces[k]] @ inside)
        return held >= self._share * float(self._areas[i] + self._areas[j])
