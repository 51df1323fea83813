"""Seconds of the check from pixels: one small job, and the default run's whole check.

First rendering and decoding 2 projectors x 2 cameras with 40 rings at 1280x720 (a
sphere that fills the images). Then, given a plan, all that `plan` does to check it:
audit, rendering, decoding, merging, comparing. Wall seconds depend on what else the
machine does; processor seconds over two cores are what it takes there.

    python -m benchmarks.pixels.pixel_check [face-plan/plan.json]
"""

import sys
import time
from collections.abc import Callable

import numpy as np
from support import reconstruction_rigs
from support.reconstruction_rigs import reconstruct_plan

from geometry.shapes.primitives import sphere
from planning.model.plan import RigPlan
from planning.verify.reconstruction.check.result import Reconstruction
from planning.verify.verification import verify_plan

RIGS = reconstruction_rigs
RINGS, RESOLUTION = 40, (1280, 720)
_REPEATS = 3
_CORES = 2


def small_job() -> RigPlan:
    """Return 2 projectors of 40 rings and 2 cameras of 1280x720 about a sphere."""
    ball = sphere(0.1, subdivisions=6)
    plan = RIGS.plan_of(
        ball,
        [
            RIGS.diverging("P1", RIGS.direction(-35.0, 5.0), ball.radius, 5e-3),
            RIGS.diverging("P2", RIGS.direction(35.0, 5.0), ball.radius, 5e-3),
        ],
        [
            RIGS.camera("C1", RIGS.direction(-20.0, -20.0), focal=3000.0),
            RIGS.camera("C2", RIGS.direction(20.0, 25.0), focal=3000.0),
        ],
    )
    for projector in plan.to_document()["projectors"]:
        outer = projector["ring_radii"][-1]
        projector["ring_radii"] = np.linspace(outer / RINGS, outer, RINGS).tolist()
    for camera in plan.to_document()["cameras"]:
        camera["resolution"] = list(RESOLUTION)
        camera["K"][0][2], camera["K"][1][2] = (0.5 * (n - 1) for n in RESOLUTION)
    return RigPlan.from_document(plan.to_document(), plan.surface)


def timed(job: Callable[[], object]) -> tuple[float, float]:
    """Return the least wall and processor seconds of a few runs."""
    runs: list[tuple[float, float]] = []
    for _ in range(_REPEATS):
        wall, processor = time.perf_counter(), time.process_time()
        job()
        runs.append((time.perf_counter() - wall, time.process_time() - processor))
    return min(wall for wall, _ in runs), min(processor for _, processor in runs)


def main() -> None:
    """Print the table."""
    plan = small_job()
    found: list[Reconstruction] = []
    jobs: list[tuple[str, Callable[[], object]]] = [
        (
            f"2 x 2, {RINGS} rings, {RESOLUTION[0]}x{RESOLUTION[1]}",
            lambda: found.append(reconstruct_plan(plan, seed=0)),
        )
    ]
    if len(sys.argv) > 1:
        large = RigPlan.load(sys.argv[1])
        devices = f"{len(large.projectors)} x {len(large.cameras)}"
        faces = len(large.surface.mesh.faces)
        jobs.append(
            (
                f"audit and pixels of {sys.argv[1].split('/')[-2]}: {devices}, "
                f"{faces} faces",
                lambda: verify_plan(large),
            )
        )
        jobs.append(
            (
                "the same, pixels alone",
                lambda: found.append(reconstruct_plan(large, seed=0)),
            )
        )
    print("| job | wall | processor | of two cores |")
    print("|---|---|---|---|")
    for name, job in jobs:
        wall, processor = timed(job)
        print(
            f"| {name} | {wall:.1f} s | {processor:.1f} s | "
            f"{processor / _CORES:.1f} s |",
            flush=True,
        )
    for one in (found[0], found[-1]):
        stages = ", ".join(f"{name} {s:.2f} s" for name, s in one.seconds.items())
        points = f"{one.n_points} points, {one.n_merged} stay"
        print(f"\nprocessor seconds by stage: {stages}; {points}")


if __name__ == "__main__":
    main()
