"""Problems of pairs: what is refused, and what bits say."""

import numpy as np
import pytest

from solvers import SolveStatus
from solvers.covers.paired.pair_cover import solve_most_pairs, solve_pair_cover
from solvers.covers.paired.pair_problem import PairCoverProblem, packed_pairs

SEES = np.ones((3, 2), dtype=bool)


def bits(table):
    """Bit rows of a table (n_e, n_s, n_s)."""
    table = np.asarray(table, dtype=bool)
    return packed_pairs(lambda i: table[:, i].T, table.shape[1], len(table))


BOTH = bits(np.broadcast_to([[0, 1], [1, 0]], (3, 2, 2)))


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"good": BOTH[:, :1]}, "bit rows"),
        ({"good": BOTH.astype(np.int64)}, "bit rows"),
        ({"sees": np.zeros((3, 2))}, "doesn't see"),
        ({"sees": np.full((3, 2), 2)}, "only 0 and 1"),
        ({"sees": np.ones(3)}, "must be a matrix"),
        ({"weights": np.ones(2)}, "weights must be"),
        ({"weights": [-1.0, 1.0, 1.0]}, "at least 0"),
        ({"min_coverage": 0.0}, "min_coverage"),
        ({"min_coverage": float("nan")}, "min_coverage"),
        ({"required_weight": -1.0}, "required_weight"),
        ({"required_weight": float("inf")}, "required_weight"),
        ({"views": 0}, "views must be from 1"),
        ({"views": [1, 2]}, "views must be one number"),
        ({"fixed": [2]}, "sets from 0 to 1"),
    ],
)
def test_bad_problems_are_refused(given, words):
    with pytest.raises(ValueError, match=words):
        PairCoverProblem(**{"sees": SEES, "good": BOTH, **given})


def test_pairs_must_be_symmetric_and_within_their_rows():
    lopsided = BOTH.copy()
    lopsided[0, 1] = 0
    with pytest.raises(ValueError, match="symmetric"):
        PairCoverProblem(SEES, lopsided)
    padded = BOTH | np.uint64(1 << 60)
    with pytest.raises(ValueError, match="bits set past"):
        PairCoverProblem(SEES, padded)


def test_too_many_pairs_are_refused_before_anything_is_allocated():
    with pytest.raises(ValueError, match="use fewer candidates"):
        packed_pairs(lambda i: SEES, 100_000, 1_000)


def test_what_is_kept_is_read_only():
    problem = PairCoverProblem(SEES, BOTH)
    for array in (problem.sees, problem.good, problem.weights, problem.views):
        assert not array.flags.writeable


def test_no_weight_needs_no_set_and_fixed_sets_may_suffice():
    nothing = PairCoverProblem(SEES, BOTH, required_weight=0.0)
    answer = solve_pair_cover(nothing)
    assert (answer.status, answer.selected.size) == (SolveStatus.OPTIMAL, 0)
    fixed = solve_pair_cover(PairCoverProblem(SEES, BOTH, fixed=[0, 1]))
    assert fixed.proof == "the fixed sets suffice"
    assert fixed.lower_bound == 2


def test_more_than_can_be_covered_is_infeasible():
    alone = PairCoverProblem(SEES, np.zeros_like(BOTH))
    answer = solve_pair_cover(alone)
    assert answer.status is SolveStatus.INFEASIBLE
    assert answer.shortfall() == 1.0
    assert solve_most_pairs(alone, 2).upper_bound == 0.0


def test_a_view_more_than_pairs_ask_for_takes_another_set():
    sees = np.ones((4, 3), dtype=bool)
    table = np.zeros((4, 3, 3), dtype=bool)
    table[:, 0, 1] = table[:, 1, 0] = True
    for views, fewest in ((1, 2), (2, 2), (3, 3)):
        problem = PairCoverProblem(sees, bits(table), views=views)
        answer = solve_pair_cover(problem)
        assert answer.status is SolveStatus.OPTIMAL
        assert len(answer.selected) == fewest


@pytest.mark.parametrize(
    "call",
    [
        lambda problem: solve_pair_cover(problem, max_sets=0),
        lambda problem: solve_pair_cover(problem, seed=-1),
        lambda problem: solve_most_pairs(problem, -1),
        lambda problem: solve_most_pairs(problem, 1, warm_start=[0, 1]),
    ],
)
def test_bad_arguments_are_refused(call):
    with pytest.raises(ValueError, match="must"):
        call(PairCoverProblem(SEES, BOTH))
    with pytest.raises(ValueError, match="are fixed"):
        solve_pair_cover(PairCoverProblem(SEES, BOTH, fixed=[0, 1]), max_sets=1)
