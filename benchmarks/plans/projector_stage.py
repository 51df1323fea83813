"""Time the projector stage on meshes of about 100,000 faces, in both lights.

Usage: python -m benchmarks.plans.projector_stage [NAME ...]   (ringrig installed, a
    checkout)

Plans a sample head of 100,000 faces and, where `../shared/data/meshes` exists, the
horse and the counter (those named, if any), on two threads and without `--prove`, as
far as the cameras. Prints the seconds of the cover, the bounds over all poses and the
poses of widest margin, and their sum; then processor seconds of cover and bounds over
all threads, which a busy machine changes less.
"""

import sys
import time
from collections.abc import Iterator

import numpy as np
from support import shared_meshes

from benchmarks.machine import machine
from geometry.mesh.mesh import TriangleMesh
from geometry.shapes.sample_head.sample_head import sample_head
from planning import load_mesh, load_rig
from planning.pipeline import plan_rig
from planning.rig.rig import Light

_FACES = 100_000
_THREADS = 2
_LIGHTS: tuple[Light, ...] = ("diverging", "parallel")
_SHARED = ("vtk_horse.ply", "tm_counter.unitsmm.STL")
# What the planner says when a stage begins; the last one isn't waited for.
_STAGES = ("projectors: ", "bounds over ", "projector poses: ", "cameras: ")


class _DoneError(Exception):
    """The projectors stand."""


class _Clock:
    """Notes when each stage begins, and stops the run before the cameras."""

    def __init__(self) -> None:
        self.begun: list[float] = []
        self.worked: list[float] = []

    def __call__(self, line: str) -> None:
        if line.startswith(_STAGES):
            self.begun.append(time.perf_counter())
            self.worked.append(time.process_time())
        if line.startswith(_STAGES[-1]):
            raise _DoneError


def main() -> int:
    """Print the table."""
    print(f"{machine()}, {_THREADS} threads\n")
    print(
        "| mesh | faces | light | cover [s] | bounds [s] | poses [s] | stage [s] "
        "| cover [CPU s] | bounds [CPU s] |"
    )
    print("|" + 9 * "---|")
    for name, mesh in _meshes(sys.argv[1:]):
        for light in _LIGHTS:
            clock = _timed(mesh, light)
            spent, worked = np.diff(clock.begun), np.diff(clock.worked)
            seconds = (*spent, spent.sum(), *worked[:2])
            cells = " | ".join(f"{own:.2f}" for own in seconds)
            print(f"| {name} | {len(mesh.faces):,} | {light} | {cells} |", flush=True)
    return 0


def _meshes(names: list[str]) -> Iterator[tuple[str, TriangleMesh]]:
    if not names or "sample_head" in names:
        yield "sample_head", sample_head(n_faces=_FACES)
    table = shared_meshes
    for mesh in table.MESHES if table.FOLDER.is_dir() else ():
        if mesh.path.name in (names or _SHARED):
            yield mesh.path.name, load_mesh(mesh.path, **mesh.options)


def _timed(mesh: TriangleMesh, light: Light) -> _Clock:
    """Return the clock of a run as far as the cameras."""
    clock = _Clock()
    try:
        plan_rig(
            mesh,
            load_rig("default", light=light),
            max_projectors=3,
            threads=_THREADS,
            check=False,
            progress=clock,
        )
    except _DoneError:
        return clock
    raise RuntimeError("the planner reached no cameras")


if __name__ == "__main__":
    raise SystemExit(main())
