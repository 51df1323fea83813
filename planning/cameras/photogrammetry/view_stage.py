"""The fewest cameras that measure the target by each other's images, with the proof."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from planning.cameras.camera_cover import n_fixed
from planning.model.devices.planned import PlannedCamera
from planning.model.errors import InfeasibleLimitsError
from planning.model.words import stopped_words
from planning.proofs.candidate_certificate import PlannedStage, certified
from planning.proofs.quotas import Quotas, RegionFloors
from planning.proofs.selection import Selection
from planning.scene.draws import DRAWS
from planning.scene.limits.view_pair_limits import MEASURED_BY_VIEWS, VIEW_CAUSES
from planning.scene.measuring.camera_views import CandidateViews
from planning.scene.samples import Target
from planning.scene.scene import Scene
from solvers.covers.paired.pair_rows import pair_rows
from solvers.covers.paired.pair_search import greedy
from solvers.status import WorkBudget

from .measured_views import (
    measured_views,
    reached_by_views,
    unseen_causes,
    views_of,
)
from .view_selection import PairCandidates, seen_together, select_fewest_views

_ROUNDS = 4
_GREEDY_BUDGET = 1e10
# Looked at where no pair measures anything: of so many candidates.
_FEW = 60


@dataclass(frozen=True, eq=False)
class ViewStage(PlannedStage):
    """Cameras alone, with what was proved of their number.

    Attributes:
        cameras: As they stand.
        candidates: What they were chosen from, existing cameras first.
        target: Samples that the cover was solved on.
        cover: What the candidates' pairs measure of these.
    """

    cameras: tuple[PlannedCamera, ...]
    candidates: CandidateViews
    target: Target
    cover: PairCandidates

    @property
    def reference(self) -> tuple[PlannedCamera, ...]:
        """The candidates."""
        return self.candidates.cameras


def place_views(scene: Scene, candidates: CandidateViews) -> ViewStage:
    """Choose the fewest cameras whose pairs measure the required share of the target.

    A minimal cover overfits its samples: where fresh ones don't confirm it, more is
    aimed at on the same samples. The bound stays that of what is required.

    Raises:
        InfeasibleLimitsError: If no pair of candidates measures any sample.
    """
    target = scene.target_samples(DRAWS.cameras)
    cover = candidate_pairs(scene, candidates, target)
    if not cover.good.any():
        raise InfeasibleLimitsError(_nothing_measured(scene, candidates, target))
    first = selection = select_fewest_views(cover)
    aimed = cover
    for attempt in range(1, _ROUNDS):
        if selection.status == "infeasible":
            break
        short = _lacking(scene, candidates, selection.chosen, attempt)
        if not short > 0.0:
            break
        aimed = _aiming(aimed, short)
        selection = select_fewest_views(aimed, first)
    return _stage(candidates, target, cover, _judged(cover, selection))


def candidate_pairs(
    scene: Scene, candidates: CandidateViews, target: Target
) -> PairCandidates:
    """Return what pairs of candidates measure of samples, with what is required."""
    views = candidates.on(target)
    sees, good = seen_together(scene, views, target.samples.normals)
    required = scene.requirements
    return PairCandidates(
        sees,
        required.coverage,
        seed=scene.seed,
        max_count=required.max_cameras,
        n_existing=n_fixed(scene),
        regions=RegionFloors.of(scene, target),
        good=good,
        views=views_of(required),
    )


def _aiming(cover: PairCandidates, short: float) -> PairCandidates:
    """Return the cover with more of it aimed at, as far as it can be reached."""
    aim = cover.required if cover.aimed is None else cover.aimed
    more = int(np.ceil(short * len(cover.covers))) + 1
    reached = cover.n_covered(np.arange(cover.covers.shape[1]))
    return replace(cover, aimed=min(aim + more, reached))


def _judged(cover: PairCandidates, selection: Selection) -> Selection:
    """Return a selection as the cover sees it that aims at no more than is required."""
    n_covered = cover.n_covered(selection.chosen)
    needed = max(selection.needed, len(selection.chosen))
    bound = min(selection.lower_bound, needed)
    met = selection.status != "infeasible" and cover.enough(selection.chosen)
    status = selection.status if met else "infeasible"
    if met:
        status = "optimal" if bound >= len(selection.chosen) else "feasible"
    return replace(
        selection,
        status=status,
        required=cover.required,
        n_covered=n_covered,
        n_covered_bound=max(selection.n_covered_bound, n_covered),
    )


def _lacking(
    scene: Scene, candidates: CandidateViews, chosen: NDArray[np.int64], attempt: int
) -> float:
    """Return the share of fresh samples that chosen candidates lack."""
    fresh = scene.target_samples(DRAWS.fresh_cameras.later(attempt))
    cameras: Sequence[PlannedCamera] = [candidates.cameras[i] for i in chosen]
    measured = measured_views(scene, cameras, fresh).measured
    others = np.flatnonzero(~measured)
    reached = measured.copy()
    reached[others] = reached_by_views(scene, candidates.cameras, fresh.take(others))
    quotas = Quotas.of(
        RegionFloors.of(scene, fresh), reached, scene.requirements.coverage
    )
    return quotas.lacking(measured) / len(fresh)


def _stage(
    candidates: CandidateViews,
    target: Target,
    cover: PairCandidates,
    selection: Selection,
) -> ViewStage:
    others, proof = certified(cover, selection, target.samples.weight)
    rows = pair_rows(cover.pairs)
    taken = greedy(rows, cover.pairs.fixed, WorkBudget(_GREEDY_BUDGET))
    # Floors of regions may ask for more than the total that it stops at.
    proof = proof.changed(greedy_count=max(len(taken), selection.lower_bound))
    by_count = {
        n: tuple(candidates.cameras[i] for i in chosen) for n, chosen in others.items()
    }
    cameras = tuple(candidates.cameras[i] for i in selection.chosen)
    return ViewStage(by_count, proof, cameras, candidates, target, cover)


def _nothing_measured(scene: Scene, candidates: CandidateViews, target: Target) -> str:
    few = candidates.cameras[:: max(1, len(candidates.cameras) // _FEW)]
    causes = unseen_causes(scene, few, target, measured_views(scene, few, target))
    counts = np.bincount(causes, minlength=MEASURED_BY_VIEWS)[:MEASURED_BY_VIEWS]
    named = stopped_words(counts.tolist(), VIEW_CAUSES, target.samples.weight)
    return (
        f"no pair of cameras of {len(candidates.cameras)} poses measures any sample; "
        f"the limit that stops each sample where it comes furthest is {named}"
    )
