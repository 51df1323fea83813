"""What a cover by pairs asks: which sets see an element, and which of them go together.

Element e has a graph E_e over the sets V_e that see it: {i, j} is an edge where the two
measure the element together, {i} alone a loop where one does. A selection X covers e if
it holds an edge of E_e, and at least k_e sets that see e::

    minimise    |X|
    subject to  sum_e w_e y_e >= W,   y_e = 1 only if  |X n V_e| >= k_e  and
                {i, j} in E_e for some i, j in X (perhaps i = j),   F in X

X holds an edge of E_e where it meets the complement of each independent set of E_e. Of
these the singletons give "two sets of V_e", which leaves out what the pairs' angles
and errors ask: the program that `pair_bounds` relaxes to.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from solvers.bit_rows import check_padding, pack_rows, unpack_rows, words_for
from solvers.checked_numbers import (
    check_weights,
    real_numbers,
    set_names,
    whole_numbers,
)

# Bits of all pairs over all elements: half a gigabyte.
MAX_PAIR_BITS = 4_000_000_000
_MAX_VIEWS = 1_000

# Of set i: whether it and set j cover element e together, shape (n_s, n_e).
Together = Callable[[int], NDArray[np.bool_]]


@dataclass(frozen=True, eq=False)
class PairCoverProblem:
    """Data of a partial cover by pairs of sets.

    Attributes:
        sees: Whether set s sees element e, sparse or dense, boolean or 0 and 1, shape
            (n_e, n_s); kept dense.
        good: Bit rows of which element sets i and j cover together, on the diagonal
            set i alone, symmetric, shape (n_s, n_s, n_words), from `packed_pairs`;
            none where one of them doesn't see it.
        weights: Weight of each element, at least 0; default ones.
        min_coverage: Fraction of the weight of all elements to cover, in (0, 1];
            ignored if ``required_weight`` is given.
        required_weight: Weight W to cover.
        views: Selected sets k_e that must see an element, at least 1; one number or
            shape (n_e,). Default 1: what a pair asks by itself.
        fixed: Sets that are in every selection.

    Raises:
        ValueError: On wrong shapes, negative or non-finite numbers, unknown sets, pairs
            that aren't symmetric or that don't see what they cover, or more than
            ``MAX_PAIR_BITS`` bits of pairs.
    """

    sees: NDArray[np.bool_]
    good: NDArray[np.uint64]
    weights: NDArray[np.float64] = field(default=None)  # type: ignore[assignment]
    min_coverage: float = 1.0
    required_weight: float = field(default=None)  # type: ignore[assignment]
    views: NDArray[np.int64] = field(default=1)  # type: ignore[assignment]
    fixed: NDArray[np.int64] = field(default=())  # type: ignore[assignment]

    def __post_init__(self) -> None:
        sees = _dense(self.sees)
        n_e, n_s = sees.shape
        weights = np.ones(n_e)
        if self.weights is not None:  # pyright: ignore[reportUnnecessaryComparison]
            weights = real_numbers("weights", self.weights)
        if weights.shape != (n_e,):
            raise ValueError(f"weights must be ({n_e},), got {weights.shape}")
        check_weights(weights)
        values = {
            "sees": sees,
            "good": _checked_pairs(np.asarray(self.good), sees),
            "weights": weights,
            "views": _views(self.views, n_e),
            "fixed": set_names("fixed", self.fixed, n_s),
        }
        for name, value in values.items():
            value.flags.writeable = False
            object.__setattr__(self, name, value)
        required = _required(self.required_weight, self.min_coverage, weights)
        object.__setattr__(self, "required_weight", required)

    @property
    def n_sets(self) -> int:
        """Number of sets n_s."""
        return self.sees.shape[1]

    def pairs_of(self, s: int) -> NDArray[np.bool_]:
        """Return with which set which element is covered by set s, (n_s, n_e)."""
        return unpack_rows(self.good[s], len(self.sees))

    def covered(self, selected: ArrayLike) -> NDArray[np.bool_]:
        """Return which elements a selection covers, shape (n_e,)."""
        chosen = set_names("selected", selected, self.n_sets)
        words = np.zeros(self.good.shape[2], dtype=np.uint64)
        for s in chosen:
            words |= np.bitwise_or.reduce(self.good[s][chosen], axis=0)
        paired = unpack_rows(words[None], len(self.sees))[0]
        return paired & (self.sees[:, chosen].sum(axis=1) >= self.views)

    def covered_weight(self, selected: ArrayLike) -> float:
        """Return the weight that a selection covers."""
        return float(self.weights[self.covered(selected)].sum())


def packed_pairs(
    together: Together, n_sets: int, n_elements: int
) -> NDArray[np.uint64]:
    """Return the bit rows of a problem's pairs, (n_s, n_s, n_words).

    ``together(i)`` says with which set j >= i set i covers which element, (n_s, n_e);
    its rows before i aren't read.
    """
    _check_size(n_sets, n_elements)
    good = np.zeros((n_sets, n_sets, words_for(n_elements)), dtype=np.uint64)
    for i in range(n_sets):
        good[i, i:] = pack_rows(np.asarray(together(i), dtype=bool)[i:])
        good[i:, i] = good[i, i:]
    return good


def _check_size(n_sets: int, n_elements: int) -> None:
    bits = n_sets * n_sets * words_for(n_elements) * 64
    if not bits <= MAX_PAIR_BITS:
        raise ValueError(
            f"the pairs of {n_sets} sets over {n_elements} elements take {bits:,} "
            f"bits, more than the limit of {MAX_PAIR_BITS:,}: use fewer candidates or "
            f"samples"
        )


def _dense(numbers: object) -> NDArray[np.bool_]:
    dense = np.asarray(
        numbers.toarray() if sparse.issparse(numbers) else numbers  # type: ignore[union-attr]
    )
    if dense.ndim != 2:
        raise ValueError(f"sees must be a matrix, got shape {dense.shape}")
    _check_size(dense.shape[1], dense.shape[0])
    if dense.dtype != bool and not np.all((dense == 0) | (dense == 1)):
        raise ValueError("sees must be boolean or hold only 0 and 1")
    return dense.astype(bool)


def _checked_pairs(
    good: NDArray[np.uint64], sees: NDArray[np.bool_]
) -> NDArray[np.uint64]:
    n_e, n_s = sees.shape
    shape = (n_s, n_s, words_for(n_e))
    if good.dtype != np.uint64 or good.shape != shape:
        raise ValueError(
            f"good must be bit rows {shape} from packed_pairs, got {good.dtype} "
            f"{good.shape}"
        )
    seen = pack_rows(sees.T)
    for i in range(n_s):
        if not np.array_equal(good[i], good[:, i]):
            raise ValueError(f"good must be symmetric, the pairs of set {i} aren't")
        check_padding(good[i], n_e)
        if np.any(good[i] & ~(seen[i] & seen)):
            raise ValueError(f"a pair of set {i} covers what one of them doesn't see")
    return good.copy()


def _views(numbers: ArrayLike, n: int) -> NDArray[np.int64]:
    views = whole_numbers("views", numbers)
    if views.shape not in ((), (n,)):
        raise ValueError(f"views must be one number or ({n},), got {views.shape}")
    if not np.all((views >= 1) & (views <= _MAX_VIEWS)):
        raise ValueError(f"views must be from 1 to {_MAX_VIEWS}")
    return np.broadcast_to(views, (n,)).copy()


def _required(
    number: float | None, share: float, weights: NDArray[np.float64]
) -> float:
    if number is not None:
        required = float(number)
        if not 0.0 <= required < np.inf:
            raise ValueError(
                f"required_weight must be finite and at least 0, got {required}"
            )
        return required
    if not 0.0 < share <= 1.0:
        raise ValueError(f"min_coverage must be in (0, 1], got {share}")
    return float(share * weights.sum())
