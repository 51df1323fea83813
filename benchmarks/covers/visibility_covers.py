"""Covers as sensors on the shared meshes see them: ours, beside HiGHS, CP-SAT and SCIP.

Usage: python -m benchmarks.covers.visibility_covers [--meshes NAME ...] [--fields wide
    narrow]
       [--sizes 2000x500 10000x2000] [--shares 1 0.99 0.95 0.9] [--time-limit S]
       [--budget UNITS] [--factor N] [--peers NAME ...] [--peer-python PATH]
       [--peer-least S] [--peer-most S] [--reduced]

Fewest candidates that see the stated share of the samples (`visibility_instances.py`).
Each peer gets as long as ours took times the factor, told to it and enforced by a kill
(no sooner than 120 s later: stating the program isn't its time), in a process of its
own, by the interpreter named; one that isn't installed there is reported as absent.
They get the problem as it is, and with `--reduced` ours after its reduction as well.
Every selection is checked here. `2 / 1.50 (60 s)` reads: cover of 2, bound 1.5, 60 s.
Returns 1 if a selection misses its share, or a bound exceeds what somebody found.

The comparison at the planner's own size, 2,000 samples x 500 poses at 90 %, is
`--sizes 2000x500 --shares 0.9 --peers HiGHS CP-SAT`: there ours took 0.3 s with proof,
plain HiGHS 25 s and CP-SAT 36 s without one when it was first made.
"""

import argparse
import math
import sys
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from benchmarks.covers.cover_peers import SOLVERS, PeerAnswer, PeerProblem, ask_peer
from benchmarks.covers.cover_runs import (
    OurRun,
    for_peers,
    peer_cell,
    run_ours,
)
from benchmarks.covers.visibility_instances import Instance, covers
from benchmarks.machine import machine
from solvers import CoverProblem
from solvers.covers.bounds.reductions import reduce_problem

MESHES = ("vtk_bunny.ply", "vtk_horse.ply", "tm_fixed_top.ply", "face_scan_james.obj")
COLUMNS = (
    "instance",
    "share",
    "ours",
    "bound",
    "gap",
    "wall [s]",
    "CPU [s]",
    "work",
    "proof",
)


@dataclass(eq=False)
class Tally:
    """What the rows come to.

    Attributes:
        ours: For each size, whether ours closed the gap, the gap, and its wall time.
        against: How often ours was `better` than, `equal` to, `worse` than the best
            peer, or met `none` that found anything.
        bounds_above: Rows in which a peer's bound, rounded up, is above ours.
        versions: Names and versions of peers, and what kept any from answering.
        faults: Contradictions, each a sentence.
    """

    ours: dict[str, list[tuple[bool, float, float]]] = field(default_factory=dict)
    against: Counter[str] = field(default_factory=Counter)
    bounds_above: int = 0
    versions: set[str] = field(default_factory=set)
    faults: list[str] = field(default_factory=list)


def main() -> int:
    """Print a row for each instance and what they come to; return 1 on a fault."""
    given = _arguments()
    asked = [(peer, False) for peer in given.peers]
    asked += [(peer, True) for peer in given.peers if given.reduced]
    headings = [f"{peer}{' reduced' * reduced}" for peer, reduced in asked]
    columns = [*COLUMNS, *(["peers' limit [s]", *headings] if asked else [])]
    most = f", at most {given.peer_most:g} s" if given.peer_most < math.inf else ""
    peers = (
        f" Peers: {given.factor:g} times our wall time, at least "
        f"{given.peer_least:g} s{most}."
    )
    print(
        f"{machine()}\n\nOurs: time limit {given.time_limit:g} s, work budget "
        f"{given.budget:.0e} units.{peers if asked else ''}\n\n"
        f"| {' | '.join(columns)} |\n|{len(columns) * '---|'}",
        flush=True,
    )
    begin, tally = time.perf_counter(), Tally()
    for instance in _instances(given):
        seen = covers(instance)
        for share in given.shares:
            row = _row(instance, seen, share, asked, given, tally)
            print(f"| {' | '.join(row)} |", flush=True)
    _summary(tally, asked=bool(asked), seconds=time.perf_counter() - begin)
    return int(bool(tally.faults))


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="covers of the shared meshes")
    parser.add_argument("--meshes", nargs="+", default=MESHES, choices=MESHES)
    fields = ("wide", "narrow")
    parser.add_argument("--fields", nargs="+", default=fields, choices=fields)
    sizes = ("2000x500", "10000x2000")
    parser.add_argument("--sizes", nargs="+", default=sizes, metavar="ROWSxCOLUMNS")
    shares = (1.0, 0.99, 0.95, 0.90)
    parser.add_argument("--shares", nargs="+", type=float, default=shares)
    parser.add_argument("--time-limit", type=float, default=60.0, help="ours, [s]")
    parser.add_argument("--budget", type=float, default=1e10, help="units of work")
    parser.add_argument("--factor", type=float, default=10.0, help="times our time")
    parser.add_argument("--peers", nargs="*", default=[*SOLVERS], choices=[*SOLVERS])
    parser.add_argument("--peer-python", default=sys.executable)
    parser.add_argument("--peer-least", type=float, default=5.0, help="[s]")
    parser.add_argument("--peer-most", type=float, default=math.inf, help="[s]")
    parser.add_argument(
        "--reduced", action="store_true", help="after our reduction too"
    )
    return parser.parse_args()


def _instances(given: argparse.Namespace) -> Iterator[Instance]:
    for size in given.sizes:
        rows, columns = (int(n) for n in size.split("x"))
        for mesh in given.meshes:
            for view in given.fields:
                yield Instance(mesh, view, rows, columns)


def _row(
    instance: Instance,
    seen: NDArray[np.bool_],
    share: float,
    asked: list[tuple[str, bool]],
    given: argparse.Namespace,
    tally: Tally,
) -> list[str]:
    name = f"{instance.name}, share {share:g}"
    required = math.ceil(share * len(seen) - 1e-9)
    problem = CoverProblem(seen, required_weight=float(required))
    run = run_ours(problem, time_limit=given.time_limit, budget=given.budget)
    ours = _checked(seen, run.solution.selected, required)
    if ours is None:
        tally.faults.append(f"{name}: our selection sees less than {required} samples")
    size = math.inf if ours is None else ours
    shape = f"{instance.samples:,} x {instance.candidates:,}"
    tally.ours.setdefault(shape, []).append((run.proved, size - run.bound, run.wall))
    cells = [instance.name, f"{share:g}", *_our_cells(run, size)]
    if not asked:
        return cells
    seconds = max(given.peer_least, min(given.peer_most, given.factor * run.wall))
    raw = _raw(problem)
    reduced, kept = _reduced(problem) if given.reduced else (raw, None)
    found, bounds = [size], [run.bound]
    for peer, on_reduced in asked:
        stated = reduced if on_reduced else raw
        answer = ask_peer(peer, stated, seconds, python=given.peer_python)
        cost = None
        if answer.selected is not None:
            selected = kept[answer.selected] if on_reduced else answer.selected
            cost = _checked(seen, selected, required)
            if cost is None:
                tally.faults.append(f"{name}: {peer}'s selection sees too little")
        _note(peer, answer, tally)
        found.append(math.inf if cost is None else cost)
        bounds.append(answer.bound)
        cells += [f"{seconds:.0f}"] if len(found) == 2 else []
        cells.append(peer_cell(answer, cost))
    _compare(name, found, bounds, tally)
    return cells


def _our_cells(run: OurRun, size: float) -> list[str]:
    proof = run.solution.proof
    return [
        f"{size:g}",
        f"{run.bound:g}",
        f"{size - run.bound:g}",
        f"{run.wall:.1f}",
        f"{run.cpu:.1f}",
        f"{run.work:.1e}",
        f"proved: {proof}" if run.proved else proof,
    ]


def _raw(problem: CoverProblem) -> PeerProblem:
    return for_peers(
        problem.covers,
        problem.weights,
        problem.costs,
        float(np.sum(problem.required_weight)),
    )


def _reduced(problem: CoverProblem) -> tuple[PeerProblem, NDArray[np.int64]]:
    """Return the problem after our reduction, and our number of each column."""
    cover = reduce_problem(problem)
    stated = for_peers(cover.by_row, cover.weights, cover.costs, cover.required)
    return stated, cover.kept


def _checked(
    seen: NDArray[np.bool_], selected: NDArray[np.int64], required: int
) -> int | None:
    """Return the size of a selection that sees enough samples, else None."""
    chosen = np.unique(selected)
    covered = np.zeros(len(seen), dtype=bool)
    for s in chosen:
        covered |= seen[:, s]
    return chosen.size if int(covered.sum()) >= required else None


def _note(peer: str, answer: PeerAnswer, tally: Tally) -> None:
    known = answer.state == "solved"
    tally.versions.add(
        answer.said if known else f"{peer} {answer.state} ({answer.said})"
    )


def _compare(name: str, found: list[float], bounds: list[float], tally: Tally) -> None:
    """Hold ours, which comes first, against the peers."""
    best = min(found[1:])
    verdict = "better" if found[0] < best else "worse"
    verdict = "equal" if found[0] == best else verdict
    tally.against["none" if math.isinf(best) else verdict] += 1
    rounded = [math.ceil(b - 1e-6) if math.isfinite(b) else b for b in bounds]
    tally.bounds_above += max(rounded[1:]) > rounded[0]
    if max(rounded) > min(found):
        tally.faults.append(f"{name}: bounds {bounds} exceed a cover of {min(found):g}")


def _summary(tally: Tally, *, asked: bool, seconds: float) -> None:
    print()
    for shape, rows in tally.ours.items():
        proved, gaps, walls = zip(*rows, strict=True)
        print(
            f"* {shape}: {len(rows)} instances, {sum(proved)} proved; our largest gap "
            f"is {max(gaps):g}, our longest time {max(walls):.1f} s."
        )
    print(f"* {seconds:.0f} s in all.")
    if asked:
        against = tally.against
        print(
            f"\nAgainst the best peer ours was better in {against['better']}, equal in "
            f"{against['equal']}, worse in {against['worse']}; in {against['none']} no "
            f"peer found a cover. A peer's bound was above ours in "
            f"{tally.bounds_above}.\n\nPeers: {'; '.join(sorted(tally.versions))}."
        )
    for fault in tally.faults:
        print(f"\nFAULT: {fault}")


if __name__ == "__main__":
    sys.exit(main())
