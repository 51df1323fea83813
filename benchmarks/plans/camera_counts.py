"""Count the cameras of both routes, and what the baseline program gains.

Usage: python -m benchmarks.plans.camera_counts [--check] [NAME ...]
(ringrig installed, from a checkout)

Plans the sample and the twelve meshes in `../shared/data/meshes` (those named, if any)
with the default rig and up to three projectors, each in the unit or size that
`tests/support/shared_meshes.py` states. For the same projectors it prints

- by default: cameras, the bound over the candidates, what either route needs and which
  was taken; the smallest baseline of neighbours and the measured share before and after
  the cameras slide apart, on fresh samples;
- with `--cameras-by paper`, written as a plan: cameras, measured share as claimed,
  false claims that the audit finds and, with --check, the check from pixels; what
  either finds goes to standard error.

Shares are of what is reachable by cameras. Last come the two figures over all meshes.
"""

import statistics
import sys
import time
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.bounds.continuous_bounds import jobs
from benchmarks.machine import machine
from geometry.curvature.refinement import cut_for_curvature
from geometry.mesh.mesh import TriangleMesh
from planning import load_mesh, load_rig, verify_plan
from planning.cameras.camera_cover import camera_candidate_views
from planning.cameras.camera_routes import widest_routes
from planning.cameras.camera_stage import CameraSolution, place_cameras
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.document.certificates import CamerasBy
from planning.model.progress import Stopwatch
from planning.projectors.projector_poses import widen_margins
from planning.projectors.projector_stage import ProjectorStage
from planning.report.assemble import write_plan
from planning.report.partial_plan import PartialPlan, PlanRequest, Prepared
from planning.rig.wishes import Wishes
from planning.scene.draws import Draw
from planning.scene.measuring.measured import lit_samples, measured_by
from planning.scene.scene import Scene
from planning.steps.prepare import prepared
from planning.steps.stages import first_projectors, polished
from planning.verify.audit.audit import audit_plan

_PROJECTORS = 3
# Samples that neither cover nor slides saw.
_FRESH, _STREAM = 12_000, 900
_HEAD = (
    "mesh",
    "cameras",
    "bound",
    "cover",
    "paper",
    "taken",
    "smallest baseline [mm]",
    "gain",
    "measured before",
    "after",
    "`--cameras-by paper`",
    "measured",
    "false claims",
    "check",
    "CPU [s]",
)


@dataclass(frozen=True)
class Found:
    """What one mesh gave.

    Attributes:
        cells: Of its row.
        paper_above: Cameras that the paper's route needs above the cover's.
        gain: Ratio of the smallest baselines; None without neighbours.
        lost: Measured share that the slides cost.
    """

    cells: tuple[str, ...]
    paper_above: float
    gain: float | None
    lost: float


def main() -> int:
    """Print the table."""
    names = [word for word in sys.argv[1:] if word != "--check"]
    print(f"{machine()}\n")
    print(f"| {' | '.join(_HEAD)} |\n|{len(_HEAD) * '---|'}")
    found: list[Found] = []
    for path, options, up in jobs(names):
        name, mesh = path.name, load_mesh(path, **options)
        begin = time.process_time()
        job = _job(mesh, up)
        by_default = _by_default(job)
        by_paper = _by_paper(job, check="--check" in sys.argv)
        spent = f"{time.process_time() - begin:.0f}"
        found.append(by_default)
        cells = (name, *by_default.cells, *by_paper, spent)
        print(f"| {' | '.join(cells)} |", flush=True)
    _print_totals(found)
    return 0


def _print_totals(found: list[Found]) -> None:
    near = sum(f.paper_above <= 1 for f in found)
    gains = [f.gain for f in found if f.gain is not None]
    print(
        f"\nThe paper's route needs at most one camera more on {near} of {len(found)}."
    )
    if gains:
        print(
            f"The smallest baseline grows by {statistics.median(gains) - 1:.1%} in the "
            f"median of {len(gains)}; the measured share falls by at most "
            f"{100 * max(f.lost for f in found):.2f} points."
        )


@dataclass(frozen=True, eq=False)
class Job:
    """One mesh with its projectors, as far as the cameras."""

    request: PlanRequest
    ready: Prepared
    stage: ProjectorStage
    projectors: tuple[PlannedProjector, ...]
    clock: Stopwatch

    def place(self, by: CamerasBy) -> CameraSolution:
        """Place the cameras."""
        rig, ready = self.request.rig, self.ready
        body = rig.camera_models[0].body
        camera = PlannedCamera("", np.eye(4), rig.camera_device(), body=body)
        n = rig.n_camera_poses
        with self.clock.stage("cameras", "cameras"):
            scene = ready.scene.among(self.projectors)
            candidates = camera_candidate_views(scene, (camera,), n)
            return place_cameras(scene, self.projectors, candidates, by)


def _job(mesh: TriangleMesh, up: str | None) -> Job:
    cut, _ = cut_for_curvature(mesh)
    wishes = Wishes(max_projectors=_PROJECTORS, up=up)
    order = PlanRequest(cut, load_rig("default"), wishes)
    clock = Stopwatch(None)
    ready = prepared(order, clock)
    stage = first_projectors(ready, clock)
    return Job(order, ready, stage, widen_margins(ready.scene, stage), clock)


def _by_default(job: Job) -> Found:
    """The better route, as far as the slides."""
    scene, solution = job.ready.scene, job.place("both")
    before = solution.stage
    after, slid = widest_routes(scene, solution.projectors, before)[0]
    routes, proof = after.routes, after.certificate
    assert routes is not None
    rows = lit_samples(
        scene, solution.projectors, scene.target_samples(Draw(_FRESH, _STREAM))
    )
    reached = measured_by(scene, before.reference, rows).any(axis=1)
    shares = [
        measured_by(scene, cameras, rows)[reached].any(axis=1).mean()
        for cameras in (before.cameras, slid.cameras)
    ]
    apart = (slid.smallest_before_m, slid.smallest_after_m)
    if after is not before:
        # The paper's slid along their route: what the cover's began with counts.
        apart = (_smallest(scene, solution), slid.smallest_after_m)
    gain = apart[1] / apart[0] if apart[0] and apart[1] else None
    told = "no neighbours" if gain is None else " -> ".join(_mm(a) for a in apart)
    cells = (
        str(len(after.cameras)),
        str(proof.candidates.lower_bound),
        _count(routes.cover),
        _count(routes.paper),
        routes.taken,
        told,
        "" if gain is None else f"{gain - 1:+.1%}",
        *(f"{share:.2%}" for share in shares),
    )
    above = np.inf if routes.paper is None else routes.paper - (routes.cover or 0)
    return Found(cells, above, gain, float(shares[0] - shares[1]))


def _smallest(scene: Scene, solution: CameraSolution) -> float | None:
    """Smallest baseline of the cover's cameras before they slide."""
    stage = replace(solution.stage, routes=None)
    return widest_routes(scene, solution.projectors, stage)[0][1].smallest_before_m


def _by_paper(job: Job, *, check: bool) -> tuple[str, ...]:
    """The plan of the paper's route alone, and what the audit says of it."""
    ready, placed, clock = job.ready, job.place("paper"), job.clock
    draft = PartialPlan(
        replace(ready, request=replace(job.request, cameras_by="paper")),
        job.stage,
        placed.projectors,
        placed.stage,
        placed.stage.cameras,
    )
    plan = write_plan(polished(draft, clock), clock)
    found = verify_plan(plan) if check else None
    false = audit_plan(plan, seed=20_261_122).failures
    pixels = None if found is None else found.reconstruction
    for sentence in (*false, *(() if pixels is None else pixels.failures)):
        print(f"  {sentence}", file=sys.stderr, flush=True)
    areas = plan.to_document()["coverage"]["target"]
    measured = areas["measured_m2"] / areas["reachable_by_cameras_m2"]
    told = "not made"
    if pixels is not None:
        told = "failed" if pixels.failures else "passed"
    return str(len(plan.cameras)), f"{measured:.2%}", str(len(false)), told


def _count(number: int | None) -> str:
    return "none" if number is None else str(number)


def _mm(length_m: float | None) -> str:
    return f"{1e3 * (length_m or 0.0):.0f}"


if __name__ == "__main__":
    sys.exit(main())
