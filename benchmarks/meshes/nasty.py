"""Send every file that breaks readers through the main job, each in a process.

Usage: python -m benchmarks.meshes.nasty [NAME ...]   (ringrig installed, from a
    checkout)

The files lie in `../shared/data/nasty`. The rig is the default one, the check from
pixels is on. Prints a table: exit code, seconds of processor and of wall time, what was
printed last; and whether a file ended otherwise than
`tests/geometry/files/test_nasty.py` says, in another way than one that is documented
(exit 0, 1, 3 or 4, one line on refusal, no traceback), or took longer than a minute. It
is the processor's minute, over all threads, since wall time tells how busy the machine
is; a run that hangs without working is cut after ten minutes.
"""

import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

from benchmarks.machine import machine
from tests.geometry.files import test_nasty

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT.parent / "shared" / "data" / "nasty"
RUN = [sys.executable, "-c", "from planning.cli.main import main; main()"]
PROCESSOR_SECONDS = 60.0
WALL_SECONDS = 600.0


@dataclass(frozen=True)
class Ended:
    """How a run ended.

    Attributes:
        code: Exit code; None if it was cut.
        processor: Processor time over all threads [s].
        wall: Wall time [s].
        words: What it said last.
        documented: Whether it ended in a documented way and in time.
    """

    code: int | None
    processor: float
    wall: float
    words: str
    documented: bool


def main() -> int:
    """Print the table; return 1 if a file ended otherwise than it must."""
    table = test_nasty
    names = sys.argv[1:] or sorted(path.name for path in FOLDER.iterdir())
    print(f"{machine()}\n")
    print("| file | exit | processor [s] | wall [s] | how it ended |")
    print("|---|---|---|---|---|")
    counts: dict[str, int] = {}
    wrong: list[str] = []
    slowest = 0.0
    for name in names:
        ended = _job(FOLDER / name)
        if not (ended.documented and _as_listed(table, name, ended)):
            wrong.append(name)
        counts[str(ended.code)] = counts.get(str(ended.code), 0) + 1
        slowest = max(slowest, ended.processor)
        print(
            f"| {name} | {ended.code} | {ended.processor:.1f} | {ended.wall:.1f} "
            f"| {ended.words[:200]} |",
            flush=True,
        )
    print("\nexit codes:", ", ".join(f"{k}: {n}" for k, n in sorted(counts.items())))
    print(f"most processor time: {slowest:.1f} s; ended otherwise: {wrong or 'none'}")
    return int(bool(wrong))


def _as_listed(table: ModuleType, name: str, ended: Ended) -> bool:
    if name in table.REFUSED:
        return ended.code == 3 and table.REFUSED[name] in ended.words
    code, words = table.ENDS[name]
    return ended.code == code and words in ended.words


def _job(path: Path) -> Ended:
    with tempfile.TemporaryDirectory() as folder:
        command = [*RUN, "--mesh", str(path), "--max-projectors", "3", "--quiet"]
        command += ["-o", f"{folder}/plan"]
        before, begin = _spent(), time.perf_counter()
        try:
            done = subprocess.run(
                command,
                capture_output=True,
                text=True,
                check=False,
                timeout=WALL_SECONDS,
                cwd=ROOT,
            )
        except subprocess.TimeoutExpired:
            wall = time.perf_counter() - begin
            return Ended(None, _spent() - before, wall, "cut", False)
        processor, wall = _spent() - before, time.perf_counter() - begin
        written = Path(folder, "plan", "plan.json").exists()
    said = done.stderr.replace(str(path), "FILE").replace("|", "/").strip()
    code = done.returncode
    if code in (0, 1):
        documented = written and not said
        lines = [line.replace("|", "/") for line in done.stdout.splitlines()]
        missed = [" ".join(line.split()) for line in lines if line.startswith("MISSED")]
        documented &= bool(missed) == (code == 1)
        said = said or "; ".join(missed) or "planned, check passed"
    else:
        documented = code in (3, 4) and not written and len(said.splitlines()) == 1
    documented &= processor <= PROCESSOR_SECONDS
    return Ended(code, processor, wall, said.removeprefix("plan: "), documented)


def _spent() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


if __name__ == "__main__":
    sys.exit(main())
