"""Damage plan files and surfaces, and whatever isn't refused or judged is listed.

Usage: python -m benchmarks.plans.damaged [COUNT] [SEED]   (from a checkout)

`tests/support/damaged_plans.py` says how a plan made by hand is damaged. It is loaded
and audited: refused by a `PlanFileError` of few lines, or false claims, or none, are
answers; any other exception escaped. Prints how many ended how; returns 1 if anything
escaped.
"""

import sys
import tempfile
from collections import Counter
from pathlib import Path

from support.damaged_plans import outcome

SEED = 20_261_127


def main() -> int:
    """Print the table."""
    words = [int(word) for word in sys.argv[1:]]
    count, seed = words + [1000, SEED][len(words) :]
    ended, escaped = Counter[tuple[str, str]](), list[str]()
    with tempfile.TemporaryDirectory() as name:
        for number in range(count):
            kind, damage, how = outcome(Path(name), seed, number)
            ended[kind, how.split(":")[0]] += 1
            if how.startswith("escaped"):
                escaped.append(f"{number} {kind} {damage} {how}")
    hows = "refused", "false", "holds", "escaped"
    print(f"| file | {' | '.join(hows)} |\n{(len(hows) + 1) * '|---'}|")
    for kind in ("plan.json", "surface.npz"):
        print(f"| {kind} | {' | '.join(str(ended[kind, how]) for how in hows)} |")
    print("\n".join(escaped))
    return int(bool(escaped))


if __name__ == "__main__":
    sys.exit(main())
