"""What other numbers of candidates than the one taken would give."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solvers.covers.cover import DEFAULT_BUDGET

from .completed import greedy_cover
from .selection import CandidateCover, Selection

# Counts beyond the one taken for which the best candidates are reported.
MORE = 2
# Counted work for the marginal table's other counts, where no proof is claimed.
_MARGINAL_BUDGET = 3e8


@dataclass(frozen=True, eq=False)
class Marginals:
    """What other numbers of candidates than the one taken would give.

    Attributes:
        by_count: Best candidates found for 1, 2, ... k + 2 devices.
        n_covered: Samples that these cover, and the proven most that as many
            candidates cover.
        greedy: Candidates that the greedy cover takes.
    """

    by_count: dict[int, NDArray[np.int64]]
    n_covered: dict[int, tuple[int, int]]
    greedy: int


def marginals(cover: CandidateCover, selection: Selection) -> Marginals:
    """Return the best candidates for every other count, for the table in the plan."""
    taken = len(selection.chosen)
    by_count: dict[int, NDArray[np.int64]] = {}
    n_covered: dict[int, tuple[int, int]] = {}
    best = np.empty(0, dtype=np.int64)
    most = min(taken + MORE, cover.covers.shape[1])
    most = most if cover.stock is None else min(most, cover.stock.total)
    for count in range(max(1, cover.n_existing), most + 1):
        if count == taken:
            best = selection.chosen
            n_covered[count] = selection.n_covered, selection.n_covered_bound
        else:
            best, bound = cover.most_covering(
                count,
                selection.smallest if count == selection.needed else best,
                DEFAULT_BUDGET if count == taken - 1 else _MARGINAL_BUDGET,
            )
            if count < selection.total_bound:
                # Where so many are proved too few, they fall short of the requirement.
                bound = min(bound, selection.required - 1)
            n_covered[count] = cover.n_covered(best), bound
        by_count[count] = best
    most_of_all = np.inf
    for count in sorted(n_covered, reverse=True):
        # No fewer cover more than the most of more.
        covered, bound = n_covered[count]
        most_of_all = min(most_of_all, bound)
        n_covered[count] = covered, int(most_of_all)
    return Marginals(by_count, n_covered, _greedy_count(cover, selection.needed))


def _greedy_count(cover: CandidateCover, needed: int) -> int:
    """How many candidates the greedy cover takes.

    Where that runs out of stock, of any number of each model, but no fewer than are
    needed.
    """
    taken = greedy_cover(cover, np.arange(cover.n_existing))
    if taken is None:
        return max(_greedy_count(cover.without_stock, 0), needed)
    return len(taken)
