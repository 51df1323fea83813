"""Fewest sets of a surviving cover: from below by covers, from above by exchanges.

For each number of sets from the bound upwards, a selection is completed set by set and
improved by the best exchange of one set until none helps; then some sets are thrown
out, chosen at random, and all begins anew. What is found is checked from the problem.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from solvers.bit_rows import sparse_rows
from solvers.covers.cover import DEFAULT_BUDGET, solve_cover
from solvers.covers.cover_problem import CoverProblem
from solvers.status import SolveStatus

from .exchanges import Exchanges, Rank
from .surviving_cover import SurvivingCover

_Index = NDArray[np.int64]
# Times that sets are thrown out of the best selection, for each number of them.
KICKS = 24
# Where more than this share of what all losses must leave is lacking after so many, it
# isn't worth more.
_HOPEFUL, _LEAST = 0.03, 2


@dataclass(frozen=True, eq=False)
class SurvivingSolution:
    """Answer of :func:`solve_surviving`.

    Attributes:
        cover: The problem this answers.
        selected: Sets in increasing order; where it isn't met those that lack least.
        lower_bound: Proven least number of sets.
        status: `optimal`, `feasible`, or `infeasible` where nothing was found: that no
            selection is any better isn't proved.
    """

    cover: SurvivingCover
    selected: _Index
    lower_bound: int
    status: Literal["optimal", "feasible", "infeasible"]


def solve_surviving(
    cover: SurvivingCover,
    *,
    lower_bound: int = 0,
    most: int | None = None,
    start: _Index | None = None,
    kicks: int = KICKS,
    seed: int = 0,
) -> SurvivingSolution:
    """Find few sets that meet a surviving cover, and bound their number.

    Args:
        cover: The problem.
        lower_bound: What is known of the number already.
        most: Sets allowed; None: any number.
        start: Sets to begin from.
        kicks: Times that sets are thrown out, for each number of them.
        seed: Of what is thrown out.
    """
    exchanges, rng = Exchanges(cover), np.random.default_rng(seed)
    fixed = cover.fixed
    allowed = min(cover.n_sets, int(cover.stock.sum()))
    allowed = allowed if most is None else min(allowed, most)
    if fixed.size and cover.lacking(fixed) == 0:
        return SurvivingSolution(cover, fixed, fixed.size, "optimal")
    bound = max(lower_bound, fixed.size + 1)
    best = np.union1d(fixed, np.empty(0, np.int64) if start is None else start)
    best = best.astype(np.int64)
    least: tuple[Rank, _Index] | None = None
    for count in range(min(bound, allowed), allowed + 1):
        rank, best = _search(exchanges, best, count, rng, kicks)
        if least is None or rank < least[0]:
            least = rank, best
        if rank[0] == 0:
            break
    assert least is not None
    (lacking, _), chosen = least
    chosen = np.sort(chosen)
    if lacking or cover.lacking(chosen):
        return SurvivingSolution(cover, chosen, bound, "infeasible")
    optimal = len(chosen) <= bound
    status: Literal["optimal", "feasible"] = "optimal" if optimal else "feasible"
    return SurvivingSolution(cover, chosen, min(bound, len(chosen)), status)


def least_surviving(
    cover: SurvivingCover, *, seed: int = 0, budget: float = DEFAULT_BUDGET
) -> int:
    """Return a proven least number of sets, by plain covers of each case.

    A set serves an element m_e times at most, so at least ceil(K / m_e) sets must; one
    set more where one may be lost, unless the fixed ones suffice.
    """
    fixed = cover.fixed
    if fixed.size and cover.lacking(fixed) == 0:
        return int(fixed.size)
    bounds = [
        _plain_bound(cover, case, serves, seed, budget) + (case == 0 and cover.losable)
        for case, serves in enumerate(cover.serves)
    ]
    return max([int(fixed.size), *bounds])


def _plain_bound(
    cover: SurvivingCover,
    case: int,
    serves: NDArray[np.uint8],
    seed: int,
    budget: float,
) -> int:
    some = serves.any(axis=1)
    if not some.any():
        return 0
    most = np.minimum(serves[some].max(axis=1).astype(np.int64), cover.need)
    problem = CoverProblem(
        sparse_rows(serves[some] > 0),
        required_weight=np.array([float(cover.required[case])]),
        needs=-(-cover.need // most),
        fixed=cover.fixed,
    )
    answer = solve_cover(problem, seed=seed, budget=budget, heaviest=False)
    if answer.status is SolveStatus.INFEASIBLE:
        # What isn't to be had in this case is told by who states it.
        return 0
    return int(np.ceil(answer.lower_bound - 1e-9))


def _search(
    exchanges: Exchanges,
    start: _Index,
    count: int,
    rng: np.random.Generator,
    kicks: int,
) -> tuple[Rank, _Index]:
    """Return the best selection of so many sets that was met, and its rank."""
    best = _improved(exchanges, _completed(exchanges, start, count))
    movable = max(count - exchanges.cover.fixed.size, 1)
    hopeful = _HOPEFUL * _asked(exchanges.cover, count)
    for kick in range(kicks):
        met = best[0][0] == 0
        if kick >= (kicks // 3 if met else _LEAST) and (met or best[0][0] > hopeful):
            break
        n_out = min(1 + kick % 3, movable)
        free = np.setdiff1d(best[1], exchanges.cover.fixed)
        out = rng.choice(free, size=min(n_out, len(free)), replace=False)
        left = np.setdiff1d(best[1], out)
        if len(free) > n_out and kick % 2:
            # A stranger leads elsewhere.
            stranger = int(rng.integers(exchanges.cover.n_sets))
            wider = np.union1d(left, [stranger])
            left = wider if exchanges.cover.in_stock(wider) else left
        found = _improved(exchanges, _completed(exchanges, left, count))
        best = min(best, found, key=lambda one: one[0])
    return best


def _asked(cover: SurvivingCover, count: int) -> int:
    """What all losses of so many sets must leave together."""
    times = count if cover.losable else 1
    return int(cover.required[0]) * times + int(cover.required[1:].sum())


def _completed(exchanges: Exchanges, start: _Index, count: int) -> _Index:
    """Return so many sets, one added after the other; the idlest go if too many."""
    chosen = start.astype(np.int64)
    while len(chosen) > count:
        free = np.setdiff1d(chosen, exchanges.cover.fixed)
        ranks = [exchanges.rank(chosen[chosen != one]) for one in free]
        chosen = chosen[chosen != free[min(range(len(free)), key=ranks.__getitem__)]]
    while len(chosen) < count:
        more = exchanges.best_addition(chosen)
        if more is None:
            break
        chosen = more[1]
    return chosen


def _improved(exchanges: Exchanges, chosen: _Index) -> tuple[Rank, _Index]:
    """Exchange one set after the other, each time the best, until none helps."""
    rank = exchanges.rank(chosen)
    while True:
        found = exchanges.best_exchange(chosen)
        if found is None or not found[0] < rank:
            return rank, chosen
        rank, chosen = found
