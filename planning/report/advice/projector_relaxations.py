"""Which single limit of the projectors, relaxed by how little, would reach how much.

For every sample that nothing lights, the pose that asks least of a limit says what that
sample needs; sorted, these say how far the limit must give way for the required share.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planning.model.planned import PlannedProjector
from planning.projectors.candidate_set import NothingLitError
from planning.scene import lighting
from planning.scene.draws import DRAWS
from planning.scene.limits.projector_limits import LIT
from planning.scene.samples import Target
from planning.scene.scene import Scene
from planning.scene.workspace.candidates import projector_candidates

from .demands import light_demands
from .least_changes import Share, least_changes, relaxations_of_projectors


def reachability_relaxations(
    scene: Scene,
    reference: Sequence[PlannedProjector],
    ring_offset: tuple[float, float],
) -> list[dict[str, Any]]:
    """Return the share of the target that each single relaxation would make reachable.

    Args:
        scene: Surface and requirements.
        reference: The projectors' reference set.
        ring_offset: Tilt and azimuth of its ring axes.

    Returns:
        One entry for each relaxation that gains at least a percentage point, the
        smallest gain first: `change`, `reachable_share`. A limit gives way as far as
        `min_reachable` needs, or else as far as it helps.
    """
    target = scene.target_samples(DRAWS.relaxations)
    n, dark = len(target), _unlit(scene, reference, target)
    share = Share(n, n - len(dark), scene.requirements.min_reachable)
    gained = _least(scene, reference, target.take(dark), share.wanted)
    for moved in scene.obstructions:
        rest = tuple(other for other in scene.obstructions if other is not moved)
        still = _unlit(scene.with_obstructions(rest), reference, target.take(dark))
        gained[f"{moved.words} out of the way"] = len(dark) - len(still)
    workspace = scene.requirements.workspace
    whole = workspace.whole_shell
    if whole != workspace:
        site = scene.site("projector", reference[0].device)
        anywhere = projector_candidates(
            reference[0],
            whole,
            len(reference) if site is None else workspace.n_reference_projectors,
            ring_offset=ring_offset,
            site=None if site is None else replace(site, workspace=whole),
        )
        still_dark = len(_unlit(scene, anywhere, target))
        gained["the whole shell as workspace"] = len(dark) - still_dark
    return share.gains(gained)


def nothing_lit(scene: Scene, error: NothingLitError) -> str:
    """Say the least by which a single limit must give way for any light at all.

    Args:
        scene: Surface and requirements.
        error: What was offered, and which limits forbid it.
    """
    offered = error.candidates
    dark = offered.samples.take(np.arange(min(len(offered.samples), DRAWS.dark)))
    if helps := _least(scene, offered.projectors, dark, 1):
        return f"the least that lights any of it: {'; or '.join(helps)}"
    return (
        "no single limit of the projector, relaxed, lights any of it: look at the "
        "workspace and at the target"
    )


def _least(
    scene: Scene, projectors: Sequence[PlannedProjector], dark: Target, wanted: int
) -> dict[str, int]:
    """How far each limit alone must give way, and how many dark samples that lights."""
    device = projectors[0].device
    relaxations = relaxations_of_projectors(scene.requirements, device)
    least = np.full((len(relaxations), len(dark)), np.inf)
    for projector in projectors:
        demanded = light_demands(scene, projector, dark, relaxations)
        least = np.minimum(least, demanded)
    return least_changes(relaxations, least, wanted)


def _unlit(
    scene: Scene, reference: Sequence[PlannedProjector], target: Target
) -> NDArray[np.int64]:
    """Return which samples no projector lights."""
    dark = np.arange(len(target))
    limits, bodies = scene.requirements.projector, scene.bodies
    for projector in reference:
        if not len(dark):
            break
        first = lighting.first_failure(
            projector, target.take(dark), limits, scene.visibility, bodies=bodies
        )
        dark = dark[first != LIT]
    return dark
