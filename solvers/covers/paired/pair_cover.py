"""Solve covers by pairs: fewest sets, and most weight with so many.

From above greedy and exchanges, from below what sets are worth by themselves, and a
tree that closes the gap; each offers a smaller cover or proves one set more, and spends
a share of one counted budget.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from solvers.checked_numbers import allowed_sets, set_names, whole_number
from solvers.covers.answers import cut_short
from solvers.one_thread import on_one_thread
from solvers.status import SolveStatus, WorkBudget

from .pair_bounds import count_bound, worth
from .pair_problem import PairCoverProblem
from .pair_rows import PairRows, pair_rows
from .pair_search import exchanged, fewer_sets, greedy, prune
from .pair_tree import PairTree

DEFAULT_BUDGET = 4e9
_NOTHING = "no weight is required"
_LARGEST = "sum of the largest sets"


@dataclass(frozen=True, eq=False)
class PairCoverSolution:
    """Answer to a cover by pairs.

    Attributes:
        problem: The problem this answers.
        status: How the solve ended.
        selected: Chosen sets in increasing order, shape (k,); if the status is
            ``INFEASIBLE``, few sets that cover all that can be covered, or of as
            many as are allowed those found to cover most.
        lower_bound: Proven lower bound on the number of sets; inf if infeasible.
        proof: What proves the bound, and what cut the proof short if anything did.
    """

    problem: PairCoverProblem
    status: SolveStatus
    selected: NDArray[np.int64]
    lower_bound: float
    proof: str

    @property
    def covered_weight(self) -> float:
        """Weight that the selection covers, recomputed from the problem."""
        return self.problem.covered_weight(self.selected)

    def shortfall(self) -> float:
        """Return the missing share of the weight of all elements; 0 if it is met."""
        problem, total = self.problem, float(self.problem.weights.sum())
        missing = problem.required_weight - self.covered_weight
        rows = pair_rows(problem)
        if rows.meets(self.selected):
            return 0.0
        return missing / total if total > 0 else 1.0


@dataclass(frozen=True, eq=False)
class MostPairsSolution:
    """Answer of :func:`solve_most_pairs`.

    Attributes:
        problem: The problem this answers; its requirement plays no part.
        n_sets: Number of sets allowed.
        status: ``OPTIMAL`` if no such selection covers more, else ``FEASIBLE``.
        selected: Chosen sets in increasing order, at most ``n_sets``.
        upper_bound: Weight that no ``n_sets`` sets exceed.
        proof: What proves the bound, and what cut the proof short if anything did.
    """

    problem: PairCoverProblem
    n_sets: int
    status: SolveStatus
    selected: NDArray[np.int64]
    upper_bound: float
    proof: str

    @property
    def covered_weight(self) -> float:
        """Weight that the selection covers, recomputed from the problem."""
        return self.problem.covered_weight(self.selected)


@on_one_thread
def solve_pair_cover(
    problem: PairCoverProblem,
    *,
    max_sets: int | None = None,
    time_limit: float = 60.0,
    seed: int = 0,
    budget: float = DEFAULT_BUDGET,
) -> PairCoverSolution:
    """Find the fewest sets whose pairs reach the required weight.

    Args:
        problem: The cover to solve.
        max_sets: Sets allowed. If more are proved necessary, the status is
            ``INFEASIBLE`` and the selection covers much with that many; if no cover
            this small is found but none is excluded, it is ``UNKNOWN``.
        time_limit: Wall time that cuts the work, in [s]; the proof then says so.
        seed: Seed of the exchanges.
        budget: Counted work, in entries touched; about 1e9 a second.

    Returns:
        The solution. An infeasible problem is an answer, not an error: its selection
        covers all the weight that can be covered (or much of it with ``max_sets``).
    """
    fixed = problem.fixed
    if max_sets is not None:
        max_sets = allowed_sets("max_sets", max_sets, least=1, fixed=fixed)
    seed = whole_number("seed", seed, least=0)
    work = WorkBudget(budget, time_limit=time_limit)
    cover = pair_rows(problem)
    work.spend(cover.size * (1.0 + cover.n_sets / 64.0))
    if not cover.quota > 0 or cover.meets(fixed):
        # Without any, nothing is met but a requirement of nothing.
        proof = "the fixed sets suffice" if fixed.size else _NOTHING
        return PairCoverSolution(
            problem, SolveStatus.OPTIMAL, fixed, float(fixed.size), proof
        )
    if not cover.total >= cover.quota:
        few = greedy(cover, fixed, work)
        if max_sets is not None and few.size > max_sets:
            few = _most(cover, max_sets, work, seed, fixed)
        proof = "all sets together cover less than is required"
        return PairCoverSolution(
            problem, SolveStatus.INFEASIBLE, few, float("inf"), proof
        )
    return _Count(cover, work, max_sets, seed).solution()


class _Count:
    """Cover from above, bound from below and its proof."""

    def __init__(
        self, cover: PairRows, budget: WorkBudget, max_sets: int | None, seed: int
    ) -> None:
        self.cover, self.budget, self.seed = cover, budget, seed
        self.fixed, self.max_sets = cover.problem.fixed, max_sets
        self.shares = worth(cover)
        self.lower, self.proof = count_bound(cover, self.shares, self.fixed), _LARGEST
        self.selected = greedy(cover, self.fixed, budget)

    @property
    def settled(self) -> bool:
        most = self.cover.n_sets if self.max_sets is None else self.max_sets
        return self.lower >= min(self.selected.size, most + 1)

    def solution(self) -> PairCoverSolution:
        self._improve(self.budget.part(0.2 * self.budget.units), self.seed)
        while not self.settled and not self.budget.exhausted:
            if not self._next_count():
                break
        seed = self.seed
        while not self.settled and not self.budget.exhausted:
            before, seed = self.budget.spent, seed + 1
            self._improve(self.budget, seed)
            if self.budget.spent == before:
                break
        return self._ended()

    def _improve(self, budget: WorkBudget, seed: int) -> None:
        self.selected = fewer_sets(
            self.cover,
            self.selected,
            budget,
            fixed=self.fixed,
            lower=self.lower,
            seed=seed,
        )

    def _next_count(self) -> bool:
        """Refute as many sets as the bound, or find a cover of them."""
        tree = PairTree(
            self.cover,
            self.shares,
            self.lower,
            target=self.cover.quota,
            budget=self.budget.part(0.8 * self.budget.remaining),
            first=True,
        )
        answer = tree.run()
        if answer.selected is not None:
            self.selected = prune(self.cover, answer.selected, self.fixed)
            return True
        if answer.complete:
            self.lower += 1
            self.proof = f"sets of {self.lower - 1} by branch and bound"
        return answer.complete

    def _ended(self) -> PairCoverSolution:
        few, lower = self.selected, float(self.lower)
        status, proof = SolveStatus.OPTIMAL, self.proof
        if self.lower < few.size:
            status, proof = SolveStatus.FEASIBLE, cut_short(proof, self.budget)
        if self.max_sets is not None and few.size > self.max_sets:
            proved = self.lower > self.max_sets
            status = SolveStatus.INFEASIBLE if proved else SolveStatus.UNKNOWN
            few = _most(self.cover, self.max_sets, self.budget, self.seed, self.fixed)
        return PairCoverSolution(self.cover.problem, status, few, lower, proof)


@on_one_thread
def solve_most_pairs(
    problem: PairCoverProblem,
    n_sets: int,
    *,
    warm_start: ArrayLike | None = None,
    time_limit: float = 60.0,
    seed: int = 0,
    budget: float = DEFAULT_BUDGET,
) -> MostPairsSolution:
    """Find the largest weight that the pairs of at most ``n_sets`` sets cover.

    Args:
        problem: The cover; its required weight plays no part.
        n_sets: Sets allowed, at least as many as are fixed.
        warm_start: A selection to start from; the answer is never worse.
        time_limit: Wall time that cuts the work, in [s]; the proof then says so.
        seed: Seed of the exchanges.
        budget: Counted work, in entries touched.
    """
    fixed = problem.fixed
    n_sets = allowed_sets("n_sets", n_sets, least=0, fixed=fixed)
    start = set_names(
        "warm_start", () if warm_start is None else warm_start, problem.n_sets
    )
    start = np.union1d(start, fixed)
    if start.size > n_sets:
        raise ValueError(f"warm_start must name at most {n_sets} sets of the problem")
    seed = whole_number("seed", seed, least=0)
    work = WorkBudget(budget, time_limit=time_limit)
    cover = pair_rows(problem)
    n_sets = min(n_sets, cover.n_sets)
    best = _most(cover, n_sets, work.part(0.4 * work.units), seed, fixed, start)
    bound, proof = cover.total, "all sets together"
    if cover.weight_of(best) < cover.total:
        target = cover.weight_of(best) + cover.grain
        tree = PairTree(
            cover, worth(cover), n_sets, target=target, budget=work, first=False
        )
        answer = tree.run()
        best = best if answer.selected is None else answer.selected
        bound, proof = answer.upper_bound, f"sets of {n_sets} by branch and bound"
        if not answer.complete:
            proof = cut_short(proof, work)
    proved = bound <= cover.weight_of(best)
    status = SolveStatus.OPTIMAL if proved else SolveStatus.FEASIBLE
    weight = problem.covered_weight(best)
    # What rounding to whole weights may have taken from the bound.
    upper = weight if proved else max(weight, (bound + _half(cover)) * cover.unit)
    return MostPairsSolution(problem, n_sets, status, best, upper, proof)


def _half(cover: PairRows) -> float:
    return 0.0 if cover.grain > 1 else 0.5 * len(cover.rows)


def _most(
    cover: PairRows,
    n_sets: int,
    budget: WorkBudget,
    seed: int,
    fixed: NDArray[np.int64],
    start: NDArray[np.int64] | None = None,
) -> NDArray[np.int64]:
    """Return sets, at most so many, that are found to cover much."""
    kept = fixed if start is None else start
    found = [greedy(cover, kept, budget, n_sets=n_sets)]
    if start is not None and start.size > fixed.size:
        found.append(greedy(cover, fixed, budget, n_sets=n_sets))
    best = max(found, key=cover.weight_of)
    return exchanged(
        cover,
        best,
        budget,
        fixed=fixed,
        target=cover.total,
        seed=seed,
        max_moves=40 * n_sets + 40,
    )
