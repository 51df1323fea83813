"""The plan of a front's point: from its candidates on, without another matrix."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from planning.cameras.camera_cover import CameraCover, candidate_cover
from planning.cameras.camera_routes import widest_routes
from planning.cameras.camera_stage import proves_as_much
from planning.cameras.kept_pairs import rings_for_pairs
from planning.cameras.proved_cameras import CameraStage, camera_stage
from planning.model.document.certificates import Certificate
from planning.model.document.ring_records import AxisTaken
from planning.model.front import FrontPoint
from planning.model.plan import RigPlan
from planning.model.planned import PlannedCamera, PlannedProjector
from planning.model.progress import Stopwatch
from planning.projectors.exposures import with_exposures
from planning.projectors.projector_poses import widen_margins
from planning.projectors.projector_stage import ProjectorStage
from planning.projectors.proved_projectors import prove_fewest
from planning.proofs import projector_bound
from planning.proofs.selection import CandidateCover, Selection, select_fewest
from planning.report.assemble import write_plan
from planning.report.partial_plan import PartialPlan, PlanRequest, Prepared
from planning.rig.devices.lens_fit import check_fields
from planning.rings.axis_moves import move_ring_axes
from planning.rings.centred_axes import centred_axes
from planning.scene.draws import DRAWS
from planning.scene.lighting import lit_stages
from planning.scene.limits.projector_limits import LIT
from planning.scene.measured import LitSamples, measured_by, taken
from planning.scene.scene import Scene
from planning.steps.best_kept import Keep, Search, best_kept
from planning.steps.prepare import prepared
from planning.steps.stages import bounded_cameras

from .best_counts import with_more
from .fresh_figures import best_sigma
from .front_matrix import FrontMatrix
from .front_refused import check_front
from .kept_front import KeptFront

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
        return best_kept(self._sought(request, clock), write_plan, clock, keep)

    def _sought(self, request: PlanRequest, clock: Stopwatch) -> Search[PartialPlan]:
        check_front(request)
        check_fields(request.rig.fits(request.mesh))
        ready = prepared(request, clock)
        matrix = self.kept.matrix(ready)
        axes = "free" if request.axis_wanted == "free" else self.point.axes
        stage, projectors = self._projectors(ready, matrix, clock)
        with clock.stage("cameras", "cameras: those of the point, for these poses"):
            share = self.point.measured_m2 / self.kept.front.area_m2
            cameras = _Cameras(ready.scene, matrix, self.point, share)
            projectors, views = cameras.placed(projectors, axes, request.ring_margin)
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


def as_taken(cover: CandidateCover, chosen: NDArray[np.int64]) -> Selection:
    """Return candidates as a selection, with what is proved of fewer and of as many."""
    fewest = select_fewest(replace(cover, max_count=None))
    _, bound = cover.most_covering(len(chosen), chosen)
    met = cover.enough(chosen)
    proved = "optimal" if fewest.lower_bound >= len(chosen) else "feasible"
    return replace(
        fewest,
        chosen=chosen,
        smallest=chosen if met else fewest.smallest,
        status=proved if met else "infeasible",
        n_covered=cover.n_covered(chosen),
        n_covered_bound=max(bound, cover.n_covered(chosen)),
    )


def _fewest_known(proof: Certificate) -> bool:
    """Whether these do, and no fewer are known to, so that a bound may prove it."""
    fewer = (row for row in proof.by_count if row.count < proof.count)
    short = all(row.value_m2 < proof.required_m2 for row in fewer)
    return proof.status != "infeasible" and short


@dataclass(frozen=True, eq=False)
class _Cameras:
    """Chooses a point's number of cameras for projectors that moved.

    What they see is kept, so that other light on it costs no ray. `share` is what the
    point measures of the target.
    """

    scene: Scene
    matrix: FrontMatrix
    point: FrontPoint
    share: float

    def placed(
        self, projectors: _Projectors, axes: AxisTaken | None, margin: float
    ) -> tuple[_Projectors, CameraStage]:
        """Return the projectors with their ring axes, and the cameras."""
        if axes == "centred":
            projectors = centred_axes(self.scene, projectors, margin)
        samples, measured = self._measured(projectors)
        chosen = self._chosen(measured, samples)
        if axes == "free":
            cameras = [self.matrix.cameras[i] for i in chosen]
            projectors = move_ring_axes(self.scene, projectors, cameras, samples)
            samples, measured = self._measured(projectors)
            chosen = self._chosen(measured, samples, chosen)
        return projectors, self._stage(samples, measured, chosen)

    def _with_axes_for(
        self,
        projectors: _Projectors,
        cameras: Sequence[PlannedCamera],
        stage: CameraStage,
    ) -> tuple[_Projectors, CameraStage]:
        """Return the projectors with ring axes for cameras that left the candidates.

        What is proved of their number is proved again for these axes; where that is
        less, they are dropped.
        """
        moved = move_ring_axes(self.scene, projectors, cameras, stage.cover.samples)
        chosen = stage.cover.selection.chosen
        again = self._stage(*self._measured(moved), chosen)
        selection = again.cover.selection
        if proves_as_much(selection, stage.certificate, len(chosen)):
            return moved, again
        return projectors, stage

    def with_rings(
        self, partial: PartialPlan, cameras: tuple[PlannedCamera, ...]
    ) -> PartialPlan:
        """Return the plan with other cameras, and ring axes and radii for them.

        Axes have moved for those of the camera stage.
        """
        partial = replace(partial, cameras=cameras)
        projectors, stage = partial.projectors, partial.camera_stage
        if partial.axes is None:
            return partial
        if partial.axes == "free" and cameras is not stage.cameras:
            projectors, stage = self._with_axes_for(projectors, cameras, stage)
        rings = rings_for_pairs(
            self.scene.among((*projectors, *cameras)),
            projectors,
            cameras,
            partial.request.rig.rings.spacing,
            stage.cover.samples,
            margin=partial.request.ring_margin,
        )
        return replace(partial, projectors=projectors, camera_stage=stage, rings=rings)

    def _stage(
        self,
        samples: LitSamples,
        measured: NDArray[np.bool_],
        chosen: NDArray[np.int64],
    ) -> CameraStage:
        cover = candidate_cover(self.scene, measured, samples, self.matrix.cameras)
        views = CameraCover(
            self.matrix.views, samples, measured, as_taken(cover, chosen)
        )
        return camera_stage(self.scene, views)

    def _measured(
        self, projectors: Sequence[PlannedProjector]
    ) -> tuple[LitSamples, NDArray[np.bool_]]:
        """Samples of the matrix that are lit, and which candidate measures which."""
        matrix, target = self.matrix, self.matrix.target
        lit = lit_stages(self.scene, projectors, target) == LIT
        every = LitSamples.of(projectors, target, lit)
        views = matrix.views.on(target)
        measured = measured_by(self.scene, matrix.cameras, every, views)
        bright = np.flatnonzero(lit.any(axis=1))
        return taken(every, bright, lit), measured[bright]

    def _chosen(
        self,
        measured: NDArray[np.bool_],
        samples: LitSamples,
        kept: NDArray[np.int64] | None = None,
    ) -> NDArray[np.int64]:
        """Those chosen before where they measure what the point says; else the most."""
        if kept is None:
            kept = np.array(self.point.views, dtype=np.int64)
        scene, cameras = self.matrix.scene, self.matrix.cameras
        cover = candidate_cover(scene, measured, samples, cameras)
        if cover.n_covered(kept) >= self.share * len(self.matrix.target):
            return kept
        best, _ = cover.most_covering(len(kept), kept)
        best = with_more(cover, best, len(kept))
        return max((kept, best), key=cover.n_covered)


def _apart(partial: PartialPlan, views: _Cameras, clock: Stopwatch) -> PartialPlan:
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
