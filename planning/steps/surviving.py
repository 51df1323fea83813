"""Projectors and cameras of which any may be lost, after the fewest that measure once.

What is asked beyond one pair is a layer over the plan that asks for one: its covers
give candidates, bounds and what survival costs.
"""

from dataclasses import replace

from planning.cameras.axis_choice import place_for_axes
from planning.cameras.camera_cover import NothingMeasuredError, camera_candidate_views
from planning.cameras.proved_cameras import bound_stage
from planning.cameras.surviving_cameras import surviving_cameras
from planning.model.errors import InputError
from planning.model.progress import Stopwatch
from planning.projectors.projector_stage import ProjectorStage
from planning.projectors.surviving_projectors import surviving_projectors
from planning.proofs import camera_bound, projector_bound
from planning.proofs.candidate_certificate import counted
from planning.proofs.surviving_counts import SurvivingCount
from planning.report.assemble import Claimed
from planning.report.entries.survival_entries import falls_short_after
from planning.report.partial_plan import PartialPlan, PlanRequest, Prepared

from .stages import placed


def check_survival(request: PlanRequest) -> None:
    """Refuse what survival can't be asked together with.

    Raises:
        InputError: It names both, and what to do.
    """
    wishes, rig = request.wishes, request.rig
    if request.evaluates or not ((wishes.views or 1) > 1 or wishes.survive):
        return
    asked = f"views = {wishes.views or 1}, survive = {wishes.survive}"
    if request.cameras_by == "paper":
        raise InputError(
            f"{asked} with cameras_by = 'paper': the paper's route measures once; take "
            f"'cover' or 'both'"
        )
    for kind in ("projector", "camera"):
        if any(model.body is not None for model in rig.models(kind)):
            raise InputError(
                f"{asked}: rig {rig.name!r} gives a {kind} a body, and devices that "
                f"may be lost aren't planned among each other's bodies; leave "
                f"[{kind}.body] out, or `plan evaluate` the devices as they stand"
            )


def placed_to_survive(
    ready: Prepared, stage: ProjectorStage, clock: Stopwatch
) -> PartialPlan:
    """Return the projectors and cameras that survival asks for.

    Raises:
        InfeasibleLimitsError: If no camera measures any lit sample.
    """
    asked = ready.scene.requirements.survival
    assert asked is not None
    lights = _once(stage)
    without: int | None = None
    if asked.survive:
        with clock.stage("survival", "survival: projectors that may be lost"):
            without = _cameras_without(ready, stage)
            effort = (
                projector_bound.PROVE
                if ready.request.prove
                else projector_bound.DEFAULT
            )
            stage, lights = surviving_projectors(
                ready.scene, stage, ready.templates, effort
            )
            _say(lights, "projectors", len(stage.projectors), clock)
    return _with_cameras(ready, stage, lights, without, clock)


def _with_cameras(
    ready: Prepared,
    stage: ProjectorStage,
    lights: SurvivingCount,
    without: int | None,
    clock: Stopwatch,
) -> PartialPlan:
    """Poses of widest margin for projectors that are counted, and cameras for them."""
    asked = ready.scene.requirements.survival
    assert asked is not None
    partial = placed(ready, stage, clock)
    plain = partial.camera_stage
    without = plain.certificate.needed.count if without is None else without
    with clock.stage("camera_bounds", "bounds over all poses of the cameras"):
        request = ready.request
        effort = camera_bound.PROVE if request.prove else camera_bound.DEFAULT
        plain = bound_stage(partial.scene, plain, request.rig.optics[1], effort)
    with clock.stage("survival", "survival: cameras"):
        scene = partial.scene.among(partial.projectors)
        cameras, views = surviving_cameras(
            scene, partial.projectors, plain, asked, without
        )
        _say(views, "cameras", len(cameras.cameras), clock)
    return replace(
        partial,
        camera_stage=cameras,
        cameras=cameras.cameras,
        surviving=(lights, views),
    )


def _say(count: SurvivingCount, kind: str, taken: int, clock: Stopwatch) -> None:
    clock.say(
        f"  {taken} {kind}, {count.without} without; at least {count.lower_bound} of "
        f"the candidates are needed"
    )


def _once(stage: ProjectorStage) -> SurvivingCount:
    """The count of projectors that none may be lost of."""
    proof = stage.certificate
    bound = proof.continuous
    return SurvivingCount(
        needed=proof.needed.count,
        without=proof.needed.count,
        lower_bound=proof.needed.lower_bound,
        everywhere=None if bound is None else bound.lower_bound,
        more={},
        met=proof.status != "infeasible",
    )


def _cameras_without(ready: Prepared, stage: ProjectorStage) -> int:
    """How many cameras measure once what the fewest projectors light."""
    request, projectors = ready.request, stage.projectors
    scene = ready.scene.among(projectors)
    views = camera_candidate_views(scene, ready.cameras, request.rig.n_camera_poses)
    try:
        solution = place_for_axes(
            scene,
            projectors,
            views,
            "cover",
            axis=request.ring_axis,
            margin=request.ring_margin,
        )
    except NothingMeasuredError:
        # With more projectors it is told what stops them, or they measure.
        return 0
    return solution.stage.certificate.needed.count


def one_more_for_losses(
    partial: PartialPlan, plan: Claimed, clock: Stopwatch
) -> PartialPlan | None:
    """One device more where fresh samples don't confirm what is left after a loss."""
    record, counts = plan.survival, partial.surviving
    if record is None or counts is None:
        return None
    short = [falls_short_after(loss, plan.requirements) for loss in record.losses]
    lights, views = counts
    if any(dark for dark, _ in short) and lights.met:
        projectors = lights.more.get(len(partial.projectors) + 1)
        if projectors is not None:
            clock.say("  fresh samples fall short after a loss: one projector more")
            area = plan.coverage.target.reachable_by_projectors_m2
            stage = counted(
                replace(partial.stage, projectors=projectors), projectors, area
            )
            return _with_cameras(partial.ready, stage, lights, views.without, clock)
    if any(unmeasured for _, unmeasured in short) and views.met:
        cameras = views.more.get(len(partial.cameras) + 1)
        if cameras is not None:
            clock.say("  fresh samples fall short after a loss: one camera more")
            area = plan.coverage.target.reachable_by_cameras_m2
            stage = counted(
                replace(partial.camera_stage, cameras=cameras), cameras, area
            )
            return replace(partial, camera_stage=stage, cameras=cameras, rings=None)
    return None
