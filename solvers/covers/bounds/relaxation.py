"""Bounds on covers from multipliers, safe whatever made the multipliers.

Covered y_i costs r_i service, so the rows ask together at least for::

    need(lambda) = sum_g min {sum_{i in G_g} lambda_i r_i y_i :
                              sum_{i in G_g} w_i y_i >= W_g, 0 <= y <= 1}

a fractional knapsack for each row set (with W required of all rows, what is lacking of
W is filled up from the cheapest of the rest), and a set pays at most lambda(a_j). So
for any lambda >= 0, with reduced costs d_j = c_j - lambda(a_j):

* fewest sets: the first K whose K costliest sets pay need(lambda);
* cheapest (of at most K) sets: cost >= need(lambda) + the (K) least min(0, d_j);
* most weight of K sets, with lambda <= w: sum_i (w_i - lambda_i) and the K costliest
  sum_i a_ij lambda_i / r_i.

The best lambda gives the bound of the linear program (Lagrangian duality). The printed
bound is evaluated here in numpy; the linear program only proposes lambda.
"""

import numpy as np
from numpy.typing import NDArray

from .reduced_cover import ReducedCover


def rounding(n_rows: int) -> float:
    """Return the share by which a sum of non-negative numbers over rows may be off."""
    return 1e-11 + n_rows * 2.0 * float(np.finfo(float).eps)


def coverage_bounds(
    cover: ReducedCover, multipliers: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return an upper bound on the weight of any K sets, for K = 0, ..., n_s.

    Multipliers are any numbers, shape (n_e,); clipped into [0, w].
    """
    clipped = np.clip(np.nan_to_num(multipliers), 0.0, cover.weights)
    payments = cover.by_set @ (clipped / cover.needs)
    payments = payments[costliest(cover, payments)]
    others = float(np.sum(cover.weights - clipped))
    paid = np.full(cover.n_sets + 1, payments.sum())
    paid[: payments.size + 1] = np.concatenate([[0.0], np.cumsum(payments)])
    bounds = others + paid
    return np.minimum(bounds * (1.0 + rounding(clipped.size)), cover.total)


def sets_worth_taking(
    cover: ReducedCover, n_sets: int, multipliers: NDArray[np.float64], target: float
) -> NDArray[np.int64]:
    """Return the sets that K sets which cover a target's weight may be among.

    With a set, K sets cover at most sum_i (w_i - lambda_i), what it pays, and what the
    K - 1 costliest do: where that is less, no such selection takes it.
    Multipliers are any numbers, shape (n_e,); clipped into [0, w].
    """
    clipped = np.clip(np.nan_to_num(multipliers), 0.0, cover.weights)
    payments = cover.by_set @ (clipped / cover.needs)
    costliest_others = np.sort(payments)[payments.size - n_sets + 1 :]
    most = float(np.sum(cover.weights - clipped) + costliest_others.sum())
    slack = 1.0 + rounding(clipped.size)
    return np.flatnonzero((most + payments) * slack >= target)


def costliest(cover: ReducedCover, payments: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the sets by what they pay, (k,), as many of each kind as its stock has.

    The first K of these are the K that pay most.
    """
    order = np.argsort(-payments, kind="stable")
    if not cover.limited:
        return order
    kinds = cover.kinds[order]
    before = np.zeros(order.size, dtype=np.int64)
    for kind in range(cover.stock.size):
        of_kind = kinds == kind
        before[of_kind] = np.arange(int(of_kind.sum()))
    return order[before < cover.stock[kinds]]


def count_bound(cover: ReducedCover, multipliers: NDArray[np.float64]) -> int:
    """Return a lower bound on the number of sets that reach what is required.

    It is n_s + 1 where no number of sets reaches it. Multipliers are any numbers, shape
    (n_e,); negative ones count as 0.
    """
    usable, _ = _usable(multipliers)
    payments = cover.by_set @ usable
    payments = payments[costliest(cover, payments)]
    paid = np.concatenate([[0.0], np.cumsum(payments)])
    slack = rounding(usable.size)
    enough = paid * (1.0 + slack) >= least_service(cover, usable) * (1.0 - slack)
    return int(np.argmax(enough)) if np.any(enough) else cover.n_sets + 1


def cost_bound(
    cover: ReducedCover,
    multipliers: NDArray[np.float64],
    *,
    max_sets: int | None = None,
) -> float:
    """Return a lower bound on the cost of any selection that reaches what is required.

    Multipliers are any numbers, shape (n_e,), in cost; negative ones count as 0.
    """
    usable, unit = _usable(multipliers)
    payments = cover.by_set @ usable
    need = least_service(cover, usable)
    ratios = cover.costs / np.maximum(payments, 1e-200)
    fit = float(np.min(ratios[payments > 0], initial=np.inf))
    best = 0.0
    for scale in (unit, fit if np.isfinite(fit) else 0.0):
        gains = np.sort(np.minimum(cover.costs - scale * payments, 0.0))[:max_sets]
        # Both sums may be off by a share of their own size.
        error = rounding(usable.size + payments.size) * (scale * need - gains.sum())
        best = max(best, float(scale * need + gains.sum() - error))
    return best * (1.0 - 1e-9)


def least_service(cover: ReducedCover, multipliers: NDArray[np.float64]) -> float:
    """Return need(lambda), for multipliers of at least 0, shape (n_e,)."""
    payments = multipliers * cover.needs
    order = np.lexsort((payments / cover.weights, cover.row_sets))
    weights, groups = cover.weights[order], cover.row_sets[order]
    before = np.cumsum(weights) - weights
    starts = np.searchsorted(groups, np.arange(cover.quotas.size))
    ahead = np.append(before, weights.sum())[starts]
    missing = cover.quotas[groups] - (before - ahead[groups])
    rows = np.zeros(weights.size)
    rows[order] = np.clip(missing / weights, 0.0, 1.0)
    lacking = cover.quota - float(cover.weights @ rows)
    if lacking > 0:
        order = np.argsort(payments / cover.weights, kind="stable")
        rest = (cover.weights * (1.0 - rows))[order]
        missing = lacking - (np.cumsum(rest) - rest)
        rows[order] += np.clip(missing, 0.0, rest) / cover.weights[order]
    return float(payments @ rows)


def _usable(multipliers: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Return multipliers from 0 to 1, and what they were divided by."""
    # Near the least and the largest numbers there are, sums would lose their digits.
    usable = np.clip(np.nan_to_num(multipliers), 0.0, 1e200)
    _, exponent = np.frexp(usable.max(initial=0.0))
    return np.ldexp(usable, -exponent), float(np.ldexp(1.0, exponent))
