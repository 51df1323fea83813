"""Covers as linear and mixed-integer programs for HiGHS, over plain arrays.

    minimise c x   subject to   A x >= r y,  w_g y >= W_g for each row set g,
                                w y >= W,  1 x <= K,  0 <= y <= 1,  x binary,
                                1 x_k <= b_k for each kind k of which a stock binds

or with the largest w y as the aim. One thread and limits on iterations and nodes, so
that the answer doesn't depend on the machine. What comes back is a proposal: selections
and linear bounds are evaluated again by the caller. Only the bound of branch and bound
is HiGHS' own word.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from solvers.one_thread import quiet_highs, row_program, run_highs
from solvers.status import WorkBudget

from .reduced_cover import ReducedCover

# Units of work per nonzero that a simplex iteration, the root with its cuts (of a
# partial and of a full cover) and any other node cost.
_UNITS_PER_ITERATION = 2.0
_UNITS_PER_ROOT = 100_000.0
_UNITS_PER_FULL_ROOT = 20_000.0
_UNITS_PER_NODE = 3_000.0
_MAX_ENTRIES = 60_000
# HiGHS' own tolerance, relative to the bound.
TOLERANCE = 1e-6
# Weights, in their mean, that it isn't told of.
_LIGHT = 1e-8


@dataclass(frozen=True, eq=False)
class IntegerAnswer:
    """What branch and bound left.

    Attributes:
        selected: The best selection, to be checked, or None.
        bound: HiGHS' bound on the cost from below, or on the weight from above, with
            its tolerance; None if it has none.
    """

    selected: NDArray[np.int64] | None
    bound: float | None


def linear_multipliers(
    cover: ReducedCover, budget: WorkBudget
) -> NDArray[np.float64] | None:
    """Return row multipliers of the linear relaxation, (n_e,), in cost, if any came."""
    steps = int(budget.remaining / (_UNITS_PER_ITERATION * cover.entries))
    if steps < 1:
        return None
    solver = _model(cover, budget)
    solver.setOptionValue("simplex_iteration_limit", min(steps, 10_000_000))
    run_highs(solver)
    budget.spend(
        float(solver.getInfo().simplex_iteration_count)
        * _UNITS_PER_ITERATION
        * cover.entries
    )
    dual = np.asarray(solver.getSolution().row_dual, dtype=np.float64)
    if dual.size < cover.weights.size:
        return None
    return _cost_unit(cover) * np.clip(
        np.nan_to_num(dual[: cover.weights.size]), 0.0, None
    )


def fits(cover: ReducedCover) -> bool:
    """Whether the program is small enough for branch and bound."""
    return cover.entries <= _MAX_ENTRIES


def branch_and_bound(
    cover: ReducedCover,
    start: NDArray[np.int64],
    budget: WorkBudget,
    *,
    max_sets: int | None = None,
    heaviest: bool = False,
) -> IntegerAnswer:
    """Look for the cheapest cover, or the heaviest, up to a number of nodes."""
    light = cover.full and not heaviest
    root = _UNITS_PER_FULL_ROOT if light else _UNITS_PER_ROOT
    spare = budget.remaining / cover.entries - root
    if not spare > 0 or budget.exhausted:
        return IntegerAnswer(None, None)
    solver = _model(cover, budget, integer=True, max_sets=max_sets, heaviest=heaviest)
    solver.setOptionValue("mip_max_nodes", 1 + int(min(spare / _UNITS_PER_NODE, 1e7)))
    _warm_start(solver, cover, start)
    run_highs(solver)
    nodes = max(0, int(solver.getInfo().mip_node_count))
    budget.spend((root + _UNITS_PER_NODE * nodes) * cover.entries)
    return _answer(solver, cover, heaviest=heaviest)


def _answer(
    solver: Any,  # noqa: ANN401
    cover: ReducedCover,
    *,
    heaviest: bool,
) -> IntegerAnswer:
    import highspy

    if solver.getModelStatus() == highspy.HighsModelStatus.kInfeasible:
        return IntegerAnswer(None, None)
    values = np.asarray(solver.getSolution().col_value, dtype=np.float64)
    n = cover.n_sets
    usable = bool(solver.getSolution().value_valid) and values.size >= n
    selected = np.flatnonzero(values[:n] > 0.5) if usable else None
    bound = float(solver.getInfo().mip_dual_bound)
    if not np.isfinite(bound):
        return IntegerAnswer(selected, None)
    tolerance = TOLERANCE * max(1.0, abs(bound))
    if heaviest:
        light = float(_weights(cover)[1].sum())
        weight = float(cover.weights.mean()) * (light + tolerance - bound)
        return IntegerAnswer(selected, weight)
    return IntegerAnswer(selected, _cost_unit(cover) * max(0.0, bound - tolerance))


def _cost_unit(cover: ReducedCover) -> float:
    """Return what costs are divided by: 1 unless small, or far above it."""
    mean = float(cover.costs.mean()) if cover.n_sets else 1.0
    # A power of two, so that whole costs stay whole in some unit.
    return 1.0 if 1.0 <= mean < 1e5 else float(2.0 ** np.round(np.log2(mean)))


def _model(
    cover: ReducedCover,
    budget: WorkBudget,
    *,
    integer: bool = False,
    max_sets: int | None = None,
    heaviest: bool = False,
) -> Any:  # noqa: ANN401
    import highspy

    n_e, n_s = cover.weights.size, cover.n_sets
    # Weights of mean 1, so that the solver's tolerance is a small share of a row.
    weights, dropped = _weights(cover)
    quotas = np.append(cover.quotas, cover.quota)
    dropped = np.append(dropped, dropped.sum())
    needed = np.maximum(0.0, quotas / cover.weights.mean() - dropped)
    with_rows = heaviest or not cover.full
    link: sparse.csr_array = cover.by_row
    lower = cover.needs.astype(np.float64)
    cost = cover.costs / _cost_unit(cover)
    if with_rows:
        service = sparse.dia_array((-lower[None], [0]), shape=(n_e, n_e))
        groups = sparse.csr_array(
            (weights, (cover.row_sets, np.arange(n_e))), shape=(cover.quotas.size, n_e)
        )
        if cover.quota > 0:
            groups = _stack([[groups], [sparse.csr_array(weights.reshape(1, -1))]])
        needed = needed if cover.quota > 0 else needed[:-1]
        link = _stack([[link, service], [None, groups]])
        lower = np.concatenate([np.zeros(n_e), needed])
        cost = np.concatenate(
            [np.zeros(n_s), -weights] if heaviest else [cost, np.zeros(n_e)]
        )
    upper = np.full(lower.size, highspy.kHighsInf)
    limits = [(np.ones(n_s), n_s if max_sets is None else max_sets)]
    if cover.limited:
        kinds = enumerate(cover.stock.tolist())
        limits += [(cover.kinds == kind, stock) for kind, stock in kinds]
    for members, most in limits:
        if members.sum() > most:
            ones = np.zeros((1, cost.size))
            ones[0, :n_s] = members
            link = _stack([[link], [sparse.csr_array(ones)]])
            lower, upper = np.append(lower, 0.0), np.append(upper, float(most))
    lp = row_program(cost, link, lower, upper)
    if integer:
        whole, free = highspy.HighsVarType.kInteger, highspy.HighsVarType.kContinuous
        kinds = [whole] * n_s
        if with_rows:
            # Half of the service is no half of a row.
            kinds += [whole if need > 1 else free for need in cover.needs]
        lp.integrality_ = kinds
    solver = quiet_highs(
        mip_rel_gap=0.0,
        mip_abs_gap=1e-9,
        time_limit=max(0.01, budget.time_left),
    )
    solver.passModel(lp)
    return solver


def _weights(
    cover: ReducedCover,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return weights in their mean, and what was left out of each row set."""
    # HiGHS ignores coefficients below 1e-9; as covered rows they leave its bound one.
    weights = cover.weights / cover.weights.mean()
    light = weights < _LIGHT
    dropped = cover.by_row_set(np.where(light, weights, 0.0))
    return np.where(light, 0.0, weights), dropped


def _stack(blocks: list[list[sparse.sparray | None]]) -> sparse.csr_array:
    return sparse.csr_array(sparse.block_array(blocks))


def _warm_start(
    solver: Any,  # noqa: ANN401
    cover: ReducedCover,
    start: NDArray[np.int64],
) -> None:
    import highspy

    values = np.zeros(solver.getNumCol())
    values[start] = 1.0
    if values.size > cover.n_sets:
        values[cover.n_sets :] = cover.served(start) >= cover.needs
    known = highspy.HighsSolution()
    known.col_value = values.tolist()
    solver.setSolution(known)
