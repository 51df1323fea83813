"""A plan with other cameras, or more, where too few drawn rigs meet what is asked."""

from dataclasses import replace

from planning.cameras.surer_cameras import Aim, surer_cameras
from planning.model.progress import Stopwatch
from planning.proofs.candidate_certificate import counted
from planning.report.partial_plan import PartialPlan
from planning.rings.ring_stage import space_rings


def surer(partial: PartialPlan, aim: Aim, clock: Stopwatch) -> PartialPlan | None:
    """Return the plan with surer cameras and their rings; None: it has them already.

    Projectors and ring axes stay, so that the bound on cameras stays true.
    """
    before, request, stage = partial.cameras, partial.request, partial.camera_stage
    projectors, samples = partial.projectors, stage.cover.samples
    with clock.stage("surer", "cameras that make drawn rigs surer"):
        cameras = surer_cameras(
            partial.scene, projectors, stage, before, aim, request.rig.n_camera_poses
        )
        if all(new in before for new in cameras):
            return None
        rings = space_rings(
            partial.scene.among((*projectors, *cameras)),
            projectors,
            cameras,
            request.rig.rings.spacing,
            samples,
            margin=request.ring_margin,
        )
        clock.say(f"  {len(before)} -> {len(cameras)} cameras")
    reachable = stage.cover.measured.any(axis=1).sum() * samples.target.samples.weight
    stage = replace(counted(stage, cameras, float(reachable)), cameras=cameras)
    return replace(partial, camera_stage=stage, cameras=cameras, rings=rings)
