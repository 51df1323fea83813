"""Covers by pairs of views at the planner's size, and plain HiGHS on smaller ones.

Usage: python -m benchmarks.covers.pair_covers [--share S] [--budget UNITS]
       [--small ROWSxCOLUMNS] [--peer-limit S] [--full-only]

Fewest candidates of which two see a sample under 10 to 90 degrees, for the stated
share of the samples that any two do (`visibility_instances.py`). Beside ours: the bound
of two views whatever their angle, by the cover engine with needs of 2. The smaller ones
go to HiGHS as well (SciPy's `milp`), with a binary variable for each set and sample and
one for each pair::

    minimise 1 x  subject to  p_ij <= x_i, p_ij <= x_j, y_e <= sum_(ij in E_e) p_ij,
                              1 y >= W

Every selection is checked here, sample by sample. Returns 1 if a selection misses its
share, or a bound exceeds what somebody found.
"""

import argparse
import math
import sys
import time

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.optimize import Bounds, LinearConstraint, milp

from benchmarks.covers.visibility_instances import Instance, SeenSamples, seen_samples
from benchmarks.machine import machine
from solvers import CoverProblem, solve_cover
from solvers.covers.paired.pair_cover import solve_pair_cover
from solvers.covers.paired.pair_problem import PairCoverProblem, packed_pairs

ANGLES = (10.0, 90.0)
INSTANCES = (
    ("vtk_bunny.ply", "wide"),
    ("vtk_bunny.ply", "narrow"),
    ("vtk_horse.ply", "wide"),
    ("vtk_horse.ply", "narrow"),
    ("tm_fixed_top.ply", "wide"),
    ("face_scan_james.obj", "wide"),
    ("face_scan_james.obj", "narrow"),
)


def main() -> int:
    """Print a row for each instance; return 1 on a fault."""
    given = _arguments()
    print(
        f"{machine()}\n\nShare {given.share:g}, angles {ANGLES[0]:g} to "
        f"{ANGLES[1]:g} degrees, work budget {given.budget:.0e} units; HiGHS at most "
        f"{given.peer_limit:g} s.\n"
    )
    columns = ("instance", "ours", "bound", "wall [s]", "proof", "bound of needs 2")
    faults: list[str] = []
    print(f"| {' | '.join(columns)} |\n|{len(columns) * '---|'}", flush=True)
    for mesh, field in INSTANCES:
        seen = seen_samples(Instance(mesh, field, 2000, 480))
        row, _ = _ours(seen, given, faults, f"{mesh} {field} 2,000 x 480")
        print(f"| {' | '.join(row)} |", flush=True)
    if not given.full_only:
        _beside_highs(given, columns, faults)
    for fault in faults:
        print(f"\nFAULT: {fault}")
    return int(bool(faults))


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="covers by pairs of views")
    parser.add_argument("--share", type=float, default=0.95)
    parser.add_argument("--budget", type=float, default=1e10, help="units of work")
    parser.add_argument("--small", default="200x60", metavar="ROWSxCOLUMNS")
    parser.add_argument("--peer-limit", type=float, default=60.0, help="[s]")
    parser.add_argument("--full-only", action="store_true", help="without HiGHS")
    return parser.parse_args()


def _beside_highs(
    given: argparse.Namespace, columns: tuple[str, ...], faults: list[str]
) -> None:
    rows, sets = (int(n) for n in given.small.split("x"))
    heads = (*columns, "HiGHS", "its bound", "wall [s]")
    print(f"\n| {' | '.join(heads)} |\n|{len(heads) * '---|'}", flush=True)
    for mesh, field in INSTANCES:
        name = f"{mesh} {field} {rows} x {sets}"
        seen = seen_samples(Instance(mesh, field, rows, sets))
        row, problem = _ours(seen, given, faults, name)
        begin = time.perf_counter()
        found, bound = _highs(problem, seen, given.peer_limit)
        wall = time.perf_counter() - begin
        ours, least = int(row[1]), int(row[2])
        size = math.inf
        if found is not None and problem.covered_weight(found) >= float(
            problem.required_weight
        ):
            size = len(found)
        if least > size or bound > ours + 1e-6:
            faults.append(f"{name}: a bound exceeds what was found")
        row += [f"{size:g}", f"{bound:.2f}", f"{wall:.1f}"]
        print(f"| {' | '.join(row)} |", flush=True)


def _ours(
    seen: SeenSamples, given: argparse.Namespace, faults: list[str], name: str
) -> tuple[list[str], PairCoverProblem]:
    problem = _problem(seen, given.share)
    begin = time.perf_counter()
    answer = solve_pair_cover(problem, budget=given.budget, time_limit=600.0)
    wall = time.perf_counter() - begin
    needs = CoverProblem(
        seen.seen, required_weight=np.array([problem.required_weight]), needs=2
    )
    two = solve_cover(needs, budget=given.budget).lower_bound
    if _by_hand(seen, answer.selected) < problem.required_weight:
        faults.append(f"{name}: our selection sees too little")
    size, least = len(answer.selected), int(answer.lower_bound)
    proof = f"proved: {answer.proof}" if least == size else answer.proof
    cells = [name, str(size), str(least), f"{wall:.1f}", proof, f"{two:g}"]
    return cells, problem


def _problem(seen: SeenSamples, share: float) -> PairCoverProblem:
    towards = _towards(seen)
    low, high = np.cos(np.deg2rad(ANGLES))

    def together(i: int) -> NDArray[np.bool_]:
        cosines = np.einsum("ek,emk->em", towards[:, i], towards)
        good = (cosines <= low) & (cosines >= high) & seen.seen & seen.seen[:, [i]]
        return good.T

    n_e, n_s = seen.seen.shape
    good = packed_pairs(together, n_s, n_e)
    whole = PairCoverProblem(seen.seen, good)
    reached = whole.covered_weight(np.arange(n_s))
    required = float(math.ceil(share * reached - 1e-9))
    return PairCoverProblem(seen.seen, good, required_weight=required)


def _towards(seen: SeenSamples) -> NDArray[np.float64]:
    towards = seen.origins[None] - seen.points[:, None]
    return towards / np.linalg.norm(towards, axis=2, keepdims=True)


def _by_hand(seen: SeenSamples, selected: NDArray[np.int64]) -> int:
    """Return how many samples two of the views see under an angle within limits."""
    count, towards = 0, _towards(seen)
    for e in range(len(seen.points)):
        chosen = [s for s in selected if seen.seen[e, s]]
        rays = towards[e, chosen]
        angles = np.rad2deg(np.arccos(np.clip(rays @ rays.T, -1.0, 1.0)))
        count += bool(np.any((angles >= ANGLES[0]) & (angles <= ANGLES[1])))
    return count


def _highs(
    problem: PairCoverProblem, seen: SeenSamples, limit: float
) -> tuple[NDArray[np.int64] | None, float]:
    """Return the selection of HiGHS with linearised pairs, and its bound."""
    n_e, n_s = seen.seen.shape
    tables = np.array([problem.pairs_of(i) for i in range(n_s)])
    first, second = np.nonzero(np.triu(tables.any(axis=2), 1))
    n_p, each = len(first), np.arange(len(first))
    cells = sparse.csr_array(tables[first, second].T.astype(float))
    pair = sparse.identity(n_p, format="csr")
    ones = np.ones(n_p)
    left = sparse.csr_array((-ones, (each, first)), shape=(n_p, n_s))
    right = sparse.csr_array((-ones, (each, second)), shape=(n_p, n_s))
    below = sparse.vstack(
        [
            sparse.hstack([left, pair, sparse.csr_array((n_p, n_e))]),
            sparse.hstack([right, pair, sparse.csr_array((n_p, n_e))]),
            sparse.hstack([sparse.csr_array((n_e, n_s)), -cells, sparse.identity(n_e)]),
        ]
    )
    weights = np.concatenate([np.zeros(n_s + n_p), np.ones(n_e)])[None]
    answer = milp(
        np.concatenate([np.ones(n_s), np.zeros(n_p + n_e)]),
        constraints=[
            LinearConstraint(sparse.csr_array(below), -np.inf, 0.0),
            LinearConstraint(weights, problem.required_weight, np.inf),
        ],
        bounds=Bounds(0.0, 1.0),
        integrality=np.concatenate([np.ones(n_s), np.zeros(n_p), np.ones(n_e)]),
        options={"time_limit": limit},
    )
    chosen = None if answer.x is None else np.flatnonzero(answer.x[:n_s] > 0.5)
    bound = getattr(answer, "mip_dual_bound", None)
    return chosen, -math.inf if bound is None else float(bound)


if __name__ == "__main__":
    sys.exit(main())
