"""Section III of the paper: the fewest projectors that light the dominant regions."""

from dataclasses import dataclass, replace

from planning.model.devices.planned import PlannedProjector
from planning.proofs.candidate_certificate import PlannedStage, certified, unsought
from planning.proofs.conflicts import Interference, resolve_conflicts
from planning.proofs.selection import Selection
from planning.scene.draws import DRAWS
from planning.scene.lighting import lit_margins
from planning.scene.limits import projector_limits
from planning.scene.placed_bodies import Obstruction, PlacedBody
from planning.scene.scene import Scene
from solvers import solve_cover

from .candidate_set import CandidateSet, CandidateSource, NothingLitError
from .fewest_projectors import Found, Search, confirms
from .share_margin import widest_selection

_ROUNDS = 3
# Times the candidates of a lattice from which one projector fewer is looked for.
_FINER = 4
# Counted work of the cover about which more candidates are offered.
_SEEDS_BUDGET = 2e8

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
        completed: Whether fresh samples take more than a cover of these samples.
    """

    projectors: tuple[PlannedProjector, ...]
    candidates: CandidateSet
    completed: bool = False

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
        proof = proof.changed(
            excluded_pairs={
                cause: int((candidates.stages == index).sum())
                for index, cause in enumerate(projector_limits.CAUSES)
                if _may_exclude(candidates.scene, index)
            },
            n_regions=int(candidates.scene.region.max()) + 1,
        )
        by_count = {n: candidates.of(chosen) for n, chosen in others.items()}
        chosen = candidates.of(selection.chosen)
        return cls(by_count, proof, chosen, candidates, selection.completed)


def _may_exclude(scene: Scene, index: int) -> bool:
    """Whether anything could violate a limit, by its index."""
    if projector_limits.CAUSES[index] == "pixel_distance":
        return scene.requirements.projector.max_sample_distance_m is not None
    kinds = {type(body) for body in scene.bodies}
    return index not in _BY_BLOCKERS or _BY_BLOCKERS[index] in kinds


def plan_projectors(
    scene: Scene,
    templates: tuple[PlannedProjector, ...],
    n_candidates: int,
    *,
    rounds: int = _ROUNDS,
) -> ProjectorStage:
    """Choose the fewest projectors that light the required share of the target.

    The best of a lattice of candidates get more candidates around them, and the cover
    is solved again over all. A minimal cover overfits its samples; so it is tested on
    fresh ones, and where it falls short there, some of them join the samples and the
    cover is solved once more. Floors of regions are looked at last: the fewest that
    light enough of all may meet them, and else are where the search goes on. What fresh
    samples still lack is added to it. With no `rounds` of fresh samples the cover is of
    the first ones, whatever others deny.

    Raises:
        NothingLitError: If no candidate lights any sample.
    """
    source, plain = CandidateSource(scene, templates), scene.without_floors
    samples = scene.target_samples(DRAWS.projectors)
    candidates = CandidateSet.over(plain, samples, source.lattice(n_candidates))
    if not candidates.lit.any():
        raise NothingLitError(candidates)
    n_lattice = len(candidates.projectors)
    # The best of a lattice lies beside the best there is.
    good = solve_cover(candidates.cover.problem, seed=scene.seed, budget=_SEEDS_BUDGET)
    around = source.around(candidates.of(good.selected), n_lattice)
    candidates = candidates.extended(around)

    search = Search(source, n_lattice, _FINER * n_candidates, rounds)
    found = search.fewest(Found(candidates, unsought(candidates.cover), 0, False))
    if plain is not scene:
        found = search.with_floors(found, scene)
    found = search.completed(found)
    candidates, selection = found.candidates, found.selection
    if found.confirmed and selection.status != "infeasible":
        wider = _with_widest_margin(candidates, selection)
        held = confirms(candidates, candidates.of(wider.chosen), found.draws)
        selection = wider if held else selection
    return ProjectorStage.over(candidates, selection)


def _with_widest_margin(candidates: CandidateSet, selection: Selection) -> Selection:
    """Return the selection with as many candidates of larger margin, if there are."""
    scene, lit = candidates.scene, candidates.lit
    chosen = widest_selection(
        lit_margins(scene, candidates.projectors, candidates.samples, lit),
        selection.chosen,
        candidates.cover.aims,
        seed=scene.seed,
        n_existing=candidates.n_existing,
        stock=candidates.stock,
    )
    return replace(selection, chosen=chosen)
