"""From a request for cameras alone to its plan."""

from dataclasses import replace

from planning.cameras.camera_cover import camera_candidate_views
from planning.cameras.photogrammetry.view_bound import bound_views
from planning.cameras.photogrammetry.view_stage import place_views
from planning.model.errors import InfeasibleLimitsError
from planning.model.plan import RigPlan
from planning.model.progress import Stopwatch
from planning.proofs import camera_bound
from planning.proofs.candidate_certificate import larger
from planning.report.advice.standing_inside import standing_inside
from planning.report.partial_plan import PlanRequest
from planning.rig.devices.lens_fit import check_fields
from planning.steps.best_kept import Keep, Search, Whole, best_kept
from planning.steps.prepare import prepared
from planning.steps.stages import short_of

from .view_document import ViewPlan, write_view_plan


def planned_alone(
    request: PlanRequest, clock: Stopwatch, keep: Keep | None
) -> tuple[RigPlan, None]:
    """Return the plan of cameras alone, and no partial plan: rings may not help it.

    Raises:
        InfeasibleLimitsError: If no pair of cameras measures anything.
        InterruptedPlanError: If planning is interrupted; it carries the best plan.
        TimeLimitError: If the time limit came before any plan was written.
    """
    plan, _ = best_kept(_cameras_sought(request, clock), _whole, clock, keep)
    return plan, None


def _whole(partial: ViewPlan, clock: Stopwatch) -> Whole:
    return Whole(write_view_plan(partial, clock))


def _cameras_sought(request: PlanRequest, clock: Stopwatch) -> Search[ViewPlan, Whole]:
    """The fewest cameras whose pairs measure enough; one more where samples ask."""
    partial = _first_cameras(request, clock)
    yield partial, False
    larger: ViewPlan | None = _bounded(partial, clock)
    while larger is not None:
        whole = yield larger, True
        assert whole is not None
        larger = _one_camera_more(larger, whole.plan, clock)


def _first_cameras(request: PlanRequest, clock: Stopwatch) -> ViewPlan:
    """The fewest of the candidates."""
    fits = request.rig.fits(request.mesh)
    check_fields([fit for fit in fits if fit.role == "camera"])
    ready = prepared(request, clock)
    with clock.stage("cameras", "cameras: candidates, their pairs and the cover"):
        count = request.rig.n_camera_poses
        views = camera_candidate_views(ready.scene, ready.cameras, count)
        try:
            stage = place_views(ready.scene, views)
        except InfeasibleLimitsError as error:
            helps = standing_inside(ready.scene, views.cameras)
            raise InfeasibleLimitsError(f"{error}{helps}") from None
        least = stage.certificate.candidates.lower_bound
        clock.say(
            f"  {len(stage.cameras)} of {len(stage.reference)} candidates; at least "
            f"{least} are needed"
        )
    return ViewPlan(ready, stage, stage.cameras)


def _bounded(partial: ViewPlan, clock: Stopwatch) -> ViewPlan:
    """The same with the bound over all poses of the workspace."""
    request = partial.request
    with clock.stage("camera_bounds", "bounds over all poses of the cameras"):
        effort = camera_bound.PROVE if request.prove else camera_bound.DEFAULT
        optics = request.rig.optics[1]
        stage = bound_views(partial.scene, partial.stage, optics, effort)
        bound = stage.certificate.continuous
        if bound is not None:
            clock.say(f"  cameras: at least {bound.lower_bound}, {bound.proof}")
    return replace(partial, stage=stage)


def _one_camera_more(
    partial: ViewPlan, plan: RigPlan, clock: Stopwatch
) -> ViewPlan | None:
    """One camera more where fresh samples don't confirm a cover that met its own.

    The proved bound stays what it is; the count is then above it, and says so.
    """
    _, unmeasured = short_of(plan)
    if not unmeasured:
        return None
    stage = larger(partial.stage, partial.cameras, plan.requirements.max_cameras)
    if stage is None:
        return None
    clock.say("  fresh samples fall short: one camera more")
    cameras = stage.by_count[stage.certificate.count]
    return replace(partial, stage=replace(stage, cameras=cameras), cameras=cameras)
