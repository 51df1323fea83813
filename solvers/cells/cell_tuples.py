"""Search over multisets of K cells: may K poses serve enough, and where?

Start from K times the whole tree. A multiset goes if its cells' rows together don't
reach the requirement, or cost less than need(lambda). Else its coarsest cell is split.
Two poses may stand in the same cell, so a cell used m times becomes (m, 0), (m - 1, 1),
... (0, m) uses of its halves: every multiset of parts once, (a, a) among them. Which
cell is split depends on the multiset alone, so none is met twice. A multiset of cells
that can't be split and still reaches the requirement is handed back.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solvers.bit_rows import BitSum, BitSums, pack_rows, parts
from solvers.status import WorkBudget

from .cell_problem import WholeRows
from .cell_store import CellStore
from .cell_subtrees import VOID, Subtrees

_BATCH = 2048
# Words that a batch's rows may take.
_WORDS = 2_000_000
_UNITS_PER_NODE = 300.0
_NEVER = np.iinfo(np.int64).max


@dataclass(frozen=True, eq=False)
class TupleAnswer:
    """Answer of :func:`refute_tuples`.

    Attributes:
        refuted: Whether no K poses reach the requirement.
        survivor: K cells of the store, with repetition, that may and can't be split;
            None if none was found.
    """

    refuted: bool
    survivor: NDArray[np.int64] | None


def refute_tuples(
    whole: WholeRows,
    store: CellStore,
    n_poses: int,
    multipliers: NDArray[np.int64],
    budget: WorkBudget,
    batch: int = _BATCH,
) -> TupleAnswer:
    """Search all multisets of K cells, K at least 1, as far as the budget reaches.

    Multipliers are any non-negative integers, shape (n_rows,); good ones prune.
    Small batches come sooner to what survives, and take longer for all.
    """
    subtrees = Subtrees(whole, store, n_poses, multipliers)
    if subtrees.root == VOID:
        return TupleAnswer(refuted=True, survivor=None)
    enough = Enough(whole, n_poses)
    start, _ = _weigh(np.full((1, n_poses), subtrees.root), subtrees, enough)
    stack = [start] if len(start) else []
    while stack:
        nodes, ended = _split(stack.pop(), subtrees)
        # With the store full, what could be split looks as if it couldn't.
        if budget.exhausted or store.full:
            return TupleAnswer(refuted=False, survivor=None)
        if ended is not None:
            cells = np.array(sorted(subtrees.cell(int(t)) for t in ended))
            return TupleAnswer(refuted=False, survivor=cells)
        budget.spend(len(nodes) * (enough.units + _UNITS_PER_NODE) + 1e5)
        nodes, weights = _weigh(nodes, subtrees, enough)
        # The heaviest last, so that what may survive comes first.
        nodes = nodes[np.argsort(weights, kind="stable")]
        stack += [nodes[part] for part in parts(len(nodes), batch)]
    return TupleAnswer(refuted=True, survivor=None)


class Enough:
    """Weighs what K bit rows serve together, each row as often as it needs."""

    def __init__(self, whole: WholeRows, n_poses: int) -> None:
        needs = np.minimum(whole.needs, n_poses + 1)
        self._planes = int(min(needs.max(initial=0), n_poses))
        self._exactly = pack_rows(needs == np.arange(self._planes + 1)[:, None])
        self._simple = bool(np.all(needs == 1))
        sets = np.arange(len(whole.needed))[:, None]
        self._sums = BitSums(np.where(whole.row_sets == sets, whole.weights, 0))
        self._sum = BitSum(whole.weights)
        # What is required of each set is required of all.
        self._least = max(whole.needed_total, sum(whole.needed))
        self._floors = np.array(whole.needed)
        words = self._exactly.shape[1]
        per_word = 2.0 * n_poses * max(1, self._planes)
        self.units = words * (per_word + self._sums.units)
        self.batch = max(1, _WORDS // (words * (1 + n_poses + self._planes)))

    def served(self, rows: NDArray[np.uint64]) -> NDArray[np.uint64]:
        """Return the rows that enough of K cells serve; of (n, K, n_words)."""
        if self._simple:
            return np.bitwise_or.reduce(rows, axis=1)
        n, n_poses, words = rows.shape
        # Plane j: what more than j of the cells so far serve.
        planes = np.zeros((self._planes, n, words), dtype=np.uint64)
        for k in range(n_poses):
            for j in range(self._planes - 1, 0, -1):
                planes[j] |= planes[j - 1] & rows[:, k]
            if self._planes:
                planes[0] |= rows[:, k]
        covered = np.broadcast_to(self._exactly[0], (n, words)).copy()
        for plane, mask in zip(planes, self._exactly[1:], strict=True):
            covered |= plane & mask
        return covered

    def __call__(
        self, rows: NDArray[np.uint64]
    ) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
        """Return whether each K rows meet every set, and what they serve in all."""
        covered = self.served(rows)
        served = self._sum(covered)
        meets = served >= self._least
        if self._floors.size > 1:
            some = np.flatnonzero(meets)
            each = self._sums(covered.take(some, axis=0))
            meets[some] = np.all(each >= self._floors, axis=1)
        return meets, served


def _weigh(
    nodes: NDArray[np.int64], subtrees: Subtrees, enough: Enough
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the multisets that remain, and what they serve at most."""
    # Subtrees stand in order, and what is void before all others.
    nodes = nodes[nodes[:, 0] != VOID]
    nodes = nodes[subtrees.costs.take(nodes.T).sum(axis=0) >= subtrees.floor]
    weights = np.zeros(len(nodes), dtype=np.int64)
    meets = np.zeros(len(nodes), dtype=bool)
    for part in parts(len(nodes), enough.batch):
        # One cell of all multisets after the other: numpy copies and joins whole rows.
        rows = subtrees.rows.take(nodes[part].T, axis=0)
        meets[part], weights[part] = enough(rows.transpose(1, 0, 2))
    return nodes[meets], weights[meets]


def _split(
    nodes: NDArray[np.int64], subtrees: Subtrees
) -> tuple[NDArray[np.int64], NDArray[np.int64] | None]:
    """Split each multiset's coarsest subtree; or return one that can't be split."""
    final = np.zeros(nodes.shape, dtype=bool)
    settled: list[NDArray[np.int64]] = []
    while len(nodes):
        ranks = np.where(final, _NEVER, subtrees.coarseness.take(nodes))
        coarsest = np.arange(len(nodes)), np.argmin(ranks, axis=1)
        if np.any(final[coarsest]):
            return nodes[:0], nodes[int(np.argmax(final[coarsest]))]
        chosen = nodes[coarsest]
        halves = subtrees.halves(chosen)
        leaf = halves[:, 0] == chosen
        settled += _uses(nodes[~leaf], chosen[~leaf], halves[~leaf])
        final = (final | (nodes == chosen[:, None]))[leaf]
        nodes = nodes[leaf]
    return np.sort(np.concatenate(settled), axis=1) if settled else nodes, None


def _uses(
    nodes: NDArray[np.int64], chosen: NDArray[np.int64], halves: NDArray[np.int64]
) -> list[NDArray[np.int64]]:
    """Replace m uses of a subtree by (m, 0), (m - 1, 1), ... uses of its halves."""
    multisets: list[NDArray[np.int64]] = []
    at = nodes == chosen[:, None]
    uses = at.sum(axis=1)
    for m in np.flatnonzero(np.bincount(uses)):
        some = np.flatnonzero(uses == m)
        rows, places, two = (each.take(some, axis=0) for each in (nodes, at, halves))
        for second in range(m + 1):
            new = rows.copy()
            new[places] = two.take([0] * (m - second) + [1] * second, axis=1).ravel()
            multisets.append(new)
    return multisets
