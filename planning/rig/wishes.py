"""What a user asks of a plan, from the command line to the requirements."""

from dataclasses import dataclass
from typing import Literal

from planning.model.document.ring_records import RingAxis

Pattern = Literal["rings", "dense", "none"]
AccuracyOf = Literal["noise", "total"]
TargetName = Literal["dominant", "surface"]


@dataclass(frozen=True)
class Wishes:
    """What is asked of a plan beside what its rig says; None: as the rig has it.

    As many cameras as needed where `max_cameras` is None. The target is then that of
    dominant regions, and the whole surface of a body known by its ranges. `robust` is
    the share of drawn rigs that must meet what is asked; None: none is drawn.
    `views` pairs at least measure what counts, and any `survive` devices may be lost.
    Sensor heads, of a rig that has them, are at most `max_heads`.
    """

    max_projectors: int
    max_cameras: int | None = None
    target: TargetName | None = None
    pattern: Pattern = "rings"
    dominant_coverage: float | None = None
    coverage: float | None = None
    min_reachable: float | None = None
    region_coverage: float | None = None
    accuracy_mm: float | None = None
    accuracy_of: AccuracyOf = "total"
    up: str | None = None
    ring_axis: RingAxis | None = None
    robust: float | None = None
    views: int | None = None
    survive: int = 0
    max_heads: int | None = None
