"""One rig that serves every member of a family, or the share of them that is asked."""

from dataclasses import dataclass, replace

from planning.cameras.camera_cover import candidate_cover
from planning.model.document.family_records import FamilyRecord
from planning.model.plan import RigPlan
from planning.model.progress import Stopwatch
from planning.model.words import count_words
from planning.projectors.projector_stage import ProjectorStage
from planning.report.assemble import Draft
from planning.report.partial_plan import PartialPlan, PlanRequest
from planning.rig.devices.lens_fit import check_fields
from planning.steps.best_kept import Search
from planning.steps.stages import (
    first_projectors,
    one_device_more,
    placed,
    polished,
    with_free_axes,
)

from .family_plan import family_plan
from .family_proofs import FamilyProofs
from .left_out import costly_members, unreachable_members
from .member_stages import member_partial
from .prepared_family import PreparedFamily, prepared_family

_COSTLY = "which cost more"


@dataclass(frozen=True, eq=False)
class FamilyPartial:
    """The rig of a family as far as it came, with what is proved of it so far."""

    family: PreparedFamily
    partial: PartialPlan
    proofs: FamilyProofs | None = None
    truncated: bool = False


@dataclass(frozen=True, eq=False)
class FamilyDraft:
    """Drafts of every member's plan, each from fresh samples of its own."""

    family: PreparedFamily
    members: tuple[Draft, ...]
    record: FamilyRecord

    @classmethod
    def of(cls, made: FamilyPartial, clock: Stopwatch) -> "FamilyDraft":
        """Recompute the areas of every member."""
        family, partial = made.family, replace(made.partial, truncated=made.truncated)
        proofs = made.proofs or FamilyProofs.over_candidates(family, partial)
        drafts = tuple(
            Draft.of(member_partial(ready, partial, needs), clock)
            for ready, needs in zip(family.members, proofs.needs, strict=True)
        )
        return cls(family, drafts, proofs.record(family, partial))

    def written(self, clock: Stopwatch) -> RigPlan:
        """Return the plan of the family."""
        asked = self.family.asked
        plans = tuple(draft.written(clock) for draft in self.members)
        return family_plan(plans, asked.names, asked.alignments, self.record)


def family_sought(
    request: PlanRequest, clock: Stopwatch
) -> Search[FamilyPartial, FamilyDraft]:
    """Devices and rings for all members that are served; proofs; one device more."""
    check_fields(request.rig.fits(request.mesh))
    family = prepared_family(request, clock)
    family, stage = _projectors(family, clock)
    partial = placed(family.ready, stage, clock)
    fewer = _without_costly_views(family, partial, clock)
    if fewer.served != family.served:
        family = fewer
        stage = first_projectors(family.ready, clock)
        partial = placed(family.ready, stage, clock)
    larger: PartialPlan | None = partial
    while larger is not None:
        yield FamilyPartial(family, larger), False
        partial = polished(larger, clock)
        yield FamilyPartial(family, partial), False
        proofs = FamilyProofs.over_candidates(family, partial)
        proofs = proofs.over_poses(family, clock)
        draft = yield FamilyPartial(family, partial, proofs), True
        assert draft is not None
        larger = _larger(family, partial, draft, clock)


def _projectors(
    family: PreparedFamily, clock: Stopwatch
) -> tuple[PreparedFamily, ProjectorStage]:
    """The fewest projectors, without members that may be left out.

    Those of which too little can be lit first, then those that cost projectors.
    """
    stage = first_projectors(family.ready, clock)
    dark = unreachable_members(stage.candidates, len(family.served), family.spare)
    if dark:
        family = _without(family, dark, "too little of which can be lit", clock)
        stage = first_projectors(family.ready, clock)
    if not family.spare:
        return family, stage
    needed = stage.certificate.needed.count
    costly = costly_members(stage.candidates.cover, needed, family.spare)
    if not costly:
        return family, stage
    family = _without(family, costly, _COSTLY, clock)
    return family, first_projectors(family.ready, clock)


def _without_costly_views(
    family: PreparedFamily, partial: PartialPlan, clock: Stopwatch
) -> PreparedFamily:
    """The family without members that cost cameras, as far as any may be left out."""
    if not family.spare:
        return family
    stage = partial.camera_stage
    cover = candidate_cover(
        partial.scene, stage.cover.measured, stage.cover.samples, stage.reference
    )
    needed = stage.certificate.needed.count
    costly = costly_members(cover, needed, family.spare)
    return _without(family, costly, _COSTLY, clock) if costly else family


def _without(
    family: PreparedFamily, places: frozenset[int], why: str, clock: Stopwatch
) -> PreparedFamily:
    left = [family.asked.names[family.served[place]] for place in sorted(places)]
    members = count_words(len(left), "member")
    clock.say(f"  {members} left out, {why}: {', '.join(left)}")
    return family.without(sorted(places))


def _larger(
    family: PreparedFamily, partial: PartialPlan, draft: FamilyDraft, clock: Stopwatch
) -> PartialPlan | None:
    """The rig with other axes or one device more, where any member falls short."""
    for member in family.served:
        own = draft.members[member]
        larger = with_free_axes(partial, own, clock)
        larger = larger or one_device_more(partial, own, clock)
        if larger is not None:
            return larger
    return None
