"""How squarely the required share is lit.

Usage: python -m benchmarks.plans.share_margins [NAME ...] [--lights parallel diverging]

For the sample and the twelve meshes in `../shared/data/meshes` (those named, if any),
at the default requirements: the margin at the required share
(`planning.projectors.share_margin`, in degrees within the limits) of the cover of most
area, of the cover of largest margin with as many projectors, and after the pose
program. Without a tangent limit the margin is by how much the largest incidence of what
counts is below its limit, to which the largest incidence of all that a cover lights
comes near: both are compared.
"""

import argparse
import sys
import time
from collections.abc import Iterator

import numpy as np

from benchmarks.bounds.continuous_bounds import jobs, ready_for
from benchmarks.machine import machine
from geometry.curvature.refinement import cut_for_curvature
from geometry.files.readers import load_mesh
from geometry.mesh.mesh import TriangleMesh
from planning.model.devices.planned import PlannedProjector
from planning.model.errors import InfeasibleLimitsError
from planning.projectors.projector_poses import widen_margins
from planning.projectors.projector_stage import ProjectorStage, plan_projectors
from planning.projectors.share_margin import margin_at_share
from planning.proofs.quotas import required_samples
from planning.report.partial_plan import Prepared
from planning.scene.lighting import lit_margins, lit_stages
from planning.scene.limits import projector_limits


def main() -> int:
    """Print the tables."""
    given = _arguments()
    print(f"{machine()}\n")
    _print_margins(given)
    return 0


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="margins at the required share")
    parser.add_argument("names", nargs="*", metavar="NAME")
    lights = ("parallel", "diverging")
    parser.add_argument("--lights", nargs="+", default=lights, choices=lights)
    parser.add_argument("--tangents", nargs="+", type=float, default=(0.0, 40.0))
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
        stage = plan_projectors(scene, ready.templates, _number(ready))
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


if __name__ == "__main__":
    sys.exit(main())
