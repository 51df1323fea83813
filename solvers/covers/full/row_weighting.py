"""Full covers by exchange: rows that stay open grow heavier until a set is moved there.

With row weights v and the K sets of a selection S, n_e of them over row e::

    gain_j = sum_{e: n_e = 0} v_e a_ej,      loss_i = sum_{e: n_e = 1} v_e a_ei

A step gives up the set of least loss, draws an open row, takes the set over it of most
gain, and adds one to the weight of every row still open. Neither is kept current:
losses are one pass over the rows, gains are asked only for the sets over one row.
Weights are integers and ties go to what stood still longest, then to the lowest index.

References:
    Gao, Weise and Li, "An efficient local search heuristic with row weighting for the
    unicost set covering problem", European Journal of Operational Research 246, 2015.
"""

import numpy as np
from numpy.typing import NDArray

from solvers.status import WorkBudget

# Units of work of a step: the calls, and a row's share of its passes.
_UNITS_PER_STEP = 4e4
_UNITS_PER_ROW = 50.0
# A weight counts as this many steps of standing still: integers below 2^53.
_AGES = 2.0**27
_MAX_TOTAL = 2.0**25
_DRAWS = 4096


class RowWeighting:
    """Search for a selection that covers every row, of rows that may become more.

    Attributes:
        chosen: Selected sets, shape (k,).
        weights: Integer-valued weight of each row, at least 1, shape (n_e,).
        open_rows: Rows that no selected set covers, increasing.
    """

    def __init__(
        self,
        covers: NDArray[np.bool_],
        chosen: NDArray[np.int64],
        *,
        seed: int,
    ) -> None:
        n_sets = covers.shape[1]
        self._rng = np.random.default_rng(seed)
        self._step = 0
        # When a set last came or went, and when the number over a row last changed.
        self._moved = np.zeros(n_sets)
        self._left = np.full(n_sets, -1.0)
        self.weights = np.empty(0)
        self._changed = np.empty(0)
        self._dense = np.empty((0, n_sets))
        self._rows = [np.empty(0, dtype=np.int64)] * n_sets
        self._sets: list[NDArray[np.int64]] = []
        self.chosen = np.array(chosen, dtype=np.int64)
        self.add_rows(covers)

    def add_rows(self, covers: NDArray[np.bool_]) -> None:
        """Take in rows, shape (n, n_s), of weight 1."""
        before, after = len(self._sets), len(self._sets) + len(covers)
        if after > len(self._dense):
            # Room for as many again: rows come few at a time.
            grown = np.empty((2 * after, covers.shape[1]))
            grown[:before] = self._dense[:before]
            self._dense = grown
        self._dense[before:after] = covers
        self._sets += [np.flatnonzero(row) for row in covers]
        for s in np.flatnonzero(covers.any(axis=0)):
            rows = before + np.flatnonzero(covers[:, s])
            self._rows[s] = np.concatenate([self._rows[s], rows])
        self.weights = np.concatenate([self.weights, np.ones(len(covers))])
        self._changed = np.concatenate(
            [self._changed, np.full(len(covers), self._step)]
        )
        self.select(self.chosen)

    def select(self, chosen: NDArray[np.int64]) -> None:
        """Replace the selection; the weights stay."""
        self.chosen = np.array(chosen, dtype=np.int64)
        self._counts = np.zeros(len(self._sets), dtype=np.int64)
        # Sum of the positions of the sets over a row: its owner, where there's one.
        self._owners = np.zeros(len(self._sets), dtype=np.int64)
        for position, s in enumerate(self.chosen):
            self._counts[self._rows[s]] += 1
            self._owners[self._rows[s]] += position
        self.open_rows = np.flatnonzero(self._counts == 0)

    def losses(self) -> NDArray[np.float64]:
        """Return the weight that each selected set covers alone, shape (k,)."""
        alone = (self._counts == 1).nonzero()[0]
        owners, n_chosen = self._owners[alone], self.chosen.size
        sums = np.bincount(owners, self.weights[alone], minlength=n_chosen)
        return sums.astype(np.float64, copy=False)

    def drop(self) -> None:
        """Give up the set of least loss."""
        key = self.losses() * _AGES + self._moved[self.chosen]
        self.select(np.delete(self.chosen, int(np.argmin(key))))

    def search(self, max_steps: int, budget: WorkBudget) -> bool:
        """Exchange sets until every row is covered; return whether that is so."""
        counts, owners, weights = self._counts, self._owners, self.weights
        chosen, moved, left = self.chosen, self._moved, self._left
        changed, dense = self._changed, self._dense
        rows_of, sets_of = self._rows, self._sets
        cost = _UNITS_PER_STEP + _UNITS_PER_ROW * len(counts)
        fresh, draws = -1, self._rng.random(_DRAWS)
        for i in range(max_steps):
            if self.open_rows.size == 0 or chosen.size == 0:
                break
            if i % 64 == 0:
                if budget.exhausted:
                    break
                if self._step >= _AGES - 64:
                    self._forget_ages()
                budget.spend(64 * cost)
            draw = i % _DRAWS
            if draw == 0 and i:
                draws = self._rng.random(_DRAWS)
                self._relax_weights()
            self._step += 1

            key = self.losses() * _AGES + moved[chosen]
            if fresh >= 0 and chosen.size > 1:
                key[fresh] = np.inf
            position = int(key.argmin())
            s = chosen[position]
            rows = rows_of[s]
            counts[rows] -= 1
            owners[rows] -= position
            changed[rows] = moved[s] = left[s] = self._step

            opened = (counts == 0).nonzero()[0]
            sets = sets_of[opened[int(draws[draw] * opened.size)]]
            gain = weights[opened] @ dense[opened[:, None], sets]
            key = gain * _AGES - moved[sets]
            s = sets[int(key.argmax())]
            # A set comes back only once something changed where it would stand.
            while changed[rows_of[s]].max() <= left[s] and key.max() > -np.inf:
                key[key.argmax()] = -np.inf
                s = sets[int(key.argmax())]
            rows = rows_of[s]
            chosen[position] = s
            counts[rows] += 1
            owners[rows] += position
            changed[rows] = moved[s] = self._step
            fresh = position
            self.open_rows = opened[counts[opened] == 0]
            weights[self.open_rows] += 1.0
        return self.open_rows.size == 0

    def _forget_ages(self) -> None:
        self._step = 0
        self._moved[:] = self._changed[:] = 0.0
        self._left[:] = -1.0

    def _relax_weights(self) -> None:
        """Halve the weights before sums of them times an age are inexact."""
        if self.weights.sum() > _MAX_TOTAL:
            np.maximum(np.floor(0.5 * self.weights), 1.0, out=self.weights)
