"""Exchanges of one set, and which of them leaves least lacking after every loss.

All sets that may come in, for each that may go, are judged at once. An element that the
rest serves j < K times is won by a set that serves it K - j times or more, so with 0/1
matrices A_l = [a >= l] and masks M_j = [served = j]::

    won = sum over l of  M_(K-l)^T A_l

counts what each set wins in each loss.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .surviving_cover import SurvivingCover

_Index = NDArray[np.int64]
# Lacking elements, then what the loss that leaves least to spare has over, negated.
Rank = tuple[int, int]


@dataclass(frozen=True, eq=False)
class Exchanges:
    """A surviving cover with its matrices laid out for exchanges."""

    cover: SurvivingCover

    @cached_property
    def _groups(self) -> list[_Index]:
        """Elements of each row set."""
        n_r = self.cover.floors.shape[1]
        return [np.flatnonzero(self.cover.row_sets == r) for r in range(n_r)]

    @cached_property
    def _columns(self) -> list[NDArray[np.int16]]:
        """How often each set serves each element in each case, (n_s, n_e)."""
        return [np.ascontiguousarray(s.T, dtype=np.int16) for s in self.cover.serves]

    @cached_property
    def _levels(self) -> list[list[list[NDArray[np.float32]]]]:
        """A_l of each case, level and row set; sums of ones are exact in float32."""
        return [
            [
                [(case[rows] >= level).astype(np.float32) for rows in self._groups]
                for level in range(1, self.cover.need + 1)
            ]
            for case in self.cover.serves
        ]

    def rank(self, selected: _Index) -> Rank:
        """Return how good a selection is, smaller if better."""
        cover, spare = self.cover, np.inf
        lacking = 0
        for case, left in cover.losses(selected):
            counts = cover.by_row_set(cover.covered(case, left))
            lacking += int(cover.short(case, counts).sum())
            spare = min(spare, int(counts.sum()) - int(cover.required[case]))
        return lacking, -int(spare)

    def with_one_more(self, rests: Sequence[_Index]) -> tuple[_Index, _Index]:
        """Return both parts of the rank of each of k selections with each other set.

        Selections of as many sets each; shape (k, n_s).
        """
        cover, k = self.cover, len(rests)
        lacking = np.zeros((k, cover.n_sets), dtype=np.int64)
        spare = np.full((k, cover.n_sets), np.iinfo(np.int64).max)

        def note(case: int, counts: _Index) -> None:
            """Take in counts of row sets after a loss, (n_r, k, n_s or 1)."""
            nonlocal lacking, spare
            lacking = lacking + cover.short(case, counts).sum(axis=0)
            spare = np.minimum(spare, counts.sum(axis=0) - cover.required[case])

        for case in range(len(cover.serves)):
            columns = self._columns[case]
            served = np.stack([columns[rest].sum(axis=0) for rest in rests])
            if case or not cover.losable:
                note(case, self._won(case, served))
                continue
            note(case, self._met(served)[:, :, None])
            for lost in range(len(rests[0])):
                gone = np.stack([columns[rest[lost]] for rest in rests])
                note(case, self._won(case, served - gone))
        return lacking, -spare

    def _met(self, served: NDArray[np.int16]) -> _Index:
        """Elements covered in each state of service, (n_r, k)."""
        met = served >= self.cover.need
        return np.stack([met[:, rows].sum(axis=1) for rows in self._groups])

    def _won(self, case: int, served: NDArray[np.int16]) -> _Index:
        """Elements covered by each set with each state of service, (n_r, k, n_s)."""
        need, levels = self.cover.need, self._levels[case]
        met = self._met(served)
        counts = np.empty((len(met), len(served), self.cover.n_sets), dtype=np.int64)
        for r, rows in enumerate(self._groups):
            won = np.zeros(counts.shape[1:], dtype=np.float32)
            for level in range(1, need + 1):
                missing = (served[:, rows] == need - level).astype(np.float32)
                won += missing @ levels[level - 1][r]
            counts[r] = met[r][:, None] + np.rint(won).astype(np.int64)
        return counts

    def best_addition(self, rest: _Index) -> tuple[Rank, _Index] | None:
        """Return the best selection of these and another set that stock allows."""
        return self._best([rest])

    def best_exchange(self, chosen: _Index) -> tuple[Rank, _Index] | None:
        """Return the best selection with another set in the place of one."""
        places = np.flatnonzero(~np.isin(chosen, self.cover.fixed))
        return self._best([np.delete(chosen, k) for k in places])

    def _best(self, rests: Sequence[_Index]) -> tuple[Rank, _Index] | None:
        if not len(rests):
            return None
        cover = self.cover
        allowed = np.ones((len(rests), cover.n_sets), dtype=bool)
        for row, rest in zip(allowed, rests, strict=True):
            taken = np.bincount(cover.kinds[rest], minlength=cover.stock.size)
            row &= (cover.stock - taken)[cover.kinds] > 0
            row[rest] = False
        if not allowed.any():
            return None
        lacking, over = self.with_one_more(rests)
        row, into = np.nonzero(allowed)
        order = np.lexsort((into, over[row, into], lacking[row, into]))[0]
        k, best = int(row[order]), int(into[order])
        rank = int(lacking[k, best]), int(over[k, best])
        return rank, np.append(rests[k], best)
