"""How wide a field would let as many projectors as are allowed light what is required.

Of every sample that a pose would light with a wider field it is known how far it lies
off the middle. Poses for larger tiles join those that are offered, since what is looked
at from beside with one field is looked at whole with another. The cover program asks
for most samples within a trial field, and bisection finds the least field that is
enough.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from planning.model.planned import PlannedProjector
from planning.projectors.projector_stage import ProjectorStage
from planning.proofs.selection import required_samples
from planning.scene.draws import DRAWS
from planning.scene.scene import Scene
from planning.scene.workspace.candidates import projector_candidates
from planning.scene.workspace.view_tiles import Site

from .demands import light_demands
from .least_changes import covers_enough, relaxations_of_projectors

# Poses for larger tiles: so many times as wide and high, so many that look at the
# centre.
_TIMES = (2, 3)
_OFFERED = 150


def wider_field(scene: Scene, stage: ProjectorStage, count: int) -> str | None:
    """Return the field with which so many projectors would be enough, as one phrase.

    Args:
        scene: Surface and requirements.
        stage: Poses offered, and the samples to light.
        count: Projectors that are allowed.

    Returns:
        Up to a whole degree or millimetre; None where the object fits the field, or
        where a field three times as wide isn't enough either.
    """
    template, required = stage.reference[0], scene.requirements
    site = scene.site("projector", template.device)
    if site is None:
        return None
    candidates = stage.candidates
    n = min(len(candidates.samples), DRAWS.fewer_devices)
    target = candidates.samples.take(np.arange(n))
    (field,) = (
        relaxation
        for relaxation in relaxations_of_projectors(required, template.device)
        if relaxation.cause == "projector_beam"
    )
    poses = (*stage.reference, *_over_larger_tiles(site, template))
    demanded = np.stack(
        [light_demands(scene, pose, target, [field])[0] for pose in poses], axis=1
    )
    least = required_samples(candidates.reached[:n], required.dominant_coverage)

    def enough(value: float) -> bool:
        existing = len(required.existing_of("projector"))
        return covers_enough(
            demanded <= value, least, count, n_existing=existing, seed=scene.seed
        )

    low, high = 0, int(np.ceil(demanded[np.isfinite(demanded)].max(initial=0.0)))
    if not enough(high):
        return None
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if enough(middle) else (middle, high)
    return field.say(high)


def _over_larger_tiles(
    site: Site, template: PlannedProjector
) -> Iterator[PlannedProjector]:
    """Yield projectors at poses that suit wider fields."""
    for times in _TIMES:
        device = template.device.widened(times)
        offered = projector_candidates(
            replace(template, device=device),
            site.workspace,
            _OFFERED,
            ring_offset=(0.0, 0.0),
            site=replace(site, device=device),
        )
        for projector in offered:
            yield replace(projector, device=template.device)
