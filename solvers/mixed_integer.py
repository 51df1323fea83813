"""Covers as linear and mixed-integer programs for HiGHS, over plain arrays.

    minimise c x   subject to   A x >= y,  w y >= W,  0 <= y <= 1,  x binary

One thread and limits on iterations and nodes, so that the answer doesn't depend on the
machine. What comes back is a proposal: selections and linear bounds are evaluated again
by the caller. Only the bound of branch and bound is HiGHS' own word.
"""

from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from .reductions import ReducedCover
from .status import WorkBudget

# Units of work per nonzero that a simplex iteration, the root with its cuts (of a
# partial and of a full cover) and any other node cost.
_UNITS_PER_ITERATION = 2.0
_UNITS_PER_ROOT = 100_000.0
_UNITS_PER_FULL_ROOT = 20_000.0
_UNITS_PER_NODE = 3_000.0
_MAX_ENTRIES = 60_000


@dataclass(frozen=True, eq=False)
class IntegerAnswer:
    """What branch and bound left.

    Attributes:
        selected: The best selection, to be checked, or None.
        lower_bound: HiGHS' bound on the cost, less its tolerance.
    """

    selected: NDArray[np.int64] | None
    lower_bound: float


def linear_multipliers(
    cover: ReducedCover, budget: WorkBudget
) -> NDArray[np.float64] | None:
    """Return row multipliers of the linear relaxation, or None if it wasn't solved.

    Shape (n_e,), in cost; safe to use in ``relaxation.cost_bound`` whatever they are.
    """
    steps = int(budget.remaining / (_UNITS_PER_ITERATION * cover.entries))
    if steps < 1:
        return None
    solver = _model(cover, integer=False, budget=budget)
    solver.setOptionValue("simplex_iteration_limit", min(steps, 10_000_000))
    solver.run()
    budget.spend(
        float(solver.getInfo().simplex_iteration_count)
        * _UNITS_PER_ITERATION
        * cover.entries
    )
    dual = np.asarray(solver.getSolution().row_dual, dtype=np.float64)
    if dual.size < cover.weights.size:
        return None
    return np.clip(np.nan_to_num(dual[: cover.weights.size]), 0.0, None)


def fits(cover: ReducedCover) -> bool:
    """Whether the program is small enough for branch and bound to be of use."""
    return cover.entries <= _MAX_ENTRIES


def solve_integer(
    cover: ReducedCover, start: NDArray[np.int64], budget: WorkBudget
) -> IntegerAnswer:
    """Run branch and bound from a known cover, up to a number of nodes."""
    root = _UNITS_PER_FULL_ROOT if _is_full(cover) else _UNITS_PER_ROOT
    spare = budget.remaining / cover.entries - root
    if not spare > 0 or budget.exhausted:
        return IntegerAnswer(None, 0.0)
    solver = _model(cover, integer=True, budget=budget)
    solver.setOptionValue("mip_max_nodes", 1 + int(min(spare / _UNITS_PER_NODE, 1e7)))
    _warm_start(solver, cover, start)
    solver.run()
    info = solver.getInfo()
    nodes = _UNITS_PER_NODE * max(0, int(info.mip_node_count))
    budget.spend((root + nodes) * cover.entries)
    values = np.asarray(solver.getSolution().col_value, dtype=np.float64)
    n = cover.n_sets
    selected = np.flatnonzero(values[:n] > 0.5) if values.size >= n else None
    bound = float(info.mip_dual_bound)
    bound = bound if np.isfinite(bound) else 0.0
    return IntegerAnswer(selected, max(0.0, bound - 1e-6 * max(1.0, abs(bound))))


def _model(cover: ReducedCover, *, integer: bool, budget: WorkBudget) -> Any:  # noqa: ANN401
    """Return a HiGHS instance that holds the program."""
    import highspy

    n_e, n_s = cover.weights.size, cover.n_sets
    full = _is_full(cover)
    link: sparse.csr_array = cover.by_row
    quota = np.empty(0)
    if not full:
        # Weights of mean 1, so that the solver's tolerance is a small share of a row.
        quota = cover.weights / cover.weights.mean()
        link = sparse.csr_array(
            sparse.vstack(
                [
                    sparse.hstack([link, -sparse.eye_array(n_e)]),
                    sparse.csr_array(np.concatenate([np.zeros(n_s), quota])[None]),
                ]
            )
        )
    n_rows, n_columns = cast("tuple[int, int]", link.shape)
    lp: Any = highspy.HighsLp()
    lp.num_col_, lp.num_row_ = n_columns, n_rows
    lp.col_cost_ = np.concatenate([cover.costs, np.zeros(n_columns - n_s)])
    lp.col_lower_, lp.col_upper_ = np.zeros(n_columns), np.ones(n_columns)
    needed = cover.required / cover.weights.mean()
    lp.row_lower_ = np.ones(n_e) if full else np.append(np.zeros(n_e), needed)
    lp.row_upper_ = np.full(lp.num_row_, highspy.kHighsInf)
    lp.a_matrix_.format_ = highspy.MatrixFormat.kRowwise
    lp.a_matrix_.start_ = link.indptr.astype(np.int32)
    lp.a_matrix_.index_ = link.indices.astype(np.int32)
    lp.a_matrix_.value_ = link.data.astype(np.float64)
    if integer:
        kinds = [highspy.HighsVarType.kInteger] * n_s
        kinds += [highspy.HighsVarType.kContinuous] * (n_columns - n_s)
        lp.integrality_ = kinds
    solver = highspy.Highs()
    for name, value in (
        ("output_flag", False),
        ("threads", 1),
        ("parallel", "off"),
        ("random_seed", 0),
        ("mip_rel_gap", 0.0),
        ("mip_abs_gap", 1e-9),
        ("time_limit", max(0.01, budget.time_left)),
    ):
        solver.setOptionValue(name, value)
    solver.passModel(lp)
    return solver


def _is_full(cover: ReducedCover) -> bool:
    """Whether no row may be lost, so that the rows' own variables fall away."""
    return cover.total - cover.required < float(cover.weights.min(initial=np.inf))


def _warm_start(
    solver: Any,  # noqa: ANN401
    cover: ReducedCover,
    start: NDArray[np.int64],
) -> None:
    import highspy

    values = np.zeros(solver.getNumCol())
    values[start] = 1.0
    if values.size > cover.n_sets:
        counts = np.asarray(cover.by_set[start].sum(axis=0)).ravel()
        values[cover.n_sets :] = np.minimum(counts, 1.0)
    known = highspy.HighsSolution()
    known.col_value = values.tolist()
    solver.setSolution(known)
