"""The fewest projectors with their bound over all poses."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from planning.model.devices.planned import PlannedProjector
from planning.proofs.all_poses import (
    BoundQuestion,
    ContinuousBound,
    Effort,
    joined,
    with_existing_alone,
)
from planning.proofs.projector_bound import bound_projectors
from planning.proofs.quotas import RegionFloors
from planning.proofs.selection import fewest_count, select_fewest
from planning.scene.codes.patterns import pattern_of
from planning.scene.lighting import lit_stages
from planning.scene.limits.projector_limits import LIT
from planning.scene.placed_bodies import existing_devices
from planning.scene.samples import Target
from planning.scene.scene import Scene

from .candidate_set import CandidateSource
from .moved_projectors import moved_projectors
from .projector_stage import ProjectorStage


def prove_fewest(
    scene: Scene,
    stage: ProjectorStage,
    templates: tuple[PlannedProjector, ...],
    effort: Effort,
    *,
    joining: bool = True,
) -> ProjectorStage:
    """Return the stage with the bound over all poses in its certificate.

    Where the bound leaves room for fewer projectors, candidates are offered there, and
    the cover is solved again; unless none are to be `joining` those that there are, or
    it is fresh samples that take as many.
    """
    source = CandidateSource(scene, templates)
    joining = joining and not stage.completed
    while (bound := bound_of(scene, stage, templates, effort)) is not None:
        better = _better(source, stage, bound, effort) if joining else stage
        if better is stage:
            break
        stage = better
    return with_bound(stage, bound)


def with_bound(stage: ProjectorStage, bound: ContinuousBound | None) -> ProjectorStage:
    """Return the stage with a bound in its certificate, of `bound_of`."""
    before = stage.certificate
    if bound is not None:
        certificate = joined(before, bound.proof())
        return replace(stage, certificate=certificate, refutation=bound.refutation())
    if before.needed.count > before.given:
        return stage
    n_reached = int(stage.candidates.reached.sum())
    return replace(stage, certificate=with_existing_alone(before, n_reached))


def _better(
    source: CandidateSource,
    stage: ProjectorStage,
    bound: ContinuousBound,
    effort: Effort,
) -> ProjectorStage:
    """Return the stage with fewer projectors, if poses are found between the bounds."""
    offered = source.towards(bound.directions)
    better = _with_more(stage, offered) if offered else stage
    # Numbers between the most that there may be and the count are of use to nobody.
    allowed = source.scene.requirements.max_projectors
    fewer = min(stage.certificate.needed.count - 1, allowed)
    if better is not stage or bound.proof().lower_bound > fewer:
        return better
    found = moved_projectors(source, stage.candidates, fewer, effort.starts)
    return _with_more(stage, found) if found else stage


def _with_more(
    stage: ProjectorStage, more: tuple[PlannedProjector, ...]
) -> ProjectorStage:
    """Return the stage with more candidates where they need fewer projectors.

    Else it is returned as it was: more candidates alone are no better plan.
    """
    candidates = stage.candidates.extended(more)
    before = stage.certificate.needed.count
    # Mostly they save none, and nothing is spent on which cover most.
    if fewest_count(candidates.cover) >= before:
        return stage
    selection = select_fewest(candidates.cover)
    better = ProjectorStage.over(candidates, selection)
    # Bodies in each other's way may cost what fewer would have saved.
    return better if better.certificate.needed.count < before else stage


def bound_of(
    scene: Scene,
    stage: ProjectorStage,
    templates: tuple[PlannedProjector, ...],
    effort: Effort,
) -> ContinuousBound | None:
    """Bound the projectors of a stage over every pose of the workspace.

    None where existing ones are enough, or may light all that is reached of the first
    samples: then nothing is known over all poses.
    """
    if stage.certificate.needed.count <= stage.certificate.given:
        return None
    # The first samples are a draw of their own; the others came where it overfitted.
    samples = stage.candidates.samples
    n = min(len(samples), effort.most_samples or len(samples))
    reached = stage.candidates.reached[:n]
    free = reached & _lit_by_existing(scene, templates, samples.take(np.arange(n)))
    question = BoundQuestion.about(
        stage.certificate,
        reached,
        free,
        scene.requirements.dominant_coverage,
        samples.samples.weight * len(samples),
        RegionFloors.of(scene, samples.take(np.arange(n))),
    )
    wanted = np.flatnonzero(reached & ~free)
    if not wanted.size:
        return None
    return bound_projectors(
        scene,
        templates,
        samples.take(wanted),
        question,
        effort,
        stage.candidates.lit[wanted].T,
        stage.candidates.unshadowed[wanted].T,
    )


def _lit_by_existing(
    scene: Scene, templates: tuple[PlannedProjector, ...], samples: Target
) -> NDArray[np.bool_]:
    """Return what existing projectors may light, whatever their ring axes, shape (n,).

    Their axes may yet be turned, so rings don't count: more that is free can only lower
    the bound.
    """
    ringless = [pattern_of(template).everywhere() for template in templates]
    projectors = existing_devices(scene.requirements, ringless)
    if not projectors:
        return np.zeros(len(samples), dtype=bool)
    return np.any(lit_stages(scene, projectors, samples) == LIT, axis=1)
