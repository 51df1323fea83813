"""Hold runs of the main job to their time limits, as whole processes.

Usage: python -m benchmarks.plans.time_limit [--busy N] [NAME ...]   (ringrig
    installed, from a checkout)

Plans the sample and five meshes in `../shared/data/meshes` (those that are there, or
are named), each with limits that cut it: before a first plan stands, while its poses
are improved, and in its check. Prints what was asked and what the process took from its
start to its end, the exit code, and the first line of what it printed; runs that end
with a plan are loaded again. Returns 1 if one took more than 1.1 times what was asked,
or passed for checked when it was cut. `--busy` keeps so many more processes at work, as
on a machine that is shared.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from support import shared_meshes

from benchmarks.machine import machine
from planning import RigPlan

ROOT = Path(__file__).resolve().parents[2]
RUN = [sys.executable, "-c", "from planning.cli.main import main; main()"]
# Of what was asked, at most.
MOST = 1.1
SAMPLE = "face.obj"
LIMITS_S = {
    SAMPLE: (5, 20, 60),
    "face_scan_james.obj": (10, 30),
    "snowden_bust_lo.obj": (10, 30),
    "vtk_horse.ply": (10, 60),
    "vtk_turbineblade.ply": (20, 50),
    "colin27_head_1mm.ply.gz": (20, 60, 120),
}


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--busy", type=int, default=0)
    parser.add_argument("names", nargs="*")
    options = parser.parse_args()
    print(
        f"{machine()}, {options.busy} more processes at work, load when it began "
        f"{os.getloadavg()[0]:.1f}\n"
    )
    print("| mesh | asked [s] | taken [s] | ratio | exit | first line |")
    print("|" + 6 * "---|")
    others = [
        subprocess.Popen([sys.executable, "-c", "while True: pass"])
        for _ in range(options.busy)
    ]
    failed = False
    try:
        for name, limits in LIMITS_S.items():
            path, words = _mesh(name)
            if path.exists() and (not options.names or name in options.names):
                for limit in limits:
                    held, row = _run(path, words, limit)
                    failed = failed or not held
                    print(row, flush=True)
    finally:
        for other in others:
            other.kill()
    return int(failed)


def _mesh(name: str) -> tuple[Path, tuple[str, ...]]:
    if name == SAMPLE:
        return ROOT / SAMPLE, ()
    mesh = shared_meshes.BY_NAME[name]
    return mesh.path, mesh.words


def _run(path: Path, words: tuple[str, ...], limit: int) -> tuple[bool, str]:
    """Whether the limit was held, and the row of the table."""
    with tempfile.TemporaryDirectory() as folder:
        command = [*RUN, "--mesh", str(path), "--max-projectors", "3", "--quiet"]
        command += ["--time-limit", str(limit), "-o", folder, *words]
        begin = time.monotonic()
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        taken = time.monotonic() - begin
        written = Path(folder) / "plan.json"
        plan = RigPlan.load(written).document if written.exists() else None
    said = (done.stdout or done.stderr).splitlines()[0].replace(str(path), path.name)
    unmarked = plan is not None and plan.truncated and "NOT CHECKED" not in said
    passed = plan is not None and plan.truncated and done.returncode != 1
    empty = plan is None and done.returncode != 5
    ratio = taken / limit
    cells = [path.name, str(limit), f"{taken:.1f}", f"{ratio:.2f}"]
    cells += [str(done.returncode), said]
    held = ratio <= MOST and not (unmarked or passed or empty)
    return held, f"| {' | '.join(cells)} |{'' if held else ' FAILED'}"


if __name__ == "__main__":
    sys.exit(main())
