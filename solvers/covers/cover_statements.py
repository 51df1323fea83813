"""The linear programs of covers, stated to be read (cvxpy) and to check others by.

Element e counts as covered when r_e of its sets are chosen; x and y are relaxed.

Cheapest cover::

    minimise    c x
    subject to  A x >= r y                           : lambda, shape (n_e,)
                sum_{e in g} w_e y_e >= W_g          : nu, shape (n_g,)
                0 <= x <= 1,  0 <= y <= 1,  x_s = 1 where s is fixed in

Most weight of K sets::

    maximise    w y
    subject to  A x >= r y                           : lambda, shape (n_e,)
                1 x <= K                             : mu, shape (1,)
                0 <= x <= 1,  0 <= y <= 1

All multipliers are at least 0. lambda_e is what one more set on e is worth, nu_g what
the last unit of W_g costs, mu what one more set adds; so by duality the optima are::

    nu W + sum_e min(0, lambda_e r_e - nu_g(e) w_e) + sum_s (c_s - lambda A_s) x_s
    mu K + sum_e max(0, w_e - lambda_e r_e)         + sum_s max(0, lambda A_s - mu)

with x_s = 1 in the first where s is fixed in or its reduced cost c_s - lambda A_s is
negative, else 0. With r = 1 these lambdas are what ``relaxation.cost_bound`` and
``relaxation.coverage_bounds`` take.
"""

from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from solvers.given_numbers import real_numbers
from solvers.status import SolveStatus

# About five seconds of simplex; cvxpy takes 1.2 GB for twenty times as many.
MAX_STATED_ENTRIES = 500_000


class StatementError(RuntimeError):
    """A stated program that cvxpy or its solver would not take."""


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
    limit_units: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LinearSolution:
    """Answer to a :class:`CoverStatement`, in the caller's units.

    Attributes:
        statement: The program this answers.
        status: ``OPTIMAL`` speaks of the linear program, not of the cover.
        value: Optimum: a lower bound on the cost, or an upper bound on the weight, of
            any selection; inf where no cover exists, nan if the solver failed.
        x: How much of each set, shape (n_s,); None without an optimum.
        y: How much of each element, shape (n_e,); None without an optimum.
        multipliers: lambda of the module's formulas, shape (n_e,), or None.
        limit_multipliers: nu, shape (n_g,), or mu, shape (1,), or None.
    """

    statement: CoverStatement
    status: SolveStatus
    value: float
    x: NDArray[np.float64] | None = None
    y: NDArray[np.float64] | None = None
    multipliers: NDArray[np.float64] | None = None
    limit_multipliers: NDArray[np.float64] | None = None


def state_cover_relaxation(
    covers: object,
    required: ArrayLike,
    *,
    weights: ArrayLike | None = None,
    costs: ArrayLike | None = None,
    needs: ArrayLike | None = None,
    row_sets: ArrayLike | None = None,
    fixed: ArrayLike = (),
) -> CoverStatement:
    """State the linear relaxation of the cheapest partial cover.

    Args:
        covers: Whether element e is covered by set s, sparse or dense, boolean or 0
            and 1, shape (n_e, n_s).
        required: Weight W_g to reach in each row set, shape (n_g,) or a number.
        weights: Weight w of each element, at least 0, shape (n_e,); default ones.
        costs: Cost c of each set, at least 0, shape (n_s,); default ones.
        needs: Sets r that an element needs, at least 1, shape (n_e,); default ones.
        row_sets: Row set of each element, in [0, n_g), shape (n_e,); default zeros.
        fixed: Sets that are chosen whatever they cost.

    Raises:
        ValueError: On wrong shapes or numbers, or more than ``MAX_STATED_ENTRIES``.
    """
    import cvxpy as cp

    a, w, r = _elements(covers, weights, needs)
    n_e, n_s = cast("tuple[int, int]", a.shape)
    c = _numbers("costs", costs, n_s)
    wanted = np.atleast_1d(real_numbers("required", required))
    if wanted.ndim != 1 or not np.all((wanted >= 0.0) & np.isfinite(wanted)):
        raise ValueError(f"required must be numbers, at least 0, got {required}")
    group = _integers("row_sets", row_sets, n_e, default=0)
    if not np.all((group >= 0) & (group < wanted.size)):
        raise ValueError(
            f"row_sets must lie in [0, {wanted.size}), one for each required weight"
        )
    chosen = np.zeros(n_s)
    chosen[_sets(fixed, n_s)] = 1.0

    cost_unit = _mean(c)
    weight_units = np.array([_mean(w[group == g]) for g in range(wanted.size)])
    share = sparse.csr_array(
        (w / weight_units[group], (group, np.arange(n_e))), shape=(wanted.size, n_e)
    )
    x, y = cp.Variable(n_s), cp.Variable(n_e)
    served: Any = a @ x >= cp.multiply(r, y)
    reached: Any = share @ y >= wanted / weight_units
    box: list[Any] = [x >= chosen, x <= 1, y >= 0, y <= 1]
    program = cp.Problem(cp.Minimize((c / cost_unit) @ x), [served, reached, *box])
    return CoverStatement(program, x, y, served, reached, cost_unit, weight_units)


def state_max_coverage(
    covers: object,
    n_sets: int,
    *,
    weights: ArrayLike | None = None,
    needs: ArrayLike | None = None,
) -> CoverStatement:
    """State the linear relaxation of the most weight that K sets cover.

    Args:
        covers: As for :func:`state_cover_relaxation`, shape (n_e, n_s).
        n_sets: K, at least 0.
        weights: Weight w of each element, at least 0, shape (n_e,); default ones.
        needs: Sets r that an element needs, at least 1, shape (n_e,); default ones.

    Raises:
        ValueError: On wrong shapes or numbers, or more than ``MAX_STATED_ENTRIES``.
    """
    import cvxpy as cp

    a, w, r = _elements(covers, weights, needs)
    n_e, n_s = cast("tuple[int, int]", a.shape)
    if not n_sets >= 0:
        raise ValueError(f"n_sets must be at least 0, got {n_sets}")

    unit = _mean(w)
    x, y = cp.Variable(n_s), cp.Variable(n_e)
    served: Any = a @ x >= cp.multiply(r, y)
    few: Any = cp.reshape(cp.sum(x), (1,), order="C") <= n_sets
    box: list[Any] = [x >= 0, x <= 1, y >= 0, y <= 1]
    program = cp.Problem(cp.Maximize((w / unit) @ y), [served, few, *box])
    return CoverStatement(program, x, y, served, few, unit, np.ones(1))


def solve_statement(statement: CoverStatement) -> LinearSolution:
    """Solve a stated program with HiGHS' simplex method, through cvxpy.

    Returns:
        The solution; a cover that doesn't exist is a status, not an error.

    Raises:
        StatementError: If cvxpy or the solver refuses the program.
    """
    import cvxpy as cp

    program = statement.program
    try:
        # HiGHS' scheduler belongs to the process: another number of threads here would
        # make every later solve that asks for one thread fail.
        program.solve(solver=cp.HIGHS, highs_options={"threads": 1})
    except (cp.SolverError, cp.DCPError) as error:
        raise StatementError(
            f"the stated program wasn't solved ({error}): check that HiGHS works with "
            f"cvxpy here, or use solve_cover, which calls it directly"
        ) from error
    if program.status == cp.INFEASIBLE:
        return LinearSolution(statement, SolveStatus.INFEASIBLE, float("inf"))
    if program.status != cp.OPTIMAL:
        return LinearSolution(statement, SolveStatus.UNKNOWN, float("nan"))
    unit = statement.unit
    priced = _read(statement.limits.dual_value) * unit / statement.limit_units
    return LinearSolution(
        statement,
        SolveStatus.OPTIMAL,
        float(program.value) * unit,
        _read(statement.sets.value),
        _read(statement.elements.value),
        _read(statement.served.dual_value) * unit,
        priced,
    )


def _elements(
    covers: object, weights: ArrayLike | None, needs: ArrayLike | None
) -> tuple[sparse.csr_array, NDArray[np.float64], NDArray[np.int64]]:
    """Return the checked matrix, the weights and the needs of its rows."""
    matrix = covers if sparse.issparse(covers) else np.asarray(covers)
    shape = cast("tuple[int, ...]", matrix.shape)  # type: ignore[union-attr]
    if len(shape) != 2 or 0 in shape:
        raise ValueError(f"covers must be a matrix that isn't empty, got shape {shape}")
    rows = sparse.csr_array(matrix, copy=True)
    rows.sum_duplicates()
    size = int(rows.nnz) + sum(shape)
    if size > MAX_STATED_ENTRIES:
        raise ValueError(
            f"the program has {size} entries, rows and columns, more than the "
            f"{MAX_STATED_ENTRIES} that are stated in cvxpy: use solve_cover or "
            f"solve_max_coverage, whose bounds come from highspy and numpy"
        )
    if rows.dtype != bool and not np.all((rows.data == 0) | (rows.data == 1)):
        raise ValueError("covers must be boolean or hold only 0 and 1")
    needed = _integers("needs", needs, shape[0], default=1)
    if not np.all(needed >= 1):
        raise ValueError(f"needs must be at least 1, got {needed.min()}")
    a = cast("sparse.csr_array", rows.astype(np.float64))
    return a, _numbers("weights", weights, shape[0]), needed


def _numbers(name: str, given: ArrayLike | None, n: int) -> NDArray[np.float64]:
    values = np.ones(n) if given is None else real_numbers(name, given)
    if values.shape != (n,):
        raise ValueError(f"{name} must be ({n},), got {values.shape}")
    with np.errstate(over="ignore"):
        total = float(values.sum())
    if not (np.all(values >= 0.0) and np.isfinite(total)):
        raise ValueError(f"{name} must be at least 0 and have a finite sum")
    return values


def _integers(
    name: str, given: ArrayLike | None, n: int, *, default: int
) -> NDArray[np.int64]:
    values = np.full(n, default) if given is None else np.asarray(given)
    if values.shape != (n,) or not np.issubdtype(values.dtype, np.integer):
        raise ValueError(
            f"{name} must be {n} integers, got {values.dtype} {values.shape}"
        )
    return values.astype(np.int64)


def _sets(given: ArrayLike, n_s: int) -> NDArray[np.int64]:
    index = np.asarray(given)
    if index.size == 0:
        return np.empty(0, dtype=np.int64)
    if not (
        np.issubdtype(index.dtype, np.integer) and np.all((index >= 0) & (index < n_s))
    ):
        raise ValueError(f"fixed must name sets in [0, {n_s}), got {given}")
    return index.astype(np.int64).ravel()


def _mean(values: NDArray[np.float64]) -> float:
    """Return the mean of the numbers, or 1 where there is none."""
    mean = float(values.mean()) if values.size else 0.0
    return mean if mean > 0.0 else 1.0


def _read(values: object) -> NDArray[np.float64]:
    array = np.array(values, dtype=np.float64)
    array.flags.writeable = False
    return array
