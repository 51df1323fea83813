"""Plan random rigs and meshes: every plan that is written must verify.

Usage: python -m benchmarks.plans.honest [COUNT] [SEED] [--from NUMBER] [--only NUMBER]
    [--keep FOLDER] [--outside]   (from a checkout)

`tests/support/drawn_jobs.py` draws a mesh or two, a rig file and the words of a command
from SEED and a number; nothing is damaged. `tests/support/drawn_plans.py` plans each as
the command does, on so few samples and poses that it takes seconds, and verifies it
from the files as `plan verify` does: the audit, figures computed again by the code that
made them, bounds over candidates; of some the pixels, the bounds over all poses, or the
whole plan again. A plan is *met* (exit 0) or *short* (exit 1, and says of what); no
claim of either may be false. What is *refused* is so in a line for each fault. Anything
else escaped: it is listed with its number, and `--only` makes it again. Prints how many
ended how; returns 1 if anything escaped. With `--outside` meshes are hollow, and the
target is what lies outside.
"""

import argparse
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from support.drawn_jobs import draw_job
from support.drawn_plans import outcome

from benchmarks.machine import machine

SEED = 20_261_127
HOWS = "met", "short", "refused", "escaped"
EXTRAS = "checked", "proofs", "replanned"


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("count", type=int, nargs="?", default=1000)
    parser.add_argument("seed", type=int, nargs="?", default=SEED)
    parser.add_argument("--from", type=int, default=0, dest="first")
    parser.add_argument("--only", type=int)
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--outside", action="store_true")
    asked = parser.parse_args()
    numbers = range(asked.first, asked.first + asked.count)
    if asked.only is not None:
        numbers = range(asked.only, asked.only + 1)
    ended, extra = Counter[tuple[str, str]](), Counter[str]()
    escaped, begin = list[str](), time.perf_counter()
    for number in numbers:
        job = draw_job(asked.seed, number, outside=asked.outside)
        began = time.perf_counter()
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name) if asked.keep is None else asked.keep / str(number)
            folder.mkdir(parents=True, exist_ok=True)
            how = outcome(job, folder)
        took = time.perf_counter() - began
        print(f"{number} {job.kind} {took:.1f} s {how}", file=sys.stderr, flush=True)
        word = how.split(":")[0]
        ended[job.kind, word] += 1
        if word in ("met", "short"):
            extra.update(name for name in EXTRAS if getattr(job, name))
        if word == "escaped":
            escaped.append(f"{number} {job.kind} {how}")
    _print(ended)
    print(
        f"\nverified {', '.join(f'{name} {extra[name]}' for name in EXTRAS)}; seed "
        f"{asked.seed}, numbers {numbers[0]} to {numbers[-1]}, "
        f"{time.perf_counter() - begin:.0f} s\n{machine()}"
    )
    print("\n".join(escaped))
    return int(bool(escaped))


def _print(ended: Counter[tuple[str, str]]) -> None:
    print(f"| job | {' | '.join(HOWS)} |\n{(len(HOWS) + 1) * '|---'}|")
    for kind in sorted({kind for kind, _ in ended}):
        print(f"| {kind} | {' | '.join(str(ended[kind, how]) for how in HOWS)} |")
    sums = (sum(n for (_, end), n in ended.items() if end == how) for how in HOWS)
    print(f"| all | {' | '.join(map(str, sums))} |")


if __name__ == "__main__":
    sys.exit(main())
