"""The fewest projectors with their bound over all poses."""

from dataclasses import replace

import numpy as np

from planning.model.planned import PlannedProjector
from planning.proofs.all_poses import ContinuousBound, joined
from planning.proofs.existing_bound import enough, given_on
from planning.proofs.projector_bound import Effort, bound_projectors
from planning.proofs.selection import required_samples
from planning.scene.scene import Scene

from .candidate_set import CandidateSource
from .projector_stage import ProjectorStage, with_more


def prove_fewest(
    scene: Scene,
    stage: ProjectorStage,
    template: PlannedProjector,
    effort: Effort,
    *,
    ring_offset: tuple[float, float],
) -> ProjectorStage:
    """Return the stage with the bound over all poses in its certificate.

    Where the bound leaves room for fewer projectors, candidates are offered there, and
    the cover is solved again.

    Args:
        scene: Surface and requirements.
        stage: Projectors from the cover.
        template: A projector; its pose doesn't count.
        effort: What to spend on a bound.
        ring_offset: Of candidates, as `projector_candidates` takes it.
    """
    source = CandidateSource(scene, template, ring_offset)
    while stage.certificate.needed.count > stage.certificate.given:
        bound = _bound_of(scene, stage, template, effort)
        found = source.towards(bound.directions)
        better = with_more(stage, found) if found else stage
        if better is stage:
            return replace(stage, certificate=joined(stage.certificate, bound.proof()))
        stage = better
    entry = enough(stage.certificate, stage.candidates.reached)
    return replace(stage, certificate=stage.certificate.changed(continuous=entry))


def _bound_of(
    scene: Scene, stage: ProjectorStage, template: PlannedProjector, effort: Effort
) -> ContinuousBound:
    # The first samples are a draw of their own; the others came where it overfitted.
    samples = stage.candidates.samples
    n = min(len(samples), effort.most_samples or len(samples))
    reached = stage.candidates.reached[:n]
    given = given_on(scene, template, samples.take(np.arange(n)))
    free = reached & given.lit
    required = required_samples(reached, scene.requirements.dominant_coverage)
    found = bound_projectors(
        scene,
        template,
        samples.take(np.flatnonzero(reached & ~free)),
        max(required - int(free.sum()), 0),
        stage.certificate.needed.count - given.count,
        effort,
        n_samples=n,
        row_area_m2=samples.samples.weight * len(samples) / n,
    )
    return replace(found, given=given.count, n_free=int(free.sum()))
