"""What solvers that aren't ours say of a cover: is there one of so few sets?"""

import importlib
import importlib.util
from typing import Any

import numpy as np
from scipy import sparse
from scipy.optimize import Bounds, LinearConstraint, milp

from geometry.arrays import Mask

HAS_CP_SAT = importlib.util.find_spec("ortools") is not None


def by_highs(covers: Mask, required: int, n_sets: int, limit_s: float) -> str:
    """Say what HiGHS covers at most with so many sets."""
    rows = covers[covers.any(axis=1)]
    n, m = rows.shape
    links = sparse.hstack([sparse.csr_array(rows.astype(float)), -sparse.eye_array(n)])
    chosen = np.concatenate([np.ones(m), np.zeros(n)])
    found = milp(
        chosen - 1.0,
        constraints=[
            LinearConstraint(sparse.csr_array(links), lb=0.0),
            LinearConstraint(chosen[None], ub=n_sets),
        ],
        bounds=Bounds(0.0, 1.0),
        integrality=np.ones(m + n),
        options={"time_limit": limit_s},
    )
    if found.x is None:
        return f"nothing in {limit_s:.0f} s"
    state = "optimal" if found.status == 0 else f"{limit_s:.0f} s"
    sets = np.flatnonzero(found.x[:m] > 0.5)
    return f"{_most(covers, sets, required)} ({state})"


def by_cp_sat(covers: Mask, required: int, n_sets: int, limit_s: float) -> str:
    """Say whether OR-tools' CP-SAT finds so many sets that are enough, or refutes them.

    Samples that the same candidates cover are one, with their number as weight; its
    clauses are that one is covered only if one of these is chosen.
    """
    if not HAS_CP_SAT:
        return "not installed"
    cp_model: Any = importlib.import_module("ortools.sat.python.cp_model")
    model: Any = cp_model.CpModel()
    solver: Any = cp_model.CpSolver()
    rows, weights = np.unique(covers[covers.any(axis=1)], axis=0, return_counts=True)
    chosen = [model.new_bool_var("") for _ in range(rows.shape[1])]
    covered = [model.new_bool_var("") for _ in range(len(rows))]
    for row, one in zip(rows, covered, strict=True):
        model.add_bool_or([chosen[j] for j in np.flatnonzero(row)] + [~one])
    model.add(sum(chosen) <= n_sets)
    model.add(cp_model.LinearExpr.weighted_sum(covered, weights.tolist()) >= required)
    solver.parameters.max_time_in_seconds = limit_s
    solver.parameters.num_workers = 1
    status = solver.solve(model)
    if status == cp_model.INFEASIBLE:
        return f"refuted in {solver.wall_time:.1f} s"
    if status == cp_model.UNKNOWN:
        return f"undecided in {limit_s:.0f} s"
    sets = np.array([j for j, one in enumerate(chosen) if solver.value(one)])
    return _most(covers, sets, required)


def _most(covers: Mask, sets: Any, required: int) -> str:  # noqa: ANN401
    most = int(covers[:, sets].any(axis=1).sum())
    return f"{most}{' SMALLER' * (most >= required)}"
