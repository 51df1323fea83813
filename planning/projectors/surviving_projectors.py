"""The fewest projectors of which any one may be lost."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from planning.model.devices.planned import PlannedProjector
from planning.projectors.candidate_set import CandidateSet, CandidateSource
from planning.projectors.loss_confirmation import confirms_losses
from planning.projectors.projector_stage import ProjectorStage
from planning.projectors.proved_projectors import prove_fewest
from planning.proofs.all_poses import Effort
from planning.proofs.candidate_certificate import counted
from planning.proofs.selection import select_fewest
from planning.proofs.surviving_counts import SurvivingCount, larger_selections
from planning.scene.draws import DRAWS
from planning.scene.scene import Scene
from solvers.surviving.fewest_surviving import (
    KICKS,
    SurvivingSolution,
    solve_surviving,
)
from solvers.surviving.surviving_cover import SurvivingCover

_Index = NDArray[np.int64]

_ROUNDS = 4
# Projectors beyond the bound that are tried.
_MORE = 8
# Times that sets are thrown out where poses between are offered.
_KICKS = 6
# How far out poses between the chosen ones are offered, in spacings of the lattice.
_SCALES = (1.0, 0.5, 0.25)
# Of fresh samples that don't confirm it one in so many joins those of the next.
_JOINING = 3


def surviving_projectors(
    scene: Scene,
    stage: ProjectorStage,
    templates: tuple[PlannedProjector, ...],
    effort: Effort,
) -> tuple[ProjectorStage, SurvivingCount]:
    """Return the stage with as many projectors as stand the loss of any one.

    Without any one of them it is a cover still, so that the stage's own bounds, plus
    one, bound their number. Where it takes more than that, poses around those chosen
    are offered; those that are taken join the candidates, over which and over all
    poses covers are then proved anew. Fresh samples confirm the end.
    """
    search = _Search(CandidateSource(scene, templates), len(stage.reference))
    candidates = replace(stage.candidates, scene=scene)
    bound, allowed = _bound(stage), scene.requirements.max_projectors
    candidates, enough, found = _confirmed(
        search, candidates, _places(candidates, stage.projectors), bound
    )
    devices = candidates.of(found.selected)
    more = larger_selections(_cover(candidates), found.selected, allowed)
    stage = _with_candidates(scene, stage, templates, devices, effort)
    bound = _bound(stage)
    count = SurvivingCount(
        needed=max(len(enough.selected), len(devices)),
        without=stage.certificate.needed.count,
        lower_bound=min(bound, len(enough.selected)),
        everywhere=_everywhere(stage, devices),
        more={n: candidates.of(chosen) for n, chosen in more.items()},
        met=found.status != "infeasible",
    )
    known, weight = stage.candidates, stage.candidates.samples.samples.weight
    reached = float(known.reached.sum()) * weight
    # Best covers of other numbers bear no loss, and may light more.
    taken = replace(stage, by_count={}, projectors=devices)
    return counted(taken, devices, reached), count


def _with_candidates(
    scene: Scene,
    stage: ProjectorStage,
    templates: tuple[PlannedProjector, ...],
    devices: tuple[PlannedProjector, ...],
    effort: Effort,
) -> ProjectorStage:
    """Return the stage proved over its candidates and these devices, if any is new."""
    known = {id(one) for one in stage.reference}
    more = tuple(device for device in devices if id(device) not in known)
    if not more:
        return stage
    candidates = stage.candidates.extended(more)
    chosen = _places(candidates, stage.projectors)
    selection = select_fewest(candidates.cover, known=chosen)
    again = ProjectorStage.over(candidates, selection)
    return prove_fewest(scene, again, templates, effort)


def _confirmed(
    search: "_Search", candidates: CandidateSet, start: _Index, bound: int
) -> tuple[CandidateSet, SurvivingSolution, SurvivingSolution]:
    """Return what is enough, and what is allowed of it, when fresh samples agree.

    Where they don't some of them join the samples, a few times.
    """
    scene, attempt = candidates.scene, 0
    allowed = scene.requirements.max_projectors
    while True:
        attempt += 1
        candidates, enough = search.fewest(candidates, start, bound)
        found, start = enough, enough.selected
        if len(start) > allowed:
            found = _solved(candidates, start, allowed, allowed)
        if found.status == "infeasible" or attempt == _ROUNDS:
            return candidates, enough, found
        fresh = scene.target_samples(DRAWS.surviving_projectors.later(attempt))
        if confirms_losses(candidates, candidates.of(start), fresh):
            return candidates, enough, found
        some = fresh.take(np.arange(0, len(fresh), _JOINING))
        candidates = candidates.with_samples(candidates.on(some))


def _bound(stage: ProjectorStage) -> int:
    """One more than any cover of the candidates, unless existing ones suffice."""
    return stage.certificate.needed.lower_bound + 1


def _everywhere(
    stage: ProjectorStage, devices: tuple[PlannedProjector, ...]
) -> int | None:
    """The same over all poses."""
    bound = stage.certificate.continuous
    if bound is None or all(device.existing for device in devices):
        return None if bound is None else len(devices)
    return bound.lower_bound + 1


def _places(
    candidates: CandidateSet, projectors: tuple[PlannedProjector, ...]
) -> _Index:
    place = {id(one): k for k, one in enumerate(candidates.projectors)}
    known = [place[id(one)] for one in projectors if id(one) in place]
    return np.array(sorted(known), dtype=np.int64)


def _cover(candidates: CandidateSet) -> SurvivingCover:
    """State the cover of which any one set may be lost."""
    # Floors so high that fresh samples should confirm them.
    quotas, stock = candidates.cover.aims, candidates.stock
    return SurvivingCover.of(
        [candidates.lit.astype(np.uint8)],
        [quotas.total],
        row_sets=quotas.regions.row,
        floors=quotas.floors[None],
        n_fixed=candidates.n_existing,
        kinds=None if stock is None else stock.kinds,
        stock=None if stock is None else stock.counts,
    )


def _solved(
    candidates: CandidateSet,
    start: _Index,
    least: int,
    most: int,
    *,
    kicks: int = KICKS,
) -> SurvivingSolution:
    return solve_surviving(
        _cover(candidates),
        lower_bound=least,
        most=most,
        start=start,
        kicks=kicks,
        seed=candidates.scene.seed,
    )


@dataclass(frozen=True, eq=False)
class _Search:
    """Looks among candidates, and for poses between them where that saves one."""

    source: CandidateSource
    n_lattice: int

    def fewest(
        self, candidates: CandidateSet, start: _Index, bound: int
    ) -> tuple[CandidateSet, SurvivingSolution]:
        """Return the fewest found, and the candidates that they are of."""
        found = _solved(candidates, start, bound, bound + _MORE)
        while found.status != "infeasible" and len(found.selected) > bound:
            better = self._one_fewer(candidates, found.selected)
            if better is None:
                break
            candidates, found = better
        return candidates, found

    def _one_fewer(
        self, candidates: CandidateSet, chosen: _Index
    ) -> tuple[CandidateSet, SurvivingSolution] | None:
        """Return one fewer from poses around those that lack least, if any do."""
        count, poses, best = len(chosen) - 1, candidates, chosen
        for scale in _SCALES:
            near = poses.of(best)
            more = self.source.around(near, self.n_lattice, scale, far=True)
            if not more:
                continue
            poses = poses.extended(more)
            found = _solved(poses, best, count, count, kicks=_KICKS)
            if found.status != "infeasible":
                return poses, found
            best = found.selected
        return None
