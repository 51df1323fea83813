"""The linear relaxation of a cover: hand-packed HiGHS arrays against cvxpy.

    minimise  c x   subject to   A x >= y,  w y >= W,  0 <= x, y <= 1

Result at the planner's size, 2,000 samples x 500 candidates, a quarter of the entries
set, 90 % of the weight, on two shared cores: arrays are packed in 0.31 s and solved in
11 s; cvxpy takes 2.1 s to import and 0.35 s to compile the same statement, which HiGHS
then solves in 15 s. So the packed arrays stay: the import costs more than most covers.

Usage: python -m benchmarks.covers.linear_bounds
"""

import time
from typing import Any

import numpy as np

from solvers import CoverProblem
from solvers.covers.bounds.mixed_integer import linear_multipliers
from solvers.covers.bounds.reduced_cover import ReducedCover
from solvers.covers.bounds.reductions import reduce_problem
from solvers.status import WorkBudget

N_SAMPLES, N_CANDIDATES = 2_000, 500


def visible_cover() -> ReducedCover:
    """Return samples on a sphere, each covered within a cap of 60 degrees."""
    rng = np.random.default_rng(0)
    points = rng.normal(size=(N_SAMPLES, 3))
    views = rng.normal(size=(N_CANDIDATES, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    views /= np.linalg.norm(views, axis=1, keepdims=True)
    covers = points @ views.T > np.cos(np.pi / 3)
    weights = rng.uniform(0.5, 1.5, N_SAMPLES)
    return reduce_problem(CoverProblem(covers, weights=weights, min_coverage=0.9))


def by_arrays(cover: ReducedCover) -> tuple[float, float]:
    """Return the seconds of packing (a budget of one step), and of a whole run."""
    began = time.perf_counter()
    linear_multipliers(cover, WorkBudget(2.5 * cover.entries))
    packed = time.perf_counter()
    if linear_multipliers(cover, WorkBudget(1e12)) is None:
        raise RuntimeError("the linear program wasn't solved")
    return packed - began, time.perf_counter() - packed


def by_cvxpy(cover: ReducedCover) -> tuple[float, float, float]:
    """Return the seconds of cvxpy's import, of its compilation and of its whole run."""
    began = time.perf_counter()
    import cvxpy as cp

    imported = time.perf_counter()
    x, y = cp.Variable(cover.n_sets), cp.Variable(cover.weights.size)
    weights = cover.weights / cover.weights.mean()
    limits: Any = [
        cover.by_row @ x >= y,
        weights @ y >= float(cover.quotas[0] / cover.weights.mean()),
        x >= 0,
        x <= 1,
        y >= 0,
        y <= 1,
    ]
    program = cp.Problem(cp.Minimize(cover.costs @ x), limits)
    program.get_problem_data(cp.HIGHS)
    compiled = time.perf_counter()
    program.solve(solver=cp.HIGHS)
    ended = time.perf_counter()
    return imported - began, compiled - imported, ended - imported


def main() -> None:
    """Print both, one statement each."""
    cover = visible_cover()
    by_arrays(cover)
    packed, whole = by_arrays(cover)
    print(f"packed arrays: pack {packed:.2f} s, run {whole:.2f} s")
    imported, compiled, whole = by_cvxpy(cover)
    print(
        f"cvxpy: import {imported:.2f} s, compile {compiled:.2f} s, run {whole:.2f} s"
    )


if __name__ == "__main__":
    main()
