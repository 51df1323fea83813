"""The search for the fewest projectors, until samples that are fresh confirm them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from planning.model.devices.planned import PlannedProjector
from planning.proofs.completed import completed
from planning.proofs.quotas import Quotas, RegionFloors
from planning.proofs.selection import Selection, select_fewest
from planning.scene.draws import DRAWS
from planning.scene.samples import merged
from planning.scene.scene import Scene

from .candidate_set import CandidateSet, CandidateSource
from .one_fewer import one_fewer

# Of fresh samples that don't confirm a cover one in so many joins those of the next.
_JOINING = 3
# Candidates that are asked first what they reach of what is dark, each time twice as
# many: where too little is lit, the first often show it.
_FIRST_ASKED = 32
# Standard errors above their floors at which fresh samples confirm regions.
_AIMED = 1.0
# Counted work of the cover whose count is kept, where less left it unproved; the
# latter with floors, of which more was seen to prove no more.
_PROOF_BUDGET, _FLOORED_PROOF_BUDGET = 1e10, 3e9


@dataclass(frozen=True, eq=False)
class Found:
    """The fewest of candidates, after how many draws, and whether the last agrees."""

    candidates: CandidateSet
    selection: Selection
    draws: int
    confirmed: bool


@dataclass(frozen=True, eq=False)
class Search:
    """Looks for the fewest candidates, and for poses between them that save one.

    Attributes:
        source: Gives other poses.
        n_lattice: First candidates, which are spread over the workspace.
        n_finer: Poses of a finer lattice.
        rounds: Times that samples are fresh, at most.
    """

    source: CandidateSource
    n_lattice: int
    n_finer: int
    rounds: int

    def fewest(self, before: Found) -> Found:
        """Return the fewest; no fewer than before are looked for between candidates."""
        candidates, draw = before.candidates, before.draws
        begun = np.union1d(np.arange(self.n_lattice), before.selection.chosen)
        while True:
            draw += 1
            first = draw == before.draws + 1
            last = draw >= before.draws + self.rounds
            candidates, selection = self._between(
                candidates, begun, before.selection.needed, thorough=first
            )
            chosen = candidates.of(selection.chosen)
            confirmed = confirms(candidates, chosen, draw)
            if confirmed or selection.status == "infeasible" or last:
                return Found(candidates, selection, draw, confirmed)
            candidates = candidates.with_samples(_on_fresh(candidates, draw))
            if candidates.scene.has_floors:
                # Floors leave little to spare: what nearly did is where to look on.
                begun = np.union1d(begun, selection.chosen)

    def with_floors(self, found: Found, scene: Scene) -> Found:
        """Return the fewest that meet a scene's floors; those found, if they do."""
        candidates, chosen = replace(found.candidates, scene=scene), found.selection
        floored, quotas = replace(found, candidates=candidates), candidates.cover.quotas
        if not quotas.floors.any():
            return floored
        met = found.confirmed and candidates.cover.enough(chosen.chosen)
        poses = candidates.of(chosen.chosen)
        if met and confirms(candidates, poses, found.draws):
            return replace(floored, selection=replace(chosen, floors=quotas))
        return self.fewest(floored)

    def completed(self, found: Found) -> Found:
        """Return projectors with others added until fresh samples don't deny them.

        Where too few are allowed, the smallest cover is, once.
        """
        candidates, draw = found.candidates, found.draws
        cover, selection = candidates.cover, found.selection
        short = selection.status == "infeasible"
        if found.confirmed or (short and cover.stock is not None):
            return found
        if short:
            few = selection.smallest
            few = cover.most_covering(len(few), few)[0]
            selection = replace(selection, smallest=few)
        confirmed = False
        for _ in range(min(1, self.rounds) if short else self.rounds):
            chosen = selection.smallest if short else selection.chosen
            confirmed = confirms(candidates, candidates.of(chosen), draw, spare=0.0)
            if confirmed:
                break
            fresh = _on_fresh(candidates, draw).cover
            selection, draw = completed(cover, selection, fresh), draw + 1
        return Found(candidates, selection, draw, confirmed and not short)

    def _between(
        self,
        candidates: CandidateSet,
        begun: NDArray[np.int64],
        least: int,
        *,
        thorough: bool,
    ) -> tuple[CandidateSet, Selection]:
        """Return the fewest of the poses, with others as long as they save one.

        One fewer, but no fewer than `least`, is looked for from the poses `begun`. Near
        misses of a share of all are pursued on the first samples only: where fresh ones
        have joined them, a cover so tight has failed already.
        """
        scene, samples = candidates.scene, candidates.samples
        selection = select_fewest(candidates.cover)
        lattice = candidates.take(begun)

        @cache
        def finer() -> CandidateSet:
            return CandidateSet.over(scene, samples, self.source.lattice(self.n_finer))

        while selection.needed > max(candidates.n_existing + 1, least):
            moved = one_fewer(
                self.source,
                lattice,
                selection.needed - 1,
                finer=finer,
                reached=candidates.reached,
                thorough=thorough or selection.floors is not None,
            )
            if moved is None:
                break
            first = len(candidates.projectors)
            candidates = candidates.joined(moved)
            known = [
                *range(candidates.n_existing),
                *range(first, len(candidates.projectors)),
            ]
            again = select_fewest(candidates.cover, known=np.array(known, np.int64))
            if again.needed >= selection.needed:
                break
            selection = again
        taken = selection.needed <= candidates.cover.most
        if taken and selection.lower_bound < selection.needed:
            # Only a count that is kept, and may be taken, is worth a longer proof.
            floored = selection.floors is not None
            selection = select_fewest(
                candidates.cover,
                known=selection.smallest,
                budget=_FLOORED_PROOF_BUDGET if floored else _PROOF_BUDGET,
            )
        return candidates, selection


def _on_fresh(candidates: CandidateSet, draw: int) -> CandidateSet:
    """What candidates light of some of the fresh samples of a draw."""
    fresh = candidates.scene.target_samples(DRAWS.fresh_projectors.later(draw))
    return candidates.on(fresh.take(np.arange(0, len(fresh), _JOINING)))


def confirms(
    candidates: CandidateSet,
    projectors: Sequence[PlannedProjector],
    draw: int,
    spare: float = _AIMED,
) -> bool:
    """Return whether projectors light enough of samples that are fresh.

    Of what they and the candidates reach: of all by a draw of the target, of regions by
    that and more samples of them, where it must be `spare` standard errors more.
    """
    scene = candidates.scene
    samples = scene.target_samples(DRAWS.fresh_projectors.later(draw))
    n = len(samples)
    more = scene.more_of_regions(samples, DRAWS.fresh_regions.later(draw))
    if scene.has_floors and more is not None:
        samples = merged(samples, more)
    lit = CandidateSet.over(scene, samples, tuple(projectors)).reached
    share, floors = (
        scene.requirements.dominant_coverage,
        RegionFloors.of(scene, samples),
    )

    def enough(reached: NDArray[np.bool_]) -> bool:
        if lit[:n].sum() < share * reached[:n].sum():
            return False
        return Quotas.of(floors, reached, 0.0, spare=spare).enough(lit)

    # Where it is enough of all there is, what candidates reach needn't be known.
    if enough(np.ones(len(lit), dtype=bool)):
        return True
    reached, size, rest = lit.copy(), _FIRST_ASKED, candidates.projectors
    while rest and enough(reached):
        few, rest, size = rest[:size], rest[size:], 2 * size
        dark = np.flatnonzero(~reached)
        reached[dark] = CandidateSet.over(scene, samples.take(dark), few).reached
    return enough(reached)
