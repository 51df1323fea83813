"""What is proved of the number of devices that serve a family.

Whoever serves all members serves each: the cover of all bounds the rig, and so does the
bound of any one of them. Where k members may be left out, whichever these are, the
(k + 1)-th largest of all members' bounds holds.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

from planning.cameras.proved_cameras import CameraStage, bound_stage
from planning.model.document.certificates import Certificate
from planning.model.document.family_records import (
    FamilyCount,
    FamilyRecord,
    MemberBound,
)
from planning.model.progress import Stopwatch
from planning.projectors.projector_stage import ProjectorStage
from planning.projectors.proved_projectors import bound_of, with_bound
from planning.proofs import camera_bound, projector_bound
from planning.report.partial_plan import PartialPlan
from planning.scene.draws import DRAWS

from .member_stages import MemberNeeds, member_needs, outsider_needs
from .prepared_family import PreparedFamily

_S = TypeVar("_S", ProjectorStage, CameraStage)


@dataclass(frozen=True, eq=False)
class FamilyProofs:
    """What each member takes for itself, in their order."""

    needs: tuple[MemberNeeds, ...]

    @classmethod
    def over_candidates(
        cls, family: PreparedFamily, partial: PartialPlan
    ) -> "FamilyProofs":
        """Return what is proved of each member over the family's candidates."""
        place = {member: k for k, member in enumerate(family.served)}
        needs: list[MemberNeeds] = []
        for member, ready in enumerate(family.members):
            ready.scene.check_cancelled()
            if member in place:
                first = family.first_face(place[member])
                needs.append(member_needs(ready, partial, first, place[member]))
                continue
            scene = ready.scene
            draws = DRAWS.projectors, DRAWS.cameras
            lights, views = (scene.target_samples(draw) for draw in draws)
            needs.append(outsider_needs(ready, partial, (lights, views)))
        return cls(tuple(needs))

    def over_poses(self, family: PreparedFamily, clock: Stopwatch) -> "FamilyProofs":
        """Return the same with bounds over every pose, of members that may matter."""
        prove, rig = family.request.prove, family.request.rig
        left = len(family.members) - family.asked.n_asked

        def of_projectors(member: int) -> ProjectorStage:
            ready, stage = family.members[member], self.needs[member].projectors
            effort = projector_bound.PROVE if prove else projector_bound.DEFAULT
            bound = bound_of(ready.scene, stage, ready.templates, effort)
            return with_bound(stage, bound)

        def of_cameras(member: int) -> CameraStage:
            stage = self.needs[member].cameras
            effort = camera_bound.PROVE if prove else camera_bound.DEFAULT
            scene = family.members[member].scene
            return bound_stage(scene, stage, rig.optics[1], effort)

        needs = list(self.needs)
        with clock.stage("bounds", "bounds over all poses of the workspace, by member"):
            counts = [one.projectors.certificate.needed.count for one in needs]
            for member, stage in _promising(counts, left, of_projectors).items():
                needs[member] = replace(needs[member], projectors=stage)
            counts = [one.cameras.certificate.needed.count for one in needs]
            for member, views in _promising(counts, left, of_cameras).items():
                needs[member] = replace(needs[member], cameras=views)
        return FamilyProofs(tuple(needs))

    def record(self, family: PreparedFamily, partial: PartialPlan) -> FamilyRecord:
        """Return `family` of the plan; `worst` is found when members are written."""
        asked = family.asked
        left = [m for m in range(len(family.members)) if m not in family.served]
        lights, views = partial.stage, partial.camera_stage
        return FamilyRecord(
            align=asked.align,
            quantile=asked.quantile,
            n_asked=asked.n_asked,
            worst=family.served[0],
            left_out=tuple(left),
            projectors=_count(
                lights.certificate,
                len(partial.projectors),
                [one.projectors.certificate for one in self.needs],
                asked.n_asked,
            ),
            cameras=_count(
                views.certificate,
                len(partial.cameras),
                [one.cameras.certificate for one in self.needs],
                asked.n_asked,
            ),
        )


def _promising(
    counts: Sequence[int], left: int, bounded: Callable[[int], _S]
) -> dict[int, _S]:
    """Bound members over all poses, those that take most first, as long as it may help.

    A member's bound is no more than it takes over the candidates.
    """
    stages: dict[int, _S] = {}
    bounds: list[int] = []
    for member in sorted(range(len(counts)), key=lambda m: (-counts[m], m)):
        bounds.sort(reverse=True)
        if len(bounds) > left and counts[member] <= bounds[left]:
            break
        stages[member] = bounded(member)
        proof = stages[member].certificate.continuous
        bounds.append(0 if proof is None else proof.lower_bound)
    return stages


def _count(
    together: Certificate, count: int, members: Sequence[Certificate], n_asked: int
) -> FamilyCount:
    left = len(members) - n_asked
    hardest = max(range(len(members)), key=lambda m: members[m].needed.count)
    by_poses = sorted(
        (-proof.continuous.lower_bound, m)
        for m, proof in enumerate(members)
        if proof.continuous is not None
    )[left : left + 1]
    own = sorted((-proof.needed.lower_bound, m) for m, proof in enumerate(members))
    least, member = -own[left][0], own[left][1]
    proof = f"member {member}: {members[member].candidates.proof}"
    if left == 0 and together.needed.lower_bound >= least:
        least, proof = together.needed.lower_bound, together.candidates.proof
    return FamilyCount(
        count=count,
        needed=together.needed.count,
        lower_bound=min(least, together.needed.count),
        n_candidates=together.candidates.n_candidates,
        n_samples=together.n_samples,
        proof=proof,
        hardest=_told(hardest, members[hardest]),
        over_poses=_told(by_poses[0][1], members[by_poses[0][1]], poses=True)
        if by_poses
        else None,
    )


def _told(member: int, proof: Certificate, *, poses: bool = False) -> MemberBound:
    bound = proof.continuous if poses and proof.continuous else proof.candidates
    return MemberBound(
        member=member,
        count=proof.needed.count,
        lower_bound=bound.lower_bound,
        proof=bound.proof,
    )
