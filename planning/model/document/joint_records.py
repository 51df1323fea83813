"""What planning projectors and cameras together saved, and what is proved of it."""

from typing import Literal

from .part import Part


class DeviceCount(Part):
    """Devices of a plan.

    Attributes:
        cost: What they cost together: each 1 where the rig states no `cost`.
    """

    projectors: int
    cameras: int
    cost: float


class JointScope(Part):
    """What the joint program chose from: so many of the reference poses, and samples.

    The devices of the two stages are among them.
    """

    projectors: int
    cameras: int
    samples: int


class JointRecord(Part):
    """What `--joint` found beside the plan of projectors first, then cameras.

    Attributes:
        two_stage: Projectors first, the fewest, then the fewest cameras for these.
        joint: Of this plan.
        found: What gave its numbers: `two stages`, the `candidates` of the joint
            program, or devices that were left out while the others moved (`poses`).
        over: What the joint program chose from.
        needed: Cost of its answer, for its samples.
        lower_bound: Proven least cost of any choice from it, for its samples.
        status: Whether both are the same (`optimal`).
        proof: What proves the bound.
        margin_before: Slack at the required share, as a share of limits, that the
            devices had before they were moved together; None: too little is measured.
        margin: The same of this plan.
    """

    two_stage: DeviceCount
    joint: DeviceCount
    found: Literal["two stages", "candidates", "poses"]
    over: JointScope
    needed: float
    lower_bound: float
    status: Literal["optimal", "feasible"]
    proof: str
    margin_before: float | None
    margin: float | None
