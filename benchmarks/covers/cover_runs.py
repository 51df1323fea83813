"""One run of our cover search, timed and its work counted, for the benchmarks."""

import math
import time
from dataclasses import dataclass
from functools import wraps
from typing import Any
from unittest import mock

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from benchmarks.covers.cover_peers import PeerAnswer, PeerProblem
from solvers import CoverProblem, CoverSolution, solve_cover
from solvers.status import WorkBudget


@dataclass(frozen=True, eq=False)
class OurRun:
    """An answer of ours and what it took.

    Attributes:
        solution: The answer.
        wall: Wall time in [s].
        cpu: CPU time of the process, all threads, in [s].
        work: Counted work that was spent.
    """

    solution: CoverSolution
    wall: float
    cpu: float
    work: float

    @property
    def bound(self) -> float:
        """Lower bound on the cost."""
        return self.solution.lower_bound

    @property
    def proved(self) -> bool:
        """Whether the bound closes the gap, by the numbers."""
        return self.bound >= self.solution.cost * (1.0 - 1e-9)


def run_ours(problem: CoverProblem, *, time_limit: float, budget: float) -> OurRun:
    """Solve a cover for its fewest or cheapest sets, no heavier than need be."""
    made: list[WorkBudget] = []
    plain = WorkBudget.__init__

    @wraps(plain)
    def noting(budget: WorkBudget, *given: Any, **named: Any) -> None:  # noqa: ANN401
        plain(budget, *given, **named)
        made.append(budget)

    # Parts of a budget pass their work on, so the whole one has counted the most.
    with mock.patch.object(WorkBudget, "__init__", noting):
        wall, cpu = time.perf_counter(), time.process_time()
        solution = solve_cover(
            problem, time_limit=time_limit, budget=budget, heaviest=False
        )
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    return OurRun(solution, wall, cpu, max((b.spent for b in made), default=0.0))


def for_peers(
    covers: sparse.csr_array,
    weights: NDArray[np.float64],
    costs: NDArray[np.float64],
    required: float,
) -> PeerProblem:
    """Return a cover of integer-valued numbers as peers take it, in smallest terms."""
    grain = int(np.gcd.reduce(weights.astype(np.int64)))
    return PeerProblem(
        covers.indptr.astype(np.int64),
        covers.indices.astype(np.int64),
        weights.astype(np.int64) // grain,
        costs.astype(np.int64),
        math.ceil(required / grain),
    )


def peer_cell(answer: PeerAnswer, cost: float | None) -> str:
    """Return what a peer found (checked by the caller), its bound and time."""
    if answer.state != "solved":
        return answer.state
    found = "none" if cost is None else f"{cost:g}"
    bound = f"{answer.bound:.2f}" if math.isfinite(answer.bound) else "none"
    return f"{found} / {bound} ({answer.seconds:.0f} s)"
