"""The fewest cameras with their bound over all poses."""

from dataclasses import replace

import numpy as np

from geometry.devices import PinholeModel
from planning.proofs.all_poses import joined
from planning.proofs.camera_bound import CameraEffort, bound_cameras
from planning.proofs.existing_bound import enough
from planning.proofs.selection import required_samples
from planning.scene.measured import taken
from planning.scene.scene import Scene

from .camera_cover import CameraStage


def bound_stage(
    scene: Scene, stage: CameraStage, device: PinholeModel, effort: CameraEffort
) -> CameraStage:
    """Return the stage with the bound over all poses in its certificate.

    Args:
        scene: Surface and requirements.
        stage: Cameras from the cover, for the projectors and ring axes of its rows.
        device: Optics of the cameras.
        effort: What to spend.
    """
    proof, cover = stage.certificate, stage.cover
    samples, measured = cover.samples, cover.measured
    n_samples = len(samples.target)
    given = proof.given
    n = min(n_samples, effort.most_samples or n_samples)
    reached = np.any(measured[:n], axis=1)
    free = np.any(measured[:n, :given], axis=1)
    rest = np.flatnonzero(reached & ~free)
    if proof.needed.count <= given or not rest.size:
        entry = enough(proof, np.any(measured, axis=1))
        return replace(stage, certificate=proof.changed(continuous=entry))
    required = required_samples(reached, scene.requirements.coverage)
    bound = bound_cameras(
        scene,
        device,
        taken(samples, rest, samples.lit),
        max(required - int(free.sum()), 0),
        proof.needed.count - given,
        effort,
        n_samples=n,
        row_area_m2=samples.target.samples.weight * n_samples / n,
    )
    bound = replace(bound, given=given, n_free=int(free.sum()))
    return replace(stage, certificate=joined(proof, bound.proof()))
