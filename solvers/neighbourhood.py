"""Good covers fast: greedy choice, swaps, and a large-neighbourhood search.

Every sum is of integer-valued weights, hence exact, and every tie goes to the lowest
index: the same seed and budget give the same answer on any machine.
"""

import numpy as np
from numpy.typing import NDArray

from .reductions import ReducedCover
from .status import WorkBudget
from .swaps import Swaps


def greedy(
    cover: ReducedCover,
    start: NDArray[np.int64],
    budget: WorkBudget,
    *,
    n_sets: int | None = None,
) -> NDArray[np.int64]:
    """Extend a selection by the set of most new weight a unit of cost.

    Stops at the required weight or, if ``n_sets`` is given, at that many sets.

    Returns:
        Selected sets in the order of choice.
    """
    chosen = [int(s) for s in start]
    counts = _counts(cover, chosen)
    covered = float(cover.weights[counts > 0].sum())
    while True:
        full = covered >= cover.required if n_sets is None else len(chosen) >= n_sets
        if full:
            break
        gains = cover.by_set @ np.where(counts > 0, 0.0, cover.weights)
        budget.spend(cover.entries)
        best = int(np.argmax(gains / cover.costs if n_sets is None else gains))
        if not gains[best] > 0:
            break
        chosen.append(best)
        covered += float(gains[best])
        counts[_members(cover, best)] += 1
    return np.array(chosen, dtype=np.int64)


def most_coverage(
    cover: ReducedCover,
    start: NDArray[np.int64],
    budget: WorkBudget,
    *,
    target: float,
    seed: int,
    max_kicks: int,
) -> NDArray[np.int64]:
    """Raise the weight that a selection covers without more sets.

    Best swaps until none helps; then some sets are dropped, refilled half at random,
    and so on from the best selection so far. Ends at the target, at the budget or
    after ``max_kicks`` restarts.

    Returns:
        The best selection found, increasing.
    """
    rng = np.random.default_rng(seed)
    best = Swaps(cover, (int(s) for s in start), budget)
    _descend(best, target, budget)
    for kick in range(max_kicks):
        if best.covered >= target or budget.exhausted or not best.chosen:
            break
        # A wider neighbourhood the longer nothing helped.
        n_sets = len(best.chosen)
        width = min(n_sets, 1 + kick % 4)
        dropped = rng.choice(n_sets, size=width, replace=False).tolist()
        current = best.copy()
        for position in sorted(dropped, reverse=True):
            current.drop(position)
        _refill(current, n_sets, rng)
        _descend(current, target, budget)
        if current.covered > best.covered:
            best = current
    return np.array(sorted(best.chosen), dtype=np.int64)


def prune(cover: ReducedCover, selected: NDArray[np.int64]) -> NDArray[np.int64]:
    """Drop sets, dearest first, while the required weight is still reached."""
    chosen = [int(s) for s in selected]
    counts = _counts(cover, chosen)
    covered = float(cover.weights[counts > 0].sum())
    for s in sorted(chosen, key=lambda s: (-cover.costs[s], -s)):
        rows = _members(cover, s)
        loss = float(cover.weights[rows[counts[rows] == 1]].sum())
        if covered - loss >= cover.required:
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
) -> NDArray[np.int64]:
    """Lower the cost of a selection that reaches the required weight.

    Drops some sets at random, lets greedy repair the cover, keeps what is cheaper.

    Returns:
        The cheapest selection found, increasing.
    """
    rng = np.random.default_rng(seed)
    best = prune(cover, start)
    best_cost = float(cover.costs[best].sum())
    for _ in range(max_kicks):
        if budget.exhausted or best.size == 0:
            break
        n_kept = best.size - int(rng.integers(1, max(2, best.size // 2 + 1)))
        kept = np.sort(rng.choice(best, size=n_kept, replace=False))
        fresh = int(rng.integers(cover.n_sets))
        trial = prune(cover, greedy(cover, np.union1d(kept, [fresh]), budget))
        cost = float(cover.costs[trial].sum())
        if cost < best_cost * (1.0 - 1e-12):
            best, best_cost = trial, cost
    return best


def _members(cover: ReducedCover, s: int) -> NDArray[np.signedinteger]:
    """Rows that set s covers."""
    return cover.by_set.indices[cover.by_set.indptr[s] : cover.by_set.indptr[s + 1]]


def _counts(cover: ReducedCover, chosen: list[int]) -> NDArray[np.int64]:
    counts = np.zeros(cover.weights.size, dtype=np.int64)
    for s in chosen:
        counts[_members(cover, s)] += 1
    return counts


def _refill(selection: Swaps, n_sets: int, rng: np.random.Generator) -> None:
    """Fill the selection up with sets drawn from the eight of most gain."""
    while len(selection.chosen) < n_sets:
        top = np.argsort(-selection.gain, kind="stable")[:8]
        top = top[selection.gain[top] > 0]
        if top.size == 0:
            break
        selection.add(int(rng.choice(top)))


def _descend(selection: Swaps, target: float, budget: WorkBudget) -> None:
    """Make best swaps until none adds weight."""
    while selection.chosen and selection.covered < target and not budget.exhausted:
        change, out, into = selection.best_swap()
        if not change > 0:
            break
        selection.drop(out)
        selection.add(into)
