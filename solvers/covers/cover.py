"""Fewest or cheapest sets that cover enough weight, with a bound and its proof.

The program is stated in ``cover_problem``. Counts (unit costs) are solved by greedy and
large-neighbourhood search from above, Lagrangian bound and exact search over tuples
from below; among the covers of the fewest sets the one of most weight is sought.
Floors of row sets come after what is required of all (``floors``), a stock after both
(``stocked_counts``). Costs, several needs
and row sets go to the linear program and HiGHS.

References:
    Tarbox and Gottschlich, "Planning for complete sensor coverage in inspection",
    Computer Vision and Image Understanding 61(1), 1995.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from solvers.checked_numbers import allowed_sets, set_names, whole_number
from solvers.covers.bounds.reduced_cover import ReducedCover
from solvers.covers.bounds.reductions import forgiven, reduce_problem
from solvers.covers.search.neighbourhood import greedy, prune
from solvers.one_thread import on_one_thread
from solvers.status import SolveStatus, WorkBudget

from .answers import NONE, Answer
from .cheapest import cheapest_sets
from .counts import fewest_sets
from .cover_problem import CoverProblem
from .floored_counts import fewest_with_floors
from .heaviest import most_weight
from .stocked_counts import fewest_in_stock

DEFAULT_BUDGET = 2e9


@dataclass(frozen=True, eq=False)
class CoverSolution:
    """Answer to a problem.

    Attributes:
        problem: The problem this answers.
        status: How the solve ended.
        selected: Chosen sets in increasing order, shape (k,); if the status is
            ``INFEASIBLE``, few sets that cover all that can be covered, or of as
            many as are allowed those that cover most.
        lower_bound: Proven lower bound on the cost of any cover; inf if infeasible.
            Where HiGHS' bound comes within 1e-5 of the cost, it is the cost.
        proof: What proves the bound, and what cut the proof short if anything did.
        total_bound: The part of the bound that ``required_total`` proves without the
            floors of row sets, where all cost the same and each row needs one set; else
            the bound itself.
    """

    problem: CoverProblem
    status: SolveStatus
    selected: NDArray[np.int64]
    lower_bound: float
    proof: str
    total_bound: float

    @property
    def cost(self) -> float:
        """Cost of the selection."""
        return float(self.problem.costs[self.selected].sum())

    @property
    def covered_weight(self) -> float:
        """Weight that the selection covers, recomputed from the problem."""
        return self.problem.covered_weight(self.selected)

    def shortfall(self) -> float:
        """Return the largest missing share of a row set's weight; 0 if all are met.

        With ``required_total``, of the weight of all as well.
        """
        problem = self.problem
        covered, spare = problem.covered_weights(self.selected), forgiven(problem)
        totals = problem.by_row_set(problem.weights)
        missing = problem.required_weight - covered
        if problem.required_total is not None:
            missing = np.append(missing, problem.required_total - covered.sum())
            totals, spare = (
                np.append(totals, totals.sum()),
                np.append(spare, spare.sum()),
            )
        missing[missing <= spare] = 0.0
        shares = missing / np.where(totals > 0, totals, np.maximum(missing, 1e-300))
        return float(shares.max())


@dataclass(frozen=True, eq=False)
class MaxCoverageSolution:
    """Answer of :func:`solve_max_coverage`.

    Attributes:
        problem: The problem this answers; its requirement plays no part, floors but.
        n_sets: Number of sets allowed.
        status: ``OPTIMAL`` if no such selection covers more, else ``FEASIBLE``, as
            where the floors of row sets aren't met.
        selected: Chosen sets in increasing order, at most ``n_sets``.
        upper_bound: Weight that no ``n_sets`` sets exceed.
        proof: What proves the bound, and what cut the proof short if anything did.
        total_bound: The same of sets that needn't meet the floors.
    """

    problem: CoverProblem
    n_sets: int
    status: SolveStatus
    selected: NDArray[np.int64]
    upper_bound: float
    proof: str
    total_bound: float

    @property
    def covered_weight(self) -> float:
        """Weight that the selection covers, recomputed from the problem."""
        return self.problem.covered_weight(self.selected)


@on_one_thread
def solve_cover(
    problem: CoverProblem,
    *,
    max_sets: int | None = None,
    time_limit: float = 60.0,
    seed: int = 0,
    budget: float = DEFAULT_BUDGET,
    heaviest: bool = True,
    reduced: ReducedCover | None = None,
) -> CoverSolution:
    """Find the fewest (or cheapest) sets that reach the required weight.

    Args:
        problem: The cover to solve.
        max_sets: Sets allowed. If more are proved necessary, the status is
            ``INFEASIBLE`` and the selection covers the most with that many; if no
            cover this small is found but none is excluded, it is ``UNKNOWN``.
        time_limit: Wall time that cuts the work, in [s]; the proof then says so.
        seed: Seed of the neighbourhood search.
        budget: Counted work, in matrix entries touched; about 1e9 a second.
        heaviest: Whether to look for the one of most weight among the covers of the
            fewest sets; no for who asks `solve_max_coverage` next.
        reduced: This problem's `reduced_problem`, where it is at hand.

    Returns:
        The solution. An infeasible problem is an answer, not an error: its selection
        covers all the weight that can be covered (or the most with ``max_sets``).
    """
    fixed = problem.fixed
    if max_sets is not None:
        max_sets = allowed_sets("max_sets", max_sets, least=1, fixed=fixed)
    seed = whole_number("seed", seed, least=0)
    work = WorkBudget(budget, time_limit=time_limit)
    cover = _or_reduce(problem, reduced)
    work.spend(cover.entries)
    free = None if max_sets is None else max_sets - fixed.size
    if not cover.required > 0:
        nothing = "no weight is required"
        proof = "the fixed sets suffice" if fixed.size else nothing
        answer = Answer(SolveStatus.OPTIMAL, NONE, 0.0, proof)
    elif not cover.reachable:
        answer = _unreachable(cover, work, seed, free)
    else:
        counting = problem.unit_costs
        unit = float(problem.costs[0]) if counting else 1.0
        cover = replace(cover, costs=cover.costs / unit)
        search = fewest_sets if counting and cover.simple else cheapest_sets
        if counting and cover.floored and cover.without_floors.simple:
            search = fewest_with_floors
        how: dict[str, Any] = {"seed": seed, "max_sets": free, "heaviest": heaviest}
        if cover.limited:
            answer = fewest_in_stock(cover, work, search, **how)
        else:
            answer = search(cover, work, **how)
        answer = replace(answer, bound=answer.bound * unit)
        if answer.total_bound is not None:
            answer = replace(answer, total_bound=answer.total_bound * unit)
    selected = np.union1d(fixed, cover.kept[answer.selected])
    lower = answer.bound + float(problem.costs[fixed].sum())
    cost = float(problem.costs[selected].sum())
    # Both are sums of costs, in another order.
    lower = cost if cost < lower <= cost * (1.0 + 1e-12) else lower
    total = lower
    if answer.total_bound is not None:
        total = min(lower, answer.total_bound + float(problem.costs[fixed].sum()))
    return CoverSolution(problem, answer.status, selected, lower, answer.proof, total)


@on_one_thread
def solve_max_coverage(
    problem: CoverProblem,
    n_sets: int,
    *,
    warm_start: ArrayLike | None = None,
    time_limit: float = 60.0,
    seed: int = 0,
    budget: float = DEFAULT_BUDGET,
    reduced: ReducedCover | None = None,
) -> MaxCoverageSolution:
    """Find the largest weight that at most ``n_sets`` sets cover; costs play no part.

    With ``required_total`` the floors of row sets count: of the selections found that
    lack least of them (and of the total), the one of most weight is returned. The bound
    is of selections that meet the floors where these are met, else of any.

    Args:
        problem: The cover; its required weight plays no part but for floors.
        n_sets: Sets allowed, at least 0.
        warm_start: A selection to start from; the answer is never worse.
        time_limit: Wall time that cuts the work, in [s]; the proof then says so.
        seed: Seed of the neighbourhood search.
        budget: Counted work, in matrix entries touched.
        reduced: This problem's `reduced_problem`, where it is at hand.
    """
    fixed = problem.fixed
    n_sets = allowed_sets("n_sets", n_sets, least=0, fixed=fixed)
    warm_start = () if warm_start is None else warm_start
    start = set_names("warm_start", warm_start, problem.costs.size)
    if start.size > n_sets:
        raise ValueError(f"warm_start must name at most {n_sets} sets of the problem")
    free = n_sets - fixed.size
    seed = whole_number("seed", seed, least=0)
    work = WorkBudget(budget, time_limit=time_limit)
    cover = _or_reduce(problem, reduced, costs=np.ones(problem.costs.size))
    work.spend(cover.entries)
    known = cover.stand_in[np.setdiff1d(start, fixed)]
    known = np.unique(known[known >= 0])[:free]
    answer = most_weight(cover, free, work, seed=seed, start=known)
    selected = np.union1d(fixed, cover.kept[answer.selected])
    warm = np.union1d(fixed, start)
    better = problem.covered_weight(warm) > problem.covered_weight(selected)
    allowed = warm.size <= n_sets and problem.in_stock(warm)
    if better and allowed and not cover.floored:
        # Only where sets that stand in for others coincide.
        selected = warm
    covered = problem.covered_weight(selected)
    optimal = answer.status is SolveStatus.OPTIMAL
    upper = (cover.settled + answer.bound) * cover.unit
    upper = covered if optimal else max(covered, upper)
    free_upper = upper
    if answer.total_bound is not None:
        free_upper = max(upper, (cover.settled + answer.total_bound) * cover.unit)
    return MaxCoverageSolution(
        problem, n_sets, answer.status, selected, upper, answer.proof, free_upper
    )


def reduced_problem(problem: CoverProblem) -> ReducedCover:
    """Return what both solvers search, to be made once for several questions.

    Raises:
        ValueError: If costs differ: where they don't count, more sets may be dropped.
    """
    if not problem.unit_costs:
        raise ValueError("costs differ: solve each question from the problem itself")
    return reduce_problem(problem)


def _or_reduce(
    problem: CoverProblem,
    reduced: ReducedCover | None,
    *,
    costs: NDArray[np.float64] | None = None,
) -> ReducedCover:
    if reduced is None:
        return reduce_problem(problem, costs=costs)
    if reduced.problem is not problem:
        raise ValueError("reduced must be made from this problem")
    return reduced


def _unreachable(
    cover: ReducedCover, work: WorkBudget, seed: int, max_sets: int | None
) -> Answer:
    """Answer a problem whose requirement exceeds the weight of all sets together."""
    everything = replace(cover, quotas=cover.totals)
    few = prune(everything, greedy(everything, NONE, work))
    if max_sets is not None and few.size > max_sets:
        few = most_weight(cover, max_sets, work, seed=seed).selected
    proof = "all sets together cover less than is required"
    return Answer(SolveStatus.INFEASIBLE, few, float("inf"), proof)
