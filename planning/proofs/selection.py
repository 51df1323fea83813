"""Fewest candidates that cover a share of the samples, and what was proved about it.

Both stages pose the same program: samples are area-true, all of equal weight, so
weights are counts and every comparison is exact.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from solvers import CoverProblem, solve_cover
from solvers.bit_rows import sparse_rows
from solvers.covers.bounds.reduced_cover import ReducedCover
from solvers.covers.cover import (
    DEFAULT_BUDGET,
    CoverSolution,
    MaxCoverageSolution,
    reduced_problem,
    solve_max_coverage,
)

from .device_stock import DeviceStock
from .quotas import Quotas, RegionFloors

# Standard errors above the floors of regions at which selections aim.
_AIMED = 1.0


@dataclass(frozen=True, eq=False)
class Selection:
    """The answer of `select_fewest`.

    Attributes:
        chosen: Candidates taken, at most the number allowed, shape (k,).
        smallest: The smallest cover found, allowed or not, shape (needed,).
        lower_bound: Proven least number of candidates for these samples.
        status: `optimal`, `feasible` or `infeasible`.
        proof: What proves the bound.
        required: Samples that must be covered, of regions and all.
        n_covered: Most samples that k candidates were found to cover.
        n_covered_bound: Proven upper bound on that.
        total_bound: The part of the lower bound that holds without floors of regions.
        but_for_bodies: How many would do if bodies didn't collide or stand in each
            other's way, where that costs more or leaves too little; else None.
        floors: What must be covered, where regions have floors; else None.
        completed: Whether candidates were added for fresh samples (`completed`).
    """

    chosen: NDArray[np.int64]
    smallest: NDArray[np.int64]
    lower_bound: int
    status: Literal["optimal", "feasible", "infeasible"]
    proof: str
    required: int
    n_covered: int
    n_covered_bound: int
    total_bound: int = 0
    but_for_bodies: int | None = None
    floors: Quotas | None = None
    completed: bool = False

    @property
    def needed(self) -> int:
        """Candidates of the smallest cover found, allowed or not."""
        return len(self.smallest)


@dataclass(frozen=True, eq=False)
class CandidateCover:
    """What candidates cover, and how much of it devices must cover together.

    Attributes:
        covers: Whether a candidate (column) covers a sample (row), shape (n, m).
        share: Required, of the samples that any candidate covers, in (0, 1].
        seed: Of the heuristics.
        max_count: Candidates allowed; None for no limit.
        n_existing: First candidates that are taken whatever they cover.
        regions: Floors of regions; None: there are none.
        stock: How many there are of each candidate's model; None: any number.
    """

    covers: NDArray[np.bool_]
    share: float
    seed: int = 0
    max_count: int | None = None
    n_existing: int = 0
    regions: RegionFloors | None = None
    stock: DeviceStock | None = None

    @cached_property
    def quotas(self) -> Quotas:
        """Samples that must be covered."""
        return self._quotas(0.0)

    @cached_property
    def aims(self) -> Quotas:
        """The same with floors so high that fresh samples should confirm them."""
        return self._quotas(_AIMED)

    @property
    def floors(self) -> Quotas | None:
        """The same where any region has a floor; else None."""
        return self.quotas if self.quotas.floors.any() else None

    @property
    def required(self) -> int:
        """Samples that must be covered, of regions and all."""
        return self.quotas.total

    @cached_property
    def problem(self) -> CoverProblem:
        """The cover over the samples that some candidate covers."""
        return self.asking(self.quotas)

    @cached_property
    def reduced(self) -> ReducedCover:
        """The same, reduced once for every count that is looked at."""
        return reduced_problem(self.problem)

    @cached_property
    def _aimed(self) -> ReducedCover:
        if np.array_equal(self.aims.floors, self.quotas.floors):
            return self.reduced
        return reduced_problem(self.asking(self.aims))

    def asking(self, required: Quotas) -> CoverProblem:
        """Return the cover with other requirements."""
        return cover_problem(self.covers, required, self.n_existing, self.stock)

    @property
    def most(self) -> int:
        """Candidates that a selection may hold, whatever is required."""
        n = self.covers.shape[1]
        stock = n if self.stock is None else self.stock.total
        return min(n if self.max_count is None else self.max_count, stock)

    @property
    def without_stock(self) -> "CandidateCover":
        """The same cover with as many devices of each model as are wanted."""
        return replace(self, stock=None)

    def _quotas(self, spare: float) -> Quotas:
        regions = self.regions or RegionFloors.none(len(self.covers))
        reached = np.any(self.covers, axis=1)
        return Quotas.of(regions, reached, self.share, spare=spare)

    def covered(self, chosen: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return which samples candidates cover together, shape (n,)."""
        return np.any(self.covers[:, chosen], axis=1)

    def n_covered(self, chosen: NDArray[np.int64]) -> int:
        """Return how many samples candidates cover together."""
        return int(self.covered(chosen).sum())

    def enough(self, chosen: NDArray[np.int64]) -> bool:
        """Return whether candidates cover the share and the floors of all regions."""
        return self.quotas.enough(self.covered(chosen))

    def most_covering(
        self,
        count: int,
        warm_start: NDArray[np.int64] | None,
        budget: float = DEFAULT_BUDGET,
    ) -> tuple[NDArray[np.int64], int]:
        """Return the candidates that cover most, and the proven most of so many.

        Of those that aim above the floors, else of those that meet them, else of those
        that lack least; the bound is of any.
        """

        def among(reduced: ReducedCover) -> MaxCoverageSolution:
            return solve_max_coverage(
                reduced.problem,
                count,
                warm_start=warm_start,
                seed=self.seed,
                budget=budget,
                reduced=reduced,
            )

        best = among(self._aimed)
        selected, bound = best.selected, int(np.floor(best.total_bound + 1e-6))
        known = warm_start is not None and self.enough(warm_start)
        if known and not self.enough(selected):
            selected = among(self.reduced).selected
        return selected, bound


def select_fewest(
    cover: CandidateCover,
    *,
    known: NDArray[np.int64] | None = None,
    budget: float = DEFAULT_BUDGET,
) -> Selection:
    """Return the fewest candidates that cover the required share, and the floors.

    After the count is known, the selection that covers most at that count is taken.

    `known` candidates may cover as much with fewer than the search finds.

    Where the stock doesn't suffice, those of it that cover most are taken; how many
    would be needed is of any number of each model.
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
        there = cover.problem.in_stock(known)
        smallest = known if there and cover.enough(known) else smallest
    if cover.stock is not None and not cover.enough(smallest):
        return _out_of_stock(cover, budget)
    needed = len(smallest)
    lower_bound = int(np.ceil(solution.lower_bound - 1e-9))
    allowed = min(needed, cover.most)
    chosen, bound = cover.most_covering(
        allowed, smallest if allowed == needed else None
    )
    n_covered = cover.n_covered(chosen)
    met = needed <= allowed and cover.enough(chosen)
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
        min(int(np.ceil(solution.total_bound - 1e-9)), needed),
        floors=cover.floors,
    )


def _out_of_stock(cover: CandidateCover, budget: float) -> Selection:
    """What covers most of a stock that isn't enough, and how many would be."""
    wanted = select_fewest(replace(cover.without_stock, max_count=None), budget=budget)
    chosen, bound = cover.most_covering(cover.most, None)
    chosen = _without_idle(cover, chosen)
    return replace(
        wanted,
        chosen=chosen,
        status="infeasible",
        n_covered=cover.n_covered(chosen),
        n_covered_bound=bound,
    )


def _without_idle(
    cover: CandidateCover, chosen: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return candidates less those without which as much is covered, least first."""
    kept = chosen
    for one in sorted(chosen.tolist(), key=lambda k: int(cover.covers[:, k].sum())):
        fewer = kept[kept != one]
        if one >= cover.n_existing and np.array_equal(
            cover.covered(fewer), cover.covered(kept)
        ):
            kept = fewer
    return kept


def fewest_count(cover: CandidateCover) -> int:
    """Return how many candidates `select_fewest` takes, and spend nothing on which."""
    return len(fewest_of(cover).selected)


def fewest_of(cover: CandidateCover, budget: float = DEFAULT_BUDGET) -> CoverSolution:
    """Return the fewest candidates that counted work finds, whichever they are."""
    return solve_cover(cover.problem, seed=cover.seed, budget=budget, heaviest=False)


def cover_problem(
    covers: NDArray[np.bool_],
    required: int | Quotas,
    n_existing: int = 0,
    stock: DeviceStock | None = None,
) -> CoverProblem:
    """State the cover over the samples that some candidate covers.

    Args:
        covers: Whether a candidate (column) covers a sample (row), shape (n, m).
        required: Samples that must be covered, perhaps with floors of regions.
        n_existing: First candidates that are taken whatever they cover.
        stock: How many there are of each candidate's model; None: any number.
    """
    reached = covers.any(axis=1)
    rows = sparse_rows(covers[reached])
    taken: dict[str, Any] = {"fixed": np.arange(n_existing)}
    if stock is not None:
        taken |= {"kinds": stock.kinds, "stock": stock.counts}
    if isinstance(required, Quotas) and required.floors.any():
        regions = required.regions.row[reached]
        return CoverProblem(
            rows,
            # The last may have no row that any candidate covers.
            required_weight=required.floors[: regions.max(initial=0) + 1].astype(float),
            required_total=required.total,
            row_sets=regions,
            **taken,
        )
    total = required.total if isinstance(required, Quotas) else required
    return CoverProblem(rows, required_weight=np.array([total]), **taken)
