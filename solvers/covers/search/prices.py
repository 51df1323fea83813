"""Prices of floors, by which a cover with floors becomes one without.

Rows of set g weigh p_g times as much, p_g whole and at least U, which stands for one.
With w(x) the weight that a selection covers and w_g(x) that of row set g, all that
meets the floors W_g satisfies::

    sum_g p_g w_g(x) - sum_g (p_g - U) W_g  >=  U w(x)

The left side is a simple cover's weight less a constant. So its searches find
selections that meet floors, while prices rise where a floor is missed, and its bounds
hold for all of them.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from solvers.covers.bounds.lagrangian import tighten
from solvers.covers.bounds.reduced_cover import ReducedCover
from solvers.covers.bounds.reductions import PRICE_BITS
from solvers.covers.bounds.relaxation import coverage_bounds
from solvers.status import WorkBudget

from .neighbourhood import most_coverage

# U where there are floors, and the largest price.
_UNIT, _DEAREST = 16.0, float(1 << PRICE_BITS)
# Prices tried, and how many of these bounds are asked of.
_ROUNDS, _BOUNDED = 12, 4
# A price that was too low grows by this factor, and how many moves each is worth.
_RISE, _MOVES = 4.0, 30


@dataclass(frozen=True, eq=False)
class Prices:
    """Prices of the row sets of a cover; without floors, one of one.

    Attributes:
        cover: The cover.
        of_sets: p_g, whole numbers, shape (n_g,).
        unit: U.
    """

    cover: ReducedCover
    of_sets: NDArray[np.float64]
    unit: float

    @classmethod
    def even(cls, cover: ReducedCover) -> "Prices":
        """Return prices of one."""
        unit = _UNIT if cover.floored else 1.0
        return cls(cover, np.full(cover.quotas.size, unit), unit)

    @cached_property
    def priced(self) -> ReducedCover:
        """The simple cover; what it requires is of no account."""
        cover = self.cover
        weights = cover.weights * self.of_sets[cover.row_sets]
        return replace(cover.without_floors, weights=weights)

    @property
    def floors(self) -> float:
        """What the floors are worth: sum_g (p_g - U) W_g."""
        return float((self.of_sets - self.unit) @ self.cover.quotas)

    def demand(self, weight: float) -> float:
        """Return the priced weight without which no such weight meets the floors."""
        return self.unit * weight + self.floors

    def weight(self, priced: float) -> float:
        """Return the weight that what meets the floors has at most, by a priced one."""
        return float(np.floor((priced - self.floors) / self.unit))

    def between(self, other: "Prices") -> "Prices":
        """Return prices halfway to others."""
        return replace(self, of_sets=np.rint(np.sqrt(self.of_sets * other.of_sets)))

    def raised(self, lacking: NDArray[np.bool_]) -> "Prices":
        """Return prices that are higher where floors are missed."""
        risen = np.minimum(_RISE * self.of_sets, _DEAREST)
        return replace(self, of_sets=np.where(lacking, risen, self.of_sets))


def least_shortage(
    cover: ReducedCover,
    start: NDArray[np.int64],
    budget: WorkBudget,
    seed: int,
    *,
    enough: bool = False,
) -> tuple[NDArray[np.int64], list[Prices]]:
    """Return as many sets that lack least, of these most weight; and prices tried.

    Prices rise until floors are met, then halve the way back: too high, they cost
    weight that the floors don't ask for. Any sets that meet all will do if that is
    `enough`.
    """
    best = selected = start
    low, high = Prices.even(cover), None
    tried = [low]
    for attempt in range(_ROUNDS):
        lacking = cover.covered_by(selected) < cover.quotas
        if attempt and not np.any(lacking):
            high = tried[-1]
        elif attempt:
            low = tried[-1]
        prices = low.raised(lacking) if high is None else low.between(high)
        same = any(np.array_equal(prices.of_sets, p.of_sets) for p in tried)
        if same or budget.exhausted or (enough and attempt and cover.meets(best)):
            break
        tried.append(prices)
        selected = most_coverage(
            prices.priced,
            selected,
            budget,
            target=np.inf,
            seed=seed + attempt,
            max_moves=_MOVES,
        )
        best = min(best, selected, key=lambda s: lack(cover, s))
    return best, tried


def tightest(
    tried: list[Prices], n_sets: int, weight: float, budget: WorkBudget
) -> tuple[Prices, NDArray[np.float64]]:
    """Return prices by which K sets fall short of a weight most, and row multipliers.

    The multipliers are the priced cover's.
    """
    best, closest = (tried[0], tried[0].cover.weights), np.inf
    few = tried[:: -(-len(tried) // _BOUNDED)]
    for prices in few:
        priced, demand = prices.priced, prices.demand(weight)
        part = budget.part(budget.remaining / (2.0 * len(few)))
        multipliers = tighten(priced, n_sets, demand, priced.weights, part)
        over = float(coverage_bounds(priced, multipliers)[n_sets]) - demand
        over /= float(prices.of_sets.mean())
        if over < closest:
            best, closest = (prices, multipliers), over
    return best


def lack(cover: ReducedCover, selected: NDArray[np.int64]) -> tuple[float, float]:
    """Return by what selections compare: what they lack, then the weight, less it."""
    return cover.shortage(selected), -cover.weight_of(selected)
