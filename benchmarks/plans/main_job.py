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

import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from support import shared_meshes

from planning import RigPlan
from planning.verify.audit.audit import audit_plan

ROOT = Path(__file__).resolve().parents[2]
RUN = [sys.executable, "-c", "from planning.cli.main import main; main()"]


def main() -> int:
    """Print the tables; return 1 if a run ended without a documented exit code."""
    print(
        f"machine: {platform.processor() or platform.machine()}, {os.cpu_count()} "
        f"cores, python {platform.python_version()}, numpy {np.__version__}\n"
    )
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
            code, row, timings = run(mesh, (*words, "--light", light), light)
            codes.append(code)
            stages.append(f"| {mesh.name} | {light} | {timings} |")
            print(row, flush=True)
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


def run(
    mesh: Path, words: tuple[str, ...], label: str, *, most: int = 3
) -> tuple[int, str, str]:
    """Return the exit code, the row of the table, and the seconds of the stages."""
    with tempfile.TemporaryDirectory() as folder:
        command = [*RUN, "--mesh", str(mesh), "--max-projectors", str(most), "--quiet"]
        command += ["-o", folder, *words]
        begin = time.perf_counter()
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        wall = time.perf_counter() - begin
        written = Path(folder) / "plan.json"
        plan = RigPlan.load(written) if written.exists() else None
    code = done.returncode
    start = f"| {mesh.name} | {label} | {code} |"
    if plan is None:
        said = " ".join(done.stderr.replace(str(mesh), "FILE").split())[:160]
        return code, f"{start} | | | {wall:.1f} | {said} | | | | | | |", "no plan"
    times = plan.to_document()["timings_s"].items()
    timings = ", ".join(f"{stage} {seconds:.1f}" for stage, seconds in times)
    return code, f"{start} {_row(plan, wall)} |", timings


def _row(plan: RigPlan, wall: float) -> str:
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
        str(document["meshes"][0]["n_faces"]),
        f"{size:.1f}",
        str(len(document["regions"])),
        f"{wall:.1f}",
        *counts,
        f"{lit:.1%}",
        f"{measured:.1%}",
        *seen,
        f"{_difference(plan):.2f} points",
    ]
    return " | ".join(cells)


def _difference(plan: RigPlan) -> float:
    found = audit_plan(plan, seed=20_261_121).areas
    return max(
        100.0 * abs(found[part][key] - value) / claimed["area_m2"]
        for part, claimed in plan.coverage.items()
        if part in found
        for key, value in claimed.items()
    )


if __name__ == "__main__":
    sys.exit(main())
