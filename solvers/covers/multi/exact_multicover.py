"""Whether K sets meet the requirements of several needs and row sets, exactly.

Branch and bound over columns, as ``exact_cover`` does for plain covers. A node has
chosen some sets; row i still needs n_i more, row set g still lacks q_g. It is refuted

* if the rows that r more sets can still complete weigh too little in a row set;
* if, for some lambda >= 0, the r dearest candidates pay less than the rows ask for at
  least (``relaxation``).

With two sets left all pairs are looked at: i and j complete the rows that need one more
and have either, and those that need two and have both,

    w_g(i, j) = g_i + g_j - sum_{n_e = 1} w_e a_ei a_ej + sum_{n_e = 2} w_e a_ei a_ej

in each row set, products of matrices of integers, exact whatever the BLAS.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from solvers.covers.bounds.lagrangian import ascend
from solvers.covers.bounds.reductions import ReducedCover
from solvers.covers.bounds.relaxation import least_service, rounding
from solvers.status import WorkBudget

_PAIR_BLOCK = 256
_DENSE_UNIT = 1.0 / 8.0
_CALL_UNITS = 2e5
_NODE_STEPS = 20
_MAX_DENSE = 200_000_000


@dataclass(frozen=True, eq=False)
class MultiSearch:
    """Answer of :func:`any_tuple`.

    Attributes:
        selected: K sets or fewer that meet the requirements, or None.
        complete: Whether the search space is exhausted.
    """

    selected: NDArray[np.int64] | None
    complete: bool


def any_tuple(
    cover: ReducedCover,
    n_sets: int,
    multipliers: NDArray[np.float64],
    budget: WorkBudget,
) -> MultiSearch:
    """Find at most K sets that meet the requirements, or show that there are none.

    Args:
        cover: The cover.
        n_sets: K, at least 1.
        multipliers: Row multipliers of at least 0 for the root, shape (n_e,).
        budget: Counted work.
    """
    if cover.n_sets * cover.weights.size > _MAX_DENSE:
        return MultiSearch(None, complete=False)
    search = _Search(cover, budget)
    search.visit(cover, np.arange(cover.n_sets), multipliers, n_sets, [])
    found = search.selected
    return MultiSearch(
        None if found is None else np.array(sorted(found), dtype=np.int64),
        complete=found is not None or not search.cut,
    )


class _Search:
    """Depth-first search; ends at the first selection that meets the requirements."""

    def __init__(self, cover: ReducedCover, budget: WorkBudget) -> None:
        self.budget = budget
        self.selected: list[int] | None = None
        self.cut = False
        self._rounding = rounding(cover.weights.size)

    def visit(
        self,
        node: ReducedCover,
        names: NDArray[np.int64],
        multipliers: NDArray[np.float64],
        r: int,
        chosen: list[int],
    ) -> None:
        """Settle one node: what is left of the cover once some sets are chosen.

        Args:
            node: The candidates and rows left.
            names: The candidates' indices in the whole cover.
            multipliers: Of the node's rows.
            r: Sets that may still be taken.
            chosen: Sets taken.
        """
        if not np.any(node.quotas > 0):
            self.selected = chosen
            return
        self.budget.spend(6.0 * node.entries + 20.0 * node.weights.size + _CALL_UNITS)
        node, multipliers = _completable(node, multipliers, r)
        if r == 0 or names.size == 0 or not node.reachable:
            return
        if r == 1 or names.size == 1:
            self._singles(node, names, chosen)
            return
        if self._refuted(node, multipliers, r):
            return
        if self.budget.exhausted:
            self.cut = True
            return
        if r == 2 or names.size == 2:
            self._pairs(node, names, chosen)
            return
        step = ascend(
            node,
            multipliers,
            self.budget,
            target=self._rounding * float(node.needs @ multipliers),
            n_sets=r,
            max_steps=_NODE_STEPS,
        )
        if not self._refuted(node, step.multipliers, r):
            self._children(node, names, step.multipliers, r, chosen)

    def _refuted(
        self, node: ReducedCover, multipliers: NDArray[np.float64], r: int
    ) -> bool:
        """Whether r sets can't pay what the rows ask for at least."""
        prices = np.sort(node.by_set @ multipliers)[::-1][:r].sum()
        asked = least_service(node, multipliers)
        return bool(prices * (1.0 + self._rounding) < asked * (1.0 - self._rounding))

    def _children(
        self,
        node: ReducedCover,
        names: NDArray[np.int64],
        multipliers: NDArray[np.float64],
        r: int,
        chosen: list[int],
    ) -> None:
        """Take each possible first column in turn, then never again."""
        prices = node.by_set @ multipliers
        asked = least_service(node, multipliers) * (1.0 - self._rounding)
        order = np.argsort(-prices, kind="stable")
        firsts = _must_take(node)[order]
        alive = np.ones(order.size, dtype=bool)
        for at in np.flatnonzero(firsts):
            alive[at] = False
            rest = order[alive]
            # Earlier columns are gone, so the dearest of the rest bound what is left.
            paid = prices[order[at]] + prices[rest[: r - 1]].sum()
            if self.selected is not None:
                return
            if paid * (1.0 + self._rounding) < asked:
                continue
            if self.budget.exhausted:
                self.cut = True
                return
            s = int(order[at])
            child, left = _taken(node, s, rest)
            self.visit(
                child, names[rest], multipliers[left], r - 1, [*chosen, int(names[s])]
            )

    def _singles(
        self, node: ReducedCover, names: NDArray[np.int64], chosen: list[int]
    ) -> None:
        """Settle a node to which one set may be added."""
        columns = np.zeros((node.weights.size, node.quotas.size))
        rows = np.flatnonzero(node.needs == 1)
        columns[rows, node.row_sets[rows]] = node.weights[rows]
        enough = np.all(np.asarray(node.by_set @ columns) >= node.quotas, axis=1)
        if np.any(enough):
            self.selected = [*chosen, int(names[int(np.argmax(enough))])]

    def _pairs(
        self, node: ReducedCover, names: NDArray[np.int64], chosen: list[int]
    ) -> None:
        """Settle a node to which two sets may be added."""
        dense = node.by_set.toarray()
        parts = [
            (float(quota), node.needs[rows], node.weights[rows], dense[:, rows])
            for g, quota in enumerate(node.quotas)
            if quota > 0
            for rows in [np.flatnonzero(node.row_sets == g)]
        ]
        n = names.size
        for start in range(0, n, _PAIR_BLOCK):
            if self.budget.exhausted:
                self.cut = True
                return
            lead = slice(start, start + _PAIR_BLOCK)
            enough = np.ones((len(range(*lead.indices(n))), n), dtype=bool)
            for quota, needs, weights, serves in parts:
                one, two = serves[:, needs == 1], serves[:, needs == 2]
                light, heavy = weights[needs == 1], weights[needs == 2]
                gains = one @ light
                both = (two[lead] * heavy) @ two.T - (one[lead] * light) @ one.T
                enough &= gains[lead, None] + gains + both >= quota
                self.budget.spend(2.0 * both.size * (4.0 + _DENSE_UNIT * needs.size))
            i, j = np.nonzero(enough)
            apart = i + start != j
            if np.any(apart):
                k = int(np.argmax(apart))
                pair = [int(names[i[k] + start]), int(names[j[k]])]
                self.selected = [*chosen, *pair]
                return


def _completable(
    node: ReducedCover, multipliers: NDArray[np.float64], r: int
) -> tuple[ReducedCover, NDArray[np.float64]]:
    """Leave out rows that r of the candidates can't complete."""
    servers = np.bincount(node.by_set.indices, minlength=node.weights.size)
    keep = node.needs <= np.minimum(servers, r)
    if np.all(keep):
        return node, multipliers
    return _with_rows(node, keep), multipliers[keep]


def _with_rows(node: ReducedCover, keep: NDArray[np.bool_]) -> ReducedCover:
    """Return a node over some of its rows."""
    by_row = node.by_row[keep]
    return replace(
        node,
        by_row=by_row,
        by_set=by_row.T.tocsr(),
        weights=node.weights[keep],
        needs=node.needs[keep],
        row_sets=node.row_sets[keep],
    )


def _must_take(node: ReducedCover) -> NDArray[np.bool_]:
    """Return which candidates one must be taken from: those of the scarcest row.

    A row is indispensable if its row set falls short without it; where none is, any
    candidate may come first.
    """
    spare = (node.totals - node.quotas)[node.row_sets]
    indispensable = np.flatnonzero(node.weights > spare)
    firsts = np.ones(node.kept.size, dtype=bool)
    if indispensable.size == 0:
        return firsts
    servers = np.diff(node.by_row.indptr)[indispensable]
    row = int(indispensable[int(np.argmin(servers))])
    start, stop = node.by_row.indptr[row : row + 2]
    firsts[:] = False
    firsts[node.by_row.indices[start:stop]] = True
    return firsts


def _taken(
    node: ReducedCover, s: int, rest: NDArray[np.int64]
) -> tuple[ReducedCover, NDArray[np.bool_]]:
    """Return a node once set s is chosen and some sets remain, and its rows."""
    needs = node.needs.copy()
    needs[node.members(s)] -= 1
    keep = needs > 0
    done = node.by_row_set(np.where(keep, 0.0, node.weights))
    left = _with_rows(replace(node, needs=needs), keep)
    by_row = left.by_row[:, rest]
    child = replace(
        left,
        by_row=by_row,
        by_set=by_row.T.tocsr(),
        quotas=np.maximum(node.quotas - done, 0.0),
        costs=node.costs[rest],
        kept=node.kept[rest],
    )
    return child, keep
