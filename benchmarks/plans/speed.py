"""Time the main job from mesh to files, and again with another requirement.

Usage: python -m benchmarks.plans.speed [--runs N] [--others K] [--words WORDS]
    [NAME ...]   (ringrig installed, a checkout)

Plans the sample, a sample head of 100,000 faces and, where `../shared/data/meshes`
exists, the face scan and the scan of 1.16 million faces (those named, if any) with the
default rig and at most three projectors, or as WORDS say instead. The first run has an
empty cache; the second asks for another coverage, accuracy or number of cameras and has
the cache that the first left (the first K of these three, all by default). Prints the
median over N runs (5) of wall time, processor time over all threads and peak memory; of
the second what part of the first's wall time it took, until the plan stands and until
it is checked and all is written; and whether its plan is that of a run without a cache,
but for what a run says of itself. Returns 1 if one isn't.
"""

import argparse
import json
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

from support import shared_meshes

from benchmarks.machine import machine
from planning.cli.other_commands import write_sample

ROOT = Path(__file__).resolve().parents[2]
RUN = [sys.executable, "-c", "from planning.cli.main import main; main()"]
_LARGE = "head of 100,000 faces"
_NAMES = ("face.obj", "face_scan_james.obj", _LARGE, "colin27_head_1mm.ply.gz")
_OTHERS = (("--coverage", "0.93"), ("--accuracy", "0.25"), ("--max-cameras", "4"))
_RUNS = 5
# An installation has its modules compiled; a checkout under this doesn't keep them.
_UNCOMPILED = "PYTHONDONTWRITEBYTECODE"
# What a run says of itself, and of the time that it took.
_ITS_OWN = ("created", "command", "timings_s")


@dataclass(frozen=True)
class Run:
    """Wall time until a plan stands and until the end, processor time [s], memory."""

    stands_s: float
    ends_s: float
    processor_s: float
    peak_gb: float
    plan: dict[str, Any]


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--runs", type=int, default=_RUNS)
    parser.add_argument("--others", type=int, default=len(_OTHERS))
    parser.add_argument("--words", default="", help="of every run, quoted as one")
    parser.add_argument("names", nargs="*", default=_NAMES)
    asked = parser.parse_args()
    always = tuple(shlex.split(asked.words))
    questions = [(*always, *words) for words in ((), *_OTHERS[: asked.others])]
    print(f"{machine()}; medians of {asked.runs} runs\n")
    print(
        "| mesh | asked | stands [s] | ends [s] | CPU [s] | peak [GB] | of the first "
        "| same plan |\n" + 8 * "|---" + "|"
    )
    differ = False
    for name in asked.names:
        with tempfile.TemporaryDirectory() as folder:
            place = Path(folder)
            if (mesh := _mesh(name, place)) is not None:
                differ |= _told_of(name, mesh, place, asked.runs, questions)
    return int(differ)


def _told_of(
    name: str, mesh: Path, place: Path, runs: int, questions: Sequence[Sequence[str]]
) -> bool:
    """Print the rows of a mesh; return whether a cache changed a plan."""
    begun, *others = questions
    left, cache = place / "left", place / "cache"
    firsts: list[Run] = []
    for _ in range(runs):
        shutil.rmtree(left, ignore_errors=True)
        firsts.append(_run(mesh, place, begun, left))
    _row(name, " ".join(begun), firsts, (), "")
    differ = False
    for words in others:
        seconds: list[Run] = []
        for _ in range(runs):
            shutil.copytree(left, cache)
            seconds.append(_run(mesh, place, words, cache))
            shutil.rmtree(cache)
        bare = _run(mesh, place, words, None)
        differs = any(_told(bare.plan) != _told(run.plan) for run in seconds)
        differ |= differs
        _row(name, " ".join(words), seconds, firsts, "NO" if differs else "yes")
    return differ


def _row(
    name: str, words: str, runs: Sequence[Run], firsts: Sequence[Run], same: str
) -> None:
    stands, ends, spent, peak = (
        median(getattr(run, key) for run in runs)
        for key in ("stands_s", "ends_s", "processor_s", "peak_gb")
    )
    shares = (
        f"{now / median(getattr(run, key) for run in firsts):.2f}"
        for now, key in ((stands, "stands_s"), (ends, "ends_s"))
        if firsts
    )
    share = ", ".join(shares)
    cells = name, words, f"{stands:.1f}", f"{ends:.1f}", f"{spent:.1f}", f"{peak:.2f}"
    print(f"| {' | '.join((*cells, share, same))} |", flush=True)


def _mesh(name: str, place: Path) -> Path | None:
    if name == _LARGE:
        write_sample(place / "head.obj", n_faces=108_000)
        return place / "head.obj"
    for path in (ROOT / name, shared_meshes.FOLDER / name):
        if path.exists():
            return path
    return None


def _run(mesh: Path, place: Path, words: Sequence[str], cache: Path | None) -> Run:
    folder = {"RINGRIG_CACHE": "" if cache is None else str(cache)}
    return timed_run(mesh, place, words, os.environ | folder)


def timed_run(
    mesh: Path,
    place: Path,
    words: Sequence[str],
    environment: Mapping[str, str] | None = None,
) -> Run:
    """Plan a mesh with at most three projectors into a folder of `place`."""
    asked = ["--mesh", str(mesh), "--max-projectors", "3", "-o", str(place / "plan")]
    found = dict(os.environ if environment is None else environment)
    found.pop(_UNCOMPILED, None)
    begin, stands = time.monotonic(), 0.0
    with subprocess.Popen(
        [*RUN, *asked, *words],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env=found,
    ) as process:
        assert process.stderr is not None
        for line in process.stderr:
            if "NOT CHECKED yet" in line:
                stands = time.monotonic() - begin
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    ends = time.monotonic() - begin
    assert process.returncode in (0, 1), process.returncode
    plan = json.loads((place / "plan" / "plan.json").read_text())
    spent = used.ru_utime + used.ru_stime
    return Run(stands, ends, spent, used.ru_maxrss / 1e6, plan)


def _told(plan: dict[str, Any]) -> dict[str, Any]:
    cost = plan["cost"]
    timed = ("t1", "t2", "t3", "t4", "t5", "C", "C_before", "C_all_rings", "render_s")
    rest = {key: plan[key] for key in plan if key not in (*_ITS_OWN, "cost")}
    return rest | {"cost": {key: cost[key] for key in cost if key not in timed}}


if __name__ == "__main__":
    sys.exit(main())
