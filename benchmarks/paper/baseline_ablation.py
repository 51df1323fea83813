"""Count cameras by the baseline program, without its rows of (10), and by the cover.

Usage: python -m benchmarks.paper.baseline_ablation [NAME ...]
(ringrig installed, from a checkout)

Twelve meshes (the sample, and those of `../shared/data/meshes` but the scan of 1.16
million faces), shapes whose section is simple, and rigs whose small image the object
overflows. The projectors are planned once; every way gets them, 1,500 samples and the
same candidates.

- Program: the route as it is. It stops because the bound over all poses says that no
  fewer are enough, or with so many samples of those required that the best of one
  fewer were found to measure. Without (10): the same with no seam in its programs.
- Cover: the fewest candidates. Least: what is proved over candidates, over all poses.
- Closed form, axes square to the surface: floor(f L / 2C) + 1 of a wall, floor(f pi /
  eta) + 1 of a tube, f the share that is required, from as far as cameras may stand.

Seconds are of processor time: program, cover, bound over all poses.
"""

import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from support import plain_shapes, shared_meshes

from benchmarks.machine import machine
from geometry.curvature.refinement import cut_for_curvature
from geometry.mesh.mesh import TriangleMesh
from geometry.shapes.primitives import sphere
from planning import load_mesh, load_rig
from planning.cameras.camera_baselines import BaselineSamples
from planning.cameras.camera_cover import camera_candidate_views, measured_of
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.progress import Stopwatch
from planning.report.partial_plan import PlanRequest, Prepared
from planning.rig.rig import Rig
from planning.rig.wishes import Wishes
from planning.scene.draws import Draw
from planning.scene.measuring.camera_views import CandidateViews
from planning.scene.measuring.measured import LitSamples, taken
from planning.scene.scene import Scene
from planning.steps.prepare import prepared

ROOT = Path(__file__).resolve().parents[2]
_SAMPLES = Draw(1500, 200)
_PROJECTORS = 3
_SMALL = (
    'base = "default"\nname = "small image"\n[camera]\nresolution_px = [640, 480]\n'
)
_HEAD = (
    "object",
    "projectors",
    "program",
    "stops",
    "without (10)",
    "cover",
    "closed form",
    "least, candidates",
    "least, all poses",
    "seconds",
)


def _capsule() -> TriangleMesh:
    ball = sphere(0.06, subdivisions=4)
    lift = np.where(ball.vertices[:, 2:] > 0.0, 0.08, -0.08) * [[0.0, 0.0, 1.0]]
    return TriangleMesh(ball.vertices + lift, ball.faces)


def _saddle() -> TriangleMesh:
    flat = plain_shapes.grid(0.2, 0.2, divisions=(40, 40))
    x, y, _ = flat.vertices.T
    return TriangleMesh(np.column_stack([x, y, 6.0 * (x * x - y * y)]), flat.faces)


# Shapes with the default rig, and with the one whose image is small.
_SHAPES: dict[str, Callable[[], TriangleMesh]] = {
    "ball": lambda: sphere(0.1, subdivisions=4),
    "capsule": _capsule,
    "torus": lambda: plain_shapes.torus(0.08, 0.03),
    "saddle": _saddle,
}
_OVERFLOWING: dict[str, Callable[[], TriangleMesh]] = {
    "row of a wall": lambda: plain_shapes.grid(0.6, 0.1, divisions=(60, 10)),
    "wall": lambda: plain_shapes.grid(0.4, 0.3, divisions=(40, 30)),
    "pipe": lambda: plain_shapes.cylinder(0.05, 0.5, capped=False),
    "tube": lambda: plain_shapes.cylinder(0.15, 0.1, capped=False),
    "large ball": lambda: sphere(0.15, subdivisions=4),
}


@dataclass(frozen=True, eq=False)
class Case:
    """An object with its projectors: candidates, lit samples, who measures which."""

    rig: Rig
    scene: Scene
    projectors: tuple[PlannedProjector, ...]
    candidates: CandidateViews
    samples: LitSamples
    measured: np.ndarray


def main() -> int:
    """Print the table."""
    names = ["face.obj", *(m.path.name for m in shared_meshes.MESHES[1:])]
    names = sys.argv[1:] or [*names, *_SHAPES, *_OVERFLOWING]
    print(f"{machine()}\n")
    print(f"| {' | '.join(_HEAD)} |\n|{len(_HEAD) * '---|'}", flush=True)
    for name in names:
        print(f"| {' | '.join(_row(name))} |", flush=True)
    return 0


def _row(name: str) -> list[str]:
    rig, ready = _prepared(name)
    case = _case(rig, ready, _planned(ready))
    (by_program, stops), seconds = _timed(lambda: _by_program(case))
    cover, least, cover_seconds = _by_cover(case)
    everywhere, bound_seconds = _timed(lambda: _bound(case, cover))
    spent = seconds, cover_seconds, bound_seconds
    cells = [name, str(len(case.projectors)), _count(by_program), stops]
    cells += [_count(_without_seams(case)), str(cover)]
    cells += [_closed_form(name, case), str(least)]
    return [*cells, str(everywhere), " / ".join(f"{s:.1f}" for s in spent)]


def _prepared(name: str) -> tuple[Rig, Prepared]:
    rig, up, mesh, target = load_rig("default"), None, None, "surface"
    if name in _OVERFLOWING:
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "small.toml"
            file.write_text(_SMALL)
            rig, mesh = load_rig(file), _OVERFLOWING[name]()
    elif name in _SHAPES:
        mesh = _SHAPES[name]()
    else:
        target = None
        mesh, up = _from_file(name)
    cut, _ = cut_for_curvature(mesh)
    wishes = Wishes(max_projectors=_PROJECTORS, up=up, target=target)
    return rig, prepared(PlanRequest(cut, rig, wishes), Stopwatch(None))


def _from_file(name: str) -> tuple[TriangleMesh, str | None]:
    if name == "face.obj":
        return load_mesh(ROOT / name), None
    (mesh,) = (m for m in shared_meshes.MESHES if m.path.name == name)
    up = mesh.words[mesh.words.index("--up") + 1] if "--up" in mesh.words else None
    return load_mesh(mesh.path, **mesh.options), up


def _planned(ready: Prepared) -> tuple[PlannedProjector, ...]:
    from planning.projectors.projector_poses import widen_margins
    from planning.steps.stages import first_projectors

    stage = first_projectors(ready, Stopwatch(None))
    return widen_margins(ready.scene, stage)


def _case(rig: Rig, ready: Prepared, projectors: tuple[PlannedProjector, ...]) -> Case:
    scene = ready.scene.among(projectors)
    camera = PlannedCamera(
        "", np.eye(4), rig.camera_device(), body=rig.camera_models[0].body
    )
    views = camera_candidate_views(scene, (camera,), rig.n_camera_poses)
    target = scene.target_samples(_SAMPLES)
    samples, measured = measured_of(scene, projectors, views, target)
    return Case(rig, scene, projectors, views, samples, measured)


def _by_program(case: Case) -> tuple[int | None, str]:
    """Cameras of the paper's route as it is, None if short, and why it stops."""
    from planning.cameras.camera_cover import candidate_cover
    from planning.cameras.paper.paper_cameras import route_problem
    from planning.cameras.paper.paper_route import paper_route

    on = BaselineSamples(case.scene, case.projectors, case.samples)
    cover = candidate_cover(
        case.scene, case.measured, case.samples, case.candidates.cameras
    )
    problem = route_problem(on, case.candidates, cover)
    route = paper_route(problem)
    why = f"{route.best_without_one} of {cover.required}"
    count = None if problem.short(route.cameras) else len(route.cameras.cameras)
    return count, "bound" if route.bounded else why


def _without_seams(case: Case) -> int | None:
    """The same where programs know the limits of samples alone."""
    from planning.cameras.baselines.hole_program import HoleTerms

    ends = HoleTerms.ends
    HoleTerms.ends = lambda *_: iter(())
    try:
        return _by_program(case)[0]
    finally:
        HoleTerms.ends = ends


def _by_cover(case: Case) -> tuple[int, int, float]:
    """Cameras of the cover, their least number over the candidates, seconds."""
    from planning.cameras.camera_cover import candidate_cover
    from planning.proofs.selection import select_fewest

    cover = candidate_cover(
        case.scene, case.measured, case.samples, case.candidates.cameras
    )
    chosen, seconds = _timed(lambda: select_fewest(cover))
    return chosen.needed, chosen.lower_bound, seconds


def _bound(case: Case, count: int) -> int:
    """Cameras needed at least, wherever they stand."""
    from planning.proofs.all_poses import BoundQuestion
    from planning.proofs.camera_bound import DEFAULT, bound_cameras
    from planning.proofs.quotas import required_samples

    reached = case.measured.any(axis=1)
    required = required_samples(reached, case.scene.requirements.coverage)
    lit = taken(case.samples, np.flatnonzero(reached), case.samples.lit)
    question = BoundQuestion(required, count, len(reached), 1.0)
    device = case.rig.camera_device()
    return int(
        bound_cameras(case.scene, (device,), lit, question, DEFAULT).found.lower_bound
    )


def _closed_form(name: str, case: Case) -> str:
    from support.closed_forms import round_body_limit

    share, space = case.scene.requirements.coverage, case.scene.requirements.workspace
    device, away = case.rig.camera_device(), space.camera_radius_m[1]
    half = device.half_rectangle(away)
    if name == "row of a wall":
        return str(int(share * 0.6 // (2.0 * half.max())) + 1)
    if name == "tube":
        theta = case.scene.requirements.camera.max_incidence
        alpha = float(np.arctan(half.max() / away))
        eta = round_body_limit(0.15, away, theta, alpha).half_angle
        return str(int(share * np.pi // eta) + 1)
    return ""


def _timed(work: Callable[[], Any]) -> tuple[Any, float]:
    begin = time.process_time()
    return work(), time.process_time() - begin


def _count(number: int | None) -> str:
    return "short" if number is None else str(number)


if __name__ == "__main__":
    sys.exit(main())
