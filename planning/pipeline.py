"""From mesh to checked plan, read top to bottom like the paper's III to VI."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

from threadpoolctl import threadpool_limits

from geometry.mesh.mesh import TriangleMesh
from geometry.parallel import n_threads
from planning.cache.cache import NO_CACHE, Cache
from planning.model.document.certificates import CamerasBy
from planning.model.document.family_records import AlignedBy
from planning.model.document.ring_records import RingAxis
from planning.model.errors import InputError
from planning.model.plan import RequirementError, RigPlan
from planning.model.progress import Report, Stopwatch
from planning.report.assemble import Draft, write_plan
from planning.report.live_bar import shown
from planning.report.partial_plan import PartialPlan, PlanRequest
from planning.report.tolerance.robust import robustly
from planning.rig.devices.lens_fit import check_fields
from planning.rig.mounted import Mounted
from planning.rig.rig import Rig
from planning.rig.wishes import AccuracyOf, Pattern, TargetName, Wishes
from planning.scene.interest import Select, Weight
from planning.scene.ranges.ranged_body import RangedBody
from planning.steps.stations.carried import devices_of_heads, pattern_of_rig
from planning.steps.stations.heads import heads_sought
from planning.steps.stations.turntable import steps_sought

from .steps.asked.request import request_of
from .steps.best_kept import Keep, Search, best_kept
from .steps.cameras_alone.stages import planned_alone
from .steps.checked import Checked, axes_may_help, checked_plan, missed_by
from .steps.family.family_plan import with_members
from .steps.family.family_search import FamilyDraft, family_sought
from .steps.front.taken_point import TakenPoint
from .steps.joint.joining import jointly
from .steps.prepare import prepared, standing_devices
from .steps.refused import check_request, check_values
from .steps.stages import (
    bounded_cameras,
    bounded_projectors,
    first_projectors,
    one_device_more,
    placed,
    polished,
    with_fewer_cameras,
    with_free_axes,
)
from .steps.standing import as_they_stand
from .steps.surviving import one_more_for_losses, placed_to_survive


def plan_rig(
    mesh: TriangleMesh | Sequence[TriangleMesh] | RangedBody,
    rig: Rig,
    *,
    align: AlignedBy = "given",
    family_quantile: float = 1.0,
    max_projectors: int | None = None,
    max_cameras: int | None = None,
    max_heads: int | None = None,
    target: TargetName | None = None,
    select: Select | None = None,
    weight: Weight | None = None,
    dominant_coverage: float | None = None,
    coverage: float | None = None,
    min_reachable: float | None = None,
    region_coverage: float | None = None,
    accuracy_mm: float | None = None,
    accuracy_of: AccuracyOf = "total",
    up: str | None = None,
    ring_axis: RingAxis | None = None,
    robust: float | None = None,
    views: int | None = None,
    survive: int = 0,
    joint: bool = False,
    pattern: Pattern | None = None,
    seed: int = 0,
    threads: int | None = None,
    check: bool = True,
    prove: bool = False,
    cameras_by: CamerasBy = "both",
    time_limit: float | None = None,
    progress: Report | bool = False,
    command: Sequence[str] = (),
    keep: Keep | None = None,
    checked: Checked | None = None,
    fixed: Mounted | None = None,
    take: TakenPoint | None = None,
    on_miss: Literal["raise", "return"] = "raise",
    cache: Cache = NO_CACHE,
) -> RigPlan:
    """Plan the projectors and cameras that measure a surface, and check the plan.

    Args:
        mesh: The surface, in metres. Several: a family that one rig serves, member by
            member (`docs/use/family.md`). Or the body that `read_ranges` found: then
            limits are tightened by what isn't known of it.
        rig: Devices and limits, from `load_rig`.
        align: How members of a family are laid over the first: as `given`, by principal
            `axes`, or by `icp`.
        family_quantile: Share of the members that the rig must serve, in (0, 1].
        max_projectors: Projectors at most; None, and no heads either: the fixed devices
            and those of the rig file are evaluated as they stand. None is sought or
            moved, nothing is proved of their number, and limits of the workspace that
            they break are told and refuse nothing. 0 with the pattern `none`.
        max_cameras: Cameras at most; None: as many as the coverage needs.
        max_heads: Instead, of a rig with a `[head]`: heads at most, or its stations.
        target: The `dominant` regions, the whole `surface`, or what of it lies
            `outside`; None: the first, and the second of a body known by its ranges.
        select: Faces that are the target instead of the dominant regions: one bool a
            face of the mesh, or face indices, or from `read_selection`.
        weight: Of each vertex of the mesh, at least 0, or from `read_weight`: takes the
            place of curvedness in choosing the target.
        dominant_coverage: Lit / reachable by projectors; None: the rig's.
        coverage: Measured / reachable by cameras; None: the rig's.
        min_reachable: Reachable by projectors / target; None: the rig's.
        region_coverage: Floor of both shares in each region, 0: none; None: the rig's.
        accuracy_mm: Largest standard deviation along the normal [mm]; None: the rig's.
        accuracy_of: Whether that is of the `total`, with what the rig says that its
            calibration leaves, or of `noise` alone.
        up: Axis that points up, `z` or `-y` and so on; None: the rig's.
        ring_axis: Rings `centred` on what is lit, with axes `free` to stand where
            errors are smallest, or `auto`; None: the rig's.
        robust: Share of drawn rigs that meet the requirements; None: none is drawn.
        views: Different pairs of projector and camera, at least, that measure what
            counts as covered; None: one. Of the pattern `none` cameras that see it, of
            which some pair measures it; None: two.
        survive: Devices, 0 or 1, of which any may be lost: what is left still meets
            the requirements.
        joint: Whether projectors and cameras are then sought together, the cheapest,
            and moved together (`docs/method/joint.md`).
        pattern: What projectors show: `rings`, or a `dense` code of every pixel; None:
            that, where the rig has a head or a turntable; `none`: there is no
            projector, and pairs of cameras measure by the object's texture.
        seed: The same seed gives the same plan.
        threads: Worker threads; no result depends on it. None: one for each core.
        check: Whether the plan is audited and reconstructed from pixels.
        prove: Whether more work is spent on the bounds over all poses.
        cameras_by: Route to the cameras: the smallest `cover` of candidates, the
            largest baselines of the `paper`, or the better of `both`.
        time_limit: Wall time in [s] that cuts the run; the plan is then `truncated`.
        progress: Receives a line when a stage begins; True: a bar is shown, on a
            terminal or in a notebook.
        command: Words of the command line, for the record.
        keep: Receives the plan when it is made and not yet checked; with a time limit
            also the first one, before its poses are improved.
        checked: Receives it with what the check found.
        fixed: Devices that stay where they are and count, from `read_mounted`.
        take: A point of a front, whose numbers of devices and candidates are taken.
        on_miss: `raise` an error with a plan that misses a requirement, or `return` it.
        cache: What was answered before, and is kept for later runs: the plan is the
            same with any; the default keeps nothing.

    Returns:
        The plan, every requirement met unless `on_miss` is `return`.

    Raises:
        InputError: If an argument can't be used.
        InfeasibleLimitsError: If no device can serve anything.
        RequirementError: If a requirement is missed; it carries the best plan.
        TimeLimitError: If the time limit came before any plan.
    """
    check_values(locals())
    rig = rig if fixed is None else fixed.on(rig)
    if take is not None:
        max_projectors, max_cameras = take.point.count
    evaluates = max_projectors is None and max_heads is None
    if max_heads is not None:
        max_projectors, max_cameras = devices_of_heads(rig, max_heads)
    elif max_projectors is None:
        max_projectors, max_cameras = standing_devices(rig)
    wishes = Wishes(
        max_projectors=max_projectors,
        max_cameras=max_cameras,
        max_heads=max_heads,
        target=target,
        dominant_coverage=dominant_coverage,
        coverage=coverage,
        min_reachable=min_reachable,
        region_coverage=region_coverage,
        accuracy_mm=accuracy_mm,
        accuracy_of=accuracy_of,
        up=up,
        ring_axis=ring_axis,
        robust=robust,
        views=views,
        survive=survive,
        joint=joint,
        pattern=pattern_of_rig(rig, pattern),
    )
    # BLAS must not split sums differently with another number of threads.
    with (
        shown(progress) as report,
        (clock := Stopwatch(report, time_limit=time_limit)).ticking(),
        threadpool_limits(1),
    ):
        request = replace(
            request_of(
                *(mesh, rig, wishes, clock),
                select=select,
                weight=weight,
                align=align,
                family_quantile=family_quantile,
                cache=cache,
            ),
            seed=seed,
            threads=threads or n_threads(),
            command=tuple(command),
            prove=prove,
            cameras_by=cameras_by,
            mounted=fixed,
            evaluates=evaluates,
        )
        check_request(request)
        if request.family is not None:
            if take is not None:
                raise InputError("take is a point of one mesh's front: give one mesh")
            return _of_family(request, clock, keep, checked, check, on_miss)
        planned = jointly(_evaluated if evaluates else robustly(_planned))
        if wishes.pattern == "none":
            planned = planned_alone
        if take is not None:
            planned = take.planned
        plan, partial = planned(request, clock, keep)
        if check and not plan.document.truncated:
            plan = checked_plan(plan, request.threads, clock, keep, checked)
            if partial is not None and axes_may_help(plan, partial):
                clock.say("  centred ring axes don't pass the check: free ones")
                freed = replace(request, axis_wanted="free")
                other, partial = planned(freed, clock, keep)
                if not other.document.truncated:
                    other = checked_plan(other, request.threads, clock, keep, checked)
                    plan = plan if missed_by(other, check=True) else other
    missed = missed_by(plan, check=check)
    if missed and on_miss == "raise":
        raise RequirementError(plan, missed)
    return plan


def _of_family(
    request: PlanRequest,
    clock: Stopwatch,
    keep: Keep | None,
    checked: Checked | None,
    check: bool,
    on_miss: Literal["raise", "return"],
) -> RigPlan:
    """The rig of a family, each member's plan checked by itself."""
    plan, _ = best_kept(family_sought(request, clock), FamilyDraft.of, clock, keep)
    if check and not plan.document.truncated:
        members = [
            checked_plan(member, request.threads, clock, None, checked)
            for member in plan.members
        ]
        plan = with_members(plan, members)
    missed = missed_by(plan, check=check)
    if missed and on_miss == "raise":
        raise RequirementError(plan, missed)
    return plan


def _evaluated(
    request: PlanRequest, clock: Stopwatch, keep: Keep | None
) -> tuple[RigPlan, PartialPlan]:
    """The devices as they stand, and their rings."""
    partial = as_they_stand(prepared(request, clock), clock)
    return write_plan(partial, clock), partial


def _planned(
    request: PlanRequest, clock: Stopwatch, keep: Keep | None
) -> tuple[RigPlan, PartialPlan]:
    """What the rig is planned by, and the best plan kept."""
    if request.wishes.max_heads is not None:
        search = heads_sought(request, clock)
    elif request.rig.turntable is not None:
        search = steps_sought(request, clock)
    else:
        search = _devices_sought(request, clock)
    return best_kept(search, Draft.of, clock, keep)


def _devices_sought(
    request: PlanRequest, clock: Stopwatch
) -> Search[PartialPlan, Draft]:
    """Devices, rings and proofs; one device more where fresh samples fall short.

    Fewer cameras are sought once for the same axes: denied ones would be found again.
    """
    larger: PartialPlan | None = _first_plan(request, clock)
    sought = False
    while larger is not None:
        yield larger, False
        partial = polished(larger, clock)
        yield partial, False
        partial = bounded_cameras(partial, clock)
        if not sought and (larger := with_fewer_cameras(partial, clock)):
            sought = True
            continue
        draft = yield partial, True
        assert draft is not None
        larger = with_free_axes(partial, draft, clock)
        larger = larger or one_more_for_losses(partial, draft, clock)
        larger = larger or one_device_more(partial, draft, clock)
        same = larger and (larger.projectors, larger.axes)
        sought = same == (partial.projectors, partial.axes)


def _first_plan(request: PlanRequest, clock: Stopwatch) -> PartialPlan:
    """Sections III and VI: regions, projectors, cameras; each the fewest."""
    check_fields(request.rig.fits(request.mesh))
    ready = prepared(request, clock)
    stage = bounded_projectors(ready, first_projectors(ready, clock), clock)
    if ready.scene.requirements.survival is not None:
        return placed_to_survive(ready, stage, clock)
    return placed(ready, stage, clock)
