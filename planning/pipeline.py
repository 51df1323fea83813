"""From mesh to checked plan, read top to bottom like the paper's III to VI."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from geometry.curvature import principal_curvatures
from geometry.mesh import TriangleMesh
from geometry.regions import DominantRegions, dominant_regions

from . import document as write
from .baselines import baseline_rows
from .camera_stage import place_cameras, spread
from .cameras import CameraStage
from .claims import Claims, Rig, make_claims
from .cost import cost_entry
from .errors import (
    InputError,
    InterruptedPlanError,
    RequirementError,
    TimeLimitError,
)
from .marginal import camera_table, projector_table
from .plan import FORMAT, VERSION, PlannedCamera, PlannedProjector, RigPlan
from .progress import Report, Stopwatch
from .projector_poses import widen_margins
from .projectors import ProjectorStage, plan_projectors
from .relaxations import reachability_relaxations
from .requirements import Requirements
from .rig import Rig as RigModel
from .ring_axes import widest_gap
from .rings import outer_radius, ring_gap, uniform_radii
from .scene import Scene
from .seams import overlap_components
from .selection import larger
from .shortfall import shortfalls
from .surface import Surface
from .verification import verify_plan

# Upwards in the image: where the ring axis points until the cameras are known.
_FIRST_AZIMUTH = -float(np.pi / 2)


@dataclass(frozen=True, eq=False)
class Order:
    """What was ordered: the mesh, the rig, and how to go about it.

    Attributes:
        mesh: The surface.
        rig: Devices and limits.
        asked: Keyword arguments of `Rig.requirements`.
        seed: Of every random draw.
        threads: Worker threads.
        command: Words of the command line, for the record.
    """

    mesh: TriangleMesh
    rig: RigModel
    asked: dict[str, Any]
    seed: int
    threads: int
    command: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Draft:
    """All stages as far as they came; enough to write a plan from."""

    order: Order
    scene: Scene
    regions: DominantRegions
    curvature_radius_m: float
    tilt: float
    stage: ProjectorStage
    projectors: tuple[PlannedProjector, ...]
    camera_stage: CameraStage
    cameras: tuple[PlannedCamera, ...]
    truncated: bool = False


def plan_rig(
    mesh: TriangleMesh | Sequence[TriangleMesh],
    rig: RigModel,
    *,
    max_projectors: int,
    max_cameras: int | None = None,
    target: Literal["dominant", "surface"] = "dominant",
    dominant_coverage: float | None = None,
    coverage: float | None = None,
    min_reachable: float | None = None,
    accuracy_mm: float | None = None,
    up: str | None = None,
    seed: int = 0,
    threads: int = 2,
    check: bool = True,
    time_limit: float | None = None,
    progress: Report | None = None,
    command: Sequence[str] = (),
) -> RigPlan:
    """Plan the projectors and cameras that measure a surface, and check the plan.

    Args:
        mesh: The surface, in metres; one for now.
        rig: Devices and limits, from `load_rig`.
        max_projectors: Projectors at most.
        max_cameras: Cameras at most; None: as many as the coverage needs.
        target: The `dominant` regions, or the whole `surface`.
        dominant_coverage: Lit / reachable by projectors; None: the rig's.
        coverage: Measured / reachable by cameras; None: the rig's.
        min_reachable: Reachable by projectors / target; None: the rig's.
        accuracy_mm: Largest standard deviation along the normal [mm]; None: the rig's.
        up: Axis that points up, `z` or `-y` and so on; None: the rig's.
        seed: The same seed gives the same plan.
        threads: Worker threads; no result depends on it.
        check: Whether the plan is audited and reconstructed from pixels.
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
    order = Order(
        _single(mesh),
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
    )
    clock = Stopwatch(progress, time_limit=time_limit)
    # BLAS must not split sums differently with another number of threads.
    with threadpool_limits(1):
        plan = _plan(order, clock, check=check)
    missed = shortfalls(plan.document, plan.requirements)
    if missed:
        raise RequirementError(plan, missed)
    return plan


def _plan(order: Order, clock: Stopwatch, *, check: bool) -> RigPlan:
    draft = _first_draft(order, clock)
    try:
        draft = _polish(draft, clock)
        plan = _write(draft, clock)
        while (larger := _one_more(draft, plan, clock)) is not None:
            draft = _polish(larger, clock)
            plan = _write(draft, clock)
        return _checked(plan, draft, clock) if check else plan
    except (KeyboardInterrupt, TimeLimitError) as cut:
        return _interrupted(draft, clock, cut)


def _first_draft(order: Order, clock: Stopwatch) -> Draft:
    """Sections III and VI: regions, projectors, cameras; each the fewest."""
    mesh, rig = order.mesh, order.rig
    with clock.stage("regions", "curvature and dominant regions"):
        field = principal_curvatures(mesh)
        regions = dominant_regions(mesh, field)
        target = order.asked["target"]
        clock.say(f"  {len(regions)} regions, {regions.dominant_share:.1%} of the area")
    requirements, radii, tilt = _resolve(order)
    scene = Scene(
        mesh,
        regions.face_region,
        _steep(regions, target),
        requirements,
        order.seed,
        order.threads,
    )
    with clock.stage("projectors", "projectors: candidates and cover"):
        template = PlannedProjector(
            "", rig.light, np.eye(4), np.eye(4), rig.projector_device(), radii
        )
        stage = plan_projectors(
            scene,
            template,
            max(rig.n_candidate_projectors, rig.n_reference_projectors),
            ring_offset=(tilt, _FIRST_AZIMUTH),
        )
        clock.say(
            f"  {len(stage.projectors)} of {len(stage.reference)} candidates; at least "
            f"{stage.certificate['candidates']['lower_bound']} are needed"
        )
    projectors, cameras = _placed(order, scene, stage, tilt, clock)
    return Draft(
        order,
        scene,
        regions,
        field.radius,
        tilt,
        stage,
        projectors,
        cameras,
        cameras.cameras,
    )


def _placed(
    order: Order, scene: Scene, stage: ProjectorStage, tilt: float, clock: Stopwatch
) -> tuple[tuple[PlannedProjector, ...], CameraStage]:
    """Poses of widest margin for chosen projectors, and the cameras for them."""
    rig = order.rig
    with clock.stage("projector_poses", "projector poses: widest margins"):
        projectors = widen_margins(scene, stage)
    with clock.stage("cameras", "cameras: candidates, measurability and cover"):
        n_cameras = max(rig.n_candidate_cameras, rig.n_reference_cameras)
        camera = PlannedCamera("", np.eye(4), rig.camera_device())
        solution = place_cameras(scene, projectors, camera, n_cameras, tilt)
        cameras = solution.stage
        clock.say(
            f"  {len(cameras.cameras)} of {len(cameras.reference)} candidates; at "
            f"least {cameras.certificate['candidates']['lower_bound']} are needed"
        )
    return solution.projectors, cameras


def _one_more(draft: Draft, plan: RigPlan, clock: Stopwatch) -> Draft | None:
    """One device more where fresh samples don't confirm a cover that met its rows.

    The proved bound stays what it is; the count is then above it, and says so.
    """
    asked, areas = plan.requirements, plan.coverage["target"]
    if _short(areas, "lit_m2", "reachable_by_projectors_m2", asked.dominant_coverage):
        stage = larger(draft.stage, draft.stage.projectors, asked.max_projectors)
        if stage is not None:
            clock.say("  fresh samples fall short: one projector more")
            stage = replace(
                stage, projectors=stage.by_count[stage.certificate["count"]]
            )
            projectors, cameras = _placed(
                draft.order, draft.scene, stage, draft.tilt, clock
            )
            return replace(
                draft,
                stage=stage,
                projectors=projectors,
                camera_stage=cameras,
                cameras=cameras.cameras,
            )
    if _short(areas, "measured_m2", "reachable_by_cameras_m2", asked.coverage):
        cameras = larger(draft.camera_stage, draft.cameras, asked.max_cameras)
        if cameras is not None:
            clock.say("  fresh samples fall short: one camera more")
            chosen = cameras.by_count[cameras.certificate["count"]]
            cameras = replace(cameras, cameras=chosen)
            return replace(draft, camera_stage=cameras, cameras=chosen)
    return None


def _short(areas: dict[str, float], part: str, whole: str, share: float) -> bool:
    return areas[part] < share * areas[whole]


def _polish(draft: Draft, clock: Stopwatch) -> Draft:
    """Section VI: neighbouring cameras slide apart while the coverage holds."""
    with clock.stage("baselines", "baselines: cameras slide apart"):
        moved = spread(draft.scene, draft.projectors, draft.camera_stage)
        if moved.smallest_before_m is not None and moved.smallest_after_m is not None:
            clock.say(
                f"  smallest baseline {1e3 * moved.smallest_before_m:.0f} -> "
                f"{1e3 * moved.smallest_after_m:.0f} mm"
            )
    return replace(draft, cameras=moved.cameras)


def _interrupted(
    draft: Draft, clock: Stopwatch, cut: KeyboardInterrupt | TimeLimitError
) -> RigPlan:
    """Write the best plan so far, marked truncated."""
    clock.lift()
    plan = _write(replace(draft, truncated=True), clock)
    if isinstance(cut, KeyboardInterrupt):
        raise InterruptedPlanError(plan) from None
    return plan


def _resolve(order: Order) -> tuple[Requirements, Any, float]:
    """Return the requirements, the ring radii, and the tilt or shift of ring axes."""
    mesh, rig = order.mesh, order.rig
    requirements = rig.requirements(
        mesh.centre, mesh.radius, **order.asked, tau_m=rig.standoff_m
    )
    projector, camera = rig.projector_device(), rig.camera_device()
    parallel = rig.light == "parallel"
    tilt = rig.ring_shift_m if parallel else rig.ring_tilt_rad
    workspace = requirements.workspace
    gap = rig.ring_gap_m or ring_gap(
        projector, camera, requirements.triangulation, rig.standoff_m
    )
    outer = outer_radius(
        projector,
        tilt,
        mesh.radius,
        workspace.projector_radius_m[0],
        rig.outer_ring_radius(),
    )
    radii = uniform_radii(outer, gap if parallel else gap / rig.standoff_m)
    workspace = replace(workspace, reference_ring_radius=float(radii[-1]))
    return replace(requirements, workspace=workspace), radii, tilt


def _write(draft: Draft, clock: Stopwatch) -> RigPlan:
    """Round the poses, recompute every claim from them, and write the document."""
    projectors = tuple(
        write.rounded_projector(p, f"P{i}") for i, p in enumerate(draft.projectors, 1)
    )
    cameras = tuple(
        write.rounded_camera(c, f"C{i}") for i, c in enumerate(draft.cameras, 1)
    )
    reference = tuple(write.rounded_projector(p, "") for p in draft.stage.reference)
    reference_cameras = tuple(
        write.rounded_camera(c, "") for c in draft.camera_stage.reference
    )
    rig = Rig(projectors, cameras, reference, reference_cameras)
    scene = draft.scene
    with clock.stage("claims", "coverage, recomputed from the rounded poses"):
        claims = make_claims(scene, rig)
        marginal = [
            *projector_table(scene, rig, draft.stage.by_count, claims),
            *camera_table(scene, rig, draft.camera_stage.by_count, claims),
        ]
    surface = Surface(
        scene.mesh,
        np.zeros(len(scene.mesh.faces), dtype=np.int64),
        scene.region,
        scene.steep,
        np.stack([p.world_from_device for p in reference]),
        np.stack([p.world_from_ring for p in reference]),
        np.stack([c.world_from_device for c in reference_cameras]),
    )
    requirements = _final_requirements(draft, claims, rig)
    document = _document(draft, clock, rig, claims, requirements, marginal, surface)
    plan = RigPlan(document, surface)
    areas = document["coverage"]["target"]
    reachable, whole = "reachable_by_projectors_m2", "area_m2"
    if _short(areas, reachable, whole, requirements.min_reachable):
        with clock.stage("relaxations", "what would help"):
            document["coverage"]["relaxations"] = reachability_relaxations(
                scene, reference
            )
    return plan


def _final_requirements(draft: Draft, claims: Claims, rig: Rig) -> Requirements:
    """State tau, one ring gap, and the reference sets as they are."""
    requirements = draft.scene.requirements
    workspace = replace(
        requirements.workspace,
        n_reference_projectors=len(rig.reference_projectors),
        n_reference_cameras=len(rig.reference_cameras),
    )
    gap = widest_gap(draft.scene, rig.projectors, claims.target_samples)
    check = replace(requirements.check, tau_m=round(gap, 6))
    return replace(requirements, workspace=workspace, check=check)


def _document(
    draft: Draft,
    clock: Stopwatch,
    rig: Rig,
    claims: Claims,
    requirements: Requirements,
    marginal: list[dict[str, Any]],
    surface: Surface,
) -> dict[str, Any]:
    samples = claims.target_samples.samples
    coverage = write.coverage_entry(claims)
    regions = [
        {
            "id": region.id,
            "area_m2": region.area_m2,
            "n_faces": len(region.faces),
            "mean_normal": region.mean_normal.tolist(),
            "cone_angle": region.cone_angle,
            "mean_curvedness": region.mean_curvedness,
            **entry,
        }
        for region, entry in zip(draft.regions, claims.regions, strict=True)
    ]
    greedy = draft.camera_stage.certificate["greedy_count"]
    return {
        "format": FORMAT,
        "version": VERSION,
        "units": {"length": "m", "angle": "rad"},
        "seed": draft.order.seed,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "command": list(draft.order.command),
        "truncated": draft.truncated,
        "meshes": [write.mesh_entry(draft.scene.mesh)],
        "surface": {
            "path": "surface.npz",
            "sha256": surface.sha256(),
            "curvature_radius_m": draft.curvature_radius_m,
            "dominant_share": draft.regions.dominant_share,
        },
        "rig": draft.order.rig.to_document(),
        "requirements": requirements.to_document(),
        "regions": regions,
        "projectors": write.projector_entries(rig.projectors, claims),
        "cameras": write.camera_entries(rig.cameras, claims),
        "coverage": coverage,
        "marginal": marginal,
        "certificates": {
            "projectors": draft.stage.certificate,
            "cameras": draft.camera_stage.certificate,
        },
        "baselines": baseline_rows(
            rig.cameras,
            samples.points,
            samples.normals,
            claims.measured_by,
            samples.weight,
            requirements.camera.max_incidence,
        ),
        "camera_groups": [
            [rig.cameras[c].id for c in group]
            for group in overlap_components(claims.measured_by, samples.weight)
        ],
        "cost": cost_entry(rig.cameras, greedy, clock.seconds),
        "members": [
            {
                "mesh": 0,
                "coverage": coverage,
                "regions": [region["id"] for region in regions],
                "reconstruction": None,
            }
        ],
        "reconstruction": None,
        "timings_s": dict(clock.seconds),
    }


def _checked(plan: RigPlan, draft: Draft, clock: Stopwatch) -> RigPlan:
    """Audit the written plan and reconstruct it from pixels, with foreign code."""
    with clock.stage("check", "check: audit, then reconstruction from pixels"):
        verification = verify_plan(
            plan, threads=draft.order.threads, progress=clock.say
        )
    found = verification.reconstruction
    entry = None if found is None else found.to_document()
    if entry is not None:
        false = list(verification.audit.failures)
        entry["failures"] = [*false, *entry["failures"]]
        entry["passed"] = entry["passed"] and not false
    greedy = draft.camera_stage.certificate["greedy_count"]
    seconds = clock.seconds | ({} if found is None else found.seconds)
    document = plan.document | {
        "reconstruction": entry,
        "members": [plan.document["members"][0] | {"reconstruction": entry}],
        "timings_s": dict(clock.seconds),
        "cost": cost_entry(plan.cameras, greedy, seconds),
    }
    return RigPlan(document, plan.surface)


def _single(mesh: TriangleMesh | Sequence[TriangleMesh]) -> TriangleMesh:
    if isinstance(mesh, TriangleMesh):
        return mesh
    if len(mesh) != 1:
        raise InputError(
            f"{len(mesh)} meshes: one rig for several isn't built yet, give one"
        )
    return mesh[0]


def _steep(regions: DominantRegions, target: str) -> NDArray[np.float64]:
    """T1 of each face of the target; zero elsewhere, where it binds nothing."""
    if target == "surface":
        return regions.steep
    return np.where((regions.face_region >= 0)[:, None], regions.steep, 0.0)
