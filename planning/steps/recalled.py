"""Steps that hang on projectors alone, recalled where they were taken before.

They see the scene as projectors know it (`Scene.for_light`), so that another demand on
cameras finds them done.
"""

from dataclasses import replace

from planning.model.devices.planned import PlannedProjector
from planning.projectors.exposures import with_exposures
from planning.projectors.projector_poses import widen_margins
from planning.projectors.projector_stage import ProjectorStage, plan_projectors
from planning.projectors.proved_projectors import prove_fewest
from planning.proofs.all_poses import Effort
from planning.scene.scene import Scene

_Templates = tuple[PlannedProjector, ...]


def fewest_projectors(
    scene: Scene, templates: _Templates, n_candidates: int
) -> ProjectorStage:
    """Return what `plan_projectors` does.

    Raises:
        NothingLitError: If no candidate lights any sample.
    """
    light = scene.for_light
    stage = scene.cache.recall(
        "plan_projectors",
        (light, templates, n_candidates),
        lambda: plan_projectors(light, templates, n_candidates),
        shared=(light,),
    )
    return _seen_in(scene, stage)


def proved_projectors(
    scene: Scene, stage: ProjectorStage, templates: _Templates, effort: Effort
) -> ProjectorStage:
    """Return what `prove_fewest` does."""
    light = scene.for_light
    stage = _seen_in(light, stage)
    proved = scene.cache.recall(
        "prove_fewest",
        (light, stage, templates, effort),
        lambda: prove_fewest(light, stage, templates, effort),
        shared=(light,),
    )
    return _seen_in(scene, proved)


def widened_projectors(
    scene: Scene, stage: ProjectorStage
) -> tuple[PlannedProjector, ...]:
    """Return projectors at their poses of widest margin, with exposures."""
    light = scene.for_light
    stage = _seen_in(light, stage)
    return scene.cache.recall(
        "widen_margins",
        (light, stage),
        lambda: with_exposures(light, widen_margins(light, stage)),
    )


def _seen_in(scene: Scene, stage: ProjectorStage) -> ProjectorStage:
    return replace(stage, candidates=replace(stage.candidates, scene=scene))
