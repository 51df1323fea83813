"""Covers by pairs from above: greedy, sets that can go, and exchanges of sets."""

import numpy as np
from numpy.typing import NDArray

from solvers.status import WorkBudget

from .pair_rows import PairRows
from .pair_selection import PairSelection

# Exchanges during which a set that left stays away.
_TENURE = 5
# What weight that a set prepares counts for beside weight that it covers.
_PREPARED = (0.0, 0.25, 0.5, 0.75)


def greedy(
    cover: PairRows,
    start: NDArray[np.int64],
    budget: WorkBudget,
    *,
    n_sets: int | None = None,
) -> NDArray[np.int64]:
    """Return sets that cover what is required, or much with as many as are allowed.

    The next is what adds most, weight that it prepares counting for a share; the best
    of a few shares. `start` is in every selection.
    """
    found = [_greedily(cover, start, budget, share, n_sets) for share in _PREPARED]
    if n_sets is not None:
        return max(found, key=cover.weight_of)
    return min(found, key=len)


def _greedily(
    cover: PairRows,
    start: NDArray[np.int64],
    budget: WorkBudget,
    share: float,
    n_sets: int | None,
) -> NDArray[np.int64]:
    state = PairSelection(cover, start.tolist(), budget)
    most = cover.n_sets if n_sets is None else n_sets
    quota = cover.quota if n_sets is None else np.inf
    while len(state.chosen) < most and state.weight < min(quota, cover.total):
        gains, prepared = state.gains()
        state.add(int(np.lexsort((-prepared, -(gains + share * prepared)))[0]))
    chosen = np.sort(np.array(state.chosen, dtype=np.int64))
    return prune(cover, chosen, start) if n_sets is None else chosen


def prune(
    cover: PairRows, chosen: NDArray[np.int64], fixed: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return a cover less the sets that it doesn't need, the latest names first."""
    kept, need = chosen, min(cover.quota, cover.weight_of(chosen))
    for s in chosen[::-1]:
        fewer = kept[kept != s]
        if s not in fixed and cover.weight_of(fewer) >= need:
            kept = fewer
    return kept


def exchanged(
    cover: PairRows,
    start: NDArray[np.int64],
    budget: WorkBudget,
    *,
    fixed: NDArray[np.int64],
    target: float,
    seed: int,
    max_moves: int,
) -> NDArray[np.int64]:
    """Return the best of as many sets that exchanges lead to, until the target.

    The best exchange is made even where it loses, and the set that left stays away for
    a while (tabu search). Ties are broken at random.
    """
    state, rng = (
        PairSelection(cover, start.tolist(), budget),
        np.random.default_rng(seed),
    )
    best, best_weight, until = start, state.weight, np.zeros(cover.n_sets)
    stale = 0
    for move in range(max_moves):
        free = [s for s in state.chosen if s not in fixed]
        if best_weight >= target or stale > 8 * len(free) + 20:
            break
        if budget.exhausted or not free or len(state.chosen) == cover.n_sets:
            break
        table = np.array([state.exchanges(s) for s in free])
        table[:, until > move] = np.where(
            table[:, until > move] > best_weight, table[:, until > move], -1.0
        )
        ties = np.argwhere(table == table.max())
        out, new = ties[rng.integers(len(ties))]
        if table[out, new] < 0:
            break
        state.remove(free[out])
        state.add(int(new))
        until[free[out]] = move + _TENURE + rng.integers(_TENURE)
        stale += 1
        if table[out, new] > best_weight:
            best_weight, stale = float(table[out, new]), 0
            best = np.sort(np.array(state.chosen, dtype=np.int64))
    return best


def fewer_sets(
    cover: PairRows,
    chosen: NDArray[np.int64],
    budget: WorkBudget,
    *,
    fixed: NDArray[np.int64],
    lower: int,
    seed: int,
) -> NDArray[np.int64]:
    """Return a cover with fewer sets, while exchanges give one."""
    while len(chosen) > max(lower, len(fixed)) and not budget.exhausted:
        without = [chosen[chosen != s] for s in chosen if s not in fixed]
        start = max(without, key=cover.weight_of)
        fewer = exchanged(
            cover,
            start,
            budget,
            fixed=fixed,
            target=cover.quota,
            seed=seed,
            max_moves=40 * len(start) + 40,
        )
        if not cover.meets(fewer):
            break
        chosen = prune(cover, fewer, fixed)
    return chosen
