"""Covers whose kinds of sets have a stock, against every selection there is."""

from itertools import combinations

import numpy as np
import pytest

from solvers import CoverProblem, SolveStatus, solve_cover
from solvers.covers.cover import solve_max_coverage


def _drawn(seed: int) -> CoverProblem:
    """A cover of three kinds, with floors of two row sets in every other draw."""
    rng = np.random.default_rng([17, seed])
    n_rows, n_sets = int(rng.integers(8, 40)), int(rng.integers(5, 12))
    covers = rng.random((n_rows, n_sets)) < rng.uniform(0.1, 0.5)
    kinds = np.append([0, 1, 2], rng.integers(0, 3, n_sets - 3))
    stock = rng.integers(0, 4, 3)
    reached = np.any(covers, axis=1)
    total = float(np.ceil(rng.uniform(0.4, 1.0) * reached.sum()))
    if seed % 2:
        return CoverProblem(covers, required_weight=total, kinds=kinds, stock=stock)
    rows = np.append([0, 1], rng.integers(0, 2, n_rows - 2))
    floors = np.floor(0.5 * np.bincount(rows, weights=reached))
    return CoverProblem(
        covers,
        required_weight=floors,
        required_total=total,
        row_sets=rows,
        kinds=kinds,
        stock=stock,
    )


def _every(problem: CoverProblem, count: int) -> list[np.ndarray]:
    """Every selection of so many sets that is in stock."""
    chosen = (np.array(s, int) for s in combinations(range(problem.costs.size), count))
    return [s for s in chosen if problem.in_stock(s)]


def _meets(problem: CoverProblem, selected: np.ndarray) -> bool:
    weights = problem.covered_weights(selected)
    floors = np.all(weights >= problem.required_weight)
    return bool(floors and weights.sum() >= (problem.required_total or 0.0))


@pytest.mark.parametrize("seed", range(24))
def test_the_fewest_in_stock_are_those_of_all_selections(seed: int) -> None:
    """The count is the least, the bound no higher, and what isn't there isn't taken."""
    problem = _drawn(seed)
    counts = range(problem.costs.size + 1)
    met = (n for n in counts if any(_meets(problem, s) for s in _every(problem, n)))
    least, answer = next(met, None), solve_cover(problem)
    assert problem.in_stock(answer.selected)
    if least is None:
        assert answer.status in (SolveStatus.UNKNOWN, SolveStatus.INFEASIBLE)
        return
    assert answer.status is SolveStatus.OPTIMAL
    assert len(answer.selected) == answer.lower_bound == least
    assert _meets(problem, answer.selected)


@pytest.mark.parametrize("seed", range(1, 13, 2))
def test_no_selection_in_stock_covers_more(seed: int) -> None:
    """What so many sets cover is within what is found and its bound."""
    problem = _drawn(seed)
    answer = solve_max_coverage(problem, 3)
    some = (s for n in range(4) for s in _every(problem, n))
    most = max(problem.covered_weight(s) for s in some)
    assert problem.in_stock(answer.selected)
    assert answer.covered_weight <= most <= answer.upper_bound
    if answer.status is SolveStatus.OPTIMAL:
        assert answer.covered_weight == most


def test_what_is_fixed_counts_against_the_stock() -> None:
    """A kind of which one is fixed and one is there gives no other."""
    covers = np.eye(4, dtype=bool)
    problem = CoverProblem(
        covers, required_weight=2.0, fixed=[0], kinds=[0, 0, 1, 1], stock=[1, 2]
    )
    answer = solve_cover(problem)
    assert 0 in answer.selected
    assert 1 not in answer.selected
    assert len(answer.selected) == 2


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"stock": [0, 2], "fixed": [0]}, "more than a stock"),
        ({"stock": [1, -1]}, "at least 0"),
        ({"stock": [1]}, "stock must be"),
        ({"kinds": [0, 0, 1]}, "kinds must be"),
        ({"stock": [1, 2], "costs": [1.0, 2.0, 1.0, 1.0]}, "equal costs"),
    ],
)
def test_a_stock_that_is_none_is_refused(change: dict[str, object], words: str) -> None:
    """Wrong shapes, numbers below 0, and what the searches don't count."""
    options: dict[str, object] = {"kinds": [0, 0, 1, 1]} | change
    with pytest.raises(ValueError, match=words):
        CoverProblem(np.eye(4, dtype=bool), **options)  # type: ignore[arg-type]
