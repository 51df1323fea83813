"""Covers by a handful of sets: all selections are looked at, without a program."""

import numpy as np
from numpy.typing import NDArray

from solvers.covers.cover_problem import CoverProblem

# Sets of which all 256 selections are looked at.
MOST_SETS = 8


def cheapest_of_all(
    problem: CoverProblem, most: int | None
) -> NDArray[np.int64] | None:
    """Return the cheapest sets that reach what is required; None: no sets do.

    At most so many, and of sets that each element needs but one of. Of equal costs the
    first, as numbers in base two.
    """
    n_s = problem.costs.size
    selections = (np.arange(1 << n_s)[:, None] >> np.arange(n_s)) & 1 > 0
    served = selections.astype(np.float64) @ problem.covers.toarray().T > 0.0
    of_set = np.zeros((problem.weights.size, problem.n_row_sets))
    of_set[np.arange(problem.weights.size), problem.row_sets] = problem.weights
    covered = served.astype(np.float64) @ of_set
    enough = np.all(covered >= problem.required_weight, axis=1)
    if problem.required_total is not None:
        enough &= covered.sum(axis=1) >= problem.required_total
    if most is not None:
        enough &= selections.sum(axis=1) <= most
    if not enough.any():
        return None
    costs = np.where(enough, selections @ problem.costs, np.inf)
    return np.flatnonzero(selections[np.argmin(costs)])
