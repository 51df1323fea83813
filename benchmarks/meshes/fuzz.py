"""Read 2,000 damaged mesh files, and whatever escapes the readers' promises is listed.

Usage: python -m benchmarks.meshes.fuzz [COUNT] [SEED]   (from a checkout)

`tests/support/fuzzing.py` says how files of every format are damaged and what may
happen: a one-line MeshError, or a mesh that keeps the laws and isn't silently another
one. The worker has 4 GB and 20 s for each file, turns warnings into errors and is
restarted when it dies. A tenth of what is read goes through curvature and regions too.
A failure is made again with `python -m benchmarks.meshes.fuzz 1 SEED NUMBER`.
"""

import sys
import time
from collections import Counter
from pathlib import Path

from support import fuzzing

from benchmarks.machine import machine

TESTS = Path(__file__).resolve().parents[2] / "tests"
SEED = 20_261_121


def main() -> int:
    """Print the table; return 1 if anything escaped."""
    words = [int(word) for word in sys.argv[1:]]
    count, seed, first = words + [2000, SEED, 0][len(words) :]
    print(f"{machine()}\n")
    begin = time.perf_counter()
    answers = fuzzing.run(seed, range(first, first + count))
    wall = time.perf_counter() - begin
    print("| made from | files | read, laws kept | refused in one line | escaped |")
    print("|---|---|---|---|---|")
    kinds = {n: Counter[str]() for n in ("read", "refused", "escaped")}
    for answer in answers:
        kind = str(answer.get("file", "?")).partition(".")[2] or "?"
        what = "read" if answer.get("read") else "refused"
        kinds["escaped" if "escaped" in answer else what][kind] += 1
    for kind in sorted(set().union(*kinds.values())):
        row = [kinds[n][kind] for n in ("read", "refused", "escaped")]
        print(f"| .{kind} | {sum(row)} | {row[0]} | {row[1]} | {row[2]} |")
    totals = [sum(kinds[n].values()) for n in ("read", "refused", "escaped")]
    print(f"| all | {count} | {totals[0]} | {totals[1]} | {totals[2]} |")
    curved = sum(bool(answer.get("curved")) for answer in answers)
    print(f"\nseed {seed}, numbers {first} to {first + count - 1}, {wall:.0f} s;")
    print(f"{curved} of those read also went through curvature and regions")
    for answer in answers:
        if "escaped" in answer:
            print(f"\n- {answer}")
    return int(totals[2] > 0)


if __name__ == "__main__":
    sys.exit(main())
