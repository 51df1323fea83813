"""Regions: what becomes of the worst with and without a floor, and what they decide.

Usage: python -m benchmarks.plans.region_shares [NAME ...] [--floors F ...]

For the sample and the twelve meshes in `../shared/data/meshes` (those named, if any),
as many devices as it takes and the default rig: projectors and cameras by covers, no
bounds, baselines or rings; what is claimed rests on fresh samples. First table, for
each floor F (by default 0 and the rig's): devices, large regions below F, the least
lit share of a large region of what projectors reach, the least measured one of what
cameras reach, and processor seconds. Second table, what the paper lets decide the
number of projectors and what else could: regions (and large ones), their cones, the
fewest of 640 directions of light from afar that meet the required share of the target
within the incidence limit if nothing shadows anything (`by normals`), the same with the
object's own shadows, of what any direction reaches (`and shadows`), and the projectors
of the lowest F. Below it rank correlations (Spearman) with the projectors.
"""

import argparse
import sys
import time
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
from planning.model.errors import InfeasibleLimitsError
from planning.model.plan import RigPlan
from planning.model.progress import Stopwatch
from planning.model.words import percent
from planning.prepare import prepared
from planning.report.assemble import write_plan
from planning.report.partial_plan import PlanRequest, Prepared
from planning.rig.wishes import Wishes
from planning.scene.draws import DRAWS
from planning.stages import first_projectors, one_device_more, placed
from solvers import CoverProblem, solve_cover

_DIRECTIONS = 640


def main() -> int:
    """Print both tables; rows of the second on standard error as they come."""
    given = _arguments()
    rows: list[tuple[str, tuple[int, ...]]] = []
    print(
        "| mesh | F | projectors | cameras | regions below F | least lit | "
        "least measured | CPU [s] |\n|---|---|---|---|---|---|---|---|",
        flush=True,
    )
    least = min(given.floors)
    for path, options, up in sorted(jobs(given.names), key=_size):
        mesh, _ = cut_for_curvature(load_mesh(path, **options))  # pyright: ignore[reportArgumentType]
        for floor in given.floors:
            begin = time.process_time()
            try:
                ready = _ready(mesh, up, floor)
                plan = _planned(ready)
            except InfeasibleLimitsError as error:
                print(f"| {path.name} | {floor:g} | none: {error} |", flush=True)
                continue
            seconds = time.process_time() - begin
            print(_line(path.name, floor, plan, seconds), flush=True)
            if floor == least:
                rows.append(_causes(path.name, ready, plan))
                print(rows[-1], file=sys.stderr, flush=True)
    _print_causes(rows)
    return 0


def _size(job: tuple[Path, dict[str, object], str | None]) -> int:
    return job[0].stat().st_size


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="regions and their floors")
    parser.add_argument("names", nargs="*", metavar="NAME")
    default = load_rig("default").table.requirements.region_coverage
    parser.add_argument("--floors", nargs="+", type=float, default=(0.0, default))
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
    least = plan.requirements.region_share * plan.coverage.target.area_m2
    return [
        (
            areas.lit_m2 / areas.reachable_by_projectors_m2,
            areas.measured_m2 / max(areas.reachable_by_cameras_m2, 1e-12),
        )
        for region in plan.document.regions
        if region.area_m2 >= least * (1.0 - 1e-9)
        and (areas := region.coverage) is not None
        and areas.reachable_by_projectors_m2 > 0.0
    ]


def _line(name: str, floor: float, plan: RigPlan, seconds: float) -> str:
    shares = np.array(_large(plan)).reshape(-1, 2)
    lit, measured = shares.min(axis=0, initial=1.0).tolist()
    below = sum(
        region.coverage is not None and region.coverage.floor == "missed"
        for region in plan.document.regions
    )
    return (
        f"| {name} | {floor:g} | {len(plan.projectors)} | {len(plan.cameras)} | "
        f"{below} of {len(shares)} | {percent(lit)} | {percent(measured)} | "
        f"{seconds:.0f} |"
    )


def _causes(name: str, ready: Prepared, plan: RigPlan) -> tuple[str, tuple[int, ...]]:
    """A line of the second table, and its numbers."""
    cones = np.degrees([r.cone_angle for r in plan.document.regions])
    n, large, count = len(cones), len(_large(plan)), len(plan.projectors)
    normals, shadows = _directions(ready, plan)
    line = (
        f"| {name} | {n} ({large}) | {np.median(cones):.0f}°, {cones.max():.0f}° | "
        f"{normals} | {shadows} | {count} | {count / n:.2f} |"
    )
    return line, (n, large, normals, shadows, count)


def _print_causes(rows: list[tuple[str, tuple[int, ...]]]) -> None:
    print(
        "\n| mesh | regions (large) | cones, median and widest | by normals | "
        "and shadows | projectors | P/regions |\n|---|---|---|---|---|---|---|"
    )
    print("\n".join(line for line, _ in rows), "\n")
    table = np.array([numbers for _, numbers in rows])
    names = "regions", "large regions", "directions by normals", "and shadows"
    for k, name in enumerate(names if len(rows) > 2 else ()):
        rank, p = spearmanr(table[:, k], table[:, -1])
        print(
            f"* {name} and projectors: rank correlation {rank:.2f} (p = {p:.2g}, "
            f"{len(table)} meshes)"
        )


def _directions(ready: Prepared, plan: RigPlan) -> tuple[int, int]:
    """Fewest directions of light from afar for the required share of the target.

    Of all its samples, if nothing shadows anything; and of those that some direction
    reaches, shadows of the object included.
    """
    limits, mesh = plan.requirements, ready.scene.mesh
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
