"""Fewest candidates that reach a share of the samples, and what was proved about it.

Both stages pose the same program: rows are area-true samples, all of equal weight, so
weights are counts and every comparison is exact.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from solvers import CoverProblem, SolveStatus, solve_cover
from solvers.cover import DEFAULT_BUDGET, solve_max_coverage

MORE = 2
# Counted work for the marginal table's other counts, where no proof is claimed.
_MARGINAL_BUDGET = 3e8


@dataclass(frozen=True, eq=False)
class Selection:
    """The answer of `select_fewest`.

    Attributes:
        chosen: Candidates taken, at most the number allowed, shape (k,).
        needed: Candidates of the smallest cover found, allowed or not.
        lower_bound: Proven least number of candidates for these rows.
        status: `optimal`, `feasible` or `infeasible`.
        proof: What proves the bound.
        required: Rows that must be covered.
        best_rows: Most rows that k candidates were found to cover.
        best_rows_bound: Proven upper bound on that.
        one_fewer_bound: Proven most rows that k - 1 candidates cover.
        by_count: Best candidates found for 1, 2, ... k + `more` devices.
        greedy: Candidates that the greedy cover takes.
    """

    chosen: NDArray[np.int64]
    needed: int
    lower_bound: int
    status: str
    proof: str
    required: int
    best_rows: int
    best_rows_bound: int
    one_fewer_bound: int
    by_count: dict[int, NDArray[np.int64]]
    greedy: int


def select_fewest(
    covers: NDArray[np.bool_],
    share: float,
    *,
    max_count: int | None,
    seed: int,
    more: int = MORE,
) -> Selection:
    """Return the fewest candidates that cover a share of what all of them cover.

    After the count is known, the selection that covers most at that count is taken.

    Args:
        covers: Whether a candidate (column) serves a sample (row), shape (n, m).
        share: Of the rows that any candidate serves, in (0, 1].
        max_count: Candidates allowed; None for no limit.
        seed: Of the heuristics.
        more: Counts beyond the one taken for which the best is wanted too.
    """
    reachable = covers.any(axis=1)
    required = int(np.ceil(share * int(reachable.sum()) - 1e-9))
    problem = CoverProblem(
        sparse.csr_array(covers[reachable]), required_weight=float(required)
    )
    solution = solve_cover(problem, seed=seed)
    needed = len(solution.selected)
    lower_bound = int(np.ceil(solution.lower_bound - 1e-9))
    allowed = needed if max_count is None else min(needed, max_count)
    by_count: dict[int, NDArray[np.int64]] = {}
    bounds: dict[int, float] = {}
    rows: dict[int, int] = {}
    warm = np.empty(0, dtype=np.int64)
    for count in range(1, min(allowed + more, covers.shape[1]) + 1):
        start = solution.selected if count == needed else warm
        best = solve_max_coverage(
            problem,
            count,
            warm_start=start,
            seed=seed,
            budget=DEFAULT_BUDGET
            if allowed - 1 <= count <= allowed
            else _MARGINAL_BUDGET,
        )
        by_count[count] = warm = best.selected
        bounds[count] = best.upper_bound
        rows[count] = int(covers[:, best.selected].any(axis=1).sum())
    one_fewer = int(np.floor(bounds[allowed - 1] + 1e-6)) if allowed > 1 else 0
    if lower_bound >= allowed:
        # Where fewer are proved too few, they fall short of what is required.
        one_fewer = min(one_fewer, required - 1)
    met = needed <= allowed and rows[allowed] >= required
    status = SolveStatus.OPTIMAL if lower_bound >= needed else SolveStatus.FEASIBLE
    return Selection(
        by_count[allowed],
        needed,
        min(lower_bound, needed),
        status.name.lower() if met else "infeasible",
        solution.proof,
        required,
        rows[allowed],
        int(np.floor(bounds[allowed] + 1e-6)),
        one_fewer,
        by_count,
        _greedy_count(covers[reachable], required),
    )


def _greedy_count(covers: NDArray[np.bool_], required: int) -> int:
    """How many candidates it takes when each adds the most rows, lower index first."""
    left = np.ones(len(covers), dtype=bool)
    count = 0
    while len(covers) - left.sum() < required:
        left &= ~covers[:, int(np.argmax(covers[left].sum(axis=0)))]
        count += 1
    return count


def certificate(
    selection: Selection, n_rows: int, row_area_m2: float, n_candidates: int
) -> dict[str, Any]:
    """Return the plan's certificate: what was proved, and over what."""
    count = len(selection.chosen)
    bounded = min(selection.lower_bound, count)
    return {
        "count": count,
        "status": selection.status,
        "required_m2": selection.required * row_area_m2,
        "n_samples": n_rows,
        "candidates": {
            "lower_bound": bounded,
            "n_candidates": n_candidates,
            "proof": selection.proof,
        },
        "continuous": None,
        "greedy_count": selection.greedy,
        "needed": {"count": selection.needed, "lower_bound": selection.lower_bound},
        "best_area": {
            "value_m2": selection.best_rows * row_area_m2,
            "upper_bound_m2": selection.best_rows_bound * row_area_m2,
        },
        "one_fewer": {"upper_bound_m2": selection.one_fewer_bound * row_area_m2},
    }


class Stage(Protocol):
    """What projector and camera stages have in common."""

    @property
    def certificate(self) -> dict[str, Any]:
        """What was proved."""
        ...

    @property
    def by_count(self) -> Mapping[int, Sequence[Any]]:
        """Best devices for each number of them."""
        ...


_S = TypeVar("_S", bound=Stage)


def larger(stage: _S, present: Sequence[object], allowed: int | None) -> _S | None:
    """Return a stage whose certificate counts one device more, if that is possible.

    Only for a cover that met its own rows: one that is short of devices anyway has
    said so.

    Args:
        stage: Projector or camera stage, a dataclass.
        present: Devices in it now.
        allowed: Devices at most; None for no limit.
    """
    count = len(present) + 1
    met = stage.certificate["status"] != "infeasible"
    if not met or count not in stage.by_count or (allowed or count) < count:
        return None
    if len(stage.by_count[count]) < count:
        return None
    needed = {**stage.certificate["needed"], "count": count}
    changed = {"count": count, "status": "feasible", "needed": needed}
    proof = stage.certificate | changed
    return replace(stage, certificate=proof)  # type: ignore[type-var]
