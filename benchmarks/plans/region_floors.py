"""What a floor of every large region costs in projectors, over the shared meshes.

Usage: python -m benchmarks.plans.region_floors [NAME ...] [--floors F ...]
    [--share S]   (ringrig installed, from a checkout)

Plans the projectors of the sample and of the twelve meshes in `../shared/data/meshes`
(those named, if any) with the default rig, as many projectors as it takes, for each
floor F of the regions of at least the share S of the target (by default the rig's);
without cameras and without the check. Prints projectors with the bound over candidates
and all poses, the least lit share of a large region and of what all reach (on 12,000
fresh samples and those that small regions get of their own), and processor seconds.

A plan whose worst region has the next floor too is its plan as well: as few as it has
are enough, and no floor that is higher needs fewer. Such a row says "as before". Last
comes, for each floor, how many meshes it costs a projector: those that need one more,
and those of which the fresh samples miss it, since a plan then gets one more.
"""

import argparse
import time
from dataclasses import dataclass, replace

from benchmarks.bounds.continuous_bounds import jobs
from geometry.curvature.refinement import cut_for_curvature
from geometry.mesh.mesh import TriangleMesh
from planning import load_mesh, load_rig
from planning.model.progress import Stopwatch
from planning.projectors.candidate_set import CandidateSet
from planning.projectors.projector_poses import widen_margins
from planning.report.partial_plan import PlanRequest, Prepared
from planning.rig.wishes import Wishes
from planning.scene.draws import DRAWS
from planning.scene.samples import Target
from planning.steps.prepare import prepared
from planning.steps.stages import bounded_projectors, first_projectors

FLOORS = (0.0, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8)
_MANY = 20


@dataclass(frozen=True)
class Found:
    """One plan: projectors, bounds, least shares, and processor seconds."""

    count: int
    bounds: tuple[int, int]
    worst: float
    lit: float
    seconds: float


def main() -> int:
    """Print both tables."""
    parser = argparse.ArgumentParser(description="what floors of regions cost")
    parser.add_argument("names", nargs="*")
    parser.add_argument("--floors", nargs="+", type=float, default=FLOORS)
    parser.add_argument("--share", type=float, default=None)
    given = parser.parse_args()
    # What floors cost is against the plan without.
    floors = sorted({0.0, *given.floors})
    print(
        "| mesh | large regions | F | projectors | bound (candidates, all poses) "
        "| worst region lit | lit | CPU [s] |\n|---|---|---|---|---|---|---|---|"
    )
    every: list[dict[float, Found]] = []
    for path, options, up in jobs(given.names):
        name, mesh = path.name, load_mesh(path, **options)
        every.append({})
        before: Found | None = None
        for floor in floors:
            again = before is None or before.worst < floor
            if again:
                before, regions = _planned(mesh, up, floor, given.share)
            every[-1][floor] = before
            print(_row(name, regions, floor, before, again), flush=True)
    print("\n| F | costs a projector on |\n|---|---|")
    for floor in floors:
        dearer = sum(
            found[floor].count > found[0.0].count or found[floor].worst < floor
            for found in every
        )
        print(f"| {floor:g} | {dearer} of {len(every)} |")
    return 0


def _row(name: str, regions: int, floor: float, found: Found, again: bool) -> str:
    spent = f"{found.seconds:.0f}" if again else "as before"
    bounds = ", ".join(map(str, found.bounds))
    cells = (name, regions, f"{floor:g}", found.count, bounds)
    shares = f"{found.worst:.1%} | {found.lit:.1%}"
    return f"| {' | '.join(map(str, cells))} | {shares} | {spent} |"


def _planned(
    mesh: TriangleMesh, up: str | None, floor: float, share: float | None
) -> tuple[Found, int]:
    """Return what the projector stage gives, and how many regions are large."""
    cut, _ = cut_for_curvature(mesh)
    wishes = Wishes(max_projectors=_MANY, region_coverage=floor, up=up)
    clock = Stopwatch(None)
    ready = prepared(PlanRequest(cut, load_rig("default"), wishes), clock)
    if share is not None:
        required = replace(ready.scene.requirements, region_share=share)
        ready = replace(ready, scene=replace(ready.scene, requirements=required))
    begin = time.process_time()
    stage = bounded_projectors(ready, first_projectors(ready, clock), clock)
    projectors = widen_margins(ready.scene, stage)
    seconds = time.process_time() - begin
    proof, reference = stage.certificate, stage.reference
    all_poses = proof.continuous.lower_bound if proof.continuous else 0
    worst, lit = _shares(ready, projectors, reference)
    bounds = proof.candidates.lower_bound, all_poses
    found = Found(len(projectors), bounds, worst, lit, seconds)
    return found, len(ready.scene.large_regions)


def _shares(
    ready: Prepared, projectors: tuple, reference: tuple
) -> tuple[float, float]:
    """Return the least lit share of a large region, and that of the whole target."""
    scene = ready.scene

    def share(samples: Target) -> float:
        lit = CandidateSet.over(scene, samples, projectors).reached
        dark = samples.take(~lit)
        n = int(lit.sum()) + int(
            CandidateSet.over(scene, dark, reference).reached.sum()
        )
        return float(lit.sum()) / n if n else 1.0

    target = scene.target_samples(DRAWS.claims)
    number = scene.region[target.samples.faces]
    worst = 1.0
    for index in scene.large_regions.tolist():
        own = target.take(number == index)
        if len(own) < DRAWS.region_claims.count:
            own = scene.region_samples(DRAWS.region_claims, index)
        worst = min(worst, share(own))
    return worst, share(target)


if __name__ == "__main__":
    raise SystemExit(main())
