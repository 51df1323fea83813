"""Section III of the paper: the fewest projectors that light the dominant regions."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from planning.model.planned import PlannedProjector
from planning.proofs.candidate_certificate import PlannedStage, certified
from planning.proofs.conflicts import Interference, resolve_conflicts
from planning.proofs.selection import Selection, select_fewest
from planning.scene.draws import DRAWS
from planning.scene.lighting import lit_margins
from planning.scene.limits import projector_limits
from planning.scene.placed_bodies import Obstruction, PlacedBody
from planning.scene.scene import Scene
from solvers import solve_cover

from .candidate_set import CandidateSet, CandidateSource, NothingLitError
from .one_fewer import one_fewer
from .share_margin import widest_selection

_ROUNDS = 3
# Times the candidates of a lattice from which one projector fewer is looked for.
_FINER = 4
# Counted work of the cover about which more candidates are offered.
_SEEDS_BUDGET = 2e8
# Counted work of the cover whose count is kept, where less left it unproved; the
# latter with floors, of which more was seen to prove no more.
_PROOF_BUDGET, _FLOORED_PROOF_BUDGET = 1e10, 3e9

# Limits that are told of only where something could violate them.
_BY_BLOCKERS = {
    projector_limits.BLOCKED: PlacedBody,
    projector_limits.OBSTRUCTED: Obstruction,
}


@dataclass(frozen=True, eq=False)
class ProjectorStage(PlannedStage):
    """The projectors of section III, and what was proved of their number.

    Attributes:
        projectors: The fewest, or the best that are allowed.
        candidates: The reference set, and what it lights of the cover's samples.
    """

    projectors: tuple[PlannedProjector, ...]
    candidates: CandidateSet

    @property
    def reference(self) -> tuple[PlannedProjector, ...]:
        """The candidates' poses."""
        return self.candidates.projectors

    @classmethod
    def over(cls, candidates: CandidateSet, selection: Selection) -> "ProjectorStage":
        """Return the stage of a selection: compatible bodies and the certificate."""
        cover, samples = candidates.cover, candidates.samples.samples
        clearance = candidates.scene.requirements.workspace.clearance_m
        among = Interference(
            candidates.projectors, samples.points, cover.covers, clearance
        )
        selection = resolve_conflicts(among, cover, selection)
        others, proof = certified(cover, selection, samples.weight, among)
        kinds = {type(body) for body in candidates.scene.bodies}
        proof = proof.changed(
            excluded_pairs={
                cause: int((candidates.stages == index).sum())
                for index, cause in enumerate(projector_limits.CAUSES)
                if index not in _BY_BLOCKERS or _BY_BLOCKERS[index] in kinds
            },
            n_regions=int(candidates.scene.region.max()) + 1,
        )
        by_count = {n: candidates.of(chosen) for n, chosen in others.items()}
        return cls(by_count, proof, candidates.of(selection.chosen), candidates)


def plan_projectors(
    scene: Scene,
    template: PlannedProjector,
    n_candidates: int,
    *,
    rounds: int = _ROUNDS,
) -> ProjectorStage:
    """Choose the fewest projectors that light the required share of the target.

    The best of a lattice of candidates get more candidates around them, and the cover
    is solved again over all. A minimal cover overfits its samples; so it is tested on
    fresh ones, and where it falls short there, they join the samples and the cover is
    solved once more.

    Raises:
        NothingLitError: If no candidate lights any sample.
    """
    source = CandidateSource(scene, template)
    samples = scene.target_samples(DRAWS.projectors)
    candidates = CandidateSet.over(scene, samples, source.lattice(n_candidates))
    if not candidates.lit.any():
        raise NothingLitError(candidates)
    n_lattice = len(candidates.projectors)
    # The best of a lattice lies beside the best there is.
    good = solve_cover(candidates.cover.problem, seed=scene.seed, budget=_SEEDS_BUDGET)
    around = source.around(candidates.of(good.selected), n_lattice)
    candidates = candidates.extended(around)

    def finer() -> CandidateSet:
        poses = source.lattice(_FINER * n_candidates)
        return CandidateSet.over(scene, candidates.samples, poses)

    attempt, begun = 0, np.arange(n_lattice)
    while True:
        attempt += 1
        candidates, selection = _fewest(
            source, candidates, begun, finer, thorough=attempt == 1
        )
        fresh = candidates.on(
            scene.target_samples(DRAWS.fresh_projectors.later(attempt))
        )
        confirmed = fresh.cover.confirms(selection.chosen)
        if confirmed or selection.status == "infeasible" or attempt == rounds:
            break
        candidates = candidates.with_samples(fresh)
        if scene.requirements.region_coverage:
            # Floors leave little to spare: what nearly did is where to look on.
            begun = np.union1d(begun, selection.chosen)
    if confirmed and selection.status != "infeasible":
        wider = _with_widest_margin(candidates, selection)
        selection = wider if fresh.cover.confirms(wider.chosen) else selection
    return ProjectorStage.over(candidates, selection)


def _fewest(
    source: CandidateSource,
    candidates: CandidateSet,
    begun: NDArray[np.int64],
    finer: Callable[[], CandidateSet],
    *,
    thorough: bool,
) -> tuple[CandidateSet, Selection]:
    """Return the fewest of the poses, with others as long as they save one.

    One fewer is looked for from the poses `begun`. Near misses are pursued on the first
    samples only: where fresh ones have joined them, a cover so tight has failed
    already.
    """
    selection = select_fewest(candidates.cover)
    lattice, finer_once = candidates.take(begun), cache(finer)
    while selection.needed > candidates.n_existing + 1:
        moved = one_fewer(
            source,
            lattice,
            selection.needed - 1,
            finer=finer_once,
            reached=candidates.reached,
            thorough=thorough,
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
    if selection.lower_bound < selection.needed:
        # Only a count that is kept is worth a longer proof.
        floored = selection.floors is not None
        selection = select_fewest(
            candidates.cover,
            known=selection.smallest,
            budget=_FLOORED_PROOF_BUDGET if floored else _PROOF_BUDGET,
        )
    return candidates, selection


def _with_widest_margin(candidates: CandidateSet, selection: Selection) -> Selection:
    """Return the selection with as many candidates of larger margin, if there are."""
    scene, lit = candidates.scene, candidates.lit
    chosen = widest_selection(
        lit_margins(scene, candidates.projectors, candidates.samples, lit),
        selection.chosen,
        candidates.cover.aims,
        seed=scene.seed,
        n_existing=candidates.n_existing,
    )
    return replace(selection, chosen=chosen)
