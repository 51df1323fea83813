"""From mesh to checked plan, read top to bottom like the paper's III to VI."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
from threadpoolctl import threadpool_limits

from geometry.curvature.refinement import cut_for_curvature
from geometry.mesh.mesh import TriangleMesh
from planning.cameras.camera_cover import (
    CameraStage,
    NothingMeasuredError,
    camera_candidate_views,
)
from planning.cameras.camera_routes import widest_route
from planning.cameras.camera_stage import follow_cameras, place_cameras
from planning.cameras.proved_cameras import bound_stage
from planning.cameras.routes import CamerasBy
from planning.model.document.certificates import Certificate
from planning.model.document.check_records import ReconstructionRecord
from planning.model.errors import InfeasibleLimitsError, InputError, TimeLimitError
from planning.model.plan import RigPlan
from planning.model.plan_errors import InterruptedPlanError, RequirementError
from planning.model.planned import PlannedCamera, PlannedProjector
from planning.model.progress import Report, Stopwatch
from planning.projectors.projector_poses import widen_margins
from planning.projectors.projector_stage import ProjectorStage
from planning.projectors.proved_projectors import prove_fewest
from planning.proofs.projector_bound import DEFAULT, PROVE
from planning.proofs.selection import larger
from planning.report.advice.camera_relaxations import nothing_measured
from planning.report.advice.what_helps import falls_short
from planning.report.assemble import write_plan
from planning.report.entries.cost import cost_record
from planning.report.partial_plan import PartialPlan, PlanRequest
from planning.report.summary.shortfall import shortfalls
from planning.rig.range_guard import Guard, guarded
from planning.rig.rig import Rig
from planning.rings.ring_stage import space_rings
from planning.scene.interest import Select, Weight, interest_of
from planning.scene.ranges.ranged_body import RangedBody
from planning.scene.scene import Scene
from planning.verify.verification import verify_plan

from .prepare import first_projectors, prepared
from .proofs import camera_bound


def plan_rig(
    mesh: TriangleMesh | Sequence[TriangleMesh] | RangedBody,
    rig: Rig,
    *,
    max_projectors: int,
    max_cameras: int | None = None,
    target: Literal["dominant", "surface"] | None = None,
    select: Select | None = None,
    weight: Weight | None = None,
    dominant_coverage: float | None = None,
    coverage: float | None = None,
    min_reachable: float | None = None,
    accuracy_mm: float | None = None,
    up: str | None = None,
    seed: int = 0,
    threads: int = 2,
    check: bool = True,
    prove: bool = False,
    cameras_by: CamerasBy = "both",
    time_limit: float | None = None,
    progress: Report | None = None,
    command: Sequence[str] = (),
) -> RigPlan:
    """Plan the projectors and cameras that measure a surface, and check the plan.

    Args:
        mesh: The surface, in metres; one for now. Or the body that `read_ranges` found:
            then limits are tightened by what isn't known of it.
        rig: Devices and limits, from `load_rig`.
        max_projectors: Projectors at most.
        max_cameras: Cameras at most; None: as many as the coverage needs.
        target: The `dominant` regions, or the whole `surface`; None: the former, and
            the latter of a body known by its ranges.
        select: Faces that are the target instead of the dominant regions: one bool a
            face of the mesh, or face indices, or from `read_selection`.
        weight: Of each vertex of the mesh, at least 0, or from `read_weight`: takes the
            place of curvedness in choosing the target.
        dominant_coverage: Lit / reachable by projectors; None: the rig's.
        coverage: Measured / reachable by cameras; None: the rig's.
        min_reachable: Reachable by projectors / target; None: the rig's.
        accuracy_mm: Largest standard deviation along the normal [mm]; None: the rig's.
        up: Axis that points up, `z` or `-y` and so on; None: the rig's.
        seed: The same seed gives the same plan.
        threads: Worker threads; no result depends on it.
        check: Whether the plan is audited and reconstructed from pixels.
        prove: Whether more work is spent on the bounds over all poses.
        cameras_by: Route to the cameras: the smallest `cover` of candidates, the
            largest baselines of the `paper`, or the better of `both`.
        time_limit: Wall time in [s] that cuts the run; the plan is then `truncated`.
        progress: Receives a line when a stage begins.
        command: Words of the command line, for the record.

    Returns:
        The plan, every requirement met.

    Raises:
        InputError: If an argument can't be used.
        InfeasibleLimitsError: If no device can serve anything.
        RequirementError: If a requirement is missed; it carries the best plan.
        TimeLimitError: If the time limit came before any plan.
    """
    ranges: tuple[RangedBody, Guard] | None = None
    if isinstance(mesh, RangedBody):
        target = _whole(target, select is None and weight is None)
        rig, guard = guarded(rig, mesh)
        mesh, ranges = mesh.mesh, (mesh, guard)
    surface = _single(mesh)
    target = target or "dominant"
    if target == "surface" and not (select is None and weight is None):
        raise InputError("the whole surface and a selection both are targets: give one")
    interest = interest_of(surface, select, weight)
    # Planned and judged on places, not on whatever triangles a flat face came in.
    cut, parent = cut_for_curvature(surface)
    order = PlanRequest(
        cut,
        rig,
        {
            "max_projectors": max_projectors,
            "max_cameras": max_cameras,
            "target": target,
            "dominant_coverage": dominant_coverage,
            "coverage": coverage,
            "min_reachable": min_reachable,
            "accuracy_mm": accuracy_mm,
            "up": up,
        },
        seed,
        threads,
        tuple(command),
        None if interest is None else interest.on_parts(parent),
        prove,
        ranges,
        cameras_by,
    )
    clock = Stopwatch(progress, time_limit=time_limit)
    if len(cut.faces) > len(surface.faces):
        clock.say(
            f"  long edges cut: {len(surface.faces):,} triangles become "
            f"{len(cut.faces):,}, the surface stays"
        )
    # BLAS must not split sums differently with another number of threads.
    with threadpool_limits(1):
        plan = _plan(order, clock, check=check)
    missed = shortfalls(plan)
    if check and plan.document.reconstruction is None:
        missed += ("the check wasn't made: the time limit came first",)
    if missed:
        raise RequirementError(plan, missed)
    return plan


def _plan(order: PlanRequest, clock: Stopwatch, *, check: bool) -> RigPlan:
    draft = _first_draft(order, clock)
    try:
        draft = _polish(draft, clock)
        draft = _bounded(draft, clock)
        plan = write_plan(draft, clock)
        while (more := _one_more(draft, plan, clock)) is not None:
            draft = _polish(more, clock)
            draft = _bounded(draft, clock)
            plan = write_plan(draft, clock)
        return _checked(plan, draft, clock) if check else plan
    except (KeyboardInterrupt, TimeLimitError) as cut:
        return _interrupted(draft, clock, cut)


def _first_draft(order: PlanRequest, clock: Stopwatch) -> PartialPlan:
    """Sections III and VI: regions, projectors, cameras; each the fewest."""
    ready = prepared(order, clock)
    stage = first_projectors(ready, clock)
    with clock.stage("bounds", "bounds over all poses of the workspace"):
        effort = PROVE if order.prove else DEFAULT
        stage = prove_fewest(
            ready.scene, stage, ready.template, effort, ring_offset=ready.ring_offset
        )
        clock.say(f"  projectors: {_bound_words(stage.certificate)}")
    projectors, cameras = _placed(order, ready.scene, stage, clock)
    return PartialPlan(
        order,
        ready.scene,
        ready.regions,
        ready.curvature_radius_m,
        ready.tilt,
        stage,
        projectors,
        cameras,
        cameras.cameras,
    )


def _placed(
    order: PlanRequest,
    scene: Scene,
    stage: ProjectorStage,
    clock: Stopwatch,
) -> tuple[tuple[PlannedProjector, ...], CameraStage]:
    """Poses of widest margin for chosen projectors, and the cameras for them."""
    rig = order.rig
    with clock.stage("projector_poses", "projector poses: widest margins"):
        projectors = widen_margins(scene, stage)
    with clock.stage("cameras", "cameras: candidates, measurability and cover"):
        n_cameras = rig.n_camera_poses
        camera = PlannedCamera(
            "", np.eye(4), rig.camera_device(), body=rig.camera_body()
        )
        scene = scene.among(projectors)
        candidates = camera_candidate_views(scene, camera, n_cameras)
        try:
            solution = place_cameras(scene, projectors, candidates, order.cameras_by)
        except NothingMeasuredError as error:
            helps = nothing_measured(scene, rig, error)
            raise InfeasibleLimitsError(f"{error}; {helps}") from None
        cameras = solution.stage
        clock.say(
            f"  {len(cameras.cameras)} of {len(cameras.reference)} candidates; at "
            f"least {cameras.certificate.candidates.lower_bound} are needed"
        )
    return solution.projectors, cameras


def _one_more(
    draft: PartialPlan, plan: RigPlan, clock: Stopwatch
) -> PartialPlan | None:
    """One device more where fresh samples don't confirm a cover that met its rows.

    The proved bound stays what it is; the count is then above it, and says so.
    """
    asked, areas = plan.requirements, plan.coverage.target
    if falls_short(
        areas.lit_m2, areas.reachable_by_projectors_m2, asked.dominant_coverage
    ):
        stage = larger(draft.stage, draft.stage.projectors, asked.max_projectors)
        if stage is not None:
            clock.say("  fresh samples fall short: one projector more")
            stage = replace(stage, projectors=stage.by_count[stage.certificate.count])
            projectors, cameras = _placed(draft.order, draft.scene, stage, clock)
            return replace(
                draft,
                stage=stage,
                projectors=projectors,
                rings=None,
                camera_stage=cameras,
                cameras=cameras.cameras,
            )
    if falls_short(areas.measured_m2, areas.reachable_by_cameras_m2, asked.coverage):
        cameras = larger(draft.camera_stage, draft.cameras, asked.max_cameras)
        if cameras is not None:
            clock.say("  fresh samples fall short: one camera more")
            chosen = cameras.by_count[cameras.certificate.count]
            cameras = replace(cameras, cameras=chosen)
            return replace(draft, camera_stage=cameras, cameras=chosen, rings=None)
    return None


def _polish(draft: PartialPlan, clock: Stopwatch) -> PartialPlan:
    """Section VI: cameras slide apart while the coverage holds; then their rings."""
    with clock.stage("baselines", "baselines: cameras slide apart"):
        ranges = draft.order.ranges
        stage, moved = widest_route(
            draft.scene,
            draft.projectors,
            draft.camera_stage,
            spare_field=0.0 if ranges is None else ranges[1].angle_rad,
        )
        if moved.smallest_before_m is not None and moved.smallest_after_m is not None:
            clock.say(
                f"  smallest baseline {1e3 * moved.smallest_before_m:.0f} -> "
                f"{1e3 * moved.smallest_after_m:.0f} mm"
            )
    with clock.stage("rings", "rings: axes and radii for the surface and the cameras"):
        final = follow_cameras(
            draft.scene,
            draft.projectors,
            moved.cameras,
            stage,
            draft.order.cameras_by,
        )
        scene = draft.scene.among((*final.projectors, *moved.cameras))
        rings = space_rings(
            scene,
            final.projectors,
            moved.cameras,
            draft.order.rig.ring_spacing,
            final.stage.cover.samples,
        )
    return replace(
        draft,
        projectors=final.projectors,
        camera_stage=final.stage,
        cameras=moved.cameras,
        rings=rings,
    )


def _bounded(draft: PartialPlan, clock: Stopwatch) -> PartialPlan:
    """The cameras' bound over all poses, for the ring axes that were kept.

    One that stands already belongs to the same projectors and axes: other axes come
    with another certificate.
    """
    stage = draft.camera_stage
    if stage.certificate.continuous is not None:
        return draft
    with clock.stage("camera_bounds", "bounds over all poses of the cameras"):
        effort = camera_bound.PROVE if draft.order.prove else camera_bound.DEFAULT
        stage = bound_stage(draft.scene, stage, draft.order.rig.camera_device(), effort)
        clock.say(f"  cameras: {_bound_words(stage.certificate)}")
    return replace(draft, camera_stage=stage)


def _interrupted(
    draft: PartialPlan, clock: Stopwatch, cut: KeyboardInterrupt | TimeLimitError
) -> RigPlan:
    """Write the best plan so far, marked truncated."""
    clock.lift()
    plan = write_plan(replace(draft, truncated=True), clock)
    if isinstance(cut, KeyboardInterrupt):
        raise InterruptedPlanError(plan) from None
    return plan


def _checked(plan: RigPlan, draft: PartialPlan, clock: Stopwatch) -> RigPlan:
    """Audit the written plan and reconstruct it from pixels, with foreign code."""
    with clock.stage("check", "check: audit, then reconstruction from pixels"):
        verification = verify_plan(
            plan, threads=draft.order.threads, progress=clock.say_in_time
        )
    found = verification.reconstruction
    record = None
    if found is not None:
        false = verification.audit.failures
        record = ReconstructionRecord(**found.to_document())
        record = record.changed(
            failures=(*false, *record.failures), passed=record.passed and not false
        )
    greedy = draft.camera_stage.certificate.greedy_count
    seconds = clock.processor | ({} if found is None else found.seconds)
    (member,) = plan.document.members
    document = plan.document.changed(
        reconstruction=record,
        members=(member.changed(reconstruction=record),),
        timings_s=dict(clock.seconds),
        cost=cost_record(plan.cameras, greedy, seconds),
    )
    return RigPlan(document, plan.surface)


def _bound_words(proof: Certificate) -> str:
    bound = proof.continuous
    return "" if bound is None else f"at least {bound.lower_bound}, {bound.proof}"


def _whole(target: str | None, unselected: bool) -> Literal["surface"]:
    """The target of a body of which only ranges are known: all of it."""
    if target == "dominant" or not unselected:
        raise InputError(
            "of a body that is known by its ranges alone the target is the whole "
            "surface: it has no dominant region and no faces to select"
        )
    return "surface"


def _single(mesh: TriangleMesh | Sequence[TriangleMesh]) -> TriangleMesh:
    if isinstance(mesh, TriangleMesh):
        return mesh
    if len(mesh) != 1:
        raise InputError(
            f"{len(mesh)} meshes: one rig for several isn't built yet, give one"
        )
    return mesh[0]
