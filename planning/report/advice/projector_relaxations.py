"""Which single limit of the projectors, relaxed by how little, would reach how much.

For every sample that nothing lights, the pose that asks least of a limit says what that
sample needs; sorted, these say how far the limit must give way for the required share.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import reduce

import numpy as np

from planning.model.devices.planned import PlannedProjector
from planning.model.document.coverage_records import Relaxation
from planning.projectors.candidate_set import NothingLitError
from planning.projectors.projector_stage import ProjectorStage
from planning.proofs.quotas import required_samples
from planning.report.claims.reach import furthest_lit
from planning.scene.draws import DRAWS
from planning.scene.limits.projector_limits import LIT
from planning.scene.samples import Target
from planning.scene.scene import Scene
from planning.scene.workspace.candidates import Candidates
from planning.scene.workspace.model_candidates import one_of_each
from planning.scene.workspace.view_tiles import Site

from .demands import light_demands
from .least_changes import (
    Share,
    enough,
    larger_workspaces,
    least_changes,
    least_enough,
    relaxations_of_projectors,
)

# Poses for larger tiles: so many times as wide and high, so many that look at the
# centre.
_TIMES = (2, 3)
_OFFERED = 150


def reachability_relaxations(
    scene: Scene, reference: Sequence[PlannedProjector], *, elsewhere: bool = True
) -> tuple[Relaxation, ...]:
    """Return the share of the target that each single relaxation would make reachable.

    The smallest gain first. A limit gives way as far as `min_reachable` needs, or else
    as far as it helps. Unless projectors may stand `elsewhere` alone, as those of heads
    can't, no larger workspace is looked at.
    """
    target = scene.target_samples(DRAWS.relaxations)
    dark = target.take(furthest_lit(scene, reference, target) < LIT)
    n, workspace = len(target), scene.requirements.workspace
    share = Share(n, n - len(dark), scene.requirements.min_reachable)
    gained = _least(scene, reference, dark, share.wanted)
    for moved, rest in scene.less_one_obstacle():
        furthest = furthest_lit(rest, reference, dark)
        gained[f"{moved} out of the way"] = int((furthest == LIT).sum())
    larger_ones = larger_workspaces(workspace, "projector")
    for change, larger in larger_ones if elsewhere else ():
        there = scene.candidates(one_of_each(reference), larger)
        tiled = workspace.projector_standoff_m is not None
        anywhere = there.over(
            workspace.n_reference_projectors if tiled else len(reference)
        )
        still_dark = furthest_lit(scene, anywhere, target) < LIT
        gained[change] = len(dark) - int(still_dark.sum())
    return share.gains(gained)


def nothing_lit(scene: Scene, error: NothingLitError) -> str:
    """Say the least by which a single limit must give way for any light at all."""
    candidates = error.candidates
    dark = candidates.samples.take(np.arange(min(len(candidates.samples), DRAWS.dark)))
    if helps := _least(scene, candidates.projectors, dark, 1):
        return f"the least that lights any of it: {'; or '.join(helps)}"
    return (
        "no single limit of the projector, relaxed, lights any of it: look at the "
        "workspace and at the target"
    )


def _least(
    scene: Scene, projectors: Sequence[PlannedProjector], dark: Target, wanted: int
) -> dict[str, int]:
    """How far each limit alone must give way, and how many dark samples that lights."""
    relaxations = relaxations_of_projectors(scene.requirements, projectors)
    asked = (light_demands(scene, p, dark, relaxations) for p in projectors)
    return least_changes(relaxations, reduce(np.minimum, asked), wanted)


def wider_field(scene: Scene, stage: ProjectorStage, count: int) -> str | None:
    """Return the field with which so many projectors would be enough, as one phrase.

    Poses for larger tiles join those that are offered, since what is looked at from
    beside with one field is looked at whole with another. None where the object fits
    the field, or where a field three times as wide isn't enough either.
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
        for relaxation in relaxations_of_projectors(required, stage.reference[:1])
        if relaxation.cause == "projector_beam"
    )
    poses = (*stage.reference, *_over_larger_tiles(site, template))
    demanded = np.stack(
        [light_demands(scene, pose, target, [field])[0] for pose in poses], axis=1
    )
    least = required_samples(candidates.reached[:n], required.dominant_coverage)
    n_existing = len(required.existing_of("projector"))
    return least_enough(
        field,
        demanded,
        lambda covered: enough(covered, least, count, n_existing, scene.seed),
    )


def _over_larger_tiles(
    site: Site, template: PlannedProjector
) -> Iterator[PlannedProjector]:
    for times in _TIMES:
        device = template.device.widened(times)
        wide = replace(template, device=device)
        over = replace(site, device=device)
        for projector in Candidates(wide, site.workspace, over).over(_OFFERED):
            yield replace(projector, device=template.device)
