"""Time the main job as a whole process, and hold its claims against the audit.

Usage: python benchmarks/main_job.py [DATA]   (ringrig installed)

DATA is the folder with the shared meshes, `../shared/data` by default; without it only
the sample is run. Prints a table: exit code, wall time, counts with their bounds, the
coverage, and the largest difference between a claimed area and the one that the audit
recomputes, in points of the target's or surface's area.
"""

import json
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from planning import RigPlan
from planning.audit import audit_plan

ROOT = Path(__file__).resolve().parents[1]
RUN = [sys.executable, "-c", "from planning.cli import main; main()"]


def main() -> int:
    """Print the tables; return 0."""
    data = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT.parent / "shared" / "data"
    print(
        f"machine: {platform.processor() or platform.machine()}, {os.cpu_count()} cores"
    )
    print(f"python {platform.python_version()}\n")
    print("`plan --help`, median of 5:", f"{_help_seconds():.2f} s\n")
    print(
        "| mesh | light | exit | wall [s] | projectors (bound) | cameras (bound) "
        "| lit | measured | rms [mm] | largest difference to the audit |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|")
    meshes = data / "meshes"
    jobs = [(ROOT / "face.obj", [])]
    if meshes.is_dir():
        jobs += [
            (meshes / "face_scan_james.obj", []),
            (meshes / "snowden_bust_lo.obj", ["--unit", "in"]),
        ]
    for mesh, words in jobs:
        for light in ("diverging", "parallel"):
            print(_row(mesh, words, light), flush=True)
    return 0


def _help_seconds() -> float:
    seconds: list[float] = []
    for _ in range(5):
        begin = time.perf_counter()
        subprocess.run([*RUN, "--help"], capture_output=True, check=True)
        seconds.append(time.perf_counter() - begin)
    return statistics.median(seconds)


def _row(mesh: Path, words: list[str], light: str) -> str:
    with tempfile.TemporaryDirectory() as folder:
        command = [*RUN, "--mesh", str(mesh), "--max-projectors", "3", "--quiet"]
        command += ["--light", light, "-o", folder, *words]
        begin = time.perf_counter()
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        wall = time.perf_counter() - begin
        plan = RigPlan.load(Path(folder) / "plan.json")
    document, areas = plan.document, plan.coverage["target"]
    counts = [
        f"{proof['count']} of {proof['needed']['count']} needed "
        f"({proof['needed']['lower_bound']})"
        for proof in (document["certificates"][k] for k in ("projectors", "cameras"))
    ]
    lit = areas["lit_m2"] / areas["reachable_by_projectors_m2"]
    measured = areas["measured_m2"] / areas["reachable_by_cameras_m2"]
    check = json.loads(json.dumps(document["reconstruction"]))
    return (
        f"| {mesh.name} | {light} | {done.returncode} | {wall:.1f} | {counts[0]} "
        f"| {counts[1]} | {lit:.1%} | {measured:.1%} "
        f"| {1e3 * check['accuracy_rms_m']:.3f} | {_difference(plan):.2f} points |"
    )


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
