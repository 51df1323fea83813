"""What 200 damaged rig files and plans end with: exit 3, every fault at once.

Half are rig files, made from the presets; half are plans, made from one by hand;
`tests/support/damaged_files.py` says how. Rigs are read by `plan lens`, plans by
`plan show`. A file may come out as good as it was; anything but exit 0, 3 or 4, any
traceback, and any wrong value of a rig that isn't named, is printed.

    PYTHONPATH=.:tests python -m benchmarks.rigs.mutated_files
"""

import sys
import tempfile
from collections import Counter
from pathlib import Path

from support.damaged_files import cases, outcome

N_FILES = 200


def main() -> int:
    """Print how many ended how; return 1 if one ended badly."""
    counts: Counter[tuple[str, str, int]] = Counter()
    lines, bad = Counter[int](), list[str]()
    with tempfile.TemporaryDirectory() as folder:
        for seed, case in enumerate(cases(range(N_FILES))):
            found = outcome(case, Path(folder))
            damage = "wrong values" if "wrong" in case.damage else case.damage
            counts[case.kind, damage, found.code] += 1
            if found.code == 3:
                lines[len(found.told.splitlines())] += 1
            if found.is_bad:
                bad.append(f"seed {seed} ({case.kind}, {case.damage}): {found}")
    print("| file | damage | exit 3 | exit 0, as good as before | exit 4 |")
    print("|---|---|---|---|---|")
    for kind, damage in sorted({key[:2] for key in counts}):
        row = " | ".join(str(counts[kind, damage, code]) for code in (3, 0, 4))
        print(f"| {kind} | {damage} | {row} |")
    total = Counter[int]()
    for (_, _, code), count in counts.items():
        total[code] += count
    print(
        f"\nOf {N_FILES}: "
        + ", ".join(f"exit {c}: {n}" for c, n in sorted(total.items()))
    )
    print(
        "Lines of faults, files: "
        + ", ".join(f"{n}: {c}" for n, c in sorted(lines.items()))
    )
    print(f"Ended otherwise, with a traceback, or left a fault out: {len(bad)}")
    print("\n".join(bad))
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
