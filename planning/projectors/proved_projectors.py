"""The fewest projectors with their bound over all poses."""

from dataclasses import replace

import numpy as np

from planning.model.planned import PlannedProjector
from planning.proofs.all_poses import ContinuousBound, joined
from planning.proofs.existing_bound import enough, given_on
from planning.proofs.projector_bound import Effort, bound_projectors
from planning.proofs.selection import required_samples
from planning.scene.clearance import with_clearance
from planning.scene.limits.projector_limits import LIT
from planning.scene.scene import Scene
from planning.scene.workspace.candidates import projectors_towards

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
    workspace = scene.requirements.workspace
    while stage.certificate.needed.count > stage.certificate.given:
        bound = _bound_of(scene, stage, template, effort)
        found = projectors_towards(
            template,
            workspace,
            bound.directions,
            ring_offset=ring_offset,
            site=scene.site("projector", template.device),
        )
        found = with_clearance(scene, found)
        better = with_more(scene, stage, found) if found else stage
        if better is stage:
            return replace(stage, certificate=joined(stage.certificate, bound.proof()))
        stage = better
    entry = enough(stage.certificate, np.any(stage.stages == LIT, axis=1))
    return replace(stage, certificate=stage.certificate.changed(continuous=entry))


def _bound_of(
    scene: Scene, stage: ProjectorStage, template: PlannedProjector, effort: Effort
) -> ContinuousBound:
    # The first samples are a draw of their own; the others came where it overfitted.
    n = min(len(stage.rows), effort.most_samples or len(stage.rows))
    reached = np.any(stage.stages[:n] == LIT, axis=1)
    given = given_on(scene, template, stage.rows.take(np.arange(n)))
    free = reached & given.lit
    required = required_samples(reached, scene.requirements.dominant_coverage)
    found = bound_projectors(
        scene,
        template,
        stage.rows.take(np.flatnonzero(reached & ~free)),
        max(required - int(free.sum()), 0),
        stage.certificate.needed.count - given.count,
        effort,
        n_samples=n,
        row_area_m2=stage.rows.samples.weight * len(stage.rows) / n,
    )
    return replace(found, given=given.count, n_free=int(free.sum()))
