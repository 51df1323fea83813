"""Time the camera stage on a head of 100,000 faces and a scan of 1.16 million.

Usage: python -m benchmarks.plans.camera_stage [NAME ...]   (ringrig installed, a
    checkout)

Plans a sample head of 100,000 faces and, where `../shared/data/meshes` exists, the head
of the Colin 27 average (those named, if any) with the default rig in both lights, at
most three projectors, two threads, without `--prove` and without the check.

The camera stage is what eq. (8) calls t5: from the lit samples over candidates,
measurability, cover and the paper's route to cameras that have slid apart. Prints its
seconds, then those of what follows: rings with the ring axes turned once more, bounds
over all poses. Wall time first; then processor time over all threads, which a busy
machine changes less; then the most memory that the process held, from start to plan.
"""

import json
import resource
import subprocess
import sys
import time

from support import shared_meshes

from benchmarks.machine import machine
from geometry.mesh.mesh import TriangleMesh
from geometry.shapes.sample_head.sample_head import sample_head
from planning import RequirementError, load_mesh, load_rig
from planning.pipeline import plan_rig

_FACES = 100_000
_THREADS = 2
_SAMPLE = "sample_head"
_NAMES = (_SAMPLE, "colin27_head_1mm.ply.gz")
# What the planner says when a stage begins, and the column it belongs to.
_STAGES = {
    "cameras: ": "cameras",
    "baselines: ": "baselines",
    "rings: ": "rings",
    "bounds over all poses of the cameras": "bounds",
    "coverage, recomputed": "claims",
}
_COLUMNS = ("cameras", "baselines", "rings", "bounds")


class _Clock:
    """Sums wall and processor time of each stage, however often it runs."""

    def __init__(self) -> None:
        self.wall = dict.fromkeys((*_STAGES.values(), ""), 0.0)
        self.worked = dict(self.wall)
        self._now, self._since = "", (time.perf_counter(), time.process_time())

    def __call__(self, line: str) -> None:
        for start, name in _STAGES.items():
            if line.startswith(start):
                self.turn(name)

    def turn(self, name: str) -> None:
        """Close the stage that runs and begin another."""
        now = time.perf_counter(), time.process_time()
        self.wall[self._now] += now[0] - self._since[0]
        self.worked[self._now] += now[1] - self._since[1]
        self._now, self._since = name, now


def main() -> int:
    """Print the table; return 0."""
    if sys.argv[1:2] == ["--measure"]:
        return _measure(*sys.argv[2:])
    print(f"{machine()}, {_THREADS} threads\n")
    print(
        "| mesh | faces | light | cameras | cover and routes [s] | baselines [s] "
        "| stage [s] | rings [s] | bounds [s] | stage [CPU s] | rings [CPU s] "
        "| bounds [CPU s] | memory [GB] |"
    )
    print("|" + 13 * "---|")
    for name in sys.argv[1:] or _NAMES:
        if name != _SAMPLE and not shared_meshes.FOLDER.is_dir():
            continue
        for light in ("diverging", "parallel"):
            # A process of its own: none gives back its largest memory.
            run = [sys.executable, "-m", __spec__.name, "--measure", name, light]
            done = subprocess.run(run, stdout=subprocess.PIPE, text=True, check=True)
            print(f"| {name} | {json.loads(done.stdout)} |", flush=True)
    return 0


def _measure(name: str, light: str) -> int:
    """Plan one mesh and print its cells as a JSON string."""
    mesh = _mesh(name)
    clock = _Clock()
    try:
        plan = plan_rig(
            mesh,
            load_rig("default", light=light),
            max_projectors=3,
            threads=_THREADS,
            check=False,
            progress=clock,
        )
    except RequirementError as missed:
        plan = missed.plan
    clock.turn("")
    wall, worked = ([t[c] for c in _COLUMNS] for t in (clock.wall, clock.worked))
    seconds = (*wall[:2], sum(wall[:2]), *wall[2:], sum(worked[:2]), *worked[2:])
    cells = [f"{len(mesh.faces):,}", light, str(len(plan.cameras))]
    cells += [f"{own:.2f}" for own in seconds]
    # Linux counts kilobytes, macOS bytes.
    unit = 1.0 if sys.platform == "darwin" else 1024.0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e9
    json.dump(" | ".join([*cells, f"{peak:.2f}"]), sys.stdout)
    return 0


def _mesh(name: str) -> TriangleMesh:
    if name == _SAMPLE:
        return sample_head(n_faces=_FACES)
    for mesh in shared_meshes.MESHES:
        if mesh.path.name == name:
            return load_mesh(mesh.path, **mesh.options)
    raise SystemExit(f"{name}: no such mesh")


if __name__ == "__main__":
    raise SystemExit(main())
