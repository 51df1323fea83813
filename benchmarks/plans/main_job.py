"""Time the main job as a whole process, and hold its claims against the audit.

Usage: python -m benchmarks.plans.main_job [NAME ...]   (ringrig installed, from a
    checkout)

Plans the sample and the twelve meshes in `../shared/data/meshes` (those named, if any),
each in the unit or size that `tests/support/shared_meshes.py` states; without that
folder only the sample. The sample, the face scan and the bust are planned in both
lights. Prints exit code, what was read, counts with their bounds, the coverage, the
check, the largest difference between a claimed area and the one that the audit
recomputes (in points of the target's or surface's area), and the seconds of every
stage.
"""

import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from support import shared_meshes

from benchmarks.machine import machine
from planning import RigPlan
from planning.verify.audit.audit import audit_plan

ROOT = Path(__file__).resolve().parents[2]
_MANY = ("--max-projectors", "3")
RUN = [sys.executable, "-c", "from planning.cli.main import main; main()"]


def main() -> int:
    """Print the tables; return 1 if a run ended without a documented exit code."""
    print(f"{machine()}\n")
    print("`plan --help`, median of 5:", f"{_help_seconds():.2f} s\n")
    print(
        "| mesh | light | exit | faces | longest side [mm] | regions | wall [s] "
        "| projectors (bound) | cameras (bound) | lit | measured | rms [mm] | missing "
        "| difference to the audit |"
    )
    print("|" + 14 * "---|")
    stages: list[str] = []
    codes: list[int] = []
    for mesh, words, lights in _jobs(sys.argv[1:]):
        for light in lights:
            done = run(mesh, (*_MANY, *words, "--light", light))
            codes.append(done.code)
            stages.append(f"| {mesh.name} | {light} | {_timings(done)} |")
            print(f"| {mesh.name} | {light} | {_row(done)} |", flush=True)
    print("\nSeconds of each stage:\n\n| mesh | light | stages |\n|---|---|---|")
    print("\n".join(stages))
    return int(any(code not in (0, 1, 4) for code in codes))


def _jobs(names: list[str]) -> list[tuple[Path, tuple[str, ...], tuple[str, ...]]]:
    table = shared_meshes
    jobs = [(ROOT / "face.obj", ())]
    if table.FOLDER.is_dir():
        jobs += [(mesh.path, mesh.words) for mesh in table.MESHES]
    both = ("face.obj", "face_scan_james.obj", "snowden_bust_lo.obj")
    lights = ("diverging", "parallel")
    return [
        (path, words, lights if path.name in both else lights[:1])
        for path, words in jobs
        if not names or path.name in names
    ]


def _help_seconds() -> float:
    seconds: list[float] = []
    for _ in range(5):
        begin = time.perf_counter()
        subprocess.run([*RUN, "--help"], capture_output=True, check=True)
        seconds.append(time.perf_counter() - begin)
    return statistics.median(seconds)


@dataclass(frozen=True)
class Run:
    """A plan made by the command line in a process of its own.

    Attributes:
        plan: None: none was written; then `said` is what the process told.
        wall: Seconds from start to end.
    """

    code: int
    wall: float
    plan: RigPlan | None
    said: str


def run(mesh: Path, words: tuple[str, ...]) -> Run:
    """Plan a mesh, and read what was written."""
    with tempfile.TemporaryDirectory() as folder:
        command = [*RUN, "--mesh", str(mesh), "--quiet", "-o", folder, *words]
        begin = time.perf_counter()
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        wall = time.perf_counter() - begin
        written = Path(folder) / "plan.json"
        plan = RigPlan.load(written) if written.exists() else None
    said = " ".join(done.stderr.replace(str(mesh), "FILE").split())[:160]
    return Run(done.returncode, wall, plan, said)


def _timings(done: Run) -> str:
    if done.plan is None:
        return "no plan"
    times = done.plan.to_document()["timings_s"].items()
    return ", ".join(f"{stage} {seconds:.1f}" for stage, seconds in times)


def _row(done: Run) -> str:
    plan = done.plan
    if plan is None:
        return f"{done.code} | | | {done.wall:.1f} | {done.said} | | | | | |"
    document, areas = plan.to_document(), plan.to_document()["coverage"]["target"]
    counts = [
        f"{proof['count']} of {proof['needed']['count']} needed "
        f"({proof['needed']['lower_bound']})"
        for proof in (document["certificates"][k] for k in ("projectors", "cameras"))
    ]
    lit = areas["lit_m2"] / areas["reachable_by_projectors_m2"]
    measured = areas["measured_m2"] / areas["reachable_by_cameras_m2"]
    check = document["reconstruction"]
    seen = ("not checked", "")
    if check is not None:
        rms = check["accuracy_rms_m"]
        seen = (
            "none" if rms is None else f"{1e3 * rms:.3f}",
            f"{check['predicted_missing']:.2%}",
        )
    size = 1e3 * np.ptp(plan.surface.mesh.bounds, axis=0).max()
    cells = [
        str(done.code),
        str(document["meshes"][0]["n_faces"]),
        f"{size:.1f}",
        str(len(document["regions"])),
        f"{done.wall:.1f}",
        *counts,
        f"{lit:.1%}",
        f"{measured:.1%}",
        *seen,
        f"{audited(plan)[1]:.2f} points",
    ]
    return " | ".join(cells)


def audited(plan: RigPlan) -> tuple[int, float]:
    """Return how many claims the audit finds false, and the largest difference.

    That is of a claimed area from the one recomputed, in points of the target's or the
    surface's area.
    """
    found = audit_plan(plan, seed=20_261_121)
    return len(found.failures), max(
        100.0 * abs(found.areas[part][key] - value) / claimed["area_m2"]
        for part, claimed in plan.to_document()["coverage"].items()
        if part in found.areas
        for key, value in claimed.items()
        if key in found.areas[part]
    )


if __name__ == "__main__":
    sys.exit(main())
