"""Multipliers for covers of any kind, by the volume algorithm.

Maximises over lambda >= 0, in the terms of ``relaxation``::

    need(lambda) - (the K dearest lambda(a_j))            to refute K sets: above 0
    need(lambda) + sum_j min(0, c_j - lambda(a_j))        to bound the cost

What comes back is a proposal; ``relaxation`` evaluates it again.

References:
    Barahona and Anbil, "The volume algorithm: producing primal solutions with a
    subgradient method", Mathematical Programming 87, 2000.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solvers.status import WorkBudget

from .reductions import ReducedCover
from .relaxation import cheapest_rows

_LOOK_BACK = 30
_MEMORY = 0.9
# Squared; below it nothing is lacking.
_LEAST_LACK = 1e-18


@dataclass(frozen=True, eq=False)
class Ascent:
    """Where an ascent got to.

    Attributes:
        multipliers: The best found, at least 0, shape (n_e,).
        value: What it maximised, there.
    """

    multipliers: NDArray[np.float64]
    value: float


def ascend(
    cover: ReducedCover,
    start: NDArray[np.float64],
    budget: WorkBudget,
    *,
    target: float,
    n_sets: int | None = None,
    max_steps: int = 300,
) -> Ascent:
    """Raise a bound until it exceeds a target or stalls.

    Args:
        cover: The cover.
        start: Multipliers to start from, at least 0, shape (n_e,).
        budget: Work; two matrix products a step.
        target: Value beyond which the bound need not go.
        n_sets: K, to refute that many sets; the multipliers keep their sum of
            r_i lambda_i. Default the cost is bounded.
        max_steps: Steps at most.
    """
    best = np.maximum(start, 0.0)
    if n_sets is not None and not np.any(best > 0):
        best = cover.weights / cover.needs
    size = float(cover.needs @ best)
    value, rows, sets = _evaluate(cover, best, n_sets)
    mean_rows, mean_sets = rows.copy(), sets.copy()
    step, stale, mark = 1.0, 0, value
    for i in range(max_steps):
        if value > target or budget.exhausted:
            break
        # What rows ask for beyond what sets give them is worth a higher price.
        lack = cover.needs * mean_rows - cover.by_row @ mean_sets
        moving = (lack > 0) | (best > 0)
        length = float(np.sum(lack[moving] ** 2))
        if not length > _LEAST_LACK:
            break
        scale = max(float(cover.needs @ best), 1e-300)
        ambition = max(target - value, 1e-3 * scale)
        trial = np.maximum(best + step * ambition / length * lack, 0.0)
        if n_sets is not None:
            # Else the way to a value of 0 would be to make all prices 0.
            left = float(cover.needs @ trial)
            trial = trial * (size / left) if left > 1e-100 * size else best
        reached, rows, sets = _evaluate(cover, trial, n_sets)
        budget.spend(3.0 * cover.entries + 40.0 * best.size + 3e4)
        mean_rows = _MEMORY * mean_rows + (1.0 - _MEMORY) * rows
        mean_sets = _MEMORY * mean_sets + (1.0 - _MEMORY) * sets
        if reached > value:
            value, best, stale, step = reached, trial, 0, min(1.1 * step, 4.0)
        else:
            stale += 1
            if stale % 5 == 0:
                step *= 0.6
        if i % _LOOK_BACK == _LOOK_BACK - 1:
            gain, mark = value - mark, value
            if target - value > 20.0 * gain:
                break
    return Ascent(best, value)


def _evaluate(
    cover: ReducedCover, multipliers: NDArray[np.float64], n_sets: int | None
) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
    """Return the bound, and the rows and sets at which it is attained."""
    rows, asked = cheapest_rows(cover, multipliers)
    prices = cover.by_set @ multipliers
    if n_sets is None:
        sets = (prices > cover.costs).astype(np.float64)
        return asked + float(np.minimum(cover.costs - prices, 0.0).sum()), rows, sets
    top = np.argsort(-prices, kind="stable")[:n_sets]
    sets = np.zeros(prices.size)
    sets[top] = 1.0
    return asked - float(prices[top].sum()), rows, sets
