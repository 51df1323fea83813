"""Fewest candidates that reach a share of the samples, and what was proved about it.

Both stages pose the same program: rows are area-true samples, all of equal weight, so
weights are counts and every comparison is exact.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from solvers import CoverProblem, SolveStatus, solve_cover
from solvers.covers.cover import DEFAULT_BUDGET, reduced_problem, solve_max_coverage
from solvers.dense_rows import sparse_rows

MORE = 2
# What a certificate says where chosen devices have bodies.
BODIES_LEFT_OUT = "bodies of chosen devices, which only take away"
# Counted work for the marginal table's other counts, where no proof is claimed.
_MARGINAL_BUDGET = 3e8


@dataclass(frozen=True, eq=False)
class Selection:
    """The answer of `select_fewest`.

    Attributes:
        chosen: Candidates taken, at most the number allowed, shape (k,).
        smallest: The smallest cover found, allowed or not, shape (needed,).
        lower_bound: Proven least number of candidates for these rows.
        status: `optimal`, `feasible` or `infeasible`.
        proof: What proves the bound.
        required: Rows that must be covered.
        best_rows: Most rows that k candidates were found to cover.
        best_rows_bound: Proven upper bound on that.
        but_for_bodies: How many would do if bodies didn't collide or stand in each
            other's way, where that costs more or leaves too little; else None.
    """

    chosen: NDArray[np.int64]
    smallest: NDArray[np.int64]
    lower_bound: int
    status: str
    proof: str
    required: int
    best_rows: int
    best_rows_bound: int
    but_for_bodies: int | None = None

    @property
    def needed(self) -> int:
        """Candidates of the smallest cover found, allowed or not."""
        return len(self.smallest)


@dataclass(frozen=True, eq=False)
class Marginals:
    """What other numbers of candidates than the one taken would give.

    Attributes:
        by_count: Best candidates found for 1, 2, ... k + `more` devices.
        most_rows: Rows that these cover, and the proven most that as many candidates
            cover.
        greedy: Candidates that the greedy cover takes.
    """

    by_count: dict[int, NDArray[np.int64]]
    most_rows: dict[int, tuple[int, int]]
    greedy: int


def select_fewest(
    covers: NDArray[np.bool_],
    share: float,
    *,
    max_count: int | None,
    seed: int,
    known: NDArray[np.int64] | None = None,
    given: int = 0,
    budget: float = DEFAULT_BUDGET,
) -> Selection:
    """Return the fewest candidates that cover a share of what all of them cover.

    After the count is known, the selection that covers most at that count is taken.

    Args:
        covers: Whether a candidate (column) serves a sample (row), shape (n, m).
        share: Of the rows that any candidate serves, in (0, 1].
        max_count: Candidates allowed; None for no limit.
        seed: Of the heuristics.
        known: Candidates that may cover as much with fewer than the search finds.
        given: First candidates that are taken whatever they cover.
        budget: Counted work of the search for the fewest.
    """
    required = required_rows(np.any(covers, axis=1), share)
    problem = cover_problem(covers, required, given)
    reduced = reduced_problem(problem)
    solution = solve_cover(
        problem, seed=seed, budget=budget, heaviest=False, reduced=reduced
    )
    smallest = solution.selected
    if known is not None and len(known) < len(smallest):
        smallest = known if _rows(covers, known) >= required else smallest
    needed = len(smallest)
    lower_bound = int(np.ceil(solution.lower_bound - 1e-9))
    allowed = needed if max_count is None else min(needed, max_count)
    best = solve_max_coverage(
        problem,
        allowed,
        warm_start=smallest if allowed == needed else None,
        seed=seed,
        reduced=reduced,
    )
    rows = _rows(covers, best.selected)
    met = needed <= allowed and rows >= required
    status = SolveStatus.OPTIMAL if lower_bound >= needed else SolveStatus.FEASIBLE
    return Selection(
        best.selected,
        smallest,
        min(lower_bound, needed),
        status.name.lower() if met else "infeasible",
        solution.proof,
        required,
        rows,
        int(np.floor(best.upper_bound + 1e-6)),
    )


def fewest_count(
    covers: NDArray[np.bool_], share: float, *, seed: int, given: int = 0
) -> int:
    """Return how many candidates `select_fewest` takes, and spend nothing on which.

    Args:
        covers: As there.
        share: As there.
        seed: As there.
        given: As there.
    """
    required = required_rows(np.any(covers, axis=1), share)
    problem = cover_problem(covers, required, given)
    return len(solve_cover(problem, seed=seed, heaviest=False).selected)


def required_rows(reached: NDArray[np.bool_], share: float) -> int:
    """Return how many rows a share of those that any candidate serves is."""
    return int(np.ceil(share * int(reached.sum()) - 1e-9))


def marginals(
    covers: NDArray[np.bool_],
    selection: Selection,
    *,
    seed: int,
    more: int = MORE,
    given: int = 0,
) -> Marginals:
    """Return the best candidates for every other count, for the table in the plan.

    Args:
        covers: As the selection was made from.
        selection: As it is kept.
        seed: Of the heuristics.
        more: Counts beyond the one taken for which the best is wanted.
        given: As in `select_fewest`; fewer than these aren't looked at.
    """
    problem = cover_problem(covers, selection.required, given)
    reduced = reduced_problem(problem)
    taken = len(selection.chosen)
    by_count: dict[int, NDArray[np.int64]] = {}
    most_rows: dict[int, tuple[int, int]] = {}
    best = np.empty(0, dtype=np.int64)
    for count in range(max(1, given), min(taken + more, covers.shape[1]) + 1):
        if count == taken:
            best = selection.chosen
            most_rows[count] = selection.best_rows, selection.best_rows_bound
        else:
            found = solve_max_coverage(
                problem,
                count,
                warm_start=selection.smallest if count == selection.needed else best,
                seed=seed,
                budget=DEFAULT_BUDGET if count == taken - 1 else _MARGINAL_BUDGET,
                reduced=reduced,
            )
            best = found.selected
            bound = int(np.floor(found.upper_bound + 1e-6))
            if count < selection.lower_bound:
                # Where so many are proved too few, they fall short of the requirement.
                bound = min(bound, selection.required - 1)
            most_rows[count] = _rows(covers, best), bound
        by_count[count] = best
    greedy = _greedy_count(covers, selection.required, given)
    return Marginals(by_count, most_rows, greedy)


def others_instead(
    others: Marginals,
    by_count: Mapping[int, NDArray[np.int64]],
    covers: NDArray[np.bool_],
) -> Marginals:
    """Return marginals with other candidates for each count, and the same bounds.

    Args:
        others: The best for each count, as found.
        by_count: Candidates to tell of instead; counts without any are left out.
        covers: As for `marginals`.
    """
    kept = {n: by_count[n] for n in others.by_count if n in by_count}
    rows = {n: (_rows(covers, kept[n]), others.most_rows[n][1]) for n in kept}
    return replace(others, by_count=kept, most_rows=rows)


def cover_problem(
    covers: NDArray[np.bool_], required: int, given: int = 0
) -> CoverProblem:
    """State the cover over the rows that some candidate serves.

    Args:
        covers: Whether a candidate (column) serves a sample (row), shape (n, m).
        required: Rows that must be covered.
        given: First candidates that are taken whatever they cover.
    """
    reachable = covers[covers.any(axis=1)]
    return CoverProblem(
        sparse_rows(reachable),
        required_weight=np.array([required]),
        fixed=np.arange(given),
    )


def _rows(covers: NDArray[np.bool_], chosen: NDArray[np.int64]) -> int:
    return int(covers[:, chosen].any(axis=1).sum())


def _greedy_count(covers: NDArray[np.bool_], required: int, given: int) -> int:
    """How many candidates it takes when each adds the most rows, lower index first."""
    left = ~covers[:, :given].any(axis=1)
    count = given
    while len(covers) - left.sum() < required:
        left &= ~covers[:, int(np.argmax(covers[left].sum(axis=0)))]
        count += 1
    return count


def certificate(
    selection: Selection,
    others: Marginals,
    *,
    n_rows: int,
    row_area_m2: float,
    n_candidates: int,
    given: int = 0,
) -> dict[str, Any]:
    """Return the plan's certificate: what was proved, and over what.

    With devices given, its bounds count them, and speak of covers that hold them.
    """
    count = len(selection.chosen)
    bounded = min(selection.lower_bound, count)
    by_count = [
        {
            "count": n,
            "value_m2": rows * row_area_m2,
            "upper_bound_m2": bound * row_area_m2,
        }
        for n, (rows, bound) in sorted(others.most_rows.items())
    ]
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
        "greedy_count": others.greedy,
        "needed": {"count": selection.needed, "lower_bound": selection.lower_bound},
        "by_count": by_count,
        **_areas(by_count, count, given),
        **({"given": given} if given else {}),
        **(
            {"but_for_bodies": selection.but_for_bodies}
            if selection.but_for_bodies is not None
            else {}
        ),
    }


def _areas(by_count: list[dict[str, Any]], count: int, given: int) -> dict[str, Any]:
    """What so many devices, and one fewer, cover at most among the candidates."""
    table = {entry["count"]: entry for entry in by_count}
    fewer = table.get(count - 1, {"upper_bound_m2": 0.0})
    return {
        "best_area": {key: table[count][key] for key in ("value_m2", "upper_bound_m2")}
        | {"scope": "candidates"},
        "one_fewer": {
            "upper_bound_m2": fewer["upper_bound_m2"],
            "scope": "candidates",
        }
        if count > given
        else None,
    }


class PlannedStage(Protocol):
    """What projector and camera stages have in common."""

    @property
    def certificate(self) -> dict[str, Any]:
        """What was proved."""
        ...

    @property
    def by_count(self) -> Mapping[int, Sequence[Any]]:
        """Best devices for each number of them."""
        ...


_S = TypeVar("_S", bound=PlannedStage)


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
    before = stage.certificate
    given = int(before.get("given", 0))
    proof = before | {
        "count": count,
        "status": "feasible",
        "needed": {**before["needed"], "count": count},
        **_areas(before["by_count"], count, given),
    }
    if before["continuous"] is not None:
        # It bounded one fewer than before.
        unknown = {"one_fewer_upper_bound_m2": None}
        proof["continuous"] = before["continuous"] | unknown
    return replace(stage, certificate=proof)  # type: ignore[type-var]
