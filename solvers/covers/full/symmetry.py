"""Which columns of a cover a symmetry exchanges.

A symmetry permutes the columns so that the rows, as sets of columns, stay the same.
Colour refinement tells columns apart that none can exchange: rows and columns start
with one colour each; a row's next colour is that of its columns together, and the other
way round, until no more colours come about. What it leaves alike is tried: two columns
are singled out, colours are refined on both sides, and where every column has its own
colour a permutation can be read off. It counts only if it maps rows to rows.

References:
    McKay and Piperno, "Practical graph isomorphism, II", Journal of Symbolic
    Computation 60, 2014.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from solvers.status import WorkBudget

# Refinements that one call and one pair of columns may cost.
_MAX_REFINEMENTS = 400
_MAX_FOR_A_PAIR = 24
_UNITS_PER_ENTRY = 4.0
_CALL_UNITS = 1e5

Colours = NDArray[np.uint64]


def may_be_symmetric(covers: NDArray[np.bool_], budget: WorkBudget) -> bool:
    """Whether refinement finds at most half as many colours as columns.

    Not where the budget ends before.
    """
    colours = column_colours(covers, budget)
    return not budget.exhausted and 2 * np.unique(colours).size <= colours.size


def column_colours(covers: NDArray[np.bool_], budget: WorkBudget) -> Colours:
    """Return a colour of each column, equal for all that some symmetry exchanges.

    Where the budget ends, colours are coarser.
    """
    refinement = _Refinement(covers, budget)
    return refinement.refined(np.zeros(covers.shape[1], dtype=np.uint64))


def column_orbits(covers: NDArray[np.bool_], budget: WorkBudget) -> NDArray[np.int64]:
    """Return for each column the first one that a symmetry carries it to.

    Every symmetry used was checked; where the search for one is given up, an orbit may
    come in several parts.
    """
    refinement = _Refinement(covers, budget)
    first = np.arange(covers.shape[1])
    colours = refinement.refined(np.zeros(covers.shape[1], dtype=np.uint64))
    rows = _row_keys(covers)
    for colour in np.unique(colours):
        alike = np.flatnonzero(colours == colour)
        # First columns of the orbits met; by insertion, so in the same order always.
        heads: dict[int, None] = {}
        for column in alike.tolist():
            if refinement.given_up:
                break
            if int(first[column]) in heads:
                continue
            for head in heads:
                moved = refinement.symmetry(colours, head, column)
                if moved is not None and _keeps(covers, moved, rows):
                    _join(first, moved)
                    break
            else:
                heads[column] = None
    return first


class _Refinement:
    """Colours of a cover, refined; equal on isomorphic sides."""

    def __init__(self, covers: NDArray[np.bool_], budget: WorkBudget) -> None:
        self._by_row = sparse.csr_array(covers, dtype=np.uint64)
        self._by_set = sparse.csr_array(self._by_row.T)
        self._entries = float(np.count_nonzero(covers) + sum(covers.shape))
        self._budget = budget
        self._left = _MAX_REFINEMENTS
        self._left_for_pair = 0

    def symmetry(
        self, colours: Colours, one: int, other: int
    ) -> NDArray[np.int64] | None:
        """Return where columns may be carried if one is carried to another, or None."""
        self._left_for_pair = _MAX_FOR_A_PAIR
        if self.given_up:
            return None
        return self._match(self._single(colours, one), self._single(colours, other))

    @property
    def given_up(self) -> bool:
        return self._left <= 0 or self._budget.exhausted

    def refined(self, colours: Colours) -> Colours:
        """Return colours that tell apart all that these do, and their neighbours."""
        n_colours, rows = np.unique(colours).size, np.zeros(1, dtype=np.uint64)
        while colours.size and not self._budget.exhausted:
            # Sums of mixed numbers modulo 2^64: equal for equal multisets of colours.
            rows = _mixed(rows + _mixed(self._by_row @ _mixed(colours)))
            colours = _mixed(colours + _mixed(self._by_set @ _mixed(rows)))
            self._budget.spend(_UNITS_PER_ENTRY * self._entries + _CALL_UNITS)
            more = np.unique(colours).size
            if more == n_colours:
                break
            n_colours = more
        self._left -= 1
        self._left_for_pair -= 1
        return colours

    def _single(self, colours: Colours, column: int) -> Colours:
        """Return the colours refined with one column told apart from all others."""
        marked = colours.copy()
        marked[column] = ~marked[column]
        return self.refined(marked)

    def _match(self, left: Colours, right: Colours) -> NDArray[np.int64] | None:
        """Return to which column each is carried, by colours made unique, or None."""
        order, other = (np.argsort(side, kind="stable") for side in (left, right))
        if not np.array_equal(left[order], right[other]):
            return None
        values, places, counts = np.unique(left, return_index=True, return_counts=True)
        if values.size == left.size:
            moved = np.empty(left.size, dtype=np.int64)
            moved[order] = other
            return moved
        several = np.flatnonzero(counts > 1)
        least = several[np.argmin(counts[several])]
        singled = self._single(left, int(places[least]))
        for column in np.flatnonzero(right == values[least]).tolist():
            if self._left_for_pair <= 0 or self.given_up:
                break
            moved = self._match(singled, self._single(right, column))
            if moved is not None:
                return moved
        return None


def _mixed(values: Colours) -> Colours:
    """Return numbers that differ where these do, and look random."""
    values = values + np.uint64(0x9E3779B97F4A7C15)
    values = (values ^ (values >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    values = (values ^ (values >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return values ^ (values >> np.uint64(31))


def _row_keys(covers: NDArray[np.bool_]) -> list[bytes]:
    return sorted(row.tobytes() for row in np.packbits(covers, axis=1))


def _keeps(
    covers: NDArray[np.bool_], moved: NDArray[np.int64], rows: list[bytes]
) -> bool:
    """Whether a permutation of the columns leaves the rows the same."""
    carried = np.empty_like(covers)
    carried[:, moved] = covers
    return _row_keys(carried) == rows


def _join(first: NDArray[np.int64], moved: NDArray[np.int64]) -> None:
    """Join each column's orbit, known by its first, with that it is carried to."""
    for column, image in enumerate(moved):
        one, other = sorted((first[column], first[image]))
        first[first == other] = one
