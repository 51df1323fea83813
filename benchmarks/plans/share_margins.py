"""How squarely the required share is lit, and what turned ring axes win.

Usage: python -m benchmarks.plans.share_margins [NAME ...] [--lights parallel diverging]
       [--axes]

For the sample and the twelve meshes in `../shared/data/meshes` (those named, if any),
at the default requirements: the margin at the required share
(`planning.projectors.share_margin`, in degrees within the limits) of the cover of most
area, of the cover of largest margin with as many projectors, and after the pose
program. Without a tangent limit the margin is by how much the largest incidence of what
counts is below its limit, to which the largest incidence of all that a cover lights
comes near: both are compared.

With `--axes`: measured / lit of the target for three projectors and three cameras, and
rms and 95th percentile of the error s_N on what is measured, on fresh samples: with
every ring axis in the middle of its beam, at the tilt that the rig states,
and with the axes that the program moves; and the CPU seconds of these two searches,
covers included.
"""

import argparse
import os
import platform
import sys
import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from benchmarks.bounds.continuous_bounds import jobs, ready_for
from geometry.curvature.refinement import cut_for_curvature
from geometry.files.readers import load_mesh
from geometry.mesh.mesh import TriangleMesh
from planning.cameras.camera_cover import camera_candidate_views, plan_cameras
from planning.cameras.camera_stage import move_axes
from planning.model.errors import InfeasibleLimitsError
from planning.model.planned import PlannedCamera, PlannedProjector
from planning.projectors.projector_poses import widen_margins
from planning.projectors.projector_stage import ProjectorStage, plan_projectors
from planning.projectors.share_margin import margin_at_share
from planning.proofs.quotas import required_samples
from planning.report.partial_plan import Prepared
from planning.rings.axis_moves import AxisJudge
from planning.scene.draws import Draw
from planning.scene.lighting import lit_margins, lit_stages
from planning.scene.lights import ring_frame
from planning.scene.limits import projector_limits
from planning.scene.measured import lit_samples
from planning.scene.scene import Scene

ROWS = 12_000


def main() -> int:
    """Print the tables."""
    given = _arguments()
    print(
        f"machine: {platform.processor() or platform.machine()}, {os.cpu_count()} "
        f"cores, python {platform.python_version()}, numpy {np.__version__}\n"
    )
    if given.axes:
        _print_axes(given)
    else:
        _print_margins(given)
    return 0


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="margins at the required share")
    parser.add_argument("names", nargs="*", metavar="NAME")
    lights = ("parallel", "diverging")
    parser.add_argument("--lights", nargs="+", default=lights, choices=lights)
    parser.add_argument("--tangents", nargs="+", type=float, default=(0.0, 40.0))
    parser.add_argument("--axes", action="store_true")
    return parser.parse_args()


def _meshes(names: list[str]) -> Iterator[tuple[str, TriangleMesh, str | None]]:
    for path, options, up in jobs(names):
        mesh, _ = cut_for_curvature(load_mesh(path, **options))
        yield path.name, mesh, up


def _print_margins(given: argparse.Namespace) -> None:
    print(
        "| mesh | light | tangent | projectors | most area | largest margin | posed | "
        "won | seconds |\n|---|---|---|---|---|---|---|---|---|"
    )
    won: dict[tuple[str, float], list[tuple[float, float]]] = {}
    for name, mesh, up in _meshes(given.names):
        for light in given.lights:
            for tangent in given.tangents:
                ready = ready_for(mesh, light, up, None, tangent)
                row = _margins(ready)
                if row is None:
                    print(f"| {name} | {light} | {tangent:g}° | nothing lit |")
                    continue
                stage, (most, best, posed), seconds = row
                won.setdefault((light, tangent), []).append((posed, posed - most))
                print(
                    f"| {name} | {light} | {tangent:g}° | {len(stage.projectors)} | "
                    f"{most:.2f} | {best:.2f} | {posed:.2f} | {posed - most:.2f} | "
                    f"{seconds:.1f} |",
                    flush=True,
                )
    print()
    for (light, tangent), gains in won.items():
        within, over = (sorted(values) for values in zip(*gains, strict=True))
        print(
            f"* {light}, tangent {tangent:g}°, median of {len(gains)} (least to most): "
            f"{np.median(within):.2f} degrees within the limits ({within[0]:.2f} to "
            f"{within[-1]:.2f}), {np.median(over):.2f} more than the cover of most "
            f"area has at the same share ({over[0]:.2f} to {over[-1]:.2f})"
        )


def _margins(
    ready: Prepared,
) -> tuple[ProjectorStage, tuple[float, float, float], float] | None:
    """Margins in degrees of the cover of most area, the one taken, and as posed."""
    scene = ready.scene
    begin = time.perf_counter()
    try:
        stage = plan_projectors(scene, ready.template, _number(ready))
    except InfeasibleLimitsError:
        return None
    posed = widen_margins(scene, stage)
    seconds = time.perf_counter() - begin
    rows, reached = stage.candidates.samples, stage.candidates.reached
    required = required_samples(reached, scene.requirements.dominant_coverage)

    def margin(projectors: tuple[PlannedProjector, ...]) -> float:
        lit = lit_stages(scene, projectors, rows) == projector_limits.LIT
        own = lit_margins(scene, projectors, rows, lit)
        return float(np.degrees(margin_at_share(own, required)))

    largest, _ = stage.candidates.cover.most_covering(len(stage.projectors), None)
    most_area = stage.candidates.of(largest)
    found = (margin(most_area), margin(stage.projectors), margin(posed))
    return stage, found, seconds


def _number(ready: Prepared) -> int:
    rig = ready.request.rig
    return rig.n_projector_poses


def _print_axes(given: argparse.Namespace) -> None:
    print(
        "| mesh | light | axis in the middle | tilt of the rig | program | projectors, "
        "cameras | CPU s |\n|---|---|---|---|---|---|---|"
    )
    for name, mesh, up in _meshes(given.names):
        for light in given.lights:
            ready = ready_for(mesh, light, up, 1.0, None, devices=3)
            cells, counts, seconds = _axes(ready)
            took = " + ".join(f"{s:.1f}" for s in seconds)
            print(
                f"| {name} | {light} | {' | '.join(cells)} | {counts} | {took} |",
                flush=True,
            )


def _axes(ready: Prepared) -> tuple[list[str], str, list[float]]:
    """On fresh samples, by where ring axes stand; and seconds of the last two."""
    scene, rig = ready.scene, ready.request.rig
    stage = plan_projectors(scene, ready.template, _number(ready))
    posed = widen_margins(scene, stage)
    camera = PlannedCamera("", np.eye(4), rig.camera_device())
    n_cameras = rig.n_camera_poses
    offered = camera_candidate_views(scene, camera, n_cameras)
    middle = tuple(
        replace(p, world_from_ring=ring_frame(p.world_from_device, p.device, 0.0, 0.0))
        for p in posed
    )
    first = plan_cameras(scene, middle, offered)
    begin = time.process_time()
    cover = plan_cameras(scene, posed, offered)
    between = time.process_time()
    moved, last = move_axes(scene, posed, cover)
    seconds = [between - begin, time.process_time() - between]
    cells = [
        _quality(scene, projectors, of.cameras)
        for projectors, of in ((middle, first), (posed, cover), (moved, last))
    ]
    return cells, f"{len(moved)}, {len(last.cameras)}", seconds


def _quality(
    scene: Scene,
    projectors: tuple[PlannedProjector, ...],
    cameras: tuple[PlannedCamera, ...],
) -> str:
    """Measured / lit, and the rms and 95th percentile of s_N in micrometres."""
    rows = lit_samples(scene, projectors, scene.target_samples(Draw(ROWS, 900)))
    sigma = AxisJudge.of(scene, cameras, rows).sigma.min(axis=0)
    known = 1e6 * sigma[np.isfinite(sigma)]
    return (
        f"{len(known) / len(sigma):.4f}, {np.sqrt(np.mean(known**2)):.0f}, "
        f"{np.quantile(known, 0.95):.0f} um"
    )


if __name__ == "__main__":
    sys.exit(main())
