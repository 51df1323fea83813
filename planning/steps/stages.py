"""The stages of planning, each of which takes a partial plan further."""

from collections.abc import Sequence
from dataclasses import replace

from planning.cameras.axis_choice import other_axes, place_for_axes
from planning.cameras.baselines.widest_baselines import WidestBaselines
from planning.cameras.camera_cover import (
    NothingMeasuredError,
    camera_candidate_views,
)
from planning.cameras.camera_routes import Widened, cheapest, widest_routes
from planning.cameras.camera_stage import CameraSolution, follow_cameras
from planning.cameras.priced_cameras import fewer_cameras, has_room
from planning.cameras.proved_cameras import CameraStage, bound_stage
from planning.model.document.certificates import Certificate
from planning.model.document.ring_records import RingAxis
from planning.model.errors import InfeasibleLimitsError
from planning.model.progress import Stopwatch
from planning.projectors.candidate_set import NothingLitError
from planning.projectors.projector_stage import ProjectorStage
from planning.proofs import camera_bound, projector_bound
from planning.proofs.candidate_certificate import larger
from planning.report.advice.camera_relaxations import nothing_measured
from planning.report.advice.projector_relaxations import nothing_lit
from planning.report.advice.standing_inside import standing_inside
from planning.report.advice.what_helps import falls_short
from planning.report.assemble import Claimed
from planning.report.claims.region_claims import below_floor
from planning.report.partial_plan import PartialPlan, Prepared
from planning.rings.acquisition import pixels_read
from planning.rings.kept_pairs import rings_for_pairs

from .recalled import fewest_projectors, proved_projectors, widened_projectors


def first_projectors(ready: Prepared, clock: Stopwatch) -> ProjectorStage:
    """Return the fewest projectors of the candidates.

    Raises:
        InfeasibleLimitsError: If no candidate lights any sample.
    """
    n_poses = ready.request.rig.n_projector_poses
    with clock.stage("projectors", "projectors: candidates and cover"):
        try:
            stage = fewest_projectors(ready.scene, ready.templates, n_poses)
        except NothingLitError as error:
            helps = nothing_lit(ready.scene, error)
            helps += standing_inside(ready.scene, error.candidates.projectors)
            raise InfeasibleLimitsError(f"{error}; {helps}") from None
        _say_count(stage, stage.projectors, clock)
    return stage


def bounded_projectors(
    ready: Prepared, stage: ProjectorStage, clock: Stopwatch
) -> ProjectorStage:
    """Return the fewest projectors with their bound over all poses."""
    prove = ready.request.prove
    with clock.stage("bounds", "bounds over all poses of the workspace"):
        effort = projector_bound.PROVE if prove else projector_bound.DEFAULT
        stage = proved_projectors(ready.scene, stage, ready.templates, effort)
        clock.say(f"  projectors: {_bound_words(stage.certificate)}")
    more, allowed = stage, ready.scene.requirements.max_projectors
    while more and len(more.projectors) < ready.request.least_projectors:
        more = _one_projector_more(more, allowed)
    return more or stage


def _one_projector_more(
    stage: ProjectorStage, allowed: int | None
) -> ProjectorStage | None:
    more = larger(stage, stage.projectors, allowed)
    if more is None:
        return None
    return replace(more, projectors=more.by_count[more.certificate.count])


def placed(
    ready: Prepared,
    stage: ProjectorStage,
    clock: Stopwatch,
    axis: RingAxis | None = None,
) -> PartialPlan:
    """Return poses of widest margin for chosen projectors, and the cameras for them.

    Ring axes stand as was asked, or else as given.

    Raises:
        InfeasibleLimitsError: If no camera measures any lit sample.
    """
    request = ready.request
    with clock.stage("projector_poses", "projector poses: widest margins"):
        projectors = widened_projectors(ready.scene, stage)
    with clock.stage("cameras", "cameras: candidates, measurability and cover"):
        scene = ready.scene.among(projectors)
        views = camera_candidate_views(scene, ready.cameras, request.rig.n_camera_poses)
        try:
            solution = place_for_axes(
                scene,
                projectors,
                views,
                request.cameras_by,
                axis=axis or request.ring_axis,
                margin=request.ring_margin,
            )
        except NothingMeasuredError as error:
            helps = nothing_measured(scene, request.rig, error)
            helps += standing_inside(scene, error.cameras)
            raise InfeasibleLimitsError(f"{error}; {helps}") from None
        cameras = solution.stage
        _say_count(cameras, cameras.cameras, clock)
    return PartialPlan(
        ready,
        stage,
        solution.projectors,
        cameras,
        cameras.cameras,
        axes=solution.axes,
    )


def _say_count(
    stage: ProjectorStage | CameraStage, devices: Sequence[object], clock: Stopwatch
) -> None:
    bound = stage.certificate.needed.lower_bound
    words = f"{len(devices)} of {len(stage.reference)} candidates"
    clock.say(f"  {words}; at least {bound} are needed")


def polished(partial: PartialPlan, clock: Stopwatch) -> PartialPlan:
    """Section VI: the largest baselines that coverage allows; then their rings."""
    with clock.stage("baselines", "baselines: the largest that coverage allows"):
        ranges = partial.request.ranges
        every = widest_routes(
            partial.scene,
            partial.projectors,
            partial.camera_stage,
            spare_field=0.0 if ranges is None else ranges[1].angle_rad,
        )
    if partial.request.ring_axis is None:
        return _best_unringed(partial, every, clock)
    with clock.stage("rings", "rings: axes and radii for the surface and the cameras"):
        ringed = [_with_rings(partial, stage, moved) for stage, moved in every]
        costs = [pixels_read(one.final_projectors, one.cameras) for one in ringed]
        stages = [one.camera_stage for one in ringed]
        best, stage = cheapest(tuple(zip(stages, costs, strict=True)))
        partial, moved = replace(ringed[best], camera_stage=stage), every[best][1]
        _say_baselines(moved, clock)
        if partial.request.ring_axis != "auto" or partial.request.family is not None:
            return partial
        others = other_axes(
            partial.scene,
            CameraSolution(partial.projectors, stage, partial.axes),
            moved.cameras,
            partial.ready.templates,
            partial.request.ring_margin,
        )
        return replace(partial, other_axes=others)


def _best_unringed(
    partial: PartialPlan, every: Sequence[Widened], clock: Stopwatch
) -> PartialPlan:
    """Cameras as they moved, of the route whose scan is cheaper."""
    costs = [pixels_read(partial.projectors, moved.cameras) for _, moved in every]
    stages = [stage for stage, _ in every]
    best, stage = cheapest(tuple(zip(stages, costs, strict=True)))
    _say_baselines(every[best][1], clock)
    return replace(partial, camera_stage=stage, cameras=every[best][1].cameras)


def _say_baselines(moved: WidestBaselines, clock: Stopwatch) -> None:
    before, after = moved.smallest_before_m, moved.smallest_after_m
    if before is not None and after is not None:
        clock.say(f"  smallest baseline {1e3 * before:.0f} -> {1e3 * after:.0f} mm")


def _with_rings(
    partial: PartialPlan, stage: CameraStage, moved: WidestBaselines
) -> PartialPlan:
    """Cameras as they moved, the ring axes that follow them, and rings for both."""
    scene, request = partial.scene, partial.request
    final = CameraSolution(partial.projectors, stage, partial.axes)
    if partial.axes == "free" and partial.surviving is None:
        final = follow_cameras(
            scene, partial.projectors, moved.cameras, stage, request.cameras_by
        )
    rings = rings_for_pairs(
        scene.among((*final.projectors, *moved.cameras)),
        final.projectors,
        moved.cameras,
        request.rig.rings.spacing,
        final.stage.cover.samples,
        margin=request.ring_margin,
    )
    return replace(
        partial,
        projectors=final.projectors,
        camera_stage=final.stage,
        cameras=moved.cameras,
        rings=rings,
    )


def bounded_cameras(partial: PartialPlan, clock: Stopwatch) -> PartialPlan:
    """The cameras' bound over all poses, for the ring axes that were kept.

    One that stands already belongs to the same projectors and axes: other axes come
    with another certificate.
    """
    stage, request = partial.camera_stage, partial.request
    if stage.certificate.continuous is not None:
        return partial
    with clock.stage("camera_bounds", "bounds over all poses of the cameras"):
        effort = camera_bound.PROVE if request.prove else camera_bound.DEFAULT
        stage = bound_stage(partial.scene, stage, request.rig.optics[1], effort)
        clock.say(f"  cameras: {_bound_words(stage.certificate)}")
    return replace(partial, camera_stage=stage)


def with_fewer_cameras(partial: PartialPlan, clock: Stopwatch) -> PartialPlan | None:
    """Fewer cameras, where any are found between the bound and the count; else None.

    The paper's route stays what it is, where it was asked for, and so do cameras that
    survive losses.
    """
    request, stage = partial.request, partial.camera_stage
    if request.cameras_by == "paper" or partial.surviving is not None:
        return None
    if not has_room(stage):
        return None
    effort = camera_bound.PROVE if request.prove else camera_bound.DEFAULT
    with clock.stage("cameras", "cameras: fewer, between the bound and the count"):
        fewer = fewer_cameras(
            partial.scene.among(partial.projectors),
            partial.projectors,
            stage,
            effort.starts,
        )
    if fewer is None:
        return None
    _say_count(fewer, fewer.cameras, clock)
    return replace(partial, camera_stage=fewer, cameras=fewer.cameras, rings=None)


def with_free_axes(
    partial: PartialPlan, plan: Claimed, clock: Stopwatch
) -> PartialPlan | None:
    """Cameras for free ring axes, where centred ones were tried and measure too little.

    None where that was asked for, or enough is measured.
    """
    left = partial.axes == "centred" and partial.request.ring_axis == "auto"
    left = left and partial.surviving is None
    if not left or short_of(plan) != (False, True):
        return None
    clock.say("  centred ring axes fall short: free ones")
    return placed(partial.ready, partial.stage, clock, "free")


def short_of(plan: Claimed) -> tuple[bool, bool]:
    """Whether less than is required is lit, and measured, in all or of a region."""
    required, areas = plan.requirements, plan.coverage.target
    floors = [
        below_floor(region.coverage, required.region_coverage)
        for region in plan.regions
        if region.coverage is not None and region.coverage.floor == "missed"
    ]
    return (
        any(unlit for unlit, _ in floors)
        or falls_short(
            areas.lit_m2, areas.reachable_by_projectors_m2, required.dominant_coverage
        ),
        any(unmeasured for _, unmeasured in floors)
        or falls_short(
            areas.measured_m2, areas.reachable_by_cameras_m2, required.coverage
        ),
    )


def one_device_more(
    partial: PartialPlan, plan: Claimed, clock: Stopwatch, axis: RingAxis | None = None
) -> PartialPlan | None:
    """One device more where fresh samples don't confirm a cover that met its own.

    The proved bound stays what it is; the count is then above it, and says so. Ring
    axes stand as given, or else as was asked.
    """
    required = plan.requirements
    unlit, unmeasured = short_of(plan)
    if partial.surviving is not None:
        # What is short with all devices there is short after a loss, too.
        return None
    if unlit:
        stage = _one_projector_more(partial.stage, required.max_projectors)
        if stage is not None:
            clock.say("  fresh samples fall short: one projector more")
            return placed(partial.ready, stage, clock, axis)
    if unmeasured:
        views = larger(partial.camera_stage, partial.cameras, required.max_cameras)
        if views is not None:
            clock.say("  fresh samples fall short: one camera more")
            cameras = views.by_count[views.certificate.count]
            views = replace(views, cameras=cameras)
            return replace(partial, camera_stage=views, cameras=cameras, rings=None)
    return None


def _bound_words(proof: Certificate) -> str:
    bound = proof.continuous
    return "" if bound is None else f"at least {bound.lower_bound}, {bound.proof}"
