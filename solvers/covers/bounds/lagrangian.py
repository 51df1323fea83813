"""Multipliers for covers, by the volume algorithm.

Minimises over lambda in [0, w], in the terms of ``relaxation``, the weight of K sets::

    sum_i (w_i - lambda_i) + (the K costliest sum_i a_ij lambda_i / r_i)

by subgradient steps towards a running mean of where the bound is attained. What comes
back is a proposal; ``relaxation`` evaluates it again.

References:
    Barahona and Anbil, "The volume algorithm: producing primal solutions with a
    subgradient method", Mathematical Programming 87, 2000.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from solvers.status import WorkBudget

from .reduced_cover import ReducedCover
from .relaxation import costliest, rounding

_LOOK_BACK = 30
_MEMORY, _FRESH = 0.9, 0.1
_MOST_STEPS = 200
_Array = NDArray[np.float64]


def tighten(
    cover: ReducedCover,
    n_sets: int,
    target: float,
    start: _Array,
    budget: WorkBudget,
) -> _Array:
    """Lower the weight that K sets cover at most, until below a target or it stalls.

    Returns multipliers in [0, w], shape (n_e,), as it takes them to start from.
    """
    weights, total, by_set = cover.weights, cover.total, cover.by_set
    if np.any(cover.needs > 1):
        by_set = sparse.csr_array(by_set.multiply(1.0 / cover.needs[None]))

    def bound(shares: _Array) -> tuple[float, _Array]:
        multipliers = shares * weights
        payments = by_set @ multipliers
        top = costliest(cover, payments)[:n_sets]
        sets = np.zeros(payments.size)
        sets[top] = 1.0
        paid = float(payments[top].sum())
        others = float(np.sum(weights - multipliers))
        return (others + paid) * (1.0 + rounding(weights.size)), sets

    aim = min(target, total) * 0.998
    best = np.clip(start / weights, 0.0, 1.0)
    lowest, mean = bound(best)
    taken, serves = np.empty(0, dtype=np.int64), by_set[:0].T
    step, stale, mark = 1.0, 0, lowest
    for i in range(_MOST_STEPS):
        if lowest < target or budget.exhausted:
            break
        if np.count_nonzero(mean) > taken.size:
            # Of all sets few are ever among the costliest.
            taken = np.flatnonzero(mean)
            serves = by_set[taken].T
        excess = 1.0 - serves @ mean[taken]
        moving = np.where(excess > 0, best < 1.0, best > 0.0)
        length = float(np.sum(weights * excess * excess * moving))
        if not length > 0:
            break
        stride = step * max(lowest - aim, 1e-4 * total) / length
        trial = np.clip(best + stride * excess, 0.0, 1.0)
        reached, sets = bound(trial)
        budget.spend(3.0 * by_set.nnz + 20.0 * weights.size + 3e4)
        mean = _MEMORY * mean + _FRESH * sets
        if reached < lowest:
            lowest, best, stale, step = reached, trial, 0, min(step * 1.1, 4.0)
        else:
            stale += 1
            step *= 0.6 if stale % 5 == 0 else 1.0
        if i % _LOOK_BACK == _LOOK_BACK - 1:
            gain, mark = mark - lowest, lowest
            if lowest - target > 20.0 * gain:
                break
    return best * weights
