"""Regions: what becomes of the worst with and without a floor, and what they decide.

Usage: python -m benchmarks.plans.region_shares [NAME ...] [--floors F ...] [--causes]

For the sample and the twelve meshes in `../shared/data/meshes` (those named, if any),
the smallest file first, as many devices as it takes, with the default rig. For each
floor F (by default 0 and the rig's), by covers alone (no bounds over all poses,
baselines or rings; what is claimed rests on fresh samples): devices, large regions
below the highest F (lit, or measured), the least lit share of a large region of what
projectors reach, the least measured one of what cameras reach, and processor seconds.

With `--causes` instead what the paper lets decide the number of projectors, and what
else could: regions (and large ones), their cones, the fewest of 640 directions of light
from afar that meet the required share of the target within the incidence limit if
nothing shadows anything (`by normals`), the same with the object's own shadows, of what
any direction reaches (`and shadows`), and the fewest candidate projectors on the
planner's first 2,000 samples, no floor asked for; below it rank correlations (Spearman)
with these.
"""

import argparse
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.stats import spearmanr

from benchmarks.bounds.continuous_bounds import MANY, jobs
from geometry.curvature.refinement import cut_for_curvature
from geometry.files.readers import load_mesh
from geometry.mesh.mesh import TriangleMesh
from geometry.poses import fibonacci_cap
from planning import load_rig
from planning.model.plan import RigPlan
from planning.model.progress import Stopwatch
from planning.model.words import percent
from planning.projectors.projector_stage import plan_projectors
from planning.report.assemble import write_plan
from planning.report.partial_plan import PlanRequest, Prepared
from planning.rig.wishes import Wishes
from planning.scene.draws import DRAWS
from planning.steps.prepare import prepared
from planning.steps.stages import first_projectors, one_device_more, placed
from solvers import CoverProblem, solve_cover

_DIRECTIONS = 640
# Name, mesh, and axis that points up.
_Job = tuple[str, TriangleMesh, str | None]


def main() -> int:
    """Print a table."""
    given = _arguments()
    meshes = (
        (path.name, cut_for_curvature(load_mesh(path, **options))[0], up)  # pyright: ignore[reportArgumentType]
        for path, options, up in sorted(jobs(given.names), key=_size)
    )
    if given.causes:
        _print_causes(meshes)
    else:
        _print_shares(meshes, given.floors)
    return 0


def _print_shares(meshes: Iterator[_Job], floors: Sequence[float]) -> None:
    print(
        f"| mesh | F | projectors | cameras | regions below {percent(max(floors))} | "
        "least lit | "
        "least measured | CPU [s] |\n|---|---|---|---|---|---|---|---|",
        flush=True,
    )
    for name, mesh, up in meshes:
        for floor in floors:
            begin = time.process_time()
            plan = _planned(_ready(mesh, up, floor))
            seconds = time.process_time() - begin
            print(_line(name, floor, max(floors), plan, seconds), flush=True)


def _size(job: tuple[Path, dict[str, object], str | None]) -> int:
    return job[0].stat().st_size


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="regions and their floors")
    parser.add_argument("names", nargs="*", metavar="NAME")
    default = load_rig("default").table.requirements.region_coverage
    parser.add_argument("--floors", nargs="+", type=float, default=(0.0, default))
    parser.add_argument("--causes", action="store_true")
    return parser.parse_args()


def _ready(mesh: TriangleMesh, up: str | None, floor: float) -> Prepared:
    wishes = Wishes(max_projectors=MANY, region_coverage=floor, up=up)
    order = PlanRequest(
        mesh, load_rig("default"), wishes, threads=1, cameras_by="cover"
    )
    return prepared(order, Stopwatch())


def _planned(ready: Prepared) -> RigPlan:
    """Covers alone, and one device more for as long as fresh samples fall short."""
    clock = Stopwatch()
    partial = placed(ready, first_projectors(ready, clock), clock)
    while True:
        # A plan that was cut goes without advice, which takes longer than all else.
        plan = write_plan(replace(partial, truncated=True), clock)
        larger = one_device_more(partial, plan, clock)
        if larger is None:
            return plan
        partial = larger


def _large(plan: RigPlan) -> list[tuple[float, float]]:
    """Lit and measured share of each large region, of what can be."""
    return [
        (
            areas.lit_m2 / areas.reachable_by_projectors_m2,
            areas.measured_m2 / max(areas.reachable_by_cameras_m2, 1e-12),
        )
        for region in plan.large_regions
        if (areas := region.coverage) is not None
        and areas.reachable_by_projectors_m2 > 0.0
    ]


def _line(
    name: str, floor: float, highest: float, plan: RigPlan, seconds: float
) -> str:
    shares = np.array(_large(plan)).reshape(-1, 2)
    lit, measured = shares.min(axis=0, initial=1.0).tolist()
    below = int((shares.min(axis=1) < highest).sum())
    return (
        f"| {name} | {floor:g} | {len(plan.projectors)} | {len(plan.cameras)} | "
        f"{below} of {len(shares)} | {percent(lit)} | {percent(measured)} | "
        f"{seconds:.0f} |"
    )


def _print_causes(meshes: Iterator[_Job]) -> None:
    print(
        "| mesh | regions (large) | cones, median and widest | by normals | "
        "and shadows | projectors | per region |\n|---|---|---|---|---|---|---|",
        flush=True,
    )
    rows: list[tuple[int, ...]] = []
    for name, mesh, up in meshes:
        ready = _ready(mesh, up, 0.0)
        cones = np.degrees([region.cone_angle for region in ready.regions])
        n, large = len(cones), len(ready.scene.large_regions)
        normals, shadows = _directions(ready)
        n_poses = ready.request.rig.n_projector_poses
        stage = plan_projectors(ready.scene, ready.templates, n_poses, rounds=1)
        count = stage.certificate.needed.count
        rows.append((n, large, normals, shadows, count))
        print(
            f"| {name} | {n} ({large}) | {np.median(cones):.0f}°, {cones.max():.0f}° | "
            f"{normals} | {shadows} | {count} | {count / n:.2f} |",
            flush=True,
        )
    names = "regions", "large regions", "directions by normals", "and shadows"
    print()
    for k, name in enumerate(names if len(rows) > 2 else ()):
        rank, p = spearmanr([row[k] for row in rows], [row[-1] for row in rows])
        print(
            f"* {name} and projectors: rank correlation {rank:.2f} (p = {p:.2g}, "
            f"{len(rows)} meshes)"
        )


def _directions(ready: Prepared) -> tuple[int, int]:
    """Fewest directions of light from afar for the required share of the target.

    Of all its samples, if nothing shadows anything; and of those that some direction
    reaches, shadows of the object included.
    """
    limits, mesh = ready.scene.requirements, ready.scene.mesh
    samples = ready.scene.target_samples(DRAWS.projectors).samples
    backs = fibonacci_cap(_DIRECTIONS, np.array([0.0, 0.0, 1.0]), np.pi)
    meets = samples.normals @ backs.T >= np.cos(limits.projector.max_incidence)
    starts = samples.points + 1e-5 * mesh.radius * samples.normals
    seen = meets.copy()
    for back, column in zip(backs, seen.T, strict=True):
        near = np.flatnonzero(column)
        away = np.full(len(near), 4.0 * mesh.reach)
        rays = np.broadcast_to(back, (len(near), 3))
        column[near] = ~ready.scene.visibility.caster.occluded(starts[near], rays, away)
    share, counts = limits.dominant_coverage, list[int]()
    for covers in (meets, seen):
        problem = CoverProblem(covers[covers.any(axis=1)], min_coverage=share)  # pyright: ignore[reportArgumentType]
        counts.append(len(solve_cover(problem, seed=0).selected))
    return counts[0], counts[1]


if __name__ == "__main__":
    sys.exit(main())
