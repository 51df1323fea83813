"""How many cameras: found, proved over candidates, proved over all poses.

Usage: python -m benchmarks.bounds.camera_bounds [NAME ...] [--lights diverging
    parallel]
       [--shares 0.95] [--max-projectors 3] [--size MM] [--prove]

For the sample and the twelve meshes in `../shared/data/meshes` (those named, if any):
projectors as the planner chooses them, at most so many, cameras and ring axes as it
places them, and `count / bound over candidates / bound over all poses`, given these
projectors, for each light and required share; what the search over cells proved it by,
and its CPU seconds. Where prices find fewer, the first count stands before an arrow,
and how long they took. `--size` scales each mesh to a longest side, so that the
cameras' field binds. `*`: shadows were left out. A bound in bold equals the count.
"""

import argparse
import os
import sys
import time
from collections import Counter

import numpy as np

from benchmarks.bounds.continuous_bounds import jobs
from benchmarks.machine import machine
from geometry.curvature.refinement import cut_for_curvature
from geometry.files.readers import load_mesh
from geometry.mesh.mesh import TriangleMesh
from planning import load_rig
from planning.cameras.camera_cover import camera_candidate_views
from planning.cameras.camera_stage import place_cameras
from planning.cameras.priced_cameras import fewer_cameras, has_room
from planning.cameras.proved_cameras import CameraStage, bound_stage
from planning.model.devices.planned import PlannedCamera
from planning.model.errors import InfeasibleLimitsError
from planning.model.progress import Stopwatch
from planning.projectors.projector_poses import widen_margins
from planning.proofs.all_poses import Effort
from planning.proofs.camera_bound import DEFAULT, PROVE
from planning.report.partial_plan import PlanRequest
from planning.rig.wishes import Wishes
from planning.scene.scene import Scene
from planning.steps.prepare import prepared
from planning.steps.stages import first_projectors


def main() -> int:
    """Print the table."""
    given = _arguments()
    print(
        f"{machine()}\n\n"
        f"{'--prove' if given.prove else 'default'} effort, at most "
        f"{given.max_projectors} projectors\n"
    )
    heads = [f"{100 * share:g} %" for share in given.shares]
    print(
        f"| mesh | faces | light | projectors | {' | '.join(heads)} |\n"
        f"|{(4 + len(heads)) * '---|'}"
    )
    below: Counter[int] = Counter()
    for path, options, up in jobs(given.names):
        mesh = load_mesh(path, **options)
        if given.size:
            factor = 1e-3 * given.size / np.ptp(mesh.bounds, axis=0).max()
            mesh = TriangleMesh(mesh.vertices * factor, mesh.faces)
        mesh, _ = cut_for_curvature(mesh)
        for light in given.lights:
            found = [_case(mesh, light, up, share, given) for share in given.shares]
            below.update(gap for _, _, gap in found)
            print(
                f"| {path.name} | {len(mesh.faces):,} | {light} | {found[0][0]} | "
                f"{' | '.join(cell for _, cell, _ in found)} |",
                flush=True,
            )
    said = ", ".join(f"{n} by {gap}" for gap, n in sorted(below.items()))
    print(f"\nbound over all poses below the count: {said}")
    return 0


def _case(
    mesh: TriangleMesh,
    light: str,
    up: str | None,
    share: float,
    given: argparse.Namespace,
) -> tuple[int, str, int]:
    """Return the projectors, the table's cell, and by how much the bound is below."""
    wishes = Wishes(max_projectors=given.max_projectors, coverage=share, up=up)
    order = PlanRequest(
        mesh, load_rig("default", light), wishes, threads=os.cpu_count() or 1
    )
    ready = prepared(order, Stopwatch())
    projectors = widen_margins(ready.scene, first_projectors(ready, Stopwatch()))
    rig = order.rig
    camera = PlannedCamera(
        "", np.eye(4), rig.camera_device(), body=rig.camera_models[0].body
    )
    n = rig.n_camera_poses
    try:
        scene = ready.scene.among(projectors)
        candidates = camera_candidate_views(scene, (camera,), n)
        stage = place_cameras(scene, projectors, candidates).stage
    except InfeasibleLimitsError:
        return len(projectors), "nothing measured", 0
    effort = PROVE if given.prove else DEFAULT
    first, words = stage.certificate.needed.count, ""
    stage, seconds = _bounded(ready.scene, stage, camera, effort)
    begin = time.process_time()
    if has_room(stage) and (
        fewer := fewer_cameras(scene, projectors, stage, effort.starts)
    ):
        words = f"{first} -> ({time.process_time() - begin:.1f} s) "
        stage, seconds = _bounded(ready.scene, fewer, camera, effort)
    proof = stage.certificate
    needed, bound = proof.needed, proof.continuous
    assert bound is not None
    count, least = needed.count, bound.lower_bound
    shown = f"**{least}**" if least == count else f"{least}"
    star = "" if bound.occlusion else "*"
    return (
        len(projectors),
        f"{words}{count} / {proof.candidates.lower_bound} / {shown}{star} "
        f"({bound.proof.split(';')[0]}, {seconds:.1f} s)",
        count - least,
    )


def _bounded(
    scene: Scene, stage: CameraStage, camera: PlannedCamera, effort: Effort
) -> tuple[CameraStage, float]:
    """Return a stage with its bound, and processor seconds."""
    begin = time.process_time()
    stage = bound_stage(scene, stage, (camera.device,), effort)
    return stage, time.process_time() - begin


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="cameras' bounds over all poses")
    parser.add_argument("names", nargs="*", metavar="NAME")
    lights = ("diverging", "parallel")
    parser.add_argument("--lights", nargs="+", default=lights[:1], choices=lights)
    parser.add_argument("--shares", nargs="+", type=float, default=(0.95,))
    parser.add_argument("--max-projectors", type=int, default=3)
    parser.add_argument("--size", type=float, help="longest side of each mesh [mm]")
    parser.add_argument("--prove", action="store_true")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
