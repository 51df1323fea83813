"""HiGHS, CP-SAT and SCIP on one cover, each in a process of its own.

    minimise  c x   subject to   A x >= y,  w y >= W,  0 <= y <= 1,  x binary

and without y where every row is to be covered. CP-SAT's y is binary and its weights and
costs are integers. The file is also the program of those processes: it needs numpy and
the one solver, so that another interpreter may run it (OR-tools and highspy don't
always live in one process, and ringrig depends on neither OR-tools nor PySCIPOpt).

Usage of the latter: python -m benchmarks.covers.cover_peers SOLVER PROBLEM.npz SECONDS
    THREADS
"""

import argparse
import json
import math
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

ABSENT = 3
# CP-SAT with two workers never moves its bound, so it gets eight on any machine.
_CP_SAT_WORKERS = 8
# Stating millions of entries in Python isn't the solver's time; a hung one is killed.
_GRACE_SECONDS = 120.0
_GRACE_SHARE = 1.25
# SCIP's infinity is 1e20.
_NO_BOUND = 1e19


@dataclass(frozen=True, eq=False)
class PeerProblem:
    """A cover as the peers get it.

    Attributes:
        indptr: Start of each row in the indices, shape (n_e + 1,).
        indices: Columns that cover each row.
        weights: Integer-valued weight of each row, shape (n_e,).
        costs: Integer-valued cost of each column, shape (n_s,).
        required: Weight to reach.
    """

    indptr: NDArray[np.int64]
    indices: NDArray[np.int64]
    weights: NDArray[np.int64]
    costs: NDArray[np.int64]
    required: int

    @property
    def full(self) -> bool:
        """Whether every row is to be covered."""
        return self.required > int(self.weights.sum()) - int(self.weights.min())

    def row(self, e: int) -> NDArray[np.int64]:
        """Return the columns that cover row e."""
        return self.indices[self.indptr[e] : self.indptr[e + 1]]


@dataclass(frozen=True, eq=False)
class PeerAnswer:
    """What a peer said; nothing in it is checked.

    Attributes:
        state: `solved`, `absent`, `killed` or `failed`.
        selected: Columns, or None if it found no cover.
        bound: Its lower bound on the cost, -inf if it has none.
        seconds: Wall time of its solve, without the stating.
        said: Name and version, or what went wrong.
    """

    state: str
    selected: NDArray[np.int64] | None = None
    bound: float = -math.inf
    seconds: float = math.nan
    said: str = ""


def ask_peer(
    solver: str,
    problem: PeerProblem,
    seconds: float,
    *,
    python: str = sys.executable,
    threads: int = 0,
) -> PeerAnswer:
    """Let a peer solve a cover, and kill it if it doesn't stop.

    Args:
        solver: One of ``SOLVERS``.
        problem: The cover.
        seconds: Wall time that the peer is told.
        python: Interpreter that has the peer.
        threads: For HiGHS; 0 leaves it the choice.
    """
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "problem.npz"
        np.savez(file, **vars(problem))
        command = [python, __file__, solver, str(file), str(seconds), str(threads)]
        try:
            done = subprocess.run(
                command,
                capture_output=True,
                text=True,
                check=False,
                timeout=_GRACE_SHARE * seconds + _GRACE_SECONDS,
            )
        except subprocess.TimeoutExpired:
            return PeerAnswer("killed", said="didn't stop at its limit")
        except OSError as error:
            return PeerAnswer("failed", said=f"{error.strerror}: the interpreter")
    if done.returncode == ABSENT:
        return PeerAnswer("absent", said=done.stderr.strip())
    if done.returncode != 0:
        last = (done.stderr.strip().splitlines() or ["nothing"])[-1]
        return PeerAnswer("failed", said=f"exit {done.returncode}: {last}")
    said = json.loads(done.stdout.splitlines()[-1])
    found = said["selected"]
    selected = None if found is None else np.array(found, dtype=np.int64)
    bound = -math.inf if said["bound"] is None else float(said["bound"])
    if bound < -_NO_BOUND:
        bound = -math.inf
    return PeerAnswer("solved", selected, bound, said["seconds"], said["version"])


def main() -> int:
    """Solve one problem; print one line of JSON."""
    parser = argparse.ArgumentParser(description="one solver on one cover")
    parser.add_argument("solver", choices=SOLVERS)
    parser.add_argument("problem")
    parser.add_argument("seconds", type=float)
    parser.add_argument("threads", type=int)
    given = parser.parse_args()
    with np.load(given.problem) as file:
        problem = PeerProblem(**{name: file[name] for name in file.files})
    try:
        selected, bound, seconds, version = SOLVERS[given.solver](
            problem, given.seconds, given.threads
        )
    except ImportError as error:
        print(error, file=sys.stderr)
        return ABSENT
    said = {
        "selected": None if selected is None else [int(s) for s in selected],
        "bound": bound if math.isfinite(bound) else None,
        "seconds": seconds,
        "version": version,
    }
    print(f"\n{json.dumps(said)}")
    return 0


_Said = tuple[NDArray[np.int64] | None, float, float, str]


def _highs(problem: PeerProblem, seconds: float, threads: int) -> _Said:
    import highspy

    n_e, n_s = problem.weights.size, problem.costs.size
    n_y = 0 if problem.full else n_e
    start, index, value = _rows_with_y(problem)
    lp: Any = highspy.HighsLp()
    lp.num_col_, lp.num_row_ = n_s + n_y, start.size - 1
    lp.col_cost_ = np.concatenate([problem.costs, np.zeros(n_y)]).astype(float)
    lp.col_lower_, lp.col_upper_ = np.zeros(n_s + n_y), np.ones(n_s + n_y)
    needed = problem.required / problem.weights.mean()
    low = np.ones(n_e) if problem.full else np.append(np.zeros(n_e), needed)
    lp.row_lower_, lp.row_upper_ = low, np.full(low.size, highspy.kHighsInf)
    lp.a_matrix_.format_ = highspy.MatrixFormat.kRowwise
    lp.a_matrix_.start_ = start.astype(np.int32)
    lp.a_matrix_.index_ = index.astype(np.int32)
    lp.a_matrix_.value_ = value
    kinds = [highspy.HighsVarType.kInteger] * n_s
    lp.integrality_ = kinds + [highspy.HighsVarType.kContinuous] * n_y
    solver = highspy.Highs()
    for name, option in (
        ("output_flag", False),
        ("threads", threads),
        ("mip_rel_gap", 0.0),
        ("time_limit", seconds),
    ):
        solver.setOptionValue(name, option)
    if solver.passModel(lp) == highspy.HighsStatus.kError:
        raise RuntimeError("HiGHS refused the problem")
    begin = time.perf_counter()
    if solver.run() == highspy.HighsStatus.kError:
        raise RuntimeError("HiGHS failed")
    taken = time.perf_counter() - begin
    info = solver.getInfo()
    values = np.asarray(solver.getSolution().col_value)
    found = (
        info.primal_solution_status == highspy.SolutionStatus.kSolutionStatusFeasible
    )
    selected = np.flatnonzero(values[:n_s] > 0.5) if found else None
    return selected, info.mip_dual_bound, taken, f"HiGHS {solver.version()}"


def _rows_with_y(
    problem: PeerProblem,
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Return the program's rows as CSR: A, or (A, -I) and the weights, of mean 1."""
    ones = np.ones(problem.indices.size)
    if problem.full:
        return problem.indptr, problem.indices, ones
    n_e = problem.weights.size
    y = problem.costs.size + np.arange(n_e)
    ends = problem.indptr[1:]
    index = np.concatenate([np.insert(problem.indices, ends, y), y])
    value = np.concatenate(
        [np.insert(ones, ends, -1.0), problem.weights / problem.weights.mean()]
    )
    start = np.append(problem.indptr + np.arange(n_e + 1), index.size)
    return start, index, value


def _cp_sat(problem: PeerProblem, seconds: float, threads: int) -> _Said:
    import ortools
    from ortools.sat.python import cp_model

    model = cp_model.CpModel()
    x = [model.new_bool_var("") for _ in problem.costs]
    serves = [[x[s] for s in problem.row(e)] for e in range(problem.weights.size)]
    if problem.full:
        for sets in serves:
            model.add_bool_or(sets)
    else:
        y = [model.new_bool_var("") for _ in serves]
        for row, sets in zip(y, serves, strict=True):
            model.add_bool_or([row.negated(), *sets])
        weights = [int(w) for w in problem.weights]
        total = cp_model.LinearExpr.weighted_sum(y, weights)
        model.add(total >= int(problem.required))
    costs = [int(c) for c in problem.costs]
    model.minimize(cp_model.LinearExpr.weighted_sum(x, costs))
    solver = cp_model.CpSolver()
    solver.parameters.num_workers = _CP_SAT_WORKERS
    solver.parameters.max_time_in_seconds = seconds
    begin = time.perf_counter()
    status = solver.solve(model)
    taken = time.perf_counter() - begin
    found = status in (cp_model.OPTIMAL, cp_model.FEASIBLE)
    selected = np.flatnonzero([solver.boolean_value(v) for v in x]) if found else None
    return selected, solver.best_objective_bound, taken, f"CP-SAT {ortools.__version__}"


def _scip(problem: PeerProblem, seconds: float, threads: int) -> _Said:
    from pyscipopt import Model, quicksum

    model = Model()
    model.hideOutput()
    x = [model.addVar(vtype="B", obj=float(c)) for c in problem.costs]
    y: list[Any] = []
    for e in range(problem.weights.size):
        serves = quicksum(x[s] for s in problem.row(e))
        if problem.full:
            model.addCons(serves >= 1)
        else:
            y.append(model.addVar(lb=0.0, ub=1.0))
            model.addCons(serves - y[-1] >= 0)
    if not problem.full:
        scaled = problem.weights / problem.weights.mean()
        needed = problem.required / problem.weights.mean()
        model.addCons(quicksum(w * v for w, v in zip(scaled, y, strict=True)) >= needed)
    model.setParam("limits/time", seconds)
    begin = time.perf_counter()
    model.optimize()
    taken = time.perf_counter() - begin
    selected = None
    if model.getNSols():
        best = model.getBestSol()
        selected = np.flatnonzero([best[v] > 0.5 for v in x])
    return selected, model.getDualbound(), taken, f"SCIP {model.version()}"


SOLVERS: dict[str, Callable[[PeerProblem, float, int], _Said]] = {
    "HiGHS": _highs,
    "CP-SAT": _cp_sat,
    "SCIP": _scip,
}


if __name__ == "__main__":
    sys.exit(main())
