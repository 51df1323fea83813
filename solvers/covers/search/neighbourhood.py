"""Good covers fast: greedy choice, tabu search, and a large-neighbourhood search.

Every sum is of integer-valued weights, hence exact, and every tie goes to the lowest
index: the same seed and budget give the same answer on any machine.
"""

import numpy as np
from numpy.typing import NDArray

from solvers.covers.bounds.reduced_cover import ReducedCover
from solvers.status import WorkBudget

from .swaps import Swaps

# Moves before a bound is asked whether more are worth it; after that, for each set.
FIRST_MOVES = 60
_MOVES_A_SET = 50
# Moves for which a set that went may not come back: from the first to below the second.
_AWAY = (6, 16)
# What came may not go for a move, and one more for each of so many sets selected.
_SETTLING = 4


def greedy(
    cover: ReducedCover,
    start: NDArray[np.int64],
    budget: WorkBudget,
    *,
    n_sets: int | None = None,
) -> NDArray[np.int64]:
    """Return a selection extended by the set of most new weight a unit of cost.

    A row that more than one set must serve gives its weight in equal parts. Stops when
    every row set has what it requires or, if ``n_sets`` is given, at that many sets; or
    when nothing is left in stock.
    """
    chosen = [int(s) for s in start]
    counts = cover.served(np.array(chosen, dtype=np.int64))
    parts = cover.weights / cover.needs
    while n_sets is None or len(chosen) < n_sets:
        open_rows = counts < cover.needs
        if n_sets is None:
            covered = cover.by_row_set(np.where(open_rows, 0.0, cover.weights))
            lacking = covered < cover.quotas
            # Of all together any row helps.
            lacking |= covered.sum() < cover.quota
            if not np.any(lacking):
                break
            open_rows &= lacking[cover.row_sets]
        gains = cover.by_set @ np.where(open_rows, parts, 0.0)
        gains[chosen] = 0.0
        if cover.limited:
            gains[cover.left(np.array(chosen, dtype=np.int64))[cover.kinds] <= 0] = 0.0
        budget.spend(cover.entries)
        if not np.any(gains > 0.0):
            break
        best = int(np.argmax(gains / cover.costs if n_sets is None else gains))
        chosen.append(best)
        counts[cover.members(best)] += 1
    return np.array(chosen, dtype=np.int64)


def moves(n_sets: int) -> int:
    """Return how many moves a selection of so many sets is worth."""
    return FIRST_MOVES + _MOVES_A_SET * n_sets


def most_coverage(
    cover: ReducedCover,
    start: NDArray[np.int64],
    budget: WorkBudget,
    *,
    target: float,
    seed: int,
    max_moves: int,
) -> NDArray[np.int64]:
    """Raise the weight that a selection covers without more sets, by tabu search.

    Makes the best swap even where it loses weight; for some moves, drawn at random,
    what went may not come back and what came may not go, unless that beats the best.

    References:
        Glover, "Tabu search - part I", ORSA Journal on Computing 1(3), 1989.
    """
    rng = np.random.default_rng(seed)
    swaps = Swaps(cover, (int(s) for s in start), budget)
    best, most = list(swaps.chosen), swaps.covered
    enters = np.zeros(cover.n_sets, dtype=np.int64)
    leaves = np.zeros(cover.n_sets, dtype=np.int64)
    for move in range(max_moves):
        if most >= target or budget.exhausted or not best:
            break
        barred = enters > move
        barred[swaps.chosen] = True
        change, out, into = swaps.best_swap(
            stay=leaves[swaps.chosen] > move,
            barred=barred,
            beyond=most - swaps.covered,
            sold_out=_sold_out(cover, swaps.chosen) if cover.limited else None,
        )
        if not np.isfinite(change):
            continue
        gone = swaps.chosen[out]
        swaps.drop(out)
        swaps.add(into)
        enters[gone] = move + int(rng.integers(*_AWAY))
        leaves[into] = move + 1 + int(rng.integers(1, 2 + len(best) // _SETTLING))
        if swaps.covered > most:
            best, most = list(swaps.chosen), swaps.covered
    return np.array(sorted(best), dtype=np.int64)


def _sold_out(cover: ReducedCover, chosen: list[int]) -> NDArray[np.bool_]:
    """Return which sets, (k, n_s), may not take the place of each chosen one."""
    leaving = cover.kinds[chosen]
    empty = cover.left(np.array(chosen, dtype=np.int64)) <= 0
    return empty[cover.kinds] & (leaving[:, None] != cover.kinds)


def prune(cover: ReducedCover, selected: NDArray[np.int64]) -> NDArray[np.int64]:
    """Drop sets, costliest first, while what is required is still reached."""
    chosen = [int(s) for s in selected]
    counts = cover.served(selected)
    covered = cover.by_row_set(np.where(counts >= cover.needs, cover.weights, 0.0))
    for s in sorted(chosen, key=lambda s: (-cover.costs[s], -s)):
        rows = cover.members(s)
        lost = rows[counts[rows] == cover.needs[rows]]
        loss = np.bincount(
            cover.row_sets[lost],
            weights=cover.weights[lost],
            minlength=cover.quotas.size,
        )
        kept = covered - loss
        if np.all(kept >= cover.quotas) and kept.sum() >= cover.quota:
            chosen.remove(s)
            counts[rows] -= 1
            covered -= loss
    return np.array(sorted(chosen), dtype=np.int64)


def cheapest(
    cover: ReducedCover,
    start: NDArray[np.int64],
    budget: WorkBudget,
    *,
    seed: int,
    max_kicks: int,
    max_sets: int | None = None,
) -> NDArray[np.int64]:
    """Lower the cost of a selection that reaches what is required.

    Drops some sets at random, lets greedy repair the cover, keeps what is better.
    """
    rng = np.random.default_rng(seed)
    best = prune(cover, start)
    for _ in range(max_kicks):
        if budget.exhausted or best.size == 0:
            break
        n_kept = best.size - int(rng.integers(1, max(2, best.size // 2 + 1)))
        kept = np.sort(rng.choice(best, size=n_kept, replace=False))
        fresh = int(rng.integers(cover.n_sets))
        trial = greedy(cover, np.union1d(kept, [fresh]), budget)
        # Also where it is no dearer, so that the search moves on.
        best = better(cover, best, trial, max_sets, slack=1e-12)
    return best


def better(
    cover: ReducedCover,
    selected: NDArray[np.int64],
    other: NDArray[np.int64],
    max_sets: int | None = None,
    *,
    slack: float = -1e-12,
) -> NDArray[np.int64]:
    """Return a proposal, pruned, if it is a cover and better, else the selection.

    Fewer sets beyond those allowed come first, then the cost.
    """
    if not cover.meets(other):
        return selected
    other = prune(cover, other)
    allowed = cover.n_sets if max_sets is None else max_sets
    excess, than = (max(0, sets.size - allowed) for sets in (other, selected))
    cheaper = cover.costs[other].sum() < cover.costs[selected].sum() * (1.0 + slack)
    return other if excess < than or (excess == than and cheaper) else selected
