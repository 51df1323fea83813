"""Fewest candidates that cover a share of the samples, and what was proved about it.

Both stages pose the same program: samples are area-true, all of equal weight, so
weights are counts and every comparison is exact.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from solvers import CoverProblem, solve_cover
from solvers.bit_rows import sparse_rows
from solvers.covers.bounds.reductions import ReducedCover
from solvers.covers.cover import DEFAULT_BUDGET, reduced_problem, solve_max_coverage

# Counts beyond the one taken for which the best candidates are reported.
MORE = 2
# Counted work for the marginal table's other counts, where no proof is claimed.
_MARGINAL_BUDGET = 3e8


@dataclass(frozen=True, eq=False)
class Selection:
    """The answer of `select_fewest`.

    Attributes:
        chosen: Candidates taken, at most the number allowed, shape (k,).
        smallest: The smallest cover found, allowed or not, shape (needed,).
        lower_bound: Proven least number of candidates for these samples.
        status: `optimal`, `feasible` or `infeasible`.
        proof: What proves the bound.
        required: Samples that must be covered.
        n_covered: Most samples that k candidates were found to cover.
        n_covered_bound: Proven upper bound on that.
        but_for_bodies: How many would do if bodies didn't collide or stand in each
            other's way, where that costs more or leaves too little; else None.
    """

    chosen: NDArray[np.int64]
    smallest: NDArray[np.int64]
    lower_bound: int
    status: Literal["optimal", "feasible", "infeasible"]
    proof: str
    required: int
    n_covered: int
    n_covered_bound: int
    but_for_bodies: int | None = None

    @property
    def needed(self) -> int:
        """Candidates of the smallest cover found, allowed or not."""
        return len(self.smallest)


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


@dataclass(frozen=True, eq=False)
class CandidateCover:
    """What candidates cover, and how much of it devices must cover together.

    Attributes:
        covers: Whether a candidate (column) covers a sample (row), shape (n, m).
        share: Required, of the samples that any candidate covers, in (0, 1].
        seed: Of the heuristics.
        max_count: Candidates allowed; None for no limit.
        n_existing: First candidates that are taken whatever they cover.
    """

    covers: NDArray[np.bool_]
    share: float
    seed: int = 0
    max_count: int | None = None
    n_existing: int = 0

    @property
    def required(self) -> int:
        """Samples that must be covered."""
        return required_samples(np.any(self.covers, axis=1), self.share)

    @cached_property
    def problem(self) -> CoverProblem:
        """The cover over the samples that some candidate covers."""
        return cover_problem(self.covers, self.required, self.n_existing)

    @cached_property
    def reduced(self) -> ReducedCover:
        """The same, reduced once for every count that is looked at."""
        return reduced_problem(self.problem)

    def n_covered(self, chosen: NDArray[np.int64]) -> int:
        """Return how many samples candidates cover together."""
        return int(self.covers[:, chosen].any(axis=1).sum())

    def confirms(self, chosen: NDArray[np.int64]) -> bool:
        """Return whether candidates cover the share; of samples that are fresh."""
        reached = self.covers.any(axis=1).sum()
        return bool(self.n_covered(chosen) >= self.share * reached)

    def most_covering(
        self,
        count: int,
        warm_start: NDArray[np.int64] | None,
        budget: float = DEFAULT_BUDGET,
    ) -> tuple[NDArray[np.int64], int]:
        """Return the candidates that cover most, and the proven most of so many."""
        best = solve_max_coverage(
            self.problem,
            count,
            warm_start=warm_start,
            seed=self.seed,
            budget=budget,
            reduced=self.reduced,
        )
        return best.selected, int(np.floor(best.upper_bound + 1e-6))


def select_fewest(
    cover: CandidateCover,
    *,
    known: NDArray[np.int64] | None = None,
    budget: float = DEFAULT_BUDGET,
) -> Selection:
    """Return the fewest candidates that cover the required share.

    After the count is known, the selection that covers most at that count is taken.

    `known` candidates may cover as much with fewer than the search finds.
    """
    solution = solve_cover(
        cover.problem,
        seed=cover.seed,
        budget=budget,
        heaviest=False,
        reduced=cover.reduced,
    )
    smallest, required = solution.selected, cover.required
    if known is not None and len(known) < len(smallest):
        smallest = known if cover.n_covered(known) >= required else smallest
    needed = len(smallest)
    lower_bound = int(np.ceil(solution.lower_bound - 1e-9))
    allowed = needed if cover.max_count is None else min(needed, cover.max_count)
    chosen, bound = cover.most_covering(
        allowed, smallest if allowed == needed else None
    )
    n_covered = cover.n_covered(chosen)
    met = needed <= allowed and n_covered >= required
    proved = "optimal" if lower_bound >= needed else "feasible"
    return Selection(
        chosen,
        smallest,
        min(lower_bound, needed),
        proved if met else "infeasible",
        solution.proof,
        required,
        n_covered,
        bound,
    )


def fewest_count(cover: CandidateCover) -> int:
    """Return how many candidates `select_fewest` takes, and spend nothing on which."""
    return len(solve_cover(cover.problem, seed=cover.seed, heaviest=False).selected)


def required_samples(reached: NDArray[np.bool_], share: float) -> int:
    """Return how many samples a share of those that any candidate covers is."""
    return int(np.ceil(share * int(reached.sum()) - 1e-9))


def marginals(cover: CandidateCover, selection: Selection) -> Marginals:
    """Return the best candidates for every other count, for the table in the plan."""
    taken = len(selection.chosen)
    by_count: dict[int, NDArray[np.int64]] = {}
    n_covered: dict[int, tuple[int, int]] = {}
    best = np.empty(0, dtype=np.int64)
    most = min(taken + MORE, cover.covers.shape[1])
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
            if count < selection.lower_bound:
                # Where so many are proved too few, they fall short of the requirement.
                bound = min(bound, selection.required - 1)
            n_covered[count] = cover.n_covered(best), bound
        by_count[count] = best
    return Marginals(by_count, n_covered, _greedy_count(cover))


def cover_problem(
    covers: NDArray[np.bool_], required: int, n_existing: int = 0
) -> CoverProblem:
    """State the cover over the samples that some candidate covers.

    Args:
        covers: Whether a candidate (column) covers a sample (row), shape (n, m).
        required: Samples that must be covered.
        n_existing: First candidates that are taken whatever they cover.
    """
    reachable = covers[covers.any(axis=1)]
    return CoverProblem(
        sparse_rows(reachable),
        required_weight=np.array([required]),
        fixed=np.arange(n_existing),
    )


def _greedy_count(cover: CandidateCover) -> int:
    """How many candidates it takes when each adds most samples, lower index first."""
    covers, count = cover.covers, cover.n_existing
    uncovered = ~covers[:, :count].any(axis=1)
    while len(covers) - uncovered.sum() < cover.required:
        best = int(np.argmax(covers[uncovered].sum(axis=0)))
        uncovered &= ~covers[:, best]
        count += 1
    return count
