"""Fewest or cheapest sets that cover enough weight, with a bound and its proof.

Element e is covered by set s iff a_es = 1; weights w, costs c, required weight W::

    minimise    sum_s c_s x_s
    subject to  sum_s a_es x_s >= y_e,   sum_e w_e y_e >= W,   x, y in {0, 1}

W is an absolute weight over frozen rows. Counts (unit costs) are solved by greedy and
large-neighbourhood search from above, Lagrangian bound and exact search over tuples
from below; among the covers of the fewest sets the one of most weight is sought.
Costs go to the linear program and HiGHS' branch and bound.

References:
    Tarbox and Gottschlich, "Planning for complete sensor coverage in inspection",
    Computer Vision and Image Understanding 61(1), 1995.
"""

import dataclasses
from dataclasses import dataclass, field
from typing import cast

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from .counts import cheapest_sets, fewest_sets, most_weight
from .neighbourhood import greedy, prune
from .reductions import WEIGHT_SLACK, ReducedCover, reduce_cover
from .status import SolveStatus, WorkBudget

# Solving takes about six bytes an entry: 1.2 GB at this limit.
MAX_ENTRIES = 200_000_000
DEFAULT_BUDGET = 2e9


@dataclass(frozen=True, eq=False)
class CoverProblem:
    """Data of a partial set cover.

    Attributes:
        covers: Whether element e is covered by set s, sparse or dense, boolean or 0
            and 1, shape (n_e, n_s); kept as CSR.
        weights: Weight of each element, at least 0, typically an area in [m²];
            default ones.
        costs: Cost of each set, positive; default ones.
        min_coverage: Fraction of the total weight to cover, in (0, 1]; ignored if
            ``required_weight`` is given.
        required_weight: Weight W to cover, in the unit of the weights.

    Raises:
        ValueError: On wrong shapes, negative or non-finite numbers, or a matrix of
            more than ``MAX_ENTRIES`` entries.
    """

    covers: sparse.csr_array
    weights: NDArray[np.float64] = field(default=None)  # type: ignore[assignment]
    costs: NDArray[np.float64] = field(default=None)  # type: ignore[assignment]
    min_coverage: float = 1.0
    required_weight: float = field(default=None)  # type: ignore[assignment]

    def __post_init__(self) -> None:
        covers = _boolean(self.covers)
        object.__setattr__(self, "covers", covers)
        n_e, n_s = cast("tuple[int, int]", covers.shape)
        weights = _vector("weights", self.weights, n_e)
        if not np.all((weights >= 0.0) & np.isfinite(weights)):
            raise ValueError("weights must be finite and at least 0")
        costs = _vector("costs", self.costs, n_s)
        if not np.all((costs > 0.0) & np.isfinite(costs)):
            raise ValueError("costs must be finite and positive")
        if not 0.0 < self.min_coverage <= 1.0:
            raise ValueError(f"min_coverage must be in (0, 1], got {self.min_coverage}")
        with np.errstate(over="ignore"):
            total = float(weights.sum())
        if not np.isfinite(total):
            raise ValueError("weights must have a finite sum")
        given = cast("float | None", self.required_weight)
        required = self.min_coverage * total if given is None else float(given)
        if not (required >= 0.0 and np.isfinite(required)):
            raise ValueError(f"required_weight must be at least 0, got {required}")
        for name, value in (("weights", weights), ("costs", costs)):
            value.flags.writeable = False
            object.__setattr__(self, name, value)
        object.__setattr__(self, "required_weight", required)

    @property
    def total_weight(self) -> float:
        """Weight of all elements."""
        return float(self.weights.sum())

    @property
    def unit_costs(self) -> bool:
        """Whether every set costs the same, so that counting decides."""
        return bool(np.all(self.costs == self.costs[:1]))

    def covered_weight(self, selected: ArrayLike) -> float:
        """Return the weight that a selection covers."""
        index = np.asarray(selected, dtype=np.int64)
        if index.size == 0:
            return 0.0
        covered = np.asarray(self.covers[:, index].sum(axis=1)).ravel() > 0
        return float(self.weights[covered].sum())

    @property
    def best_weight(self) -> float:
        """Weight covered when every set is taken."""
        return float(self.weights[np.diff(self.covers.indptr) > 0].sum())


@dataclass(frozen=True, eq=False)
class CoverSolution:
    """Answer to a :class:`CoverProblem`.

    Attributes:
        problem: The problem this answers.
        status: How the solve ended.
        selected: Chosen sets in increasing order, shape (k,); if the status is
            ``INFEASIBLE``, few sets that cover all that can be covered.
        lower_bound: Proven lower bound on the cost of any cover; inf if infeasible.
        proof: What proves the bound, and what cut the proof short if anything did.
    """

    problem: CoverProblem
    status: SolveStatus
    selected: NDArray[np.int64]
    lower_bound: float
    proof: str

    @property
    def cost(self) -> float:
        """Cost of the selection."""
        return float(self.problem.costs[self.selected].sum())

    @property
    def covered_weight(self) -> float:
        """Weight that the selection covers, recomputed from the problem."""
        return self.problem.covered_weight(self.selected)

    def shortfall(self) -> float:
        """Return the missing share of the total weight, recomputed; 0 if met."""
        required, total = self.problem.required_weight, self.problem.total_weight
        missing = required - self.covered_weight
        if missing <= 2.0 * WEIGHT_SLACK * max(required, total):
            return 0.0
        return missing / total if total > 0 else 1.0


@dataclass(frozen=True, eq=False)
class MaxCoverageSolution:
    """Answer of :func:`solve_max_coverage`.

    Attributes:
        problem: The problem this answers; its requirement plays no part.
        n_sets: Number of sets allowed.
        status: ``OPTIMAL`` if no such selection covers more, else ``FEASIBLE``.
        selected: Chosen sets in increasing order, at most ``n_sets``.
        upper_bound: Weight that no ``n_sets`` sets exceed.
        proof: What proves the bound, and what cut the proof short if anything did.
    """

    problem: CoverProblem
    n_sets: int
    status: SolveStatus
    selected: NDArray[np.int64]
    upper_bound: float
    proof: str

    @property
    def covered_weight(self) -> float:
        """Weight that the selection covers, recomputed from the problem."""
        return self.problem.covered_weight(self.selected)


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
    if max_sets is not None and not max_sets >= 1:
        raise ValueError(f"max_sets must be at least 1, got {max_sets}")
    work = WorkBudget(budget, time_limit=time_limit)
    if problem.required_weight == 0.0:
        nothing = np.empty(0, dtype=np.int64)
        proof = "no weight is required"
        return CoverSolution(problem, SolveStatus.OPTIMAL, nothing, 0.0, proof)
    cover = _or_reduce(problem, problem.costs, reduced)
    work.spend(cover.entries)
    if cover.total < cover.required:
        return _unreachable(problem, cover, work)
    if problem.unit_costs:
        answer = fewest_sets(
            cover, work, seed=seed, max_sets=max_sets, heaviest=heaviest
        )
        unit = float(problem.costs[0])
        bound = answer.lower_bound * unit
    else:
        answer = cheapest_sets(cover, work, seed=seed, max_sets=max_sets)
        bound = answer.lower_bound
    selected = cover.kept[answer.selected]
    return CoverSolution(problem, answer.status, selected, bound, answer.proof)


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

    Args:
        problem: The cover; its required weight plays no part.
        n_sets: Sets allowed, at least 0.
        warm_start: A selection to start from; the answer is never worse.
        time_limit: Wall time that cuts the work, in [s]; the proof then says so.
        seed: Seed of the neighbourhood search.
        budget: Counted work, in matrix entries touched.
        reduced: This problem's `reduced_problem`, where it is at hand.
    """
    if not n_sets >= 0:
        raise ValueError(f"n_sets must be at least 0, got {n_sets}")
    start = np.unique(np.asarray([] if warm_start is None else warm_start, dtype=int))
    if start.size > n_sets or not np.all((start >= 0) & (start < problem.costs.size)):
        raise ValueError(f"warm_start must name at most {n_sets} sets of the problem")
    work = WorkBudget(budget, time_limit=time_limit)
    cover = _or_reduce(problem, np.ones(problem.costs.size), reduced)
    work.spend(cover.entries)
    stand_in = cover.stand_in[start]
    answer = most_weight(
        cover, n_sets, work, seed=seed, start=np.unique(stand_in[stand_in >= 0])
    )
    selected = cover.kept[answer.selected]
    covered = problem.covered_weight(selected)
    optimal = answer.status is SolveStatus.OPTIMAL
    upper = covered if optimal else max(covered, answer.upper_bound * cover.unit)
    return MaxCoverageSolution(
        problem, n_sets, answer.status, selected, upper, answer.proof
    )


def reduced_problem(problem: CoverProblem) -> ReducedCover:
    """Return what both solvers search, to be made once for several questions.

    Raises:
        ValueError: If costs differ: where they don't count, more sets may be dropped.
    """
    if not problem.unit_costs:
        raise ValueError("costs differ: solve each question from the problem itself")
    return _or_reduce(problem, problem.costs, None)


def _or_reduce(
    problem: CoverProblem, costs: NDArray[np.float64], given: ReducedCover | None
) -> ReducedCover:
    if given is not None:
        if given.stand_in.size != problem.costs.size:
            raise ValueError(
                f"reduced is of a problem of {given.stand_in.size} sets, not "
                f"{problem.costs.size}"
            )
        return given
    return reduce_cover(problem.covers, problem.weights, costs, problem.required_weight)


def _unreachable(
    problem: CoverProblem, cover: ReducedCover, work: WorkBudget
) -> CoverSolution:
    """Answer a problem whose requirement exceeds the weight of all sets together."""
    everything = dataclasses.replace(cover, required=cover.total)
    few = prune(everything, greedy(everything, np.empty(0, dtype=np.int64), work))
    proof = "all sets together cover less than is required"
    return CoverSolution(
        problem, SolveStatus.INFEASIBLE, cover.kept[few], float("inf"), proof
    )


def _boolean(given: object) -> sparse.csr_array:
    """Return a boolean CSR matrix, or say what is wrong with the one given."""
    matrix = given if sparse.issparse(given) else np.asarray(given)
    shape = matrix.shape  # type: ignore[union-attr]
    if len(shape) != 2:
        raise ValueError(f"covers must be a matrix, got shape {shape}")
    if not shape[0] * shape[1] <= MAX_ENTRIES:
        raise ValueError(
            f"covers has {shape[0]} x {shape[1]} entries, more than the limit of "
            f"{MAX_ENTRIES}: use fewer samples or candidates"
        )
    rows = sparse.csr_array(matrix)
    rows.sum_duplicates()
    if rows.dtype != bool and not np.all((rows.data == 0) | (rows.data == 1)):
        raise ValueError("covers must be boolean or hold only 0 and 1")
    rows = cast("sparse.csr_array", rows.astype(bool))
    rows.eliminate_zeros()
    return rows


def _vector(name: str, given: ArrayLike | None, n: int) -> NDArray[np.float64]:
    values = np.ones(n) if given is None else np.array(given, dtype=np.float64)
    if values.shape != (n,):
        raise ValueError(f"{name} must be ({n},), got {values.shape}")
    return values
