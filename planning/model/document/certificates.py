"""`certificates`: what was proved of the numbers of devices, and over what."""

from typing import Literal

from pydantic import Field

from .part import Count, Part


class CandidateBound(Part):
    """Least number among the candidate poses.

    Attributes:
        status: `proved` where `proof.npz` has what derives it again; else `claimed`.
        for_total: Least number for the required area alone, whatever becomes of single
            regions; absent: no region has a floor.
    """

    lower_bound: Count
    n_candidates: Count
    proof: str = ""
    status: Literal["proved", "claimed"] = "claimed"
    for_total: Count | None = None


class ContinuousProof(Part):
    """What was proved over all poses of the workspace.

    Attributes:
        status: Whether it refutes fewer devices than are needed; or stopped, because
            cells that can't be split don't, or at a limit.
        occlusion: Whether shadows took part.
        n_samples: Samples that the bound speaks of.
        n_reached: Those of them that some candidate covers.
        one_fewer_upper_bound_m2: Most area that one device fewer covers, from any
            poses; None: not known.
        certificate: `offered` where `proof.npz` has multipliers by which others may
            derive the bound again; else `none`.
    """

    lower_bound: Count
    status: Literal["proved", "survived", "cut"]
    proof: str
    occlusion: bool
    n_samples: Count
    n_reached: Count
    n_cells: Count
    one_fewer_upper_bound_m2: float | None
    certificate: Literal["offered", "none"] = "none"


class NeededCount(Part):
    """How many devices the requirement takes, allowed or not.

    Attributes:
        count: Of the smallest cover that was found, with what fresh samples lacked.
        lower_bound: Proven least number.
        wider_field: Field with which the devices that are allowed would be enough.
        relaxations: Single changes with which they would be.
    """

    count: Count
    lower_bound: Count
    wider_field: str | None = None
    relaxations: tuple[str, ...] = ()


class CountArea(Part):
    """What so many candidates cover: found, and at most."""

    count: Count
    value_m2: float
    upper_bound_m2: float


class BestArea(Part):
    """What as many candidates as planned cover: found, and at most."""

    value_m2: float
    upper_bound_m2: float
    scope: Literal["candidates"] = "candidates"


class OneFewer(Part):
    """What one device fewer covers at most."""

    upper_bound_m2: float
    scope: Literal["candidates"] = "candidates"


CamerasBy = Literal["cover", "paper", "both"]


class RouteCounts(Part):
    """Cameras by either route, and which was taken; None: it has no answer."""

    asked: CamerasBy
    cover: Count | None
    paper: Count | None
    taken: Literal["cover", "paper"]
    why: str


class Certificate(Part):
    """What was proved of the projectors, or of the cameras given the projectors.

    Attributes:
        count: Devices of the plan.
        required_m2: Area that must be covered.
        floors: Regions of each of which `region_coverage` must be covered as well.
        n_samples: Samples that the cover was solved on.
        continuous: Over all poses; None: nothing was proved.
        greedy_count: Candidates that the greedy cover takes.
        one_fewer: None: all of them stand already.
        given: Existing devices, which the bounds count.
        but_for_bodies: How many would do if bodies took no room.
        bounds_leave_out: What the bounds know nothing of.
        excluded_pairs: Pairs of candidate and sample by the first limit that they fail.
        n_regions: Regions of the target.
        alone: Candidates that a member of a family takes for itself; None: no family.
    """

    count: Count
    status: Literal["optimal", "feasible", "infeasible"]
    required_m2: float
    n_samples: Count
    candidates: CandidateBound
    continuous: ContinuousProof | None
    greedy_count: Count
    needed: NeededCount
    by_count: tuple[CountArea, ...] = ()
    best_area: BestArea
    one_fewer: OneFewer | None
    given: Count = 0
    but_for_bodies: Count = 0
    bounds_leave_out: str = ""
    excluded_pairs: dict[str, Count] = Field(default={})
    n_regions: Count = 0
    floors: Count = 0
    routes: RouteCounts | None = None
    alone: Count | None = None


class ProofRecord(Part):
    """The file of certificates beside the plan, nowhere else."""

    path: Literal["proof.npz"]
    sha256: str


class Certificates(Part):
    """The certificates of a plan.

    Attributes:
        projectors: None: the pattern `none` has no projector.
        asked: As of `coverage`.
        proof: What bounds that are `proved` are derived from; None: none is.
    """

    projectors: Certificate | None = None
    cameras: Certificate
    asked: str | None = None
    proof: ProofRecord | None = None
