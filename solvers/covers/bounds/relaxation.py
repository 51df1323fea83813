"""Bounds on covers from multipliers, safe whatever made the multipliers.

Covered y_i costs r_i service, so the rows ask together at least for::

    need(lambda) = sum_g min {sum_{i in G_g} lambda_i r_i y_i :
                              sum_{i in G_g} w_i y_i >= W_g, 0 <= y <= 1}

a fractional knapsack for each row set, and a set pays at most lambda(a_j). So for any
lambda >= 0, with reduced costs d_j = c_j - lambda(a_j):

* fewest sets: the first K whose K dearest sets pay need(lambda);
* cheapest (of at most K) sets: cost >= need(lambda) + the (K) least min(0, d_j);
* most weight of K sets, with lambda <= w: sum_i (w_i - lambda_i) and the K dearest
  sum_i a_ij lambda_i / r_i.

The best lambda gives the bound of the linear program (Lagrangian duality). The printed
bound is evaluated here in numpy; the linear program only proposes lambda.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from solvers.status import WorkBudget

from .reductions import ReducedCover

# Steps after which a descent that hardly moves is given up.
_LOOK_BACK = 30


def rounding(n_rows: int) -> float:
    """Return the share by which a sum of non-negative numbers over rows may be off."""
    return 1e-11 + n_rows * 2.0 * float(np.finfo(float).eps)


def coverage_bounds(
    cover: ReducedCover, multipliers: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return an upper bound on the weight of any K sets, for K = 0, ..., n_s.

    Args:
        cover: The cover.
        multipliers: Any numbers, shape (n_e,); clipped into [0, w].
    """
    clipped = np.clip(np.nan_to_num(multipliers), 0.0, cover.weights)
    prices = np.sort(cover.by_set @ (clipped / cover.needs))[::-1]
    rest = float(np.sum(cover.weights - clipped))
    bounds = rest + np.concatenate([[0.0], np.cumsum(prices)])
    return np.minimum(bounds * (1.0 + rounding(clipped.size)), cover.total)


def count_bound(cover: ReducedCover, multipliers: NDArray[np.float64]) -> int:
    """Return a lower bound on the number of sets that reach what is required.

    It is n_s + 1 where no number of sets reaches it.

    Args:
        cover: The cover.
        multipliers: Any numbers, shape (n_e,); negative ones count as 0.
    """
    usable, _ = _usable(multipliers)
    paid = np.concatenate([[0.0], np.cumsum(np.sort(cover.by_set @ usable)[::-1])])
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

    Args:
        cover: The cover.
        multipliers: Any numbers, shape (n_e,), in cost; negative ones count as 0.
        max_sets: Sets allowed.
    """
    usable, unit = _usable(multipliers)
    prices = cover.by_set @ usable
    asked = least_service(cover, usable)
    fit = float(
        np.min((cover.costs / np.maximum(prices, 1e-200))[prices > 0], initial=np.inf)
    )
    best = 0.0
    for scale in (unit, fit if np.isfinite(fit) else 0.0):
        gains = np.sort(np.minimum(cover.costs - scale * prices, 0.0))[:max_sets]
        # Both sums may be off by a share of their own size.
        error = rounding(usable.size + prices.size) * (scale * asked - gains.sum())
        best = max(best, float(scale * asked + gains.sum() - error))
    return best * (1.0 - 1e-9)


def least_service(cover: ReducedCover, multipliers: NDArray[np.float64]) -> float:
    """Return need(lambda), what rows that meet the requirements ask for at least.

    Args:
        cover: The cover.
        multipliers: Numbers of at least 0, shape (n_e,).
    """
    return cheapest_rows(cover, multipliers)[1]


def cheapest_rows(
    cover: ReducedCover, multipliers: NDArray[np.float64]
) -> tuple[NDArray[np.float64], float]:
    """Return the fractional rows y, shape (n_e,), that attain need(lambda), and it.

    Args:
        cover: The cover.
        multipliers: Numbers of at least 0, shape (n_e,).
    """
    prices = multipliers * cover.needs
    order = np.lexsort((prices / cover.weights, cover.row_sets))
    weights, groups = cover.weights[order], cover.row_sets[order]
    before = np.cumsum(weights) - weights
    starts = np.searchsorted(groups, np.arange(cover.quotas.size))
    ahead = np.append(before, weights.sum())[starts]
    missing = cover.quotas[groups] - (before - ahead[groups])
    rows = np.zeros(weights.size)
    rows[order] = np.clip(missing / weights, 0.0, 1.0)
    return rows, float(prices @ rows)


def _usable(multipliers: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Return multipliers from 0 to 1, and what to multiply them by to have those given.

    Near the least and the largest numbers there are, sums would lose their digits.
    """
    usable = np.clip(np.nan_to_num(multipliers), 0.0, 1e200)
    _, exponent = np.frexp(usable.max(initial=0.0))
    return np.ldexp(usable, -exponent), float(np.ldexp(1.0, exponent))


@dataclass(frozen=True, eq=False)
class Tightening:
    """Multipliers after a descent.

    Attributes:
        multipliers: The best found, in [0, w], shape (n_e,).
        bound: Weight that no K sets exceed, by these multipliers.
    """

    multipliers: NDArray[np.float64]
    bound: float


def tighten(
    by_set: sparse.csr_array,
    weights: NDArray[np.float64],
    n_sets: int,
    target: float,
    start: NDArray[np.float64],
    budget: WorkBudget,
    *,
    max_steps: int = 200,
) -> Tightening:
    """Lower the coverage bound for K sets until it is below a target or stalls.

    Volume algorithm: subgradient steps towards a running mean of the K dearest sets.

    Args:
        by_set: Ones where set s covers row e, shape (n_s, n_e).
        weights: Weight of each row, at least 0, shape (n_e,).
        n_sets: K.
        target: Weight below which the bound need not go.
        start: Multipliers to start from, shape (n_e,).
        budget: Work; two matrix products a step.
        max_steps: Steps at most.

    References:
        Barahona and Anbil, "The volume algorithm: producing primal solutions with a
        subgradient method", Mathematical Programming 87, 2000.
    """
    by_row = by_set.T
    total = float(weights.sum())
    heavy = np.where(weights > 0, weights, 1.0)
    best = np.clip(start / heavy, 0.0, 1.0)
    bound, chosen = _dearest(by_set, weights, best, n_sets)
    primal = chosen.copy()
    aim = min(target, total) * 0.998
    step, stale, mark = 1.0, 0, bound
    for i in range(max_steps):
        if bound < target or budget.exhausted:
            break
        excess = 1.0 - by_row @ primal
        moving = np.where(excess > 0, best < 1.0, best > 0.0)
        length = float(np.sum(weights * excess * excess * moving))
        if not length > 0:
            break
        stride = step * max(bound - aim, 1e-4 * total) / length
        share = np.clip(best + stride * excess, 0.0, 1.0)
        value, chosen = _dearest(by_set, weights, share, n_sets)
        budget.spend(3.0 * by_set.nnz + 20.0 * weights.size + 3e4)
        primal = 0.9 * primal + 0.1 * chosen
        if value < bound:
            bound, best, stale, step = value, share, 0, min(step * 1.1, 4.0)
        else:
            stale += 1
            if stale % 5 == 0:
                step *= 0.6
        if i % _LOOK_BACK == _LOOK_BACK - 1:
            gain, mark = mark - bound, bound
            if bound - target > 20.0 * gain:
                break
    return Tightening(best * weights, bound)


def _dearest(
    by_set: sparse.csr_array,
    weights: NDArray[np.float64],
    share: NDArray[np.float64],
    n_sets: int,
) -> tuple[float, NDArray[np.float64]]:
    """Return the coverage bound for K sets and the indicator of the K dearest."""
    multipliers = share * weights
    prices = by_set @ multipliers
    top = np.argsort(-prices, kind="stable")[:n_sets]
    chosen = np.zeros(prices.size)
    chosen[top] = 1.0
    rest = float(np.sum(weights - multipliers))
    return (rest + float(prices[top].sum())) * (1.0 + rounding(share.size)), chosen
