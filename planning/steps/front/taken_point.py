"""The plan of a front's point: from its candidates on, without another matrix."""

from dataclasses import dataclass, replace

import numpy as np

from planning.cameras.camera_routes import widest_routes
from planning.model.devices.planned import PlannedProjector
from planning.model.document.certificates import Certificate
from planning.model.front import FrontPoint
from planning.model.plan import RigPlan
from planning.model.progress import Stopwatch
from planning.projectors.exposures import with_exposures
from planning.projectors.projector_poses import widen_margins
from planning.projectors.projector_stage import ProjectorStage
from planning.projectors.proved_projectors import prove_fewest
from planning.proofs import projector_bound
from planning.report.assemble import Draft
from planning.report.partial_plan import PartialPlan, PlanRequest, Prepared
from planning.rig.devices.lens_fit import check_fields
from planning.scene.draws import DRAWS
from planning.steps.best_kept import Keep, Search, best_kept
from planning.steps.prepare import prepared
from planning.steps.stages import bounded_cameras

from .fresh_figures import best_sigma
from .front_matrix import FrontMatrix
from .front_refused import check_front
from .kept_front import KeptFront
from .point_cameras import PointCameras, as_taken

_Projectors = tuple[PlannedProjector, ...]

# Times what a point promises of errors: so far they may grow for larger baselines.
_MORE = 1.05


@dataclass(frozen=True, eq=False)
class TakenPoint:
    """A point of a front, to be planned from where the front left it."""

    kept: KeptFront
    point: FrontPoint

    def planned(
        self, request: PlanRequest, clock: Stopwatch, keep: Keep | None
    ) -> tuple[RigPlan, PartialPlan]:
        """Return the plan of the point's devices, and what it was written from."""
        return best_kept(self._sought(request, clock), Draft.of, clock, keep)

    def _sought(
        self, request: PlanRequest, clock: Stopwatch
    ) -> Search[PartialPlan, Draft]:
        check_front(request)
        check_fields(request.rig.fits(request.mesh))
        ready = prepared(request, clock)
        matrix = self.kept.matrix(ready)
        axes = "free" if request.axis_wanted == "free" else self.point.axes
        stage, projectors = self._projectors(ready, matrix, clock)
        with clock.stage("cameras", "cameras: those of the point, for these poses"):
            share = self.point.measured_m2 / self.kept.front.area_m2
            cameras = PointCameras(ready.scene, matrix, self.point, share)
            found = cameras.placed(projectors, axes, request.ring_margin)
            if not cameras.keep_the_point(found):
                # Wider margins keep what is lit, and not all that is measured of it.
                before = with_exposures(ready.scene, stage.projectors)
                left = cameras.left(before, axes, request.ring_margin)
                found = max(found, left, key=cameras.worth)
                if found is left:
                    clock.say("  wider margins not taken: less would be measured")
            projectors, views = found
        partial = PartialPlan(
            *(ready, stage, projectors, views, views.cameras), axes=axes
        )
        yield partial, False
        partial = _apart(partial, cameras, clock)
        yield partial, False
        if _fewest_known(views.certificate):
            partial = bounded_cameras(partial, clock)
        yield partial, True

    def _projectors(
        self, ready: Prepared, matrix: FrontMatrix, clock: Stopwatch
    ) -> tuple[ProjectorStage, _Projectors]:
        """The point's projectors with what is proved of their number, and moved."""
        candidates = replace(matrix.candidates, scene=ready.scene)
        chosen = np.array(self.point.lights, dtype=np.int64)
        with clock.stage("projectors", "projectors: those of the point"):
            selection = as_taken(candidates.cover, chosen)
            stage = ProjectorStage.over(candidates, selection)
            frames = self.kept.rings_of(self.point)
            stage = replace(
                stage,
                projectors=tuple(
                    replace(projector, world_from_ring=frame)
                    if self.point.axes == "free" and not projector.keeps_rings
                    else projector
                    for projector, frame in zip(stage.projectors, frames, strict=True)
                ),
            )
        if _fewest_known(stage.certificate):
            with clock.stage("bounds", "bounds over all poses of the workspace"):
                prove = ready.request.prove
                effort = projector_bound.PROVE if prove else projector_bound.DEFAULT
                stage = prove_fewest(
                    ready.scene, stage, ready.templates, effort, joining=False
                )
        with clock.stage("projector_poses", "projector poses: widest margins"):
            required, reached = ready.scene.requirements, candidates.reached
            covered = candidates.cover.n_covered(chosen) / reached.sum()
            # What the point lights is what stays lit, not what would do.
            asking = ready.scene.asking(
                replace(
                    required,
                    dominant_coverage=max(required.dominant_coverage, float(covered)),
                )
            )
            held = replace(stage, candidates=replace(candidates, scene=asking))
            moved = widen_margins(asking, held)
            return stage, with_exposures(ready.scene, moved)


def _fewest_known(proof: Certificate) -> bool:
    """Whether these do, and no fewer are known to, so that a bound may prove it."""
    fewer = (row for row in proof.by_count if row.count < proof.count)
    short = all(row.value_m2 < proof.required_m2 for row in fewer)
    return proof.status != "infeasible" and short


def _apart(partial: PartialPlan, views: PointCameras, clock: Stopwatch) -> PartialPlan:
    """Cameras as far apart as coverage allows, and rings for them.

    They stay where they are if errors would grow beyond what the point promises.
    """
    with clock.stage("baselines", "baselines: the largest that coverage allows"):
        stage = partial.camera_stage
        ((_, moved),) = widest_routes(partial.scene, partial.projectors, stage)
    with clock.stage("rings", "rings: axes and radii for the surface and the cameras"):
        wide = views.with_rings(partial, moved.cameras)
        promised, errors = views.point.sigma_p95_m, _errors(wide)
        if promised is None or errors <= _MORE * promised:
            return wide
        near = views.with_rings(partial, stage.cameras)
        if (nearer := _errors(near)) >= errors:
            return wide
        clock.say(
            f"  not taken: 95 % within {1e3 * errors:.3f} mm, and {1e3 * nearer:.3f} "
            f"where the cameras are"
        )
        return near


def _errors(partial: PartialPlan) -> float:
    """Standard deviation that 5 % of what is measured exceed, of the front's draw."""
    scene, cameras = partial.scene, partial.cameras
    sigma = best_sigma(scene, partial.final_projectors, cameras, DRAWS.front)
    return float(np.quantile(sigma[np.isfinite(sigma)], 0.95))
