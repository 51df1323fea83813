"""Time a run that finds what an earlier one with another requirement left.

Usage: python -m benchmarks.plans.replanning [NAME ...]   (ringrig installed, a
    checkout)

Plans the sample, a sample head of 100,000 faces and, where `../shared/data/meshes`
exists, the face scan and the scan of 1.16 million faces (those named, if any) with the
default rig and at most three projectors: first with an empty cache, then with another
requirement and the cache of the first, and that without a cache. Prints for each run
processor time over all threads until the plan stands and until it is checked and all is
written, which a busy machine changes less than wall time; that of the second with the
cache as a share of the first and of itself without; and whether the two plans of the
second requirement are the same but for what a run says of itself. Returns 1 if they
aren't.
"""

import json
import os
import platform
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from support import shared_meshes

from planning.cli.other_commands import write_sample

ROOT = Path(__file__).resolve().parents[2]
RUN = [sys.executable, "-c", "from planning.cli.main import main; main()"]
_LARGE = "head of 100,000 faces"
_NAMES = ("face.obj", "face_scan_james.obj", _LARGE, "colin27_head_1mm.ply.gz")
_OTHERS = (("--coverage", "0.93"), ("--accuracy", "0.25"), ("--max-cameras", "4"))
# What a run says of itself, and of the time that it took.
_ITS_OWN = ("created", "command", "timings_s")


@dataclass(frozen=True)
class Run:
    """Processor time until a plan stands and until the end [s], and the plan."""

    stands_s: float
    ends_s: float
    plan: dict[str, Any]


def main() -> int:
    """Print the table."""
    print(
        f"machine: {platform.processor() or platform.machine()}, {os.cpu_count()} "
        f"cores\n"
    )
    print(
        "| mesh | second requirement | first: stands, ends [CPU s] | second, no cache "
        "| second | of the first | of itself | same plan |\n" + 8 * "|---" + "|"
    )
    differ = False
    for name in sys.argv[1:] or _NAMES:
        with tempfile.TemporaryDirectory() as folder:
            place = Path(folder)
            if (mesh := _mesh(name, place)) is None:
                continue
            left, cache = place / "left", place / "cache"
            first = _run(mesh, place, (), left)
            for words in _OTHERS:
                bare = _run(mesh, place, words, None)
                shutil.copytree(left, cache)
                last = _run(mesh, place, words, cache)
                shutil.rmtree(cache)
                differs = _told(bare.plan) != _told(last.plan)
                differ |= differs
                every = first, bare, last
                runs = (f"{run.stands_s:.1f}, {run.ends_s:.1f}" for run in every)
                shares = (_shares(last, run) for run in (first, bare))
                same = "NO" if differs else "yes"
                cells = (name, " ".join(words), *runs, *shares, same)
                print(f"| {' | '.join(cells)} |", flush=True)
    return int(differ)


def _mesh(name: str, place: Path) -> Path | None:
    if name == _LARGE:
        write_sample(place / "head.obj", n_faces=108_000)
        return place / "head.obj"
    for path in (ROOT / name, shared_meshes.FOLDER / name):
        if path.exists():
            return path
    return None


def _run(mesh: Path, place: Path, words: Sequence[str], cache: Path | None) -> Run:
    asked = ["--mesh", str(mesh), "--max-projectors", "3", "-o", str(place / "plan")]
    folder = {"RINGRIG_CACHE": "" if cache is None else str(cache)}
    with subprocess.Popen(
        [*RUN, *asked, *words],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | folder,
    ) as process:
        stands = 0.0
        assert process.stderr is not None
        for line in process.stderr:
            if "NOT CHECKED yet" in line:
                stands = _spent(process.pid)
        before = os.times()
        process.wait()
    after = os.times()
    ends = sum(after[2:4]) - sum(before[2:4])
    assert process.returncode in (0, 1), process.returncode
    return Run(stands, ends, json.loads((place / "plan" / "plan.json").read_text()))


def _spent(process: int) -> float:
    """Processor time of a process so far, over all threads [s]."""
    fields = Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _told(plan: dict[str, Any]) -> dict[str, Any]:
    cost = plan["cost"]
    timed = ("t1", "t2", "t3", "t4", "t5", "C", "C_before", "C_all_rings", "render_s")
    rest = {key: plan[key] for key in plan if key not in (*_ITS_OWN, "cost")}
    return rest | {"cost": {key: cost[key] for key in cost if key not in timed}}


def _shares(run: Run, other: Run) -> str:
    return f"{run.stands_s / other.stands_s:.2f}, {run.ends_s / other.ends_s:.2f}"


if __name__ == "__main__":
    sys.exit(main())
