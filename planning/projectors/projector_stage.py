"""Section III of the paper: the fewest projectors that light the dominant regions."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from planning.model.document.certificates import Certificate
from planning.model.errors import InfeasibleLimitsError
from planning.model.planned import PlannedProjector
from planning.proofs.conflicts import (
    ProjectorInterference,
    resolve_conflicts,
    resolve_others,
)
from planning.proofs.selection import (
    BODIES_LEFT_OUT,
    CandidateCover,
    Selection,
    certificate,
    fewest_count,
    marginals,
    select_fewest,
)
from planning.scene.clearance import candidates_with_clearance, with_clearance
from planning.scene.existing import existing_projectors, movable
from planning.scene.lighting import lit_margins, lit_stages
from planning.scene.limits import projector_limits
from planning.scene.samples import Target, merged
from planning.scene.scene import Scene
from planning.scene.workspace.candidates import projector_candidates, projectors_around
from solvers import solve_cover

from .one_fewer import Offer, one_fewer
from .share_margin import widest_selection

_ROWS = 2000
_CHECK_ROWS = 4000
_ROUNDS = 3
# Times the candidates of a lattice from which one projector fewer is looked for.
_FINER = 4
# Streams of random samples: rows of the cover, then a fresh check set for each round.
_STREAM = 100
# Counted work of the cover about which more candidates are offered.
_SEEDS_BUDGET = 2e8
# Counted work of the cover whose count is kept, where less left it unproved.
_PROOF_BUDGET = 1e10


class NothingLitError(InfeasibleLimitsError):
    """No candidate lights any sample.

    Attributes:
        candidates: The poses.
        rows: The samples.
        stages: First failing limit of each sample and pose.
    """

    def __init__(
        self,
        candidates: tuple[PlannedProjector, ...],
        rows: Target,
        stages: NDArray[np.int8],
    ) -> None:
        n_causes = len(projector_limits.CAUSES)
        counts = np.bincount(stages.ravel(), minlength=n_causes)[:n_causes]
        share = 100.0 * counts / counts.sum()
        named = ", ".join(
            f"{cause} {part:.0f} %"
            for cause, part in sorted(
                zip(projector_limits.CAUSES, share, strict=True),
                key=lambda pair: -pair[1],
            )
            if part >= 1.0
        )
        super().__init__(
            f"no projector of {len(candidates)} poses lights any part of the target; "
            f"of all pairs of pose and sample, the first limit that fails is {named}"
        )
        self.candidates, self.rows, self.stages = candidates, rows, stages


@dataclass(frozen=True, eq=False)
class ProjectorStage:
    """What the projector stage found.

    Attributes:
        projectors: The fewest, or the best that are allowed.
        reference: The reference set, which is the candidate set.
        rows: Samples that the cover was solved on.
        stages: First failing limit of each row and candidate.
        by_count: Best candidates for each number of devices, for the marginal table.
        certificate: As in the plan file.
        most_area: As many projectors as taken, those that light most.
    """

    projectors: tuple[PlannedProjector, ...]
    reference: tuple[PlannedProjector, ...]
    rows: Target
    stages: NDArray[np.int8]
    by_count: dict[int, tuple[PlannedProjector, ...]]
    certificate: Certificate
    most_area: tuple[PlannedProjector, ...]


def plan_projectors(
    scene: Scene,
    template: PlannedProjector,
    n_candidates: int,
    *,
    ring_offset: tuple[float, float],
    rounds: int = _ROUNDS,
) -> ProjectorStage:
    """Choose the fewest projectors that light the required share of the target.

    The best of a lattice of candidates get more candidates around them, and the cover
    is solved again over all. A minimal cover overfits its samples; so it is tested on
    fresh ones, and where it falls short there, they join the rows and the cover is
    solved once more.

    Args:
        scene: Surface and requirements.
        template: Optics and rings of the projector.
        n_candidates: Poses offered.
        ring_offset: Tilt and azimuth of the ring axis until the cameras are known.
        rounds: Covers at most, each with more rows.

    Raises:
        NothingLitError: If no candidate lights any sample.
    """
    required = scene.requirements
    # Those that stand already come first, and are in every cover.
    candidates = existing_projectors(required, template, ring_offset)
    site = scene.site("projector", template.device)

    def lattice(n: int) -> tuple[PlannedProjector, ...]:
        return projector_candidates(
            template, required.workspace, n, ring_offset=ring_offset, site=site
        )

    candidates += candidates_with_clearance(scene, n_candidates, lattice)
    rows = scene.target_samples(_ROWS, _STREAM)
    stages = lit_stages(scene, candidates, rows)
    if not np.any(stages == projector_limits.LIT):
        raise NothingLitError(candidates, rows, stages)
    # The best of a lattice lies beside the best there is.
    n_lattice = len(candidates)
    around = projectors_around(
        movable([candidates[i] for i in _good_cover(scene, stages)]),
        required.workspace,
        n_lattice,
        ring_offset=ring_offset,
        site=site,
    )
    around = with_clearance(scene, around)
    stages = np.concatenate([stages, lit_stages(scene, around, rows)], axis=1)
    candidates += around
    given = _n_given(scene)

    def finer(rows: Target) -> Offer:
        more = candidates_with_clearance(scene, _FINER * n_candidates, lattice)
        more = candidates[:given] + more
        return Offer(more, lit_stages(scene, more, rows))

    attempt = 0
    while True:
        attempt += 1
        offer = Offer(candidates, stages)
        offer, selection = _fewer(
            scene, rows, offer, n_lattice, finer, ring_offset, thorough=attempt == 1
        )
        candidates, stages = offer.projectors, offer.stages
        fresh = scene.target_samples(_CHECK_ROWS, _STREAM + attempt)
        fresh_stages = lit_stages(scene, candidates, fresh)
        lit = fresh_stages == projector_limits.LIT
        covered = lit[:, selection.chosen].any(axis=1).sum()
        confirmed = covered >= required.dominant_coverage * lit.any(axis=1).sum()
        if confirmed or selection.status == "infeasible" or attempt == rounds:
            break
        rows = merged(rows, fresh)
        stages = np.concatenate([stages, fresh_stages])
    most_area = selection.chosen
    if confirmed and selection.status != "infeasible":
        wider = _with_widest_margin(scene, candidates, rows, stages, selection)
        covered = lit[:, wider.chosen].any(axis=1).sum()
        if covered >= required.dominant_coverage * lit.any(axis=1).sum():
            selection = wider
    return _stage(scene, candidates, rows, stages, selection, most_area)


def _with_widest_margin(
    scene: Scene,
    candidates: tuple[PlannedProjector, ...],
    rows: Target,
    stages: NDArray[np.int8],
    selection: Selection,
) -> Selection:
    """Return the selection with as many candidates of larger margin, if there are."""
    margin = lit_margins(scene, candidates, rows, stages == projector_limits.LIT)
    chosen = widest_selection(
        margin,
        selection.chosen,
        selection.required,
        seed=scene.seed,
        given=_n_given(scene),
    )
    return replace(selection, chosen=chosen)


def _fewer(
    scene: Scene,
    rows: Target,
    offer: Offer,
    n_lattice: int,
    finer: Callable[[Target], Offer],
    ring_offset: tuple[float, float],
    *,
    thorough: bool,
) -> tuple[Offer, Selection]:
    """Return the fewest of the poses, others offered as long as they save one.

    Near misses are pursued on the first rows only: where fresh ones have joined them,
    a cover so tight has failed already.
    """
    selection = select_fewest(_cover(scene, offer.stages))
    lattice = offer.take(np.arange(n_lattice))
    given = _n_given(scene)
    more = cache(lambda: finer(rows))
    while selection.needed > given + 1:
        moved = one_fewer(
            scene,
            lattice,
            selection.needed - 1,
            finer=more,
            reached=np.any(offer.stages == projector_limits.LIT, axis=1),
            stages_of=lambda projectors: lit_stages(scene, projectors, rows),
            given=given,
            ring_offset=ring_offset,
            thorough=thorough,
        )
        if moved is None:
            break
        offer = offer.joined(moved)
        n_candidates, n_moved = len(offer.projectors), len(moved.projectors)
        known = np.arange(n_candidates - n_moved, n_candidates)
        known = np.concatenate([np.arange(given), known])
        again = select_fewest(_cover(scene, offer.stages), known=known)
        if again.needed >= selection.needed:
            break
        selection = again
    if selection.lower_bound < selection.needed:
        # Only a count that is kept is worth a longer proof.
        selection = select_fewest(
            _cover(scene, offer.stages), known=selection.smallest, budget=_PROOF_BUDGET
        )
    return offer, selection


def with_more(
    scene: Scene, stage: ProjectorStage, more: tuple[PlannedProjector, ...]
) -> ProjectorStage:
    """Return the stage with more candidates where they need fewer projectors.

    Else it is returned as it was: more candidates alone are no better plan.
    """
    lit = lit_stages(scene, more, stage.rows)
    stages = np.concatenate([stage.stages, lit], axis=1)
    before = stage.certificate.needed.count
    # Mostly they save none, and nothing is spent on which cover most.
    if fewest_count(_cover(scene, stages)) >= before:
        return stage
    selection = select_fewest(_cover(scene, stages))
    every = stage.reference + more
    found = _stage(scene, every, stage.rows, stages, selection, selection.chosen)
    # Bodies in each other's way may cost what fewer would have saved.
    return found if found.certificate.needed.count < before else stage


def _good_cover(scene: Scene, stages: NDArray[np.int8]) -> NDArray[np.int64]:
    """Return candidates that light what is required, no proof asked."""
    cover = _cover(scene, stages)
    return solve_cover(cover.problem, seed=scene.seed, budget=_SEEDS_BUDGET).selected


def _cover(scene: Scene, stages: NDArray[np.int8]) -> CandidateCover:
    required = scene.requirements
    return CandidateCover(
        stages == projector_limits.LIT,
        required.dominant_coverage,
        seed=scene.seed,
        max_count=required.max_projectors,
        n_existing=_n_given(scene),
    )


def _n_given(scene: Scene) -> int:
    return len(scene.requirements.existing_of("projector"))


def _stage(
    scene: Scene,
    candidates: tuple[PlannedProjector, ...],
    rows: Target,
    stages: NDArray[np.int8],
    selection: Selection,
    most_area: NDArray[np.int64],
) -> ProjectorStage:
    cover, given = _cover(scene, stages), _n_given(scene)
    crowd, as_before = ProjectorInterference(candidates, rows, cover.covers), selection
    selection = resolve_conflicts(crowd, cover, selection)
    if selection is not as_before:
        most_area = selection.chosen
    others = marginals(cover, selection)
    others = resolve_others(crowd, cover, others, len(selection.chosen))
    proof = certificate(
        selection,
        others,
        n_rows=len(rows),
        row_area_m2=rows.samples.weight,
        n_candidates=len(candidates),
        given=given,
    )
    if crowd.bodied:
        proof = proof.changed(bounds_leave_out=BODIES_LEFT_OUT)
    proof = proof.changed(
        excluded_pairs={
            cause: int((stages == index).sum())
            for index, cause in enumerate(projector_limits.CAUSES)
            if index != projector_limits.BLOCKED or scene.standing
        },
        n_regions=int(scene.region.max()) + 1,
    )
    return ProjectorStage(
        tuple(candidates[i] for i in selection.chosen),
        candidates,
        rows,
        stages,
        {
            number: tuple(candidates[i] for i in chosen)
            for number, chosen in others.by_count.items()
        },
        proof,
        tuple(candidates[i] for i in most_area),
    )
