"""Full covers of equal costs as programs over few of their rows.

Any subset of the rows asks less, so what holds from below for a subset holds for the
whole. The linear program takes rows in until no other is violated; its multipliers y
give, evaluated here in numpy, for any y >= 0::

    count >= sum_e y_e + sum_j min(0, 1 - y a_j)

The integer program looks for fewer sets than known that cover the subset. One thread,
and limits on iterations and nodes, so that the answer doesn't depend on the machine.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from .highs import run_highs
from .status import WorkBudget

_FIRST_ROWS = 200
_BATCH = 100
_VIOLATED = 1e-6
# Rounding of sums of multipliers.
_ROUNDING = 1e-7
# Units of work a nonzero of a simplex iteration, of the root with its cuts, of a node.
_UNITS_PER_ITERATION = 4.0
_UNITS_PER_ROOT = 300_000.0
_UNITS_PER_NODE = 5_000.0


@dataclass(frozen=True, eq=False)
class LinearCover:
    """Linear relaxation of a full cover, by rows.

    Attributes:
        lower_bound: Sets that any cover needs at least, by the multipliers.
        needed: The same before it was rounded up.
        reduced: Sets that a cover with set j needs beyond these, shape (n_s,).
        rows: Rows that the solution meets without slack, increasing.
        primal: Share of each set, shape (n_s,).
    """

    lower_bound: int
    needed: float
    reduced: NDArray[np.float64]
    rows: NDArray[np.int64]
    primal: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class IntegerCover:
    """What branch and bound found about a full cover.

    Attributes:
        selected: A cover of fewer sets than was known, or None.
        lower_bound: Sets that any cover needs at least, by HiGHS' dual bound less its
            tolerance.
    """

    selected: NDArray[np.int64] | None
    lower_bound: int


def least_count(covers: NDArray[np.bool_], multipliers: NDArray[np.float64]) -> int:
    """Return a lower bound on the sets that cover every row.

    Args:
        covers: Whether set s covers row e, shape (n_e, n_s).
        multipliers: Any numbers, shape (n_e,); negative ones count as 0.
    """
    return _rounded_up(_priced(covers, multipliers)[0])


def _priced(
    covers: NDArray[np.bool_], multipliers: NDArray[np.float64]
) -> tuple[float, NDArray[np.float64]]:
    """Return the bound by multipliers, not rounded up, and the reduced costs."""
    given = np.clip(np.nan_to_num(multipliers), 0.0, 1.0)
    reduced = 1.0 - given @ covers.astype(np.float64)
    return needed_sets(given, reduced), reduced


def needed_sets(
    multipliers: NDArray[np.float64], reduced: NDArray[np.float64]
) -> float:
    """Return the bound by multipliers and the reduced costs of the sets allowed."""
    bound = float(multipliers.sum() + np.minimum(reduced, 0.0).sum())
    return bound * (1.0 - 1e-9)


def _rounded_up(bound: float) -> int:
    return max(0, int(np.ceil(bound - _ROUNDING)))


def linear_cover(covers: NDArray[np.bool_], budget: WorkBudget) -> LinearCover:
    """Solve the linear relaxation as far as the budget lasts.

    Args:
        covers: Whether set s covers row e, shape (n_e, n_s); every row is covered.
        budget: Work.
    """
    n_rows, n_sets = covers.shape
    rows = np.argsort(covers.sum(axis=1), kind="stable")[:_FIRST_ROWS]
    solver = program(covers[rows], budget)
    primal, dual = np.zeros(n_sets), np.zeros(rows.size)
    taken = np.zeros(n_rows, dtype=bool)
    needed, reduced = 0.0, np.ones(n_sets)
    taken[rows] = True
    tight = np.sort(rows)
    while not budget.exhausted:
        entries = float(np.count_nonzero(covers[rows]) + n_sets)
        steps = int(budget.remaining / (_UNITS_PER_ITERATION * entries))
        solver.setOptionValue("simplex_iteration_limit", max(1, min(steps, 10**7)))
        solver.setOptionValue("time_limit", solver.getRunTime() + _seconds(budget))
        run_highs(solver)
        done = float(solver.getInfo().simplex_iteration_count)
        budget.spend(_UNITS_PER_ITERATION * entries * done + 2.0 * covers.size)
        solution = solver.getSolution()
        dual = np.asarray(solution.row_dual, dtype=np.float64)
        primal = np.asarray(solution.col_value, dtype=np.float64)
        if dual.size != rows.size or primal.size != n_sets:
            break
        bound, costs = _priced(covers[rows], dual)
        if bound > needed:
            needed, reduced = bound, costs
        support = np.flatnonzero(primal > 0)
        reached = covers[:, support] @ primal[support]
        tight = np.sort(rows[reached[rows] < 1.0 + _VIOLATED])
        missed = np.flatnonzero((reached < 1.0 - _VIOLATED) & ~taken)
        if missed.size == 0:
            break
        missed = missed[np.argsort(reached[missed], kind="stable")][:_BATCH]
        for row in missed:
            sets = np.flatnonzero(covers[row]).astype(np.int32)
            solver.addRow(1.0, np.inf, sets.size, sets, np.ones(sets.size))
        rows = np.concatenate([rows, missed])
        taken[missed] = True
    return LinearCover(_rounded_up(needed), needed, reduced, tight, primal)


def integer_cover(
    covers: NDArray[np.bool_], known: NDArray[np.int64], budget: WorkBudget
) -> IntegerCover:
    """Look for a smaller cover than a known one, by HiGHS' branch and bound.

    Args:
        covers: Whether set s covers row e, shape (n_e, n_s).
        known: Sets that cover every row, shape (k,).
        budget: Work; without enough for the root, nothing is done.
    """
    entries = float(np.count_nonzero(covers) + sum(covers.shape))
    spare = budget.remaining / entries - _UNITS_PER_ROOT
    if not spare > 0 or budget.exhausted:
        return IntegerCover(None, 0)
    import highspy

    n_sets = covers.shape[1]
    solver = program(covers, budget, integer=True)
    start = highspy.HighsSolution()
    start.col_value = np.isin(np.arange(n_sets), known).astype(float).tolist()
    solver.setSolution(start)
    solver.setOptionValue("mip_max_nodes", 1 + int(min(spare / _UNITS_PER_NODE, 1e7)))
    # One set less ends it: the rows that it misses are taken in first.
    solver.setOptionValue("objective_target", known.size - 0.5)
    run_highs(solver)
    info = solver.getInfo()
    nodes = _UNITS_PER_NODE * max(0, int(info.mip_node_count))
    budget.spend((_UNITS_PER_ROOT + nodes) * entries)
    values = np.asarray(solver.getSolution().col_value, dtype=np.float64)
    selected = np.flatnonzero(values > 0.5) if values.size == n_sets else None
    if selected is not None and not (
        selected.size < known.size and covers[:, selected].any(axis=1).all()
    ):
        selected = None
    bound = float(info.mip_dual_bound)
    lower = int(np.ceil(bound - 1e-5)) if np.isfinite(bound) else 0
    return IntegerCover(selected, max(0, min(lower, known.size)))


def _seconds(budget: WorkBudget) -> float:
    return float(max(0.01, min(budget.time_left, 1e9)))


def program(
    covers: NDArray[np.bool_], budget: WorkBudget, *, integer: bool = False
) -> Any:  # noqa: ANN401
    """Return a HiGHS instance that holds min sum x, A x >= 1, 0 <= x <= 1."""
    import highspy

    n_rows, n_sets = covers.shape
    matrix = sparse.csr_array(covers)
    lp: Any = highspy.HighsLp()
    lp.num_col_, lp.num_row_ = n_sets, n_rows
    lp.col_cost_ = np.ones(n_sets)
    lp.col_lower_, lp.col_upper_ = np.zeros(n_sets), np.ones(n_sets)
    lp.row_lower_, lp.row_upper_ = np.ones(n_rows), np.full(n_rows, np.inf)
    lp.a_matrix_.format_ = highspy.MatrixFormat.kRowwise
    lp.a_matrix_.start_ = matrix.indptr.astype(np.int32)
    lp.a_matrix_.index_ = matrix.indices.astype(np.int32)
    lp.a_matrix_.value_ = matrix.data.astype(np.float64)
    if integer:
        lp.integrality_ = [highspy.HighsVarType.kInteger] * n_sets
    solver = highspy.Highs()
    for name, value in (
        ("output_flag", False),
        ("threads", 1),
        ("parallel", "off"),
        ("random_seed", 0),
        ("mip_rel_gap", 0.0),
        # Counts are whole numbers.
        ("mip_abs_gap", 0.999),
        # Covers come from elsewhere; here only the bound is wanted.
        ("mip_heuristic_effort", 0.0),
        ("time_limit", _seconds(budget)),
    ):
        solver.setOptionValue(name, value)
    solver.passModel(lp)
    return solver
