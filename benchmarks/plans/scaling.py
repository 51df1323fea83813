"""Wall time of the main job against faces and candidates, with exponents.

Usage: python -m benchmarks.plans.scaling [faces|candidates] [MOST]   (ringrig
    installed, from a checkout)

Faces: sample heads of 20,000 to 2 million (MOST at most), default rig. Candidates: the
sample with 250 to 8,000 poses offered of either kind (MOST at most). Three projectors
at most, nothing kept from before; written without page and patterns. Prints seconds
from the first line of Python to the plan, to its check and of each stage, peak memory,
and the exponents: slopes of log time against log size, over all sizes and from one to
the next at the end.
"""

import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.machine import machine
from planning.cli.other_commands import write_sample

from .speed import ROOT, timed_run

_FACES = 20_000, 60_000, 200_000, 600_000, 2_000_000
_CANDIDATES = 250, 500, 1000, 2000, 4000, 8000
_RIG = """
base = "default"
name = "{n} candidates"
[placement]
n_candidate_projectors = {n}
n_candidate_cameras = {n}
"""
_STAGES = (
    *("regions", "projectors", "bounds", "projector_poses", "cameras", "baselines"),
    *("rings", "camera_bounds", "claims", "check"),
)


@dataclass(frozen=True)
class Timed:
    """Seconds of each part of a run, and what it planned."""

    size: int
    parts: dict[str, float]
    devices: str
    peak_gb: float


def main() -> int:
    """Print the tables."""
    words = sys.argv[1:]
    most = next((int(word) for word in words if word.isdigit()), _FACES[-1])
    kinds = [word for word in words if not word.isdigit()] or ["faces", "candidates"]
    print(machine())
    for kind in kinds:
        sizes = _FACES if kind == "faces" else _CANDIDATES
        parts = ("to the plan", "to the end", *_STAGES)
        print(f"\n| {kind} | plan | {' | '.join(parts)} | peak [GB] |")
        print((len(parts) + 3) * "|---" + "|")
        runs: list[Timed] = []
        for run in _runs(kind, [size for size in sizes if size <= most]):
            runs.append(run)
            seconds = (f"{run.parts.get(part, 0.0):.1f}" for part in parts)
            cells = f"{run.size:,}", run.devices, *seconds, f"{run.peak_gb:.2f}"
            print(f"| {' | '.join(cells)} |", flush=True)
        if len(runs) > 1:
            slopes = (_exponents(runs, part) for part in parts)
            print(f"| exponent: all, last | | {' | '.join(slopes)} | |")
    return 0


def _runs(kind: str, sizes: Sequence[int]) -> Iterator[Timed]:
    for size in sizes:
        with tempfile.TemporaryDirectory() as folder:
            place = Path(folder)
            if kind == "faces":
                mesh = place / "head.obj"
                write_sample(mesh, n_faces=size)
                yield _run(size, place, mesh)
            else:
                (place / "rig.toml").write_text(_RIG.format(n=size))
                rig = "--rig", str(place / "rig.toml")
                yield _run(size, place, ROOT / "face.obj", *rig)


def _run(size: int, place: Path, mesh: Path, *words: str) -> Timed:
    run = timed_run(mesh, place, (*words, "--no-report", "--no-patterns"))
    whole = {"to the plan": run.stands_s, "to the end": run.ends_s}
    devices = f"{len(run.plan['projectors'])} + {len(run.plan['cameras'])}"
    return Timed(size, run.plan["timings_s"] | whole, devices, run.peak_gb)


def _exponents(runs: Sequence[Timed], part: str) -> str:
    sizes = np.log([run.size for run in runs])
    times = np.log([max(run.parts.get(part, 0.0), 1e-3) for run in runs])
    whole = np.polyfit(sizes, times, 1)[0]
    last = (times[-1] - times[-2]) / (sizes[-1] - sizes[-2])
    return f"{whole:.2f}, {last:.2f}"


if __name__ == "__main__":
    sys.exit(main())
