"""Edit every kind of leaf of a plan file: what `plan verify` refuses, finds, lets by.

Usage: python -m benchmarks.plans.edits [--seed 0] [--only KEY,...] [PLAN]   (ringrig
    installed, from a checkout)

Plans a sample head of 1,500 faces with few candidates (or takes PLAN, a folder that
this code made), checked from pixels. A kind is a key with numbers of lists wildcarded
(`regions.*.area_m2`). Of each kind leaves are drawn, and edited in six ways or more:
numbers by a per mille, by a tenth, by one, times 500, to 0, to their negative; words,
truths and lists to others; and any of them to null, to another type, or left out. What
stands in a plan twice, coverage and check as the member's, is edited twice; then every
digest is made anew, as a forger would, who isn't the check's author. Devices are also
moved by 0.02 mm and turned by 0.002 degrees, ring frames alike.

Each edited plan is read, audited, and its claims are computed again; what passes so far
and moves something that is seen is rendered and decoded, as `plan verify` does with
every plan. Of other edits the figures of the check, the samples and, where they can't
matter, the claims that come out again are those of the plan as made; and of what is no
claim the slowest audits are left out. Prints for each section how many edits were
refused when read (exit 3), found (exit 1), passed, or crashed; then each kind of which
one passed. `planning.verify.no_claims` says what is no claim, each with its reason, and
`planning.verify.trust` what verify tells is taken on trust. A key left out that is read
as the value it had, since that is its default, is *the same* plan to every reader.
Returns 1 where another passes, or anything crashes.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from collections import Counter, defaultdict
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.machine import machine
from planning import RigPlan
from planning.cli.other_commands import write_sample

from .edited import KeyPath, edits, leaves, moved
from .judged_edits import Judge, excuse
from .speed import RUN

_RIG = """
base = "default"
name = "few candidates"
[placement]
n_candidate_projectors = 60
n_candidate_cameras = 60
n_reference_projectors = 600
n_reference_cameras = 400
"""


def main() -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="")
    parser.add_argument("plan", nargs="?", type=Path)
    asked = parser.parse_args()
    only = tuple(asked.only.split(","))
    rng, begin = np.random.default_rng(asked.seed), time.perf_counter()
    with tempfile.TemporaryDirectory() as name:
        folder = asked.plan or _made(Path(name))
        judge = Judge(RigPlan.load(folder / "plan.json"))
        # A judge who finds fault with the plan as made finds every edit, too.
        unedited = judge.judged(judge.document, "projectors")
        if unedited != "passed":
            raise SystemExit(f"the plan as made is {unedited}")
        kinds: dict[str, list[tuple[KeyPath, Any]]] = defaultdict(list)
        for path, value in leaves(judge.document):
            kinds[_kind(path)].append((path, value))
        ended: dict[str, Counter[str]] = defaultdict(Counter)
        let_by: dict[str, list[str]] = defaultdict(list)
        for kind, of_kind in kinds.items():
            if not kind.startswith(only):
                continue
            path, value = of_kind[int(rng.integers(len(of_kind)))]
            for what, other in edits(value):
                how = judge.edited(path, other)
                print(f"{kind}: {what}: {how}", file=sys.stderr)
                if how == "passed" and judge.reads_the_same(path, other):
                    how = "the same"
                elif how == "passed":
                    how = excuse(".".join(map(str, path)))
                if how == "on trust" and judge.differs_planned_again(path, other):
                    how = "replanned"
                _note(ended, let_by, kind, f"{what}: {how}", how)
        for kind, what, edited in moved(judge.document):
            if kind.startswith(only):
                how = judge.judged(edited, "projectors")
                _note(ended, let_by, kind, f"{what}: {how}", how)
    n = sum(map(len, kinds.values()))
    print(
        f"{machine()}; {n} leaves of {len(kinds)} kinds, seed {asked.seed}, "
        f"{time.perf_counter() - begin:.0f} s\n"
    )
    return int(_print(ended, let_by))


def _made(folder: Path) -> Path:
    (folder / "few.toml").write_text(_RIG)
    write_sample(folder / "head.obj", n_faces=1500)
    words = ["--mesh", str(folder / "head.obj"), "--rig", str(folder / "few.toml")]
    words += ["--max-projectors", "6", "-o", str(folder / "plan"), "--quiet"]
    subprocess.run([*RUN, *words, "--no-report", "--no-patterns"], check=False)
    return folder / "plan"


def _kind(path: KeyPath) -> str:
    return ".".join("*" if isinstance(key, int) else key for key in path)


def _note(
    ended: dict[str, Counter[str]],
    let_by: dict[str, list[str]],
    kind: str,
    words: str,
    how: str,
) -> None:
    ended[kind.split(".")[0]][how.split(":")[0]] += 1
    if how not in ("refused", "found", "replanned", "the same"):
        let_by[kind].append(words)


def _print(ended: dict[str, Counter[str]], let_by: dict[str, list[str]]) -> bool:
    kinds = "refused", "found", "replanned", "the same", "no claim", "on trust"
    kinds += "passed", "crashed"
    print(f"| section | {' | '.join(kinds)} |\n{(len(kinds) + 1) * '|---'}|")
    total = Counter[str]()
    for section, counts in ended.items():
        total += counts
        print(f"| {section} | {' | '.join(str(counts[kind]) for kind in kinds)} |")
    print(f"| all | {' | '.join(str(total[kind]) for kind in kinds)} |\n")
    for kind, ways in let_by.items():
        print(f"{kind}: {'; '.join(ways)}")
    return bool(total["passed"] or total["crashed"])


if __name__ == "__main__":
    sys.exit(main())
