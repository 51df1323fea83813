"""What covers lack, for people and tests."""

import numpy as np

from solvers.covers.bounds.reductions import forgiven


def shortfall(solution):
    """Return the largest missing share of a row set's weight; 0 if all are met."""
    problem = solution.problem
    missing = problem.required_weight - problem.covered_weights(solution.selected)
    missing[missing <= forgiven(problem)] = 0.0
    totals = problem.by_row_set(problem.weights)
    shares = missing / np.where(totals > 0, totals, np.maximum(missing, 1e-300))
    return float(shares.max())
