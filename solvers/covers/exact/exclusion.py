"""A certificate that no K sets cover as much as is required, to be checked elsewhere.

Whoever checks it needs its numbers, the matrix and whole-number arithmetic, and no
solver: `docs/method/covers.md` has the formula. Up to two sets need no certificate:
looking at all of them is cheaper than reading one.
"""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from solvers.bit_rows import sparse_rows
from solvers.covers.bounds.reduced_cover import ReducedCover
from solvers.status import WorkBudget

from .group_bounds import GroupPart, PartBounds
from .group_branching import likeness
from .group_parts import children, only_selection

# A multiplier is so many parts of a row's weight at most.
WHOLE = 240
# Code of a node that no multipliers refute.
BRANCH = -1
LOOKED_AT = 2
# The last multipliers are tried on a part before its own are sought.
_RECENT = 24
_BATCH, _FIRST_STEPS, _STEPS = 32, 200, 40
_FINE = 2.0**24
# More makes a file that nobody wants to send.
_MOST_MULTIPLIERS, _MOST_NODES = 2000, 200_000

# Counts in single precision are exact up to here.
_EXACT = 1 << 24


@dataclass(frozen=True, eq=False)
class Exclusion:
    """Why no K sets reach a weight; every row weighs one.

    Attributes:
        n_sets: K.
        stand_in: For each set the one that stands for it; that is taken to cover what
            all cover that it stands for, shape (n_s,).
        multipliers: Multiplier of each row, in parts of `WHOLE`, shape (n_m, n_e).
        nodes: The tree, parents first: the multipliers that refute a leaf, or `BRANCH`:
            first the part that takes one of the next group at least, then the part that
            takes none.
        groups: Sets of all groups, one group after the other.
        group_ends: Where each ends, one for each branch.
    """

    n_sets: int
    stand_in: NDArray[np.int64]
    multipliers: NDArray[np.uint8]
    nodes: NDArray[np.int64]
    groups: NDArray[np.int64]
    group_ends: NDArray[np.int64]


@dataclass(eq=False)
class _Node:
    """A part, and what became of it."""

    part: GroupPart
    code: int = BRANCH
    group: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))
    below: tuple["_Node", ...] = ()


def excluded(
    covers: NDArray[np.bool_],
    reduced: ReducedCover,
    n_sets: int,
    required: int,
    budget: WorkBudget,
) -> Exclusion | None:
    """Return why no K sets cover `required` rows; None where the budget doesn't do.

    Args:
        covers: Whether a set (column) covers a row, shape (n_e, n_s).
        reduced: The same, reduced: it says which set stands for which.
        n_sets: K.
        required: Rows.
        budget: Of work.
    """
    kept = reduced.kept
    stand_in = kept[np.maximum(reduced.stand_in, 0)] if kept.size else kept
    united = _united(covers, stand_in, kept)
    if n_sets > LOOKED_AT and kept.size:
        return _Refutation(united, reduced, n_sets, required).run(stand_in, budget)
    if _most_of_few(united, n_sets) >= required:
        return None
    none = np.empty(0, dtype=np.int64)
    empty = np.empty((0, len(covers)), dtype=np.uint8)
    return Exclusion(n_sets, stand_in, empty, none, none, none)


def _most_of_few(covers: NDArray[np.bool_], n_sets: int) -> int:
    """Return how many rows two sets cover at most, or one, or none."""
    counts = covers.sum(axis=0)
    if n_sets < LOOKED_AT or counts.size < LOOKED_AT:
        return int(counts.max(initial=0)) if n_sets else 0
    ones = covers.astype(np.float32 if len(covers) < _EXACT else np.float64)
    return int((counts[:, None] + counts[None, :] - ones.T @ ones).max())


def _united(
    covers: NDArray[np.bool_], stand_in: NDArray[np.int64], kept: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """Return what the sets kept cover with all that they stand for, (n_e, n_kept)."""
    united = covers[:, kept].copy()
    place = np.searchsorted(kept, stand_in)
    for s in np.flatnonzero(stand_in != np.arange(stand_in.size)).tolist():
        united[:, place[s]] |= covers[:, s]
    return united


class _Refutation:
    """Grows the tree; rows that equal sets cover are one row of more weight."""

    def __init__(
        self,
        covers: NDArray[np.bool_],
        reduced: ReducedCover,
        n_sets: int,
        required: int,
    ) -> None:
        self.kept, self.n_sets, self.required = reduced.kept, n_sets, required
        _, first, inverse, counts = np.unique(
            np.packbits(covers, axis=1),
            axis=0,
            return_index=True,
            return_inverse=True,
            return_counts=True,
        )
        self.row_of, self.counts = inverse.ravel(), counts
        by_row = sparse.csr_array(sparse_rows(covers[first]), dtype=np.float64)
        self.by_set = sparse.csr_array(by_row.T)
        self.covered = np.any(covers[first], axis=1)
        # Bounds take whole steps of weights: of ones there would be two.
        self.cover = replace(reduced, by_set=self.by_set, weights=counts * _FINE)
        self.multipliers: list[NDArray[np.uint8]] = []
        self.paid: list[NDArray[np.float64]] = []
        self.unpaid: list[int] = []

    def run(self, stand_in: NDArray[np.int64], budget: WorkBudget) -> Exclusion | None:
        target = self.required * _FINE
        bounds = PartBounds(self.cover, self.n_sets, target, budget)
        alike = likeness(bounds.covers, self.cover.weights)
        root = _Node(bounds.whole(np.ones(self.counts.size)))
        waiting, steps, n_nodes = [root], _FIRST_STEPS, 1
        while waiting:
            large = n_nodes > _MOST_NODES or len(self.multipliers) > _MOST_MULTIPLIERS
            if budget.exhausted or large:
                return None
            taken, waiting = waiting[-_BATCH:], waiting[:-_BATCH]
            # A part keeps what it closes while it is bounded: that names it.
            open_nodes = {
                id(node.part.closed): node for node in taken if not self._refuted(node)
            }
            parts = [node.part for node in open_nodes.values()]
            for part in bounds.lowered(parts, steps):
                node = open_nodes[id(part.closed)]
                if part.bound < target and self._refuted_by(node, part):
                    continue
                if only_selection(part, self.n_sets) is not None:
                    return None
                below = children(part, self.n_sets, alike)
                node.group = below[0].groups[-1]
                node.below = tuple(_Node(each) for each in below)
                waiting += node.below
                n_nodes += 2
            steps = _STEPS
        return self._written(root, stand_in)

    def _refuted(self, node: _Node) -> bool:
        """Whether known multipliers refute a node, or it is one small selection."""
        only = only_selection(node.part, self.n_sets)
        if only is not None:
            # At these the bound is what the selection covers.
            return self._takes(node, self.by_set[only].sum(axis=0) == 0)
        for index in range(len(self.paid))[-_RECENT:]:
            if self._below_required(node.part, index):
                node.code = index
                return True
        return False

    def _refuted_by(self, node: _Node, part: GroupPart) -> bool:
        """Whether the multipliers of a part refute it when they are rounded."""
        # What nobody covers weighs nothing where its multiplier is its weight.
        return self._takes(node, np.where(self.covered, part.shares, 1.0))

    def _takes(self, node: _Node, parts: NDArray[Any]) -> bool:
        """Whether multipliers, as parts of weights, refute a node; they are kept."""
        shares = np.round(parts * float(WHOLE)).astype(np.uint8)
        whole = shares.astype(np.int64) * self.counts
        self.paid.append(self.by_set @ whole.astype(np.float64))
        self.unpaid.append(WHOLE * int(self.counts.sum()) - int(whole.sum()))
        if self._below_required(node.part, len(self.paid) - 1):
            self.multipliers.append(shares)
            node.code = len(self.multipliers) - 1
            return True
        self.paid.pop()
        self.unpaid.pop()
        return False

    def _below_required(self, part: GroupPart, index: int) -> bool:
        paid = self.paid[index].copy()
        most = float(self.unpaid[index])
        for group in part.groups:
            best = group[np.argmax(paid[group])]
            most += float(paid[best])
            paid[best] = -1.0
        # There may be fewer sets than may be taken.
        spare = min(self.n_sets - len(part.groups), paid.size)
        if spare:
            others = np.where(part.closed, 0.0, np.maximum(paid, 0.0))
            most += float(np.partition(others, -spare)[-spare:].sum())
        return most < self.required * WHOLE

    def _written(self, root: _Node, stand_in: NDArray[np.int64]) -> Exclusion:
        nodes: list[int] = []
        groups: list[NDArray[np.int64]] = [np.empty(0, dtype=np.int64)]
        waiting = [root]
        while waiting:
            node = waiting.pop()
            nodes.append(node.code)
            if node.code == BRANCH:
                groups.append(self.kept[node.group])
                waiting += reversed(node.below)
        return Exclusion(
            self.n_sets,
            stand_in,
            np.stack(self.multipliers)[:, self.row_of]
            if self.multipliers
            else np.empty((0, self.row_of.size), dtype=np.uint8),
            np.array(nodes, dtype=np.int64),
            np.concatenate(groups),
            np.cumsum([group.size for group in groups[1:]], dtype=np.int64),
        )
