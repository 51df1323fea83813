"""Send every file that breaks readers through the main job, each in a process.

Usage: python benchmarks/nasty.py [FOLDER]   (ringrig installed)

FOLDER is `../shared/data/nasty` by default. The rig is the default one, the check from
pixels is on. Prints a table: exit code, seconds, and what was printed last; and whether
any file ended in another way than one that is documented (exit 0, 1, 3 or 4, one line
on refusal, no traceback) or took longer than a minute.
"""

import os
import platform
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
RUN = [sys.executable, "-c", "from planning.cli import main; main()"]
SECONDS = 60.0


def main() -> int:
    """Print the table; return 1 if a file ended in a way that isn't documented."""
    default = ROOT.parent / "shared" / "data" / "nasty"
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else default
    print(
        f"machine: {platform.processor() or platform.machine()}, {os.cpu_count()} "
        f"cores, python {platform.python_version()}, numpy {np.__version__}\n"
    )
    print("| file | exit | wall [s] | how it ended |")
    print("|---|---|---|---|")
    counts: dict[str, int] = {}
    bad = 0
    slowest = 0.0
    for path in sorted(folder.iterdir()):
        code, wall, words, documented = _job(path)
        counts[code] = counts.get(code, 0) + 1
        bad += not documented
        slowest = max(slowest, wall)
        print(f"| {path.name} | {code} | {wall:.1f} | {words} |", flush=True)
    print("\nexit codes:", ", ".join(f"{k}: {n}" for k, n in sorted(counts.items())))
    print(f"slowest: {slowest:.1f} s; ended otherwise than documented: {bad}")
    return int(bad > 0)


def _job(path: Path) -> tuple[str, float, str, bool]:
    with tempfile.TemporaryDirectory() as folder:
        command = [*RUN, "--mesh", str(path), "--max-projectors", "3", "--quiet"]
        command += ["-o", f"{folder}/plan"]
        begin = time.perf_counter()
        try:
            done = subprocess.run(
                command,
                capture_output=True,
                text=True,
                check=False,
                timeout=SECONDS,
                cwd=ROOT,
            )
        except subprocess.TimeoutExpired:
            return "none", time.perf_counter() - begin, "cut after a minute", False
        wall = time.perf_counter() - begin
        written = Path(folder, "plan", "plan.json").exists()
    said = done.stderr.replace(str(path), "FILE").replace("|", "/").strip()
    code = done.returncode
    if code in (0, 1):
        documented = written and not said
        missed = [line for line in done.stdout.splitlines() if "MISSED" in line]
        said = said or " ".join("; ".join(missed).split()) or "planned, check passed"
    else:
        documented = code in (3, 4) and not written and len(said.splitlines()) == 1
    return str(code), wall, said.removeprefix("plan: ")[:200], documented


if __name__ == "__main__":
    sys.exit(main())
