"""The linear programs of covers, stated to be read (cvxpy) and to hold bounds against.

Element e counts as covered when r_e of its sets are chosen; x and y are relaxed.

Cheapest cover::

    minimise    c x
    subject to  A x >= r y                           : lambda, shape (n_e,)
                sum_{e in g} w_e y_e >= W_g          : nu, shape (n_g,)
                0 <= x <= 1,  0 <= y <= 1,  x_s = 1 where s is fixed

Most weight of K sets::

    maximise    w y
    subject to  A x >= r y                           : lambda, shape (n_e,)
                1 x <= K                             : mu, shape (1,)
                0 <= x <= 1,  0 <= y <= 1

All multipliers are at least 0. lambda_e is what one more set on e is worth, nu_g what
the last unit of W_g costs, mu what one more set adds; so by duality the optima are::

    nu W + sum_e min(0, lambda_e r_e - nu_g(e) w_e) + sum_s (c_s - lambda A_s) x_s
    mu K + sum_e max(0, w_e - lambda_e r_e)         + sum_s max(0, lambda A_s - mu)

with x_s = 1 in the first where s is fixed or its reduced cost c_s - lambda A_s is
negative, else 0. With r = 1 these lambdas are what ``relaxation.cost_bound`` and
``relaxation.coverage_bounds`` take.
"""

from dataclasses import dataclass
from typing import Any

import cvxpy as cp
import numpy as np
from scipy import sparse

from solvers.status import SolveStatus


@dataclass(frozen=True, eq=False)
class CoverStatement:
    """A linear program of a cover, stated and not yet solved.

    Costs, or weights if they are the objective, count in their mean, and so do the
    weights of each requirement, because solvers' tolerances are absolute.

    Attributes:
        program: The cvxpy problem; it prints itself.
        sets: Its variable x, shape (n_s,).
        elements: Its variable y, shape (n_e,).
        served: Its rows A x >= r y.
        limits: Its rows on weights per row set, or on the number of sets.
        unit: What one unit of the program's objective stands for.
        limit_units: What one unit of each limit stands for, shape (n_g,) or (1,).
    """

    program: Any
    sets: Any
    elements: Any
    served: Any
    limits: Any
    unit: float
    limit_units: Any


@dataclass(frozen=True, eq=False)
class LinearSolution:
    """Answer to a :class:`CoverStatement`, in the caller's units.

    Attributes:
        status: ``OPTIMAL`` speaks of the linear program, not of the cover.
        value: Optimum: a lower bound on the cost, or an upper bound on the weight, of
            any selection; inf where no cover exists.
        x: How much of each set, shape (n_s,); None without an optimum.
        y: How much of each element, shape (n_e,); None without an optimum.
        multipliers: lambda of the module's formulas, shape (n_e,), or None.
        limit_multipliers: nu, shape (n_g,), or mu, shape (1,), or None.
    """

    status: SolveStatus
    value: float
    x: Any = None
    y: Any = None
    multipliers: Any = None
    limit_multipliers: Any = None


def state_cover_relaxation(
    covers, required, *, weights=None, costs=None, needs=None, row_sets=None, fixed=()
):
    """State the linear relaxation of the cheapest partial cover."""
    a, w, r = _elements(covers, weights, needs)
    n_e, n_s = a.shape
    c = np.ones(n_s) if costs is None else np.asarray(costs, dtype=float)
    wanted = np.atleast_1d(np.asarray(required, dtype=float))
    group = np.zeros(n_e, dtype=int) if row_sets is None else np.asarray(row_sets)
    chosen = np.zeros(n_s)
    chosen[np.asarray(fixed, dtype=int)] = 1.0
    cost_unit = _mean(c)
    weight_units = np.array([_mean(w[group == g]) for g in range(wanted.size)])
    share = sparse.csr_array(
        (w / weight_units[group], (group, np.arange(n_e))), shape=(wanted.size, n_e)
    )
    x, y = cp.Variable(n_s), cp.Variable(n_e)
    served = a @ x >= cp.multiply(r, y)
    reached = share @ y >= wanted / weight_units
    box = [x >= chosen, x <= 1, y >= 0, y <= 1]
    program = cp.Problem(cp.Minimize((c / cost_unit) @ x), [served, reached, *box])
    return CoverStatement(program, x, y, served, reached, cost_unit, weight_units)


def state_max_coverage(covers, n_sets, *, weights=None, needs=None):
    """State the linear relaxation of the most weight that K sets cover."""
    a, w, r = _elements(covers, weights, needs)
    n_e, n_s = a.shape
    unit = _mean(w)
    x, y = cp.Variable(n_s), cp.Variable(n_e)
    served = a @ x >= cp.multiply(r, y)
    few = cp.reshape(cp.sum(x), (1,), order="C") <= n_sets
    box = [x >= 0, x <= 1, y >= 0, y <= 1]
    program = cp.Problem(cp.Maximize((w / unit) @ y), [served, few, *box])
    return CoverStatement(program, x, y, served, few, unit, np.ones(1))


def solve_statement(statement):
    """Solve a stated program with HiGHS' simplex method, through cvxpy."""
    program = statement.program
    # HiGHS' scheduler belongs to the process: another number of threads here would
    # make every later solve that wants one thread fail.
    program.solve(solver=cp.HIGHS, highs_options={"threads": 1})
    if program.status == cp.INFEASIBLE:
        return LinearSolution(SolveStatus.INFEASIBLE, float("inf"))
    assert program.status == cp.OPTIMAL
    unit = statement.unit
    limits = np.asarray(statement.limits.dual_value) * unit / statement.limit_units
    return LinearSolution(
        SolveStatus.OPTIMAL,
        float(program.value) * unit,
        np.asarray(statement.sets.value),
        np.asarray(statement.elements.value),
        np.asarray(statement.served.dual_value) * unit,
        limits,
    )


def _elements(covers, weights, needs):
    a = sparse.csr_array(covers).astype(float)
    w = np.ones(a.shape[0]) if weights is None else np.asarray(weights, dtype=float)
    r = np.ones(a.shape[0]) if needs is None else np.asarray(needs)
    return a, w, r


def _mean(values):
    """Return the mean of the numbers, or 1 where there is none."""
    mean = float(values.mean()) if values.size else 0.0
    return mean if mean > 0.0 else 1.0
