"""The bound over all poses for cameras alone: what is seen but once takes fewer.

Of cameras that measure a sample at least K see it, so that all but any K - 1 of them
still see all that is measured. With n_1 the fewest cameras, from any poses, of which
one sees enough of the samples::

    n >= n_1 + K - 1

n_1 is bounded over cells of poses (`proofs.camera_bound`) by the limits that one camera
has; what pairs ask of angles and deviations is left out.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from geometry.devices import PinholeModel
from planning.proofs.all_poses import BoundQuestion, Effort, joined
from planning.proofs.camera_bound import bound_cameras
from planning.proofs.quotas import RegionFloors
from planning.scene.measuring.measured import LitSamples
from planning.scene.scene import Scene

from .measured_views import views_of
from .view_stage import ViewStage


def bound_views(
    scene: Scene,
    stage: ViewStage,
    devices: Sequence[PinholeModel],
    effort: Effort,
) -> ViewStage:
    """Return the stage with the bound over all poses in its certificate.

    Existing cameras may be one of two, so that what they measure isn't free of more
    cameras: nothing is proved with them.
    """
    proof, target, measured = stage.certificate, stage.target, stage.cover
    if proof.given:
        return stage
    n = min(len(target), effort.most_samples or len(target))
    reached = measured.covered(np.arange(measured.covers.shape[1]))[:n]
    spare = views_of(scene.requirements) - 1
    question = BoundQuestion.about(
        proof,
        reached,
        np.zeros(n, dtype=bool),
        scene.requirements.coverage,
        target.samples.weight * len(target),
        RegionFloors.none(n),
    )
    question = replace(question, count=max(1, question.count - spare))
    some = target.take(np.flatnonzero(reached))
    lit = LitSamples.of((), some, np.zeros((len(some), 0), dtype=bool))
    found = bound_cameras(scene, devices, lit, question, effort).proof()
    words = f"{found.proof}; of one view each, and {spare} more"
    bound = found.changed(lower_bound=found.lower_bound + spare, proof=words)
    return replace(stage, certificate=joined(proof, bound))
