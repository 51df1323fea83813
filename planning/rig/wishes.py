"""What a user asks of a plan, from the command line to the requirements."""

from dataclasses import dataclass
from typing import Literal

Pattern = Literal["rings", "dense", "none"]
TargetName = Literal["dominant", "surface"]


@dataclass(frozen=True)
class Wishes:
    """What is asked of a plan beside what its rig says.

    Attributes:
        max_projectors: Projectors at most.
        max_cameras: Cameras at most; None: as many as needed.
        target: `dominant` regions or the whole `surface`; None: the former, and the
            latter of a body known by its ranges.
        pattern: `rings`, `dense` or `none`.
        dominant_coverage: Lit over reachable; None: what the rig says.
        coverage: Measured over reachable; None: what the rig says.
        min_reachable: Reachable over target; None: what the rig says.
        accuracy_mm: Largest s_N in [mm]; None: what the rig says.
        up: x, y, z, -x, -y or -z; None: what the rig says.
    """

    max_projectors: int
    max_cameras: int | None = None
    target: TargetName | None = None
    pattern: Pattern = "rings"
    dominant_coverage: float | None = None
    coverage: float | None = None
    min_reachable: float | None = None
    accuracy_mm: float | None = None
    up: str | None = None
