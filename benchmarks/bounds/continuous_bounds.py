"""How many projectors: found, proved over candidates, proved over all poses.

Usage: python -m benchmarks.bounds.continuous_bounds [NAME ...] [--lights parallel
    diverging]
       [--shares 0.9 0.95] [--tangents 0 40] [--efforts default prove] [--more N]
       [--target dominant|surface|outside]

For the sample and the twelve meshes in `../shared/data/meshes` (those named, if any):
`count / bound over candidates / bound over all poses` for each light, required share
and tangent limit, on the 2,000 samples that the planner starts from; what the search
over cells proved it by, and the seconds of maps and searches together, of the clock and
of all processors. With `--more N` the count that N times as many candidates need stands
beside it, and no bound over all poses. `*`: shadows were left out. A bound in bold
equals the count.
"""

import argparse
import os
import sys
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np
from support import shared_meshes

from benchmarks.machine import machine
from geometry.curvature.refinement import cut_for_curvature
from geometry.files.readers import load_mesh
from geometry.mesh.mesh import TriangleMesh
from planning import load_rig
from planning.model.errors import InfeasibleLimitsError
from planning.model.progress import Stopwatch
from planning.projectors.projector_stage import ProjectorStage, plan_projectors
from planning.projectors.proved_projectors import prove_fewest
from planning.proofs.all_poses import Effort
from planning.proofs.projector_bound import DEFAULT, PROVE
from planning.report.partial_plan import PlanRequest, Prepared
from planning.rig.wishes import TargetName, Wishes
from planning.steps.prepare import prepared

ROOT = Path(__file__).resolve().parents[2]
MANY = 200
EFFORTS = {"default": DEFAULT, "prove": PROVE}


def main() -> int:
    """Print the table; return 1 where a bound contradicts a count."""
    given = _arguments()
    print(f"{machine()}\n")
    cases = [(a, b) for b in given.tangents for a in given.shares]
    efforts = given.efforts if given.more == 1 else [f"{given.more} times the poses"]
    heads = [
        f"{100 * share:g} %, tangent {tangent:g}°, {effort}"
        for share, tangent in cases
        for effort in efforts
    ]
    print(
        f"| mesh | faces | light | {' | '.join(heads)} |\n|{(3 + len(heads)) * '---|'}"
    )
    below: dict[tuple[str, str], Counter[int]] = {}
    for path, options, up in jobs(given.names):
        mesh, _ = cut_for_curvature(load_mesh(path, **options))
        for light in given.lights:
            cells: list[tuple[str, int]] = []
            for share, tangent in cases:
                ready = ready_for(mesh, light, up, share, tangent, target=given.target)
                if given.more > 1:
                    cells.append(_with_more(ready, given.more))
                else:
                    cells += _cells(ready, given.efforts)
            for head, (_, gap) in zip(heads, cells, strict=True):
                below.setdefault((light, head), Counter())[gap] += 1
            row = " | ".join(cell for cell, _ in cells)
            print(
                f"| {path.name} | {len(mesh.faces):,} | {light} | {row} |", flush=True
            )
    print()
    for (light, head), counts in below.items():
        said = ", ".join(f"{n} by {gap}" for gap, n in sorted(counts.items()))
        what = "bound over all poses below the count"
        if given.more > 1:
            what = f"{given.more} times the candidates need fewer"
        print(f"* {light}, {head}: {what}: {said}")
    return 0


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="bounds over all poses")
    parser.add_argument("names", nargs="*", metavar="NAME")
    lights = ("parallel", "diverging")
    parser.add_argument("--lights", nargs="+", default=lights, choices=lights)
    parser.add_argument("--shares", nargs="+", type=float, default=(0.9, 0.95))
    parser.add_argument("--tangents", nargs="+", type=float, default=(0.0, 40.0))
    parser.add_argument("--efforts", nargs="+", default=["default"], choices=EFFORTS)
    parser.add_argument("--target", choices=get_args(TargetName))
    parser.add_argument("--more", type=int, default=1, help="times the candidates")
    return parser.parse_args()


def jobs(names: list[str]) -> list[tuple[Path, dict[str, object], str | None]]:
    """Return path, reading options and `up` of the meshes named, or of all."""
    table = shared_meshes
    jobs = [(ROOT / "face.obj", {"unit": "mm"}, None)]
    if table.FOLDER.is_dir():
        for mesh in table.MESHES:
            words = dict(zip(mesh.words[::2], mesh.words[1::2], strict=True))
            jobs.append((mesh.path, mesh.options, words.get("--up")))
    return [job for job in jobs if not names or job[0].name in names]


def ready_for(
    mesh: TriangleMesh,
    light: str,
    up: str | None,
    share: float | None,
    tangent: float | None,
    *,
    devices: int | None = None,
    target: TargetName | None = None,
) -> Prepared:
    """Return a mesh ready for planning.

    Args:
        mesh: The surface.
        light: Kind of light.
        up: Axis that points up; None: the rig's.
        share: Of the target that must be lit; None: the rig's.
        tangent: Least tangent angle in degrees; None: the rig's.
        devices: Projectors and cameras at most, and as much measured as they can;
            None: as many as needed.
        target: What must be covered; None: the dominant regions.
    """
    wishes = Wishes(
        max_projectors=devices or MANY,
        max_cameras=devices,
        dominant_coverage=share,
        coverage=1.0 if devices else None,
        up=up,
        target=target,
    )
    order = PlanRequest(
        mesh, load_rig("default", light), wishes, threads=os.cpu_count() or 1
    )
    ready = prepared(order, Stopwatch())
    if tangent is None:
        return ready
    required = ready.scene.requirements
    limits = replace(required.projector, min_tangent_angle=float(np.deg2rad(tangent)))
    scene = replace(ready.scene, requirements=replace(required, projector=limits))
    return replace(ready, scene=scene)


def stage_of(ready: Prepared, times: int = 1) -> ProjectorStage | None:
    """Return the projectors chosen of so many times the candidates; None: no light."""
    rig = ready.request.rig
    number = times * rig.n_projector_poses
    try:
        return plan_projectors(ready.scene, ready.templates, number, rounds=0)
    except InfeasibleLimitsError:
        return None


def _with_more(ready: Prepared, times: int) -> tuple[str, int]:
    """Return count and bound with more candidates too, and how many they save."""
    stages = [stage_of(ready, number) for number in (1, times)]
    needed = [None if s is None else s.certificate.needed for s in stages]
    if needed[0] is None or needed[1] is None:
        return "nothing lit", 0
    told = " -> ".join(f"{n.count} / {n.lower_bound}" for n in needed if n)
    return told, needed[0].count - needed[1].count


def _cells(ready: Prepared, efforts: list[str]) -> list[tuple[str, int]]:
    """Return the table's cells, and by how many each bound is below its count."""
    stage = stage_of(ready)
    if stage is None:
        return [("nothing lit", 0)] * len(efforts)
    return [_cell(ready, stage, EFFORTS[effort]) for effort in efforts]


def _cell(ready: Prepared, stage: ProjectorStage, effort: Effort) -> tuple[str, int]:
    before = stage.certificate.needed.count
    begun, spent = time.perf_counter(), time.process_time()
    proved = prove_fewest(ready.scene, stage, ready.templates, effort)
    seconds, spent = time.perf_counter() - begun, time.process_time() - spent
    needed, bound = proved.certificate.needed, proved.certificate.continuous
    assert bound is not None
    count, least = needed.count, bound.lower_bound
    shown = f"**{least}**" if least == count else f"{least}"
    star = "" if bound.occlusion else "*"
    saved = f" (was {before})" if count < before else ""
    return (
        f"{count}{saved} / {needed.lower_bound} / {shown}{star} "
        f"({bound.proof.split(';')[0]}, {seconds:.1f} s, {spent:.1f} s of CPU)",
        count - least,
    )


if __name__ == "__main__":
    sys.exit(main())
