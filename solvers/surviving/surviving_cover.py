r"""A cover that asks to be met several times over, in several cases, and after a loss.

A set s serves element e a_gse times in case g; a selection S covers e in case g if its
sets serve it K times together. Elements weigh the same::

    minimise    |S|
    subject to  |covered_0(S \ {s})| >= W_0   for each s in S, where one may be lost
                |covered_0(S)| >= W_0         where none may
                |covered_g(S)| >= W_g         for each further case g
                F selected,   at most b_k sets of each kind k

and the same of each row set with a requirement of its own. It isn't a cover with needs:
what one set alone covers may be lost with it, as long as enough is left, and it is no
more than a row set of K + 1 that asks no single element to be covered twice.
Because a selection without any one of its sets meets W_0, any such selection has one
set more than a plain cover at least (unless the fixed ones suffice by themselves).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_Index = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class SurvivingCover:
    """Data of a surviving cover.

    Attributes:
        serves: How often each set serves each element in each case, (n_e, n_s) each.
        need: K, at least 1.
        required: Elements W_g to cover in each case, (n_g,).
        row_sets: Row set of each element, 0, 1, ..., shape (n_e,).
        floors: Elements to cover of each row set in each case, 0 for none, shape (n_g,
            n_r).
        losable: Whether any one set may be lost, in case 0.
        fixed: Sets that are in every selection.
        kinds: Kind of each set, shape (n_s,).
        stock: Sets of each kind that a selection may hold, (n_k,).

    Raises:
        ValueError: On wrong shapes, or a need below 1.
    """

    serves: tuple[NDArray[np.uint8], ...]
    need: int
    required: _Index
    row_sets: _Index
    floors: _Index
    losable: bool
    fixed: _Index
    kinds: _Index
    stock: _Index

    def __post_init__(self) -> None:
        n_g, shape = len(self.serves), self.serves[0].shape
        if len(shape) != 2 or any(case.shape != shape for case in self.serves):
            raise ValueError("serves must be matrices of one shape, one for each case")
        n_r = int(self.row_sets.max(initial=0)) + 1
        for name, value, expected in (
            ("required", self.required, (n_g,)),
            ("row_sets", self.row_sets, shape[:1]),
            ("kinds", self.kinds, shape[1:]),
        ):
            if value.shape != expected:
                raise ValueError(f"{name} must be {expected}, got {value.shape}")
        if self.floors.ndim != 2 or not self.floors.shape >= (n_g, n_r):
            raise ValueError(f"floors must be ({n_g}, {n_r}), got {self.floors.shape}")
        if not self.need >= 1:
            raise ValueError(f"need must be 1 or more, got {self.need}")

    @classmethod
    def of(
        cls,
        serves: Sequence[NDArray[np.uint8]],
        required: Sequence[int],
        *,
        need: int = 1,
        losable: bool = True,
        row_sets: _Index | None = None,
        floors: _Index | None = None,
        n_fixed: int = 0,
        kinds: _Index | None = None,
        stock: _Index | None = None,
    ) -> "SurvivingCover":
        """Return the cover; what isn't given asks for nothing, the first are fixed."""
        n_e, n_s = serves[0].shape
        rows = np.zeros(n_e, dtype=np.int64) if row_sets is None else row_sets
        n_r = int(rows.max(initial=0)) + 1
        kinds = np.zeros(n_s, dtype=np.int64) if kinds is None else kinds
        return cls(
            tuple(np.asarray(case, dtype=np.uint8) for case in serves),
            need,
            np.asarray(required, dtype=np.int64),
            rows,
            np.zeros((len(serves), n_r), np.int64) if floors is None else floors,
            losable,
            np.arange(n_fixed),
            kinds,
            np.full(int(kinds.max(initial=0)) + 1, n_s) if stock is None else stock,
        )

    @property
    def n_sets(self) -> int:
        """Number of sets."""
        return int(self.serves[0].shape[1])

    def losses(self, selected: _Index) -> list[tuple[int, _Index]]:
        """Return the case and the sets that are left, of each loss to be met."""
        first = [np.delete(selected, k) for k in range(len(selected))]
        if not self.losable or not first:
            first = [selected]
        return [
            *((0, left) for left in first),
            *((g, selected) for g in range(1, len(self.serves))),
        ]

    def covered(self, case: int, selected: _Index) -> NDArray[np.bool_]:
        """Return which elements sets cover in a case, shape (n_e,)."""
        served = self.serves[case][:, selected].sum(axis=1, dtype=np.int64)
        return np.asarray(served >= self.need)

    def lacking(self, selected: _Index) -> int:
        """Return how many elements are lacking, of all losses and row sets together."""
        return sum(
            int(self.short(case, self.by_row_set(self.covered(case, left))).sum())
            for case, left in self.losses(np.asarray(selected, dtype=np.int64))
        )

    def by_row_set(self, mask: NDArray[np.bool_]) -> _Index:
        """Return how many elements of a mask are of each row set, (n_r,)."""
        return np.bincount(self.row_sets[mask], minlength=self.floors.shape[1])

    def short(self, case: int, counts: _Index) -> _Index:
        """Return what counts of row sets, (n_r, ...), lack: floors, then the total."""
        floors = self.floors[case].reshape(-1, *[1] * (counts.ndim - 1))
        total = self.required[case] - counts.sum(axis=0)
        return np.clip(np.concatenate([floors - counts, total[None]]), 0, None)

    def in_stock(self, selected: _Index) -> bool:
        """Return whether the stock of every kind holds what is selected of it."""
        taken = np.bincount(self.kinds[selected], minlength=self.stock.size)
        return bool(np.all(taken <= self.stock))
