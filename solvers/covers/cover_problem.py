"""What a cover asks: rows, sets, how often a row is needed, how much weight must be.

Element e is covered if at least r_e of the selected sets serve it; row sets G_1, ...
share the elements among them and each asks for a weight of its own::

    minimise    sum_s c_s x_s
    subject to  sum_s a_es x_s >= r_e y_e            for each element e
                sum_{e in G_g} w_e y_e >= W_g        for each row set g
                sum_{s in K_k} x_s <= b_k               for each kind of set k
                x_s = 1 for s fixed,   x, y in {0, 1}

With a weight W required of all rows together, the W_g are floors beside it::

        sum_e w_e y_e >= W

W and W_g are absolute weights over frozen rows: a share of "what can be covered" would
change its meaning with the sets on offer. r_e = 2 keeps what it covers when any set is
lost; several row sets are several objects on one rig, or regions of one. Kinds of sets
are models of devices, of each of which a stock holds so many.
"""

from dataclasses import dataclass, field
from typing import cast

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from solvers.checked_numbers import (
    check_weights,
    real_numbers,
    set_names,
    whole_numbers,
)

# Limits of one problem, checked before anything is allocated.
MAX_ENTRIES = 200_000_000
MAX_ONES = 40_000_000
MAX_ROWS = 2_000_000
MAX_SETS = 100_000
# Beyond this a need can't be told from a mistake, and labels would fill the memory.
_MAX_NEED = 1_000
_MAX_LABELS = 10_000
# What is within this and its inverse neither vanishes nor overflows.
_LEAST_COST = 1e-100


@dataclass(frozen=True, eq=False)
class CoverProblem:
    """Data of a partial set cover.

    Attributes:
        covers: Whether element e is served by set s, sparse or dense, boolean or 0
            and 1, shape (n_e, n_s); kept as CSR.
        weights: Weight of each element, at least 0, typically an area in [m²],
            together 0 or from 1e-250 to 1e250; default ones.
        costs: Cost of each set, positive, from 1e-100 to 1e100; default ones.
        min_coverage: Fraction of the weight of each row set to cover, in (0, 1], one
            number or one for each row set; ignored if ``required_weight`` is given.
        required_weight: Weight W_g to cover in each row set, in the unit of the
            weights; one number where there is one row set. Kept with shape (n_g,).
        needs: Selected sets r_e that must serve an element before it counts, at least
            1; one number or shape (n_e,). Default 1.
        row_sets: Row set of each element, 0, 1, ... n_g - 1, shape (n_e,); default one
            row set.
        required_total: Weight W to cover of all elements together; then
            ``required_weight`` are floors of row sets, 0 for none. None: each row set
            has its own requirement and there is no other.
        fixed: Sets that are in every selection (devices that stand already).
        kinds: Kind of each set, 0, 1, ... n_k - 1, shape (n_s,); default one kind.
        stock: Sets b_k of each kind that a selection may hold, fixed ones included,
            shape (n_k,); default any number. With a stock that binds, costs are all the
            same and every need is 1.

    Raises:
        ValueError: On wrong shapes, negative or non-finite numbers, unknown sets, or a
            matrix of more than ``MAX_ENTRIES`` entries, ``MAX_ONES`` ones, ``MAX_ROWS``
            rows or ``MAX_SETS`` columns.
    """

    covers: sparse.csr_array
    weights: NDArray[np.float64] = field(default=None)  # type: ignore[assignment]
    costs: NDArray[np.float64] = field(default=None)  # type: ignore[assignment]
    min_coverage: float | NDArray[np.float64] = 1.0
    required_weight: NDArray[np.float64] = field(default=None)  # type: ignore[assignment]
    needs: NDArray[np.int64] = field(default=1)  # type: ignore[assignment]
    row_sets: NDArray[np.int64] = field(default=None)  # type: ignore[assignment]
    required_total: float | None = None
    fixed: NDArray[np.int64] = field(default=())  # type: ignore[assignment]
    kinds: NDArray[np.int64] = field(default=None)  # type: ignore[assignment]
    stock: NDArray[np.int64] = field(default=None)  # type: ignore[assignment]

    def __post_init__(self) -> None:
        covers = _boolean(self.covers)
        n_e, n_s = cast("tuple[int, int]", covers.shape)
        weights = _vector("weights", self.weights, n_e)
        check_weights(weights)
        costs = _vector("costs", self.costs, n_s)
        if not np.all((costs >= _LEAST_COST) & (costs <= 1.0 / _LEAST_COST)):
            raise ValueError(
                "costs must be finite and positive, from "
                f"{_LEAST_COST:g} to {1.0 / _LEAST_COST:g}"
            )
        row_sets = _labels("row_sets", self.row_sets, n_e)
        kinds = _labels("kinds", self.kinds, n_s)
        totals = _sums(weights, row_sets)
        whole = self.required_total
        if whole is not None and not 0.0 <= whole < np.inf:
            raise ValueError(
                f"required_total must be finite and at least 0, got {whole}"
            )
        values = {
            "covers": covers,
            "weights": weights,
            "costs": costs,
            "required_weight": _required(
                self.required_weight, self.min_coverage, totals
            ),
            "needs": _needs(self.needs, n_e),
            "row_sets": row_sets,
            "fixed": set_names("fixed", self.fixed, n_s),
            "kinds": kinds,
            "stock": _stock(self.stock, kinds),
        }
        for name, value in values.items():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False
            object.__setattr__(self, name, value)
        _check_stock(self)

    def by_row_set(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the sums of elements' values over each row set, shape (n_g,)."""
        return _sums(values, self.row_sets, self.n_row_sets)

    @property
    def n_row_sets(self) -> int:
        """Number of row sets."""
        return self.required_weight.size

    @property
    def total_weight(self) -> float:
        """Weight of all elements."""
        return float(self.weights.sum())

    @property
    def unit_costs(self) -> bool:
        """Whether every set costs the same, so that counting decides."""
        return bool(np.all(self.costs == self.costs[:1]))

    def in_stock(self, selected: NDArray[np.int64]) -> bool:
        """Return whether the stock of every kind holds what is selected of it."""
        taken = np.bincount(self.kinds[selected], minlength=self.stock.size)
        return bool(np.all(taken <= self.stock))

    def covered_weights(self, selected: ArrayLike) -> NDArray[np.float64]:
        """Return the weight that known sets cover in each row set, shape (n_g,)."""
        index = set_names("selected", selected, self.costs.size)
        # A selection is a set: a name given twice counts once.
        served = np.asarray(self.covers[:, index].sum(axis=1)).ravel()
        covered = np.where(served >= self.needs, self.weights, 0.0)
        return self.by_row_set(covered)

    def covered_weight(self, selected: ArrayLike) -> float:
        """Return the weight that a selection covers, all row sets together."""
        return float(self.covered_weights(selected).sum())


def _sums(
    values: NDArray[np.float64], row_sets: NDArray[np.int64], n: int = 0
) -> NDArray[np.float64]:
    return np.bincount(row_sets, weights=values, minlength=max(n, 1)).astype(np.float64)


def _boolean(numbers: object) -> sparse.csr_array:
    matrix = numbers if sparse.issparse(numbers) else np.asarray(numbers)
    shape = matrix.shape  # type: ignore[union-attr]
    if len(shape) != 2:
        raise ValueError(f"covers must be a matrix, got shape {shape}")
    if not (shape[0] <= MAX_ROWS and shape[1] <= MAX_SETS):
        raise ValueError(
            f"covers is {shape[0]} x {shape[1]}, more than the limit of {MAX_ROWS} "
            f"samples and {MAX_SETS} candidates: use fewer"
        )
    if not shape[0] * shape[1] <= MAX_ENTRIES:
        raise ValueError(
            f"covers has {shape[0]} x {shape[1]} entries, more than the limit of "
            f"{MAX_ENTRIES}: use fewer samples or candidates"
        )
    ones = int(matrix.nnz if sparse.issparse(matrix) else np.count_nonzero(matrix))  # type: ignore[union-attr]
    if not ones <= MAX_ONES:
        raise ValueError(
            f"covers has {ones} nonzero entries, more than the limit of {MAX_ONES}: "
            "use fewer samples or candidates"
        )
    rows = sparse.csr_array(matrix)
    if not rows.has_canonical_format:
        rows = rows.copy()
        rows.sum_duplicates()
    if rows.dtype != bool and not np.all((rows.data == 0) | (rows.data == 1)):
        raise ValueError("covers must be boolean or hold only 0 and 1")
    rows = cast("sparse.csr_array", rows.astype(bool))
    rows.eliminate_zeros()
    return rows


def _vector(name: str, numbers: ArrayLike | None, n: int) -> NDArray[np.float64]:
    values = np.ones(n) if numbers is None else real_numbers(name, numbers)
    if values.shape != (n,):
        raise ValueError(f"{name} must be ({n},), got {values.shape}")
    return values


def _needs(numbers: ArrayLike, n: int) -> NDArray[np.int64]:
    needs = whole_numbers("needs", numbers)
    if needs.shape not in ((), (n,)):
        raise ValueError(f"needs must be one number or ({n},), got {needs.shape}")
    if not np.all((needs >= 1) & (needs <= _MAX_NEED)):
        raise ValueError(f"needs must be from 1 to {_MAX_NEED}")
    return np.broadcast_to(needs, (n,)).copy()


def _labels(name: str, numbers: ArrayLike | None, n: int) -> NDArray[np.int64]:
    labels = (
        np.zeros(n, dtype=np.int64) if numbers is None else whole_numbers(name, numbers)
    )
    if labels.shape != (n,):
        raise ValueError(f"{name} must be ({n},), got {labels.shape}")
    if not np.all((labels >= 0) & (labels < _MAX_LABELS)):
        raise ValueError(f"{name} must be from 0 to {_MAX_LABELS - 1}")
    return labels


def _stock(numbers: ArrayLike | None, kinds: NDArray[np.int64]) -> NDArray[np.int64]:
    n_kinds = int(kinds.max(initial=0)) + 1
    if numbers is None:
        return np.full(n_kinds, kinds.size)
    stock = whole_numbers("stock", numbers)
    if stock.shape != (n_kinds,) or not np.all(stock >= 0):
        raise ValueError(
            f"stock must be ({n_kinds},), at least 0 for each kind, got {numbers}"
        )
    return np.minimum(stock, kinds.size)


def _check_stock(problem: CoverProblem) -> None:
    kinds, stock = problem.kinds, problem.stock
    if not problem.in_stock(problem.fixed):
        raise ValueError(
            f"fixed sets are more than a stock of {stock.tolist()} of their kinds holds"
        )
    if np.all(stock >= np.bincount(kinds, minlength=stock.size)):
        return
    if not problem.unit_costs or np.any(problem.needs > 1):
        raise ValueError("a stock that binds takes equal costs and needs of 1")


def _required(
    numbers: ArrayLike | None, share: ArrayLike, totals: NDArray[np.float64]
) -> NDArray[np.float64]:
    if numbers is None:
        shares = real_numbers("min_coverage", share)
        if not np.all((shares > 0.0) & (shares <= 1.0)):
            raise ValueError(f"min_coverage must be in (0, 1], got {share}")
        if shares.shape not in ((), (1,), totals.shape):
            raise ValueError(
                f"min_coverage must be one number or ({totals.size},), one for each "
                f"row set, got {shares.shape}"
            )
        return shares * totals
    required = np.atleast_1d(real_numbers("required_weight", numbers))
    if not np.all((required >= 0.0) & np.isfinite(required)):
        raise ValueError(
            f"required_weight must be finite and at least 0, got {numbers}"
        )
    if required.shape != totals.shape:
        raise ValueError(
            f"required_weight must be ({totals.size},), one for each row set, got "
            f"{required.shape}"
        )
    return required
