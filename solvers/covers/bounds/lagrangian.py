"""Multipliers for covers, by the volume algorithm.

Maximises over lambda, in the terms of ``relaxation``::

    need(lambda) - (the K costliest lambda(a_j)),      lambda >= 0: refutes K
    need(lambda) + sum_j min(0, c_j - lambda(a_j)),    lambda >= 0: bounds a cost
    -sum_i (w_i - lambda_i) - (the K costliest),       lambda in [0, w]: a weight

by subgradient steps towards a running mean of where the bound is attained. What comes
back is a proposal; ``relaxation`` evaluates it again.

References:
    Barahona and Anbil, "The volume algorithm: producing primal solutions with a
    subgradient method", Mathematical Programming 87, 2000.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from solvers.status import WorkBudget

from .reductions import ReducedCover
from .relaxation import cheapest_rows, rounding

_LOOK_BACK = 30
_MEMORY, _FRESH = 0.9, 0.1
_MOST_STEPS = 200
# Squared; below it nothing is lacking.
_LEAST_LACK = 1e-18
_Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Ascent:
    """Where an ascent got to.

    Attributes:
        multipliers: The best found, at least 0, shape (n_e,).
        value: What it maximised, there.
    """

    multipliers: _Array
    value: float


def tighten(
    cover: ReducedCover,
    n_sets: int,
    target: float,
    start: _Array,
    budget: WorkBudget,
) -> Ascent:
    """Lower the weight that K sets cover at most, until below a target or it stalls.

    Args:
        cover: The cover.
        n_sets: K.
        target: Weight below which the bound need not go.
        start: Multipliers to start from, shape (n_e,).
        budget: Work; two matrix products a step.

    Returns:
        Multipliers in [0, w]; the value is the bound, negated.
    """
    dual = _WeightDual(cover, n_sets, target)
    share = np.clip(start / cover.weights, 0.0, 1.0)
    best, value = dual.climb(share, -target, budget, _MOST_STEPS)
    return Ascent(best * cover.weights, value)


def ascend(
    cover: ReducedCover,
    start: _Array,
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
    dual = _ServiceDual(cover, n_sets, target, float(cover.needs @ best))
    return Ascent(*dual.climb(best, target, budget, max_steps))


class _Dual(ABC):
    """A concave function of multipliers; its primal is where it is attained."""

    units: float

    @abstractmethod
    def evaluate(self, point: _Array) -> tuple[float, _Array]:
        """Return the value and the primal that attains it."""

    @abstractmethod
    def moved(
        self, point: _Array, value: float, primal: _Array, step: float
    ) -> _Array | None:
        """Return a step along the slope of a primal; None where that is level."""

    def climb(
        self, best: _Array, target: float, budget: WorkBudget, max_steps: int
    ) -> tuple[_Array, float]:
        """Return the best point and its value, once beyond a target or stalled."""
        value, mean = self.evaluate(best)
        step, stale, mark = 1.0, 0, value
        for i in range(max_steps):
            if value > target or budget.exhausted:
                break
            trial = self.moved(best, value, mean, step)
            if trial is None:
                break
            reached, primal = self.evaluate(trial)
            budget.spend(self.units)
            mean = _MEMORY * mean + _FRESH * primal
            if reached > value:
                value, best, stale, step = reached, trial, 0, min(step * 1.1, 4.0)
            else:
                stale += 1
                if stale % 5 == 0:
                    step *= 0.6
            if i % _LOOK_BACK == _LOOK_BACK - 1:
                gain, mark = value - mark, value
                if target - value > 20.0 * gain:
                    break
        return best, value


class _WeightDual(_Dual):
    """Minus the weight of K sets, of multipliers as shares of the weights."""

    def __init__(self, cover: ReducedCover, n_sets: int, target: float) -> None:
        self._weights, self._total, self._n_sets = cover.weights, cover.total, n_sets
        self._by_set = cover.by_set
        if np.any(cover.needs > 1):
            service = cover.by_set.multiply(1.0 / cover.needs[None])
            self._by_set = sparse.csr_array(service)
        self._by_row = self._by_set.T
        self._aim = min(target, self._total) * 0.998
        self.units = 3.0 * self._by_set.nnz + 20.0 * self._weights.size + 3e4

    def evaluate(self, point: _Array) -> tuple[float, _Array]:
        multipliers = point * self._weights
        paid, sets = _costliest(self._by_set @ multipliers, self._n_sets)
        others = float(np.sum(self._weights - multipliers))
        return -(others + paid) * (1.0 + rounding(point.size)), sets

    def moved(
        self, point: _Array, value: float, primal: _Array, step: float
    ) -> _Array | None:
        excess = 1.0 - self._by_row @ primal
        moving = np.where(excess > 0, point < 1.0, point > 0.0)
        length = float(np.sum(self._weights * excess * excess * moving))
        if not length > 0:
            return None
        stride = step * max(-value - self._aim, 1e-4 * self._total) / length
        return np.clip(point + stride * excess, 0.0, 1.0)


class _ServiceDual(_Dual):
    """What rows ask for less what sets give, of K sets or for a cost."""

    def __init__(
        self, cover: ReducedCover, n_sets: int | None, target: float, size: float
    ) -> None:
        self._cover, self._n_sets = cover, n_sets
        self._target, self._size = target, size
        self.units = 3.0 * cover.entries + 40.0 * cover.weights.size + 3e4

    def evaluate(self, point: _Array) -> tuple[float, _Array]:
        rows, need = cheapest_rows(self._cover, point)
        payments = self._cover.by_set @ point
        if self._n_sets is None:
            sets = (payments > self._cover.costs).astype(np.float64)
            paid = -float(np.minimum(self._cover.costs - payments, 0.0).sum())
        else:
            paid, sets = _costliest(payments, self._n_sets)
        return need - paid, np.concatenate([rows, sets])

    def moved(
        self, point: _Array, value: float, primal: _Array, step: float
    ) -> _Array | None:
        # What rows ask for beyond what sets give them is worth a higher multiplier.
        needs, n_rows = self._cover.needs, point.size
        lack = needs * primal[:n_rows] - self._cover.by_row @ primal[n_rows:]
        moving = (lack > 0) | (point > 0)
        length = float(np.sum(lack[moving] ** 2))
        if not length > _LEAST_LACK:
            return None
        scale = max(float(needs @ point), 1e-300)
        ambition = max(self._target - value, 1e-3 * scale)
        trial = np.maximum(point + step * ambition / length * lack, 0.0)
        if self._n_sets is None:
            return trial
        # Else the way to a value of 0 would be to make all multipliers 0.
        size = float(needs @ trial)
        return trial * (self._size / size) if size > 1e-100 * self._size else point


def _costliest(payments: _Array, n_sets: int) -> tuple[float, _Array]:
    """Return what the K costliest sets pay, and their indicator."""
    top = np.argsort(-payments, kind="stable")[:n_sets]
    sets = np.zeros(payments.size)
    sets[top] = 1.0
    return float(payments[top].sum()), sets
