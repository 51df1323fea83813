"""The fewest cameras with their bound over all poses."""

from dataclasses import replace

import numpy as np

from geometry.devices import PinholeModel
from planning.proofs.all_poses import (
    BoundQuestion,
    Effort,
    joined,
    with_existing_alone,
)
from planning.proofs.camera_bound import bound_cameras
from planning.scene.measured import taken
from planning.scene.scene import Scene

from .camera_cover import CameraStage


def bound_stage(
    scene: Scene, stage: CameraStage, device: PinholeModel, effort: Effort
) -> CameraStage:
    """Return the stage with the bound over all poses in its certificate.

    Args:
        scene: Surface and requirements.
        stage: Cameras from the cover, for the projectors and ring axes of its samples.
        device: Optics of the cameras.
        effort: What to spend.
    """
    proof, cover = stage.certificate, stage.cover
    samples, measured = cover.samples, cover.measured
    n_samples = len(samples.target)
    n = min(n_samples, effort.most_samples or n_samples)
    reached = np.any(measured[:n], axis=1)
    free = np.any(measured[:n, : proof.given], axis=1)
    wanted = np.flatnonzero(reached & ~free)
    if proof.needed.count <= proof.given or not wanted.size:
        n_reached = int(np.any(measured, axis=1).sum())
        return replace(stage, certificate=with_existing_alone(proof, n_reached))
    question = BoundQuestion.about(
        proof,
        reached,
        free,
        scene.requirements.coverage,
        samples.target.samples.weight * n_samples,
    )
    lit = taken(samples, wanted, samples.lit)
    bound = bound_cameras(scene, device, lit, question, effort)
    return replace(stage, certificate=joined(proof, bound.proof()))
