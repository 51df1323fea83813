"""`family` of a plan: one rig for several meshes, and what is proved of all."""

from typing import Annotated, Literal

from pydantic import Field

from .part import Part, Pose

AlignedBy = Literal["given", "axes", "icp"]
Count = Annotated[int, Field(ge=0)]


class AlignmentRecord(Part):
    """Where a member stands: as its file says, or moved to the first member.

    Attributes:
        world_from_file: What moved it; the identity where it stands as given.
        rms_before_m: Root mean square distance of its surface from the first member's
            before it was moved; None: it stands as given.
        rms_m: The same after.
    """

    world_from_file: Pose
    rms_before_m: float | None = None
    rms_m: float | None = None


class MemberBound(Part):
    """Devices that a member takes for itself: found, and at least.

    Attributes:
        member: Its index.
        count: Candidates that were found to be enough for it.
        lower_bound: Proven least number.
        proof: What proves it.
    """

    member: Count
    count: Count
    lower_bound: Count
    proof: str = ""


class FamilyCount(Part):
    """What is proved of the number of devices that serve a family.

    Attributes:
        count: Devices of the plan.
        needed: Candidates that were found to be enough, allowed or not.
        lower_bound: Proven least number of candidates; of cameras for these projectors.
        n_candidates: Of which they are.
        n_samples: Of all members together.
        proof: What proves the bound: a cover of all members, or of one.
        hardest: The member that takes most for itself, over the candidates.
        over_poses: The member of which most is proved over every pose; None: of none.
    """

    count: Count
    needed: Count
    lower_bound: Count
    n_candidates: Count
    n_samples: Count
    proof: str
    hardest: MemberBound
    over_poses: MemberBound | None = None


class FamilyRecord(Part):
    """One rig for several meshes.

    Attributes:
        align: How the members were laid over each other.
        quantile: Share of the members that must be served.
        n_asked: Members that this is.
        worst: Index of the served member that misses a requirement, if any does, and of
            which the smallest share of what is asked is met; the rest of the plan is of
            this one.
        left_out: Indices of members that the rig needn't serve.
        projectors: Of their number; `cameras` likewise.
    """

    align: AlignedBy
    quantile: Annotated[float, Field(gt=0.0, le=1.0)]
    n_asked: Count
    worst: Count
    left_out: tuple[Count, ...] = ()
    projectors: FamilyCount
    cameras: FamilyCount
