"""Published set covers: what we find and prove, beside what is known.

Usage: python -m benchmarks.covers.set_covers [NAME ...] [--time-limit S] [--budget
    UNITS]
       [--peers] [--peer-python PATH]

The ten instances of `../shared/data/setcover` with all costs 1, and three of them with
their own costs. Every cover is checked here, row by row. With `--peers` HiGHS gets the
same problem and time, with one thread. The budget counts work, so that a slower machine
gives the same answer where the time limit doesn't cut. Returns 1 if a cover misses a
row, or a bound exceeds a cover that somebody found.
"""

import argparse
import sys
import time
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from support import set_cover_files

from benchmarks.covers.cover_peers import PeerAnswer, ask_peer
from benchmarks.covers.cover_runs import for_peers, peer_cell, run_ours
from benchmarks.machine import machine
from solvers import CoverProblem

COLUMNS = (
    "instance",
    "costs",
    "rows x columns",
    "best known",
    "ours",
    "bound",
    "gap",
    "wall [s]",
    "CPU [s]",
    "work",
    "proof",
)


def main() -> int:
    """Print the table; return 1 if it contradicts itself."""
    given = _arguments()
    print(
        f"{machine()}\n\nTime limit {given.time_limit:g} s and work budget "
        f"{given.budget:.0e} units each; `proved` where our bound meets our cover.\n"
    )
    columns = COLUMNS + (("HiGHS: cover / bound",) if given.peers else ())
    print(f"| {' | '.join(columns)} |\n|{len(columns) * '---|'}")
    begin = time.perf_counter()
    faults: list[str] = []
    tally = [0, 0, 0]
    for instance, weighted in _jobs(given.names):
        cells, settled = _row(instance, weighted, given, faults)
        print(f"| {' | '.join(cells)} |", flush=True)
        tally = [n + one for n, one in zip(tally, (True, *settled), strict=True)]
    print(
        f"\n{tally[0]} instances, {tally[1]} proved, {tally[2]} not above the best "
        f"known; {time.perf_counter() - begin:.0f} s in all."
    )
    for fault in faults:
        print(f"\nFAULT: {fault}")
    return int(bool(faults))


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="published set covers")
    parser.add_argument("names", nargs="*", help="instances, default all")
    parser.add_argument("--time-limit", type=float, default=120.0, help="[s] each")
    parser.add_argument("--budget", type=float, default=2e10, help="units of work")
    parser.add_argument("--peers", action="store_true", help="run HiGHS too")
    parser.add_argument("--peer-python", default=sys.executable)
    return parser.parse_args()


def _jobs(names: list[str]) -> Iterator[tuple[object, bool]]:
    for weighted in (False, True):
        for instance in set_cover_files.INSTANCES:
            if names and instance.name not in names:
                continue
            if not weighted or instance.cheapest is not None:
                yield instance, weighted


def _row(
    instance: object, weighted: bool, given: argparse.Namespace, faults: list[str]
) -> tuple[list[str], tuple[bool, bool]]:
    """Return the cells, and whether it is proved and no worse than the best known."""
    covers, costs = instance.read()
    costs = costs if weighted else np.ones(costs.size)
    known = instance.cheapest if weighted else instance.fewest
    name = f"{instance.name} {'weighted' if weighted else 'costs 1'}"
    problem = CoverProblem(covers, costs=costs)
    run = run_ours(problem, time_limit=given.time_limit, budget=given.budget)
    cost = _checked(covers, costs, run.solution.selected)
    if cost is None:
        faults.append(f"{name}: our selection misses a row")
        cost = np.inf
    found, bounds = [known, cost], [run.bound]
    proof = run.solution.proof
    cells = [
        instance.name,
        "given" if weighted else "1",
        f"{covers.shape[0]:,} x {covers.shape[1]:,}",
        f"{known:g}",
        f"{cost:g}",
        f"{run.bound:.6g}",
        f"{cost - run.bound:.3g}",
        f"{run.wall:.1f}",
        f"{run.cpu:.1f}",
        f"{run.work:.1e}",
        f"proved: {proof}" if run.proved else proof,
    ]
    if given.peers:
        answer, peer_cost = _peer(covers, costs, given)
        cells.append(peer_cell(answer, peer_cost))
        found.append(np.inf if peer_cost is None else peer_cost)
        bounds.append(answer.bound)
    if max(bounds) > min(found) + 1e-6 * max(1.0, min(found)):
        faults.append(f"{name}: bounds {bounds} exceed a cover of {min(found):g}")
    return cells, (run.proved, cost <= known + 1e-9)


def _peer(
    covers: sparse.csr_array, costs: NDArray[np.float64], given: argparse.Namespace
) -> tuple[PeerAnswer, float | None]:
    n = covers.shape[0]
    problem = for_peers(covers, np.ones(n), costs, n)
    answer = ask_peer(
        "HiGHS", problem, given.time_limit, python=given.peer_python, threads=1
    )
    if answer.selected is None:
        return answer, None
    return answer, _checked(covers, costs, answer.selected)


def _checked(
    covers: sparse.csr_array, costs: NDArray[np.float64], selected: NDArray[np.int64]
) -> float | None:
    """Return the cost of a selection that covers every row, else None."""
    chosen = np.unique(selected)
    left = np.ones(covers.shape[0], dtype=bool)
    for column in covers[:, chosen].toarray().T:
        left &= ~column
    return None if left.any() else float(costs[chosen].sum())


if __name__ == "__main__":
    sys.exit(main())
