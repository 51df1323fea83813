"""Kill runs at many moments over a good older folder: one whole plan must stand there.

Usage: python -m benchmarks.plans.kills [--moments 20] [--seed 0]   (ringrig installed,
    from a checkout)

Plans a plate with seed 0 into a folder, checked and reconstructed, and puts a
stranger's file beside. Then the same job with seed 1 into a copy of that folder, with a
cache that is empty, is killed, by SIGKILL and by SIGTERM, at moments drawn from a run
that is left alone: three in ten of them while it plans, as many from the first line of
saving until the plan is written, the rest in the check and the last saving. Of every
folder that is left: plan.json, surface.npz, patterns and picture carry one plan's
digest, none of its files is missing, the audit believes the plan, and the stranger's
file is there; of the cache, that every entry is whole and what else is there is a
file's beginning. Every other run is killed in an empty folder instead, where no plan
may stand either. Afterwards a run to the end, with what the last one left in the cache,
replaces the plan by the one that is planned without; and what killed runs left beside
the folder is cleaned up. Prints a table; returns 1 if anything isn't so.
"""

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import trimesh
from PIL import Image

from benchmarks.machine import machine
from planning import RigPlan, verify_plan
from planning.cache.entries import FolderEntries
from planning.verify.reconstruction.check.cloud_file import is_cloud

RUN = [sys.executable, "-c", "from planning.cli.main import main; main()"]
RIG = """
base = "default"
name = "few candidates, from the front"
[workspace]
shape = "cone"
axis = [0.0, -1.0, 0.0]
half_angle_deg = 25.0
[requirements]
dominant_coverage = 0.8
coverage = 0.8
min_reachable = 0.1
[placement]
n_candidate_projectors = 600
n_candidate_cameras = 400
n_reference_projectors = 600
n_reference_cameras = 400
"""
STRANGER = "captures/mine.txt"
# The cloud of the old plan, as `plan reconstruct` leaves it.
CLOUD = "cloud.ply"


@dataclass(frozen=True)
class Moment:
    """So long after a line of progress [s]."""

    line: str
    delay: float


@dataclass(frozen=True)
class Left:
    """What a killed run leaves: its exit code, whose plan stands there, faults."""

    code: int
    plan: str
    wrong: tuple[str, ...]


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--moments", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    print(f"{machine()}, moments of seed {options.seed}\n")
    with tempfile.TemporaryDirectory() as name:
        place = Path(name)
        (place / "front.toml").write_text(RIG)
        trimesh.creation.box((100.0, 10.0, 100.0)).export(place / "plate.obj")
        _run(place, place / "old", 0)
        cloud = [*RUN, "reconstruct", str(place / "old" / "plan.json")]
        subprocess.run(cloud, check=False, capture_output=True)
        assert is_cloud(place / "old" / CLOUD)
        (place / "old" / STRANGER).parent.mkdir()
        (place / "old" / STRANGER).write_text("mine")
        lines = _run(place, place / "alone", 1)
        # From here on runs keep answers; this package lets none do so otherwise.
        os.environ["RINGRIG_CACHE"] = str(place / "cache")
        moments = _moments(lines, options.moments, np.random.default_rng(options.seed))
        print(
            "| moment | signal | exit | stands there | wrong |\n|---|---|---|---|---|"
        )
        wrong: list[str] = []
        for k, moment in enumerate(moments):
            for number in (signal.SIGKILL, signal.SIGTERM):
                left = _killed(place, moment, number, over_old=k % 2 == 0)
                wrong += left.wrong
                print(
                    f"| {moment.line} + {moment.delay:.2f} s | {number.name} "
                    f"| {left.code} | {left.plan} | {', '.join(left.wrong) or '-'} |",
                    flush=True,
                )
        wrong += _cleaned_up(place)
    print(f"\n{len(wrong)} faults in {2 * len(moments)} kills: {wrong or 'none'}")
    return int(bool(wrong))


def _command(place: Path, folder: Path, seed: int) -> list[str]:
    words = ["--mesh", str(place / "plate.obj"), "--max-projectors", "3"]
    words += ["--target", "surface", "--rig", str(place / "front.toml")]
    return [*RUN, *words, "--seed", str(seed), "-o", str(folder)]


def _run(place: Path, folder: Path, seed: int) -> list[tuple[str, float]]:
    """Plan to the end; lines of progress and when they came [s], the end last."""
    lines: list[tuple[str, float]] = []
    begin = time.monotonic()
    with _started(place, folder, seed) as process:
        assert process.stderr is not None
        for line in process.stderr:
            lines.append((_words(line), time.monotonic() - begin))
    assert process.returncode == 0, process.returncode
    return [*lines, ("the end", time.monotonic() - begin)]


def _started(place: Path, folder: Path, seed: int) -> subprocess.Popen[str]:
    return subprocess.Popen(
        _command(place, folder, seed),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )


def _words(line: str) -> str:
    """A line of progress without what differs from run to run."""
    said = line.strip().removeprefix("plan:").strip()
    return said.split(", about")[0] if "pixels" in said else said


def _moments(
    lines: list[tuple[str, float]], n: int, rng: np.random.Generator
) -> list[Moment]:
    """Three in ten while it plans, as many while it saves, the rest afterwards.

    Each falls into a gap between two lines, as often as the gap is long.
    """
    names = [words for words, _ in lines]
    drawing = names.index("drawing")
    written = next(k for k, words in enumerate(names) if "NOT CHECKED yet" in words)
    some = 3 * n // 10
    parts = ((0, drawing, some), (drawing, written, some))
    parts += ((written, len(names) - 1, n - 2 * some),)
    moments: list[Moment] = []
    for first, last, count in parts:
        ends = rng.uniform(lines[first][1], lines[last][1], count)
        for end in np.sort(ends):
            begun = [line for line in lines[first:last] if line[1] <= end][-1]
            moments.append(Moment(begun[0], float(end - begun[1])))
    return moments


def _killed(
    place: Path, moment: Moment, number: signal.Signals, *, over_old: bool
) -> Left:
    folder = place / "run"
    shutil.rmtree(folder, ignore_errors=True)
    shutil.rmtree(place / "cache", ignore_errors=True)
    if over_old:
        shutil.copytree(place / "old", folder)
    with _started(place, folder, 1) as process:
        assert process.stderr is not None
        for line in process.stderr:
            if _words(line) == moment.line:
                time.sleep(moment.delay)
                process.send_signal(number)
                break
        process.communicate()
    broken = _broken(place / "cache")
    if not over_old and not (folder / "plan.json").exists():
        return Left(process.returncode, "none", broken)
    plan, wrong = _standing(folder, over_old=over_old)
    return Left(process.returncode, plan, (*wrong, *broken))


def _broken(folder: Path) -> tuple[str, ...]:
    """Say which entries of a cache aren't whole, or are none."""
    entries = FolderEntries(folder)
    named = [path for path in folder.glob("*") if not path.name.startswith(".")]
    # An entry that is no whole one is dropped by who reads it.
    return tuple(
        f"{path.name} in the cache" for path in named if entries.get(path.stem) is None
    )


@cache
def _believed(digest: str, folder: Path) -> bool:
    """Whether the audit finds no false claim; a plan of a digest is asked once."""
    plan = RigPlan.load(folder / "plan.json")
    assert plan.digest == digest
    return verify_plan(plan, check_pixels=False).passed


def _standing(folder: Path, *, over_old: bool) -> tuple[str, tuple[str, ...]]:
    """Say which plan stands there, maybe over an old one, and what isn't whole."""
    wrong: list[str] = []
    # It refuses a surface of another plan.
    plan = RigPlan.load(folder / "plan.json")
    manifest = json.loads((folder / "patterns" / "sequence.json").read_text())
    with Image.open(folder / "rig.png") as picture:
        digests = {plan.digest, manifest["plan"], picture.info["ringrig-plan"]}
    if len(digests) != 1:
        wrong.append("files of two plans")
    named = sum(len(one["frames"]) for one in manifest["projectors"])
    if named != len(list((folder / "patterns").glob("*/*.png"))):
        wrong.append("patterns are missing")
    if not _believed(plan.digest, folder):
        wrong.append("the audit finds false claims")
    if over_old and not (folder / STRANGER).exists():
        wrong.append("the stranger's file is gone")
    new = plan.document.seed == 1
    if over_old and new == (folder / CLOUD).exists():
        wrong.append(f"an older {CLOUD}" if new else f"{CLOUD} is gone")
    words = ["new" if new else "old"]
    if plan.document.truncated:
        words.append("truncated")
    words.append("NOT CHECKED" if plan.document.reconstruction is None else "checked")
    return ", ".join(words), tuple(wrong)


def _cleaned_up(place: Path) -> list[str]:
    """What is wrong after a run to the end, when what was left has become old."""
    remnants = list(place.glob(".run.*"))
    for remnant in remnants:
        os.utime(remnant, (1.0, 1.0))
    shutil.rmtree(place / "run", ignore_errors=True)
    shutil.copytree(place / "old", place / "run")
    _run(place, place / "run", 1)
    plan, wrong = _standing(place / "run", over_old=True)
    plans = [RigPlan.load(place / name / "plan.json") for name in ("run", "alone")]
    if plans[0].digest != plans[1].digest:
        wrong = (*wrong, "another plan with the cache than without")
    print(f"\n{len(remnants)} remnants of killed runs; after a run to the end: {plan}")
    still = [f"{path.name} is left" for path in place.glob(".run.*")]
    return [*wrong, *still]


if __name__ == "__main__":
    sys.exit(main())
