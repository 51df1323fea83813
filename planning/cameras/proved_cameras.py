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
    proof = stage.certificate
    given = proof.given
    n = min(len(stage.rows.target), effort.most_samples or len(stage.rows.target))
    reached = np.any(stage.measured[:n], axis=1)
    free = np.any(stage.measured[:n, :given], axis=1)
    rest = np.flatnonzero(reached & ~free)
    if proof.needed.count <= given or not rest.size:
        entry = enough(proof, np.any(stage.measured, axis=1))
        return replace(stage, certificate=proof.changed(continuous=entry))
    required = required_samples(reached, scene.requirements.coverage)
    bound = bound_cameras(
        scene,
        device,
        taken(stage.rows, rest, stage.rows.lit),
        max(required - int(free.sum()), 0),
        proof.needed.count - given,
        effort,
        n_samples=n,
        row_area_m2=stage.rows.target.samples.weight * len(stage.rows.target) / n,
    )
    bound = replace(bound, given=given, n_free=int(free.sum()))
    return replace(stage, certificate=joined(proof, bound.proof()))
