"""Selections of a given size for covers with several needs or row sets.

The worth of a selection is, first, what it reaches of the requirements,
sum_g min(W_g, w(G_g)); then, while that falls short, the service that rows have had,
sum_i w_i min(n_i, r_i) / r_i, and after that the weight. The best exchange of a set is
made until none is worth more; then some sets are dropped and refilled half at random.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from solvers.covers.bounds.reductions import ReducedCover
from solvers.status import WorkBudget

_TOP = 8


class Worth(NamedTuple):
    """How good a selection is; compared in this order.

    Attributes:
        reached: Integer-valued weight that counts towards the requirements.
        beyond: Service of rows while short of them, else total weight.
    """

    reached: float
    beyond: float


def exchange(
    cover: ReducedCover,
    start: NDArray[np.int64],
    budget: WorkBudget,
    *,
    seed: int,
    heaviest: bool,
    max_kicks: int | None = None,
) -> NDArray[np.int64]:
    """Return the selection of most worth found, with no more sets than at the start.

    Args:
        cover: The cover.
        start: Selection to start from, at least one set.
        budget: Counted work.
        seed: Seed of the restarts.
        heaviest: Whether to go on for weight once the requirements are met.
        max_kicks: Restarts at most, default 20 and 10 for each set.
    """
    rng = np.random.default_rng(seed)
    best, worth = _descend(cover, [int(s) for s in start], budget, heaviest=heaviest)
    kicks = 20 + 10 * start.size if max_kicks is None else max_kicks
    for kick in range(kicks):
        if budget.exhausted or (worth.reached >= cover.required and not heaviest):
            break
        width = min(len(best), 1 + kick % 4)
        dropped = rng.choice(len(best), size=width, replace=False)
        trial = _refill(cover, np.delete(best, dropped).tolist(), len(best), rng)
        trial, other = _descend(cover, trial, budget, heaviest=heaviest)
        if other > worth:
            best, worth = trial, other
    return np.array(sorted(best), dtype=np.int64)


def _descend(
    cover: ReducedCover, chosen: list[int], budget: WorkBudget, *, heaviest: bool
) -> tuple[list[int], Worth]:
    """Make the best exchange until none is worth more."""
    worth = worth_of(cover, np.array(chosen, dtype=np.int64))
    while not budget.exhausted:
        if worth.reached >= cover.required and not heaviest:
            break
        ways = [_best_without(cover, chosen, i, budget) for i in range(len(chosen))]
        i = max(range(len(ways)), key=lambda i: ways[i][0])
        if not ways[i][0] > worth:
            break
        chosen = [*chosen[:i], *chosen[i + 1 :], ways[i][1]]
        # Recomputed, so that rounding of parts of weights can't send it in circles.
        other = worth_of(cover, np.array(chosen, dtype=np.int64))
        if not other > worth:
            break
        worth = other
    return chosen, worth


def worth_of(cover: ReducedCover, selected: NDArray[np.int64]) -> Worth:
    """Return the worth of a selection."""
    counts = cover.served(selected)
    covered = cover.by_row_set(np.where(counts >= cover.needs, cover.weights, 0.0))
    reached = float(np.minimum(covered, cover.quotas).sum())
    if reached >= cover.required:
        return Worth(reached, float(covered.sum()))
    service = np.minimum(counts, cover.needs) / cover.needs
    # Below any weight at which the requirements are met.
    return Worth(reached, float(cover.weights @ service) - cover.total)


def _best_without(
    cover: ReducedCover, chosen: list[int], i: int, budget: WorkBudget
) -> tuple[Worth, int]:
    """Return the best set to take instead of the i-th, and the worth of that."""
    others = np.array(chosen[:i] + chosen[i + 1 :], dtype=np.int64)
    counts = cover.served(others)
    done = counts >= cover.needs
    last = counts == cover.needs - 1
    held = cover.by_row_set(np.where(done, cover.weights, 0.0))
    n_groups = cover.quotas.size
    columns = np.zeros((cover.weights.size, n_groups + 1))
    rows = np.flatnonzero(last)
    columns[rows, cover.row_sets[rows]] = cover.weights[rows]
    columns[:, -1] = np.where(done, 0.0, cover.weights / cover.needs)
    gains = np.asarray(cover.by_set @ columns)
    budget.spend(cover.entries * (2.0 + n_groups) + 8.0 * columns.size)
    reached = np.minimum(held + gains[:, :-1], cover.quotas).sum(axis=1)
    service = cover.weights @ (np.minimum(counts, cover.needs) / cover.needs)
    beyond = np.where(
        reached >= cover.required,
        held.sum() + gains[:, :-1].sum(axis=1),
        service + gains[:, -1] - cover.total,
    )
    reached[others] = -1.0
    best = int(np.lexsort((-np.arange(beyond.size), beyond, reached))[-1])
    return Worth(float(reached[best]), float(beyond[best])), best


def _refill(
    cover: ReducedCover, chosen: list[int], n_sets: int, rng: np.random.Generator
) -> list[int]:
    """Fill a selection up with sets drawn from the eight of most open service."""
    while len(chosen) < n_sets:
        counts = cover.served(np.array(chosen, dtype=np.int64))
        parts = np.where(counts < cover.needs, cover.weights / cover.needs, 0.0)
        gains = cover.by_set @ parts
        gains[chosen] = -1.0
        top = np.argsort(-gains, kind="stable")[: min(_TOP, n_sets)]
        top = top[gains[top] >= 0.0]
        if top.size == 0:
            break
        chosen = [*chosen, int(rng.choice(top))]
    return chosen
