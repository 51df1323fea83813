"""Whether fresh samples confirm that any one projector may be lost."""

from collections.abc import Sequence

from planning.model.devices.planned import PlannedProjector
from planning.proofs.losses import light_survives
from planning.proofs.quotas import Quotas, RegionFloors
from planning.scene.draws import DRAWS
from planning.scene.samples import Target, merged

from .candidate_set import CandidateSet

# Standard errors above floors at which samples of regions confirm it.
_AIMED = 1.0


def confirms_losses(
    candidates: CandidateSet, projectors: Sequence[PlannedProjector], fresh: Target
) -> bool:
    """Return whether enough of samples stays lit without any one projector.

    Of what they and the candidates reach: of all by the samples given, of regions by
    these and more samples of them.
    """
    scene, samples, n = candidates.scene, fresh, len(fresh)
    more = scene.more_of_regions(samples, DRAWS.surviving_regions)
    if scene.has_floors and more is not None:
        samples = merged(samples, more)
    taken = CandidateSet.over(scene, samples, tuple(projectors))
    reached, dark = taken.reached.copy(), samples.take(~taken.reached)
    offered = CandidateSet.over(scene, dark, candidates.projectors)
    reached[~taken.reached] = offered.reached
    share = scene.requirements.dominant_coverage
    total = Quotas.of(RegionFloors.none(n), reached[:n], share)
    floors = Quotas.of(RegionFloors.of(scene, samples), reached, 0.0, spare=_AIMED)
    return light_survives(total, taken.lit[:n]) and light_survives(floors, taken.lit)
