"""Hold every kind of small cover against trying all selections.

Usage: python -m benchmarks.covers.small_covers [INSTANCES]   (from a checkout; default
    10,000)

What `tests/solvers/covers/test_small_covers.py` does with the first few hundred: full
and partial, weighted, redundant, several row sets, fixed sets, costs, limits on the
number; solved whole and cut by a random budget, and the most weight of K sets. Prints
how many there were of each kind and how many differed from the truth.
"""

import collections
import multiprocessing
import os
import sys
import time

import numpy as np

from benchmarks.machine import machine
from solvers import CoverProblem
from tests.solvers.covers import test_small_covers

_CHUNK = 50


def main() -> int:
    """Print the table; return 1 if an instance differed."""
    n = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
    print(f"{machine()}\n")
    begin = time.perf_counter()
    kinds: collections.Counter[str] = collections.Counter()
    wrong: collections.Counter[str] = collections.Counter()
    with multiprocessing.get_context("spawn").Pool(os.cpu_count()) as pool:
        seeds = [range(i, min(i + _CHUNK, n)) for i in range(0, n, _CHUNK)]
        for some in pool.imap_unordered(_checked, seeds):
            for words, fault in some:
                kinds.update(words)
                if fault:
                    wrong.update(words)
                    print(fault, flush=True)
    print("| kind | instances | differ from trying all |\n|---|---|---|")
    for kind in sorted(kinds, key=lambda kind: -kinds[kind]):
        print(f"| {kind} | {kinds[kind]:,} | {wrong[kind]} |")
    print(f"\n{time.perf_counter() - begin:.0f} s")
    return int(bool(wrong))


def _checked(seeds: range) -> list[tuple[list[str], str]]:
    tests = test_small_covers
    done: list[tuple[list[str], str]] = []
    for seed in seeds:
        fault = ""
        try:
            tests.check(seed)
        except AssertionError as error:
            fault = f"instance {seed}: {str(error).splitlines()[:1]}"
        done.append((_kinds(tests.small_cover(seed)), fault))
    return done


def _kinds(p: CoverProblem) -> list[str]:
    """Return what an instance is counted under."""
    shares = p.required_weight / np.maximum(p.by_row_set(p.weights), 1e-300)
    return [
        "all",
        "full" if np.all(shares > 1 - 1e-9) else "partial",
        "weighted" if np.unique(p.weights).size > 1 else "equal weights",
        "equal costs" if p.unit_costs else "costs",
        "redundant" if np.any(p.needs > 1) else "needed once",
        "several row sets" if p.n_row_sets > 1 else "one row set",
        "fixed sets" if p.fixed.size else "none fixed",
        "can be covered" if _reachable(p) else "can't be covered",
    ]


def _reachable(p: CoverProblem) -> bool:
    every = np.arange(p.costs.size)
    held = p.covered_weights(every)
    return bool(np.all(held >= p.required_weight * (1 - 1e-12)))


if __name__ == "__main__":
    sys.exit(main())
