"""How wide a field would let as many projectors as are allowed light what is required.

At each pose that is offered the field is widened, and of every sample that is lit then
it is known how far it lies off the middle. Poses for larger tiles join them, since what
is looked at from beside with one field is looked at whole with another. The cover
program asks for most samples within a trial field, and bisection finds the least field
that is enough.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from planning.model.planned import PlannedProjector
from planning.projectors.projector_stage import ProjectorStage
from planning.proofs.selection import cover_problem, required_samples
from planning.scene.lighting import lit_stages
from planning.scene.limits.projector_limits import LIT
from planning.scene.scene import Scene
from planning.scene.workspace.candidates import projector_candidates
from planning.scene.workspace.view_tiles import Site
from solvers import solve_max_coverage

from .relaxations import field_limit, widened

_ROWS = 2000
# Poses for larger tiles: so many times as wide and high, so many that look at the
# centre.
_TIMES = (2, 3)
_OFFERED = 150
# Counted work of each cover, of which no proof is asked.
_BUDGET = 1e8


@dataclass(frozen=True, eq=False)
class _Fields:
    """What each pose would light, were its field wider.

    Attributes:
        asked: Field that a sample asks of a pose, inf where it isn't lit, (n, m).
        required: Samples that must be lit.
        count: Projectors.
        given: First poses, which are taken whatever they light.
        seed: Of the search.
    """

    asked: NDArray[np.float64]
    required: int
    count: int
    given: int
    seed: int

    def enough(self, field: float) -> bool:
        lit = self.asked <= field
        best = solve_max_coverage(
            cover_problem(lit, self.required, self.given),
            self.count,
            seed=self.seed,
            budget=_BUDGET,
        ).selected
        return bool(lit[:, best].any(axis=1).sum() >= self.required)


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
    site = scene.site("projector", stage.reference[0].device)
    if site is None:
        return None
    n = min(len(stage.candidates.samples), _ROWS)
    rows = stage.candidates.samples.take(np.arange(n))
    field = field_limit(scene, stage.reference[0])
    poses = [field.projector(pose) for pose in stage.reference]
    poses += _over_larger_tiles(site, stage.reference[0])
    lit = lit_stages(scene, poses, rows) == LIT
    asked = np.full(lit.shape, np.inf)
    for column, pose in enumerate(poses):
        own = np.flatnonzero(lit[:, column])
        asked[own, column] = field.asks(pose, rows.take(own))
    reached = stage.candidates.reached[:n]
    required = required_samples(reached, scene.requirements.dominant_coverage)
    given = len(scene.requirements.existing_of("projector"))
    fields = _Fields(asked, required, count, given, scene.seed)
    low, high = 0, int(np.ceil(asked[np.isfinite(asked)].max(initial=0.0)))
    if not fields.enough(high):
        return None
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if fields.enough(middle) else (middle, high)
    return field.say(high)


def _over_larger_tiles(
    site: Site, template: PlannedProjector
) -> list[PlannedProjector]:
    """Return projectors of the widest field at poses that suit wider ones."""
    found: list[PlannedProjector] = []
    for times in _TIMES:
        device = widened(template, times).device
        wide = replace(site, device=device)
        offered = projector_candidates(
            replace(template, device=device),
            site.workspace,
            _OFFERED,
            ring_offset=(0.0, 0.0),
            site=wide,
        )
        found += [widened(replace(p, device=template.device)) for p in offered]
    return found
