"""What must be served, in whole numbers, and the bounds that multipliers prove.

Row i weighs w_i, is served iff r_i devices serve it, and belongs to one row set g::

    y_i = 1  iff  #{k : pose k serves i} >= r_i,    sum_{i in g} w_i y_i >= W_g

For any lambda >= 0, a pose in a cell with rows S serves lambda(S) at most, and another
pose in the same cell no more than that again. With M the largest lambda(S) of cells
that hold all poses together, K poses satisfy::

    K M >= sum_k lambda(S_k) >= sum_i lambda_i r_i y_i >= need(lambda)
    need(lambda) = sum_g min {sum lambda_i r_i y_i : w y >= W_g, 0 <= y <= 1}

Where W is required of all rows together and the W_g are floors beside it, need(lambda)
fills each set up to its floor from its cheapest rows, then W from the cheapest of the
rest. With t the price of a unit of W and P_g >= t of one of W_g, it is at least::

    t (W - sum_g W_g) + sum_g (P_g W_g - sum_{i in g} max(0, P_g w_i - lambda_i r_i))

so K >= need / M, and their weight is at most max {w y : sum lambda_i r_i y_i <= K M}.
M is the largest, never a sum over different cells: a cell may be used again.

Both knapsacks are evaluated through their duals, with one rational price each, in
integers: weights and multipliers are integers below 2^52, the rest is Python's own.
"""

from dataclasses import dataclass, field
from fractions import Fraction
from typing import cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from solvers.checked_numbers import (
    WEIGHT_SLACK,
    check_weights,
    real_numbers,
    whole_weights,
)

# Of rows; the tables of row weights take 256 bytes a row.
MAX_ROWS = 1_000_000
_BITS = 51


@dataclass(frozen=True, eq=False)
class CellProblem:
    """Rows to be served by poses that may stand anywhere.

    Attributes:
        weights: Weight of each row, at least 0, typically an area in [m²], (n_rows,).
        required_weight: Weight to serve in each row set, one number or shape
            (n_sets,); an absolute weight, in the unit of the weights.
        needs: Devices that must serve a row before it counts, default 1,
            shape (n_rows,); 0 where fixed devices serve it already.
        row_sets: Number of each row's set, default 0, shape (n_rows,). Who wants a row
            in two sets gives it twice.
        required_total: Weight to serve of all rows together; then `required_weight` are
            floors of row sets. None: there is no such requirement.

    Raises:
        ValueError: On wrong shapes, negative or non-finite numbers.
    """

    weights: NDArray[np.float64]
    required_weight: NDArray[np.float64]
    needs: NDArray[np.int64] = field(default=None)  # type: ignore[assignment]
    row_sets: NDArray[np.int64] = field(default=None)  # type: ignore[assignment]
    required_total: float | None = None

    def __post_init__(self) -> None:
        weights = real_numbers("weights", self.weights)
        if weights.ndim != 1 or not 1 <= weights.size <= MAX_ROWS:
            raise ValueError(
                f"weights must be a vector of 1 to {MAX_ROWS} rows, got shape "
                f"{weights.shape}"
            )
        required = real_numbers("required_weight", self.required_weight).reshape(-1)
        check_weights(weights)
        if not np.all((required >= 0.0) & np.isfinite(required)):
            raise ValueError("required_weight must be finite and at least 0")
        whole = self.required_total
        if whole is not None and not 0.0 <= whole < np.inf:
            raise ValueError("required_total must be finite and at least 0")
        needs = _counts("needs", self.needs, weights.size, 1)
        row_sets = _counts("row_sets", self.row_sets, weights.size, 0)
        if not np.all(row_sets < required.size):
            raise ValueError(
                f"row_sets names set {int(row_sets.max())}, but required_weight has "
                f"{required.size} entries: give one for each set"
            )
        for name, value in (
            ("weights", weights),
            ("required_weight", required),
            ("needs", needs),
            ("row_sets", row_sets),
        ):
            value.flags.writeable = False
            object.__setattr__(self, name, value)


@dataclass(frozen=True, eq=False)
class WholeRows:
    """A problem in integers; what is rounded is rounded in favour of serving.

    Attributes:
        weights: Integer weights, shape (n_rows,), of a sum below 2^52.
        needed: Integer weight required of each set.
        needs: As in the problem.
        row_sets: As in the problem.
        unit: Weight, in the problem's unit, of one integer step.
        rounded: Number of rows whose weight isn't a whole number of steps.
        needed_total: Integer weight required of all, 0 where none is beside the sets'.
    """

    weights: NDArray[np.int64]
    needed: tuple[int, ...]
    needs: NDArray[np.int64]
    row_sets: NDArray[np.int64]
    unit: float
    rounded: int
    needed_total: int = 0

    @property
    def total(self) -> int:
        """Integer weight of all rows."""
        return int(self.weights.sum())

    def multipliers(self, numbers: ArrayLike) -> NDArray[np.int64]:
        """Return integers in proportion to any numbers, those below 0 as 0.

        Integers of a small enough sum stay as they are.
        """
        cost = np.maximum(self.needs, 1).astype(np.float64)
        values = np.clip(np.nan_to_num(real_numbers("multipliers", numbers)), 0.0, None)
        if values.shape != self.weights.shape:
            raise ValueError(
                f"multipliers must be {self.weights.shape}, got {values.shape}"
            )
        # Rows that cost nothing to serve or weigh nothing only make cells costlier.
        values = np.where((self.needs > 0) & (self.weights > 0), values, 0.0)
        top = float(values.max(initial=0.0))
        if top == 0.0:
            return np.zeros(values.size, dtype=np.int64)
        whole = bool(np.all(values == np.floor(values)))
        if whole and top < 2.0**_BITS and float(np.sum(values * cost)) <= 2.0**_BITS:
            return values.astype(np.int64)
        # Scaled to at most 1 first, so that no sum overflows; sums without BLAS, whose
        # rounding depends on its threads.
        values = values / top
        scale = 2.0**_BITS / float(np.sum(values * cost))
        return np.floor(values * scale).astype(np.int64)

    def least_cost(self, multipliers: NDArray[np.int64]) -> Fraction:
        """Return the least cost of serving enough: need(lambda), or a little less."""
        live = self.weights > 0
        weights, costs = self.weights[live], (multipliers * self.needs)[live]
        sets, rest = self.row_sets[live], weights.copy()
        prices: list[Fraction] = []
        for g, needed in enumerate(self.needed):
            rows = np.flatnonzero(sets == g)
            price, rest[rows] = _filled(weights[rows], rest[rows], costs[rows], needed)
            prices.append(price)
        lacking = min(self.needed_total - int((weights - rest).sum()), int(rest.sum()))
        price, _ = _filled(weights, rest, costs, lacking)
        least = price * max(0, lacking)
        for g, needed in enumerate(self.needed):
            rows = sets == g
            reached = min(needed, int(weights[rows].sum()))
            dearer = max(price, prices[g])
            least += _dual(weights[rows], costs[rows], reached, dearer)
        return least

    def count_bound(self, multipliers: NDArray[np.int64], largest_cost: int) -> float:
        """Return the poses needed at least where no cell costs more; inf if none do."""
        need = self.least_cost(multipliers)
        if need <= 0:
            return 0.0
        return float(-(-need // largest_cost)) if largest_cost > 0 else float("inf")

    def most(self, multipliers: NDArray[np.int64], paid: int) -> int:
        """Return the integer weight that rows which cost ``paid`` can have at most."""
        costs = multipliers * self.needs
        paying = (costs > 0) & (self.weights > 0)
        weights, costs = self.weights[paying], costs[paying]
        order = _by_ratio(weights, costs)
        last = int(np.searchsorted(np.cumsum(costs[order]), paid))
        if last >= order.size:
            return self.total
        # Weight that one more unit of cost buys: the dual price of the budget.
        p, q = int(weights[order[last]]), int(costs[order[last]])
        bought = (p * paid + _excess(weights, q, costs, p)) // q
        return self.total - int(weights.sum()) + bought

    def in_unit(self, weight: int) -> float:
        """Return a weight, rounded up, in the problem's unit."""
        return (weight + 0.5 * self.rounded) * self.unit * (1.0 + 1e-15)


def whole_rows(problem: CellProblem) -> WholeRows:
    """Return the problem in integers."""
    total = float(np.sum(problem.weights))
    exponent, whole, inexact = whole_weights(problem.weights, bits=_BITS)
    sets = np.arange(problem.required_weight.size)
    lost = [0.5 * np.count_nonzero(inexact & (problem.row_sets == g)) for g in sets]
    # More than there is can't be had, however much more; of nothing, nothing.
    wanted = np.append(problem.required_weight, problem.required_total or 0.0)
    required = np.minimum(wanted, 4.0 * total)
    needed = np.ldexp(required, exponent) * (1.0 - WEIGHT_SLACK) - [*lost, sum(lost)]
    if not total > 0:
        needed = (wanted > 0).astype(np.float64)
    *each, of_all = (max(0, int(np.floor(x))) for x in needed)
    row_sets = problem.row_sets
    if of_all and (len(each) == 1 or not any(each)):
        # No floor tells rows apart.
        row_sets, each, of_all = np.zeros_like(row_sets), [max(of_all, *each)], 0
    return WholeRows(
        weights=whole.astype(np.int64),
        needed=tuple(each),
        needed_total=of_all,
        needs=problem.needs,
        row_sets=row_sets,
        unit=float(np.ldexp(1.0, -exponent)),
        rounded=int(np.count_nonzero(inexact)),
    )


def _filled(
    weights: NDArray[np.int64],
    rest: NDArray[np.int64],
    costs: NDArray[np.int64],
    needed: int,
) -> tuple[Fraction, NDArray[np.int64]]:
    """Take what is needed of the rest of rows, the cheapest first.

    Return the marginal row's ratio of cost and weight, and what is left of each. Where
    all together can't reach it, all is taken.
    """
    if needed <= 0 or weights.size == 0:
        return Fraction(0), rest
    order = _by_ratio(weights, costs)
    upto = np.cumsum(rest[order])
    marginal = order[min(int(np.searchsorted(upto, needed)), order.size - 1)]
    remaining = rest.copy()
    remaining[order] -= np.clip(needed - upto + rest[order], 0, rest[order])
    return Fraction(int(costs[marginal]), int(weights[marginal])), remaining


def _dual(
    weights: NDArray[np.int64], costs: NDArray[np.int64], needed: int, price: Fraction
) -> Fraction:
    """Return a lower bound on min {c y : w y >= W, 0 <= y <= 1}: t W - (t w - c)+.

    The marginal row's ratio t makes it the minimum.
    """
    p, q = price.numerator, price.denominator
    return Fraction(p * needed - _excess(weights, p, costs, q), q)


def _by_ratio(
    weights: NDArray[np.int64], costs: NDArray[np.int64]
) -> NDArray[np.int64]:
    return np.argsort(costs / weights, kind="stable")


def _excess(a: NDArray[np.int64], p: int, b: NDArray[np.int64], q: int) -> int:
    """Return sum_i max(0, p a_i - q b_i), exactly: products take 104 bits."""
    difference = a.astype(object) * p - b.astype(object) * q
    return int(sum(x for x in difference if x > 0))


def _counts(name: str, numbers: object, n: int, default: int) -> NDArray[np.int64]:
    if numbers is None:
        return np.full(n, default, dtype=np.int64)
    values = np.array(cast("ArrayLike", numbers))
    if values.shape != (n,) or values.dtype.kind not in "iu":
        raise ValueError(
            f"{name} must be integers of shape ({n},), got {values.dtype} of shape "
            f"{values.shape}"
        )
    if not np.all((values >= 0) & (values < 2**31)):
        raise ValueError(f"{name} must be at least 0")
    return values.astype(np.int64)
