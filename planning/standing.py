"""A rig as it stands: nothing is sought or moved, only rings are spaced."""

from dataclasses import replace

import numpy as np

from planning.cameras.axis_choice import standing_axes
from planning.cameras.camera_cover import (
    CameraCover,
    camera_candidate_views,
    candidate_cover,
    measured_of,
)
from planning.cameras.proved_cameras import CameraStage
from planning.model.device_poses import moved_to
from planning.model.planned import PlannedProjector
from planning.model.progress import Stopwatch
from planning.projectors.candidate_set import (
    CandidateSet,
    CandidateSource,
)
from planning.projectors.projector_stage import ProjectorStage
from planning.proofs.candidate_certificate import unproved
from planning.proofs.selection import CandidateCover, Selection
from planning.report.partial_plan import PartialPlan, Prepared
from planning.rings.ring_stage import space_rings
from planning.scene.camera_views import CandidateViews
from planning.scene.draws import DRAWS
from planning.scene.placed_bodies import existing_devices


def as_they_stand(ready: Prepared, clock: Stopwatch) -> PartialPlan:
    """Return the existing devices with their rings, and what candidates would reach."""
    request, scene = ready.request, ready.scene
    with clock.stage("projectors", "projectors: what they light as they stand"):
        offered, views = _offered(ready)
        samples = scene.target_samples(DRAWS.projectors)
        candidates = CandidateSet.over(scene, samples, offered)
        projectors = candidates.projectors[: candidates.n_existing]
        proof = unproved(candidates.cover, candidates.samples.samples.weight)
        stage = ProjectorStage(
            {len(projectors): projectors}, proof, projectors, candidates
        )
    with clock.stage("cameras", "cameras: what they measure as they stand"):
        cameras = views.cameras[: len(scene.requirements.existing_of("camera"))]
        target = scene.target_samples(DRAWS.cameras)
        asked, margin = request.ring_axis, request.ring_margin
        projectors, axes = standing_axes(
            scene, projectors, views, target, axis=asked, margin=margin
        )
        samples, measured = measured_of(scene, projectors, views, target)
        cover = candidate_cover(scene, measured, samples)
        proof = unproved(cover, target.samples.weight)
        camera_stage = CameraStage(
            {len(cameras): cameras},
            proof,
            cameras,
            CameraCover(views, samples, measured, _standing(cover)),
        )
    with clock.stage("rings", "rings: radii for the surface and the cameras"):
        spacing = request.rig.rings.spacing
        rings = space_rings(scene, projectors, cameras, spacing, samples, margin=margin)
    return PartialPlan(
        ready, stage, projectors, camera_stage, cameras, axes=axes, rings=rings
    )


def _offered(ready: Prepared) -> tuple[tuple[PlannedProjector, ...], CandidateViews]:
    """Existing devices and poses that define what is reachable: a plan's own, or new.

    A plan's devices reach what they reached there.
    """
    scene, rig, mounted = ready.scene, ready.request.rig, ready.request.mounted
    required = scene.requirements
    known = None if mounted is None else mounted.reference(required.workspace)
    if known is None:
        source = CandidateSource(scene, ready.template)
        views = camera_candidate_views(scene, ready.camera, rig.n_camera_poses)
        return source.lattice(rig.n_projector_poses), views
    frames = zip(known.reference_projectors, known.reference_rings, strict=True)
    projectors = (
        replace(ready.template, world_from_device=pose, world_from_ring=ring)
        for pose, ring in frames
    )
    cameras = (moved_to(ready.camera, pose) for pose in known.reference_cameras)
    return (
        (*existing_devices(required, ready.template), *projectors),
        CandidateViews(scene, (*existing_devices(required, ready.camera), *cameras)),
    )


def _standing(cover: CandidateCover) -> Selection:
    """The existing devices as a selection that nothing was proved of."""
    chosen = np.arange(cover.n_existing)
    n_covered = cover.n_covered(chosen)
    met = cover.enough(chosen)
    return Selection(
        chosen,
        chosen,
        0,
        "feasible" if met else "infeasible",
        "",
        cover.required,
        n_covered,
        n_covered,
    )
