"""Devices that are evaluated as they stand, with what candidates would reach."""

from dataclasses import replace

from planning.cameras.axis_choice import standing_axes
from planning.cameras.camera_cover import CameraCover, candidate_cover, measured_of
from planning.cameras.proved_cameras import CameraStage
from planning.model.document.ring_records import AxisTaken
from planning.model.progress import Stopwatch
from planning.projectors.candidate_set import CandidateSet
from planning.projectors.exposures import with_exposures
from planning.projectors.projector_stage import ProjectorStage
from planning.proofs.candidate_certificate import unproved, unsought
from planning.report.partial_plan import PartialPlan, Prepared
from planning.rings.ring_stage import space_rings
from planning.scene.draws import DRAWS

from .prepare import offered


def as_they_stand(ready: Prepared, clock: Stopwatch) -> PartialPlan:
    """Return the existing devices with their rings, and what candidates would reach."""
    request, scene = ready.request, ready.scene
    with clock.stage("projectors", "projectors: what they light as they stand"):
        poses, views = offered(ready)
        samples = scene.target_samples(DRAWS.projectors)
        candidates = CandidateSet.over(scene, samples, poses)
        projectors = candidates.projectors[: candidates.n_existing]
        projectors = with_exposures(scene, projectors)
        proof = unproved(candidates.cover, candidates.samples.samples.weight)
        stage = ProjectorStage(
            {len(projectors): projectors}, proof, projectors, candidates
        )
    with clock.stage("cameras", "cameras: what they measure as they stand"):
        cameras = views.cameras[: len(scene.requirements.existing_of("camera"))]
        target = scene.target_samples(DRAWS.cameras)
        asked, margin = request.ring_axis, request.ring_margin
        axes: AxisTaken | None = None
        if asked is not None:
            projectors, axes = standing_axes(
                scene, projectors, views, target, axis=asked, margin=margin
            )
        samples, measured = measured_of(scene, projectors, views, target)
        cover = candidate_cover(scene, measured, samples, views.cameras)
        proof = unproved(cover, target.samples.weight)
        camera_stage = CameraStage(
            {len(cameras): cameras},
            proof,
            cameras,
            CameraCover(views, samples, measured, unsought(cover)),
        )
    partial = PartialPlan(ready, stage, projectors, camera_stage, cameras, axes=axes)
    if asked is None:
        return partial
    with clock.stage("rings", "rings: radii for the surface and the cameras"):
        spacing = request.rig.rings.spacing
        rings = space_rings(scene, projectors, cameras, spacing, samples, margin=margin)
    return replace(partial, rings=rings)
