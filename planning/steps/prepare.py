"""What stands before any device does: request, target, limits and rings."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from geometry.curvature.curvature import (
    CurvatureField,
    know_curvatures,
    principal_curvatures,
)
from geometry.devices import DeviceModel
from geometry.mesh.bearing import bearing
from geometry.rays.rays import RayCaster
from geometry.regions.regions import DominantRegions, dominant_regions
from geometry.regions.selected_regions import regions_of_faces
from geometry.repair.hollow import outside_faces
from planning.cameras.camera_cover import camera_candidate_views
from planning.model.devices.device_poses import moved_to
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.errors import InputError
from planning.model.progress import Stopwatch
from planning.model.requirements import Requirements
from planning.model.words import count_words
from planning.projectors.candidate_set import CandidateSource
from planning.report.partial_plan import PlanRequest, Prepared
from planning.rig.rig import Rig
from planning.rings.ring_radii import uniform_radii, widest_ring_gap
from planning.scene.bodies.clearance import check_existing_clearance
from planning.scene.lights import light_of, ring_frame
from planning.scene.measuring.camera_views import CandidateViews
from planning.scene.placed_bodies import Obstruction, existing_devices
from planning.scene.scene import Scene


def prepared(request: PlanRequest, clock: Stopwatch) -> Prepared:
    """Find the regions and state what is asked.

    Raises:
        InputError: If nothing is curved enough to be a target.
        RigError: If an obstacle's file can't be read.
        InfeasibleLimitsError: If limits exclude each other.
    """
    return prepared_for(request, *asked(request), clock)


def asked(request: PlanRequest) -> tuple[Requirements, NDArray[np.float64]]:
    """State what is asked, and the ring radii: what the rig has in vain comes first.

    Raises:
        InputError: If what is asked can't be together.
        InfeasibleLimitsError: If limits exclude each other.
    """
    rig = request.rig
    if request.cameras_by == "paper" and len(rig.camera_models) > 1:
        raise InputError(
            f"cameras_by = 'paper': the paper's route is of cameras of one model, rig "
            f"{rig.name!r} has {len(rig.camera_models)}; take 'cover' or 'both'"
        )
    return _resolve(request)


def prepared_for(
    request: PlanRequest,
    requirements: Requirements,
    radii: NDArray[np.float64],
    clock: Stopwatch,
) -> Prepared:
    """Find the regions of a mesh of which it is known what is asked.

    Raises:
        InputError: If nothing is curved enough to be a target.
        RigError: If an obstacle's file can't be read.
        InfeasibleLimitsError: If existing devices lack clearance.
    """
    mesh, rig = request.mesh, request.rig
    obstacles = rig.obstacles(requirements.workspace, mesh)
    with clock.stage("regions", "curvature and dominant regions"):
        field = request.cache.recall(
            "principal_curvatures", (mesh,), lambda: principal_curvatures(mesh)
        )
        # The report asks for them, too.
        know_curvatures(mesh, field)
        regions = _regions(request, field)
        found = count_words(len(regions), "region")
        clock.say(f"  {found}, {regions.dominant_share:.1%} of the area")
    scene = Scene(
        mesh,
        regions.face_region,
        regions.steep_on(request.wishes.target),
        requirements,
        request.seed,
        request.threads,
        clock.check,
        obstructions=Obstruction.about(mesh, obstacles, request.threads),
        cache=request.cache,
    )
    code = rig.table.dense.code() if requirements.pattern == "dense" else None
    templates = tuple(
        PlannedProjector(
            "",
            rig.light,
            np.eye(4),
            np.eye(4) if code else _first_rings(rig, model.device),
            model.device,
            radii,
            body=model.body,
            pattern=requirements.pattern,
            model=model.name,
            code=code,
        )
        for model in (
            (*rig.projector_models,) if requirements.pattern != "none" else ()
        )
    )
    cameras = tuple(
        PlannedCamera("", np.eye(4), device, body=model.body, model=model.name)
        for model, device in zip(rig.camera_models, rig.optics[1], strict=True)
    )
    if requirements.existing and not request.evaluates:
        check_existing_clearance(scene, templates, cameras)
    return Prepared(request, scene, regions, field.radius, templates, cameras)


def _first_rings(rig: Rig, device: DeviceModel) -> NDArray[np.float64]:
    """A ring frame that leans upwards in the image until cameras are known."""
    return ring_frame(np.eye(4), device, rig.ring_offset, -0.5 * np.pi)


def _regions(request: PlanRequest, field: CurvatureField) -> DominantRegions:
    """The user's selection, what lies outside, or else the most curved surface."""
    if request.interest is not None:
        return regions_of_faces(request.mesh, field, request.interest.chosen)
    if request.wishes.target == "outside":
        return _regions_outside(request, field)
    regions = request.cache.recall(
        "dominant_regions",
        (request.mesh,),
        lambda: dominant_regions(request.mesh, field),
    )
    if request.wishes.target != "surface" and not len(regions):
        raise InputError(
            "no dominant region: the surface is flat where its curvature can be "
            "trusted; use --target surface, or choose faces with --select"
        )
    return regions


def _regions_outside(request: PlanRequest, field: CurvatureField) -> DominantRegions:
    mesh = request.mesh
    outside = request.cache.recall(
        "outside_faces",
        (mesh,),
        lambda: outside_faces(RayCaster(mesh, threads=request.threads)),
    )
    if not outside.any():
        raise InputError(
            "no face lies outside: each sees too little of what is about the mesh; "
            "choose faces with --select"
        )
    return regions_of_faces(mesh, field, outside)


def _resolve(request: PlanRequest) -> tuple[Requirements, NDArray[np.float64]]:
    """Return the requirements and the ring radii; without rings there are none."""
    mesh, rig = request.mesh, request.rig
    requirements = rig.requirements(
        mesh.centre, mesh.radius, request.wishes, tau_m=rig.standoff_m
    )
    x, y, z = bearing(mesh, np.array(requirements.workspace.axis)).tolist()
    if requirements.pattern != "rings":
        workspace = replace(
            requirements.workspace, reference_ring_radius=0.0, bearing=(x, y, z)
        )
        return replace(requirements, workspace=workspace), np.zeros(0)
    light, offset = light_of(rig.projector_device()), rig.ring_offset
    workspace = requirements.workspace
    gap = rig.ring_gap_m or widest_ring_gap(
        *rig.optics, requirements.triangulation, rig.standoff_m
    )
    corner = rig.outer_ring_radius()
    nearest = workspace.projector_radius_m[0]
    outer = min(corner, light.object_ring(offset, mesh.radius, nearest))
    if workspace.projector_standoff_m is not None:
        # What is looked at from beside reaches to the corners of the image.
        outer = corner
    if request.mounted is not None:
        requirements = request.mounted.with_rings(requirements)
    for kept in requirements.existing:
        # One outermost ring for all, no narrower than rings that stay.
        outer = max((outer, *kept.ring_radii[-1:]))
    radii = uniform_radii(outer, light.ring_step(gap, rig.standoff_m))
    workspace = replace(
        workspace, reference_ring_radius=float(radii[-1]), bearing=(x, y, z)
    )
    return replace(requirements, workspace=workspace), radii


def offered(ready: Prepared) -> tuple[tuple[PlannedProjector, ...], CandidateViews]:
    """Existing devices and poses that define what is reachable: a plan's own, or new.

    A plan's devices reach what they reached there.
    """
    scene, rig, mounted = ready.scene, ready.request.rig, ready.request.mounted
    required = scene.requirements
    known = None if mounted is None else mounted.reference(required.workspace)
    if known is None:
        source = CandidateSource(scene, ready.templates)
        views = camera_candidate_views(scene, ready.cameras, rig.n_camera_poses)
        return source.lattice(rig.n_projector_poses), views
    poses = zip(
        known.reference_projectors,
        known.reference_rings,
        known.models_of("projector"),
        strict=True,
    )
    projectors = (
        replace(ready.templates[model], world_from_device=pose, world_from_ring=ring)
        for pose, ring, model in poses
    )
    views = zip(known.reference_cameras, known.models_of("camera"), strict=True)
    cameras = (moved_to(ready.cameras[model], pose) for pose, model in views)
    return (
        (*existing_devices(required, ready.templates), *projectors),
        CandidateViews(scene, (*existing_devices(required, ready.cameras), *cameras)),
    )


def standing_devices(rig: Rig) -> tuple[int, int]:
    """How many projectors and cameras of a rig stand already.

    Raises:
        InputError: If none of either does.
    """
    kinds = [table.kind for table in rig.table.existing]
    counts = kinds.count("projector"), kinds.count("camera")
    if not all(counts):
        raise InputError(
            f"{count_words(counts[0], 'projector')} and "
            f"{count_words(counts[1], 'camera')} stand; a rig measures with one of "
            f"either or more: place them, or have them planned with max_projectors, or "
            f"max_heads of a [head]"
        )
    return counts
