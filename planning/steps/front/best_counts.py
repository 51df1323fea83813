"""The best candidates of each number, each from the ones before."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from planning.proofs.selection import CandidateCover

# Of what can be covered at all: more devices than that take aren't asked for.
_ALL = 0.995
# Devices of a kind where no number is given.
MOST = 8


@dataclass(frozen=True, eq=False)
class BestCount:
    """Candidates of a number that cover most, and samples that none exceed."""

    chosen: NDArray[np.int64]
    covered: int
    bound: int


def best_counts(
    cover: CandidateCover, most: int | None, budget: float
) -> dict[int, BestCount]:
    """Return the best candidates found of 1, 2, ... devices, existing ones in all.

    Up to `most`; None: until nearly all is covered that can be. Each number's are
    never worse than the ones before and another.
    """
    cover = replace(cover, max_count=None)
    n_reached = int(cover.covers.any(axis=1).sum())
    last = min(MOST if most is None else most, cover.most)
    chosen = np.arange(cover.n_existing)
    found: dict[int, BestCount] = {}
    for count in range(max(1, cover.n_existing), last + 1):
        begun = with_more(cover, chosen, count)
        best, bound = cover.most_covering(count, begun, budget)
        chosen = with_more(cover, best, count)
        if cover.n_covered(chosen) < cover.n_covered(begun):
            chosen = begun
        covered = cover.n_covered(chosen)
        found[count] = BestCount(chosen, covered, min(bound, n_reached))
        if most is None and covered >= _ALL * n_reached:
            break
    least = n_reached
    for count in sorted(found, reverse=True):
        # No fewer cover more than the most of more.
        least = min(least, found[count].bound)
        found[count] = replace(found[count], bound=least)
    return found


def with_more(
    cover: CandidateCover, chosen: NDArray[np.int64], count: int
) -> NDArray[np.int64]:
    """Return candidates and others, so many in all as far as there are.

    Each covers most of what is covered by none, then by one alone, lower index first.
    """
    taken = chosen.tolist()
    while len(taken) < count:
        times = cover.covers[:, taken].sum(axis=1)
        new, second = (cover.covers[times == k].sum(axis=0) for k in (0, 1))
        worth = new * (len(times) + 1) + second
        worth[taken] = -1
        if cover.stock is not None:
            left = cover.stock.left(np.array(taken, dtype=np.int64))
            worth[left[cover.stock.kinds] <= 0] = -1
        best = int(np.argmax(worth))
        if worth[best] < 0:
            break
        taken.append(best)
    return np.array(sorted(taken), dtype=np.int64)
