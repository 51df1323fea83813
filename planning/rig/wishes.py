"""What a user asks of a plan, from the command line to the requirements."""

from dataclasses import dataclass
from typing import Literal

from planning.model.document.ring_records import RingAxis
from planning.model.errors import InputError

Pattern = Literal["rings", "dense", "none"]
AccuracyOf = Literal["noise", "total"]
TargetName = Literal["dominant", "surface", "outside"]
# Pairs that may be asked for of each point: more are no survival but another rig.
MOST_VIEWS = 8


@dataclass(frozen=True)
class Wishes:
    """What is asked of a plan beside what its rig says; None: as the rig has it.

    As many cameras as needed where `max_cameras` is None. The target is then that of
    dominant regions, and the whole surface of a body known by its ranges. `robust` is
    the share of drawn rigs that must meet what is asked; None: none is drawn.
    `views` pairs at least measure what counts, and any `survive` devices may be lost.
    `joint` asks for projectors and cameras that were planned together.
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
    joint: bool = False
    max_heads: int | None = None


def check_counts(wishes: Wishes) -> None:
    """Refuse fewer devices than any plan has.

    Raises:
        InputError: It says how many there must be.
    """
    least = {"max_projectors": 1, "max_cameras": 1}
    if wishes.pattern == "none":
        least = {"max_projectors": 0, "max_cameras": 2}
        if wishes.max_projectors:
            raise InputError(
                f"max_projectors = {wishes.max_projectors} with pattern 'none', which "
                f"has no projector: leave it out, or make it 0"
            )
    for name, few in least.items():
        most = getattr(wishes, name)
        if most is not None and not most >= few:
            raise InputError(f"{name} = {most} must be {few} or more")


def views_alone(wishes: Wishes) -> int:
    """Return how many cameras must see what counts where there is no projector.

    Raises:
        InputError: If it is fewer than two, or more than may be asked for.
    """
    views = 2 if wishes.views is None else wishes.views
    if not 2 <= views <= MOST_VIEWS:
        raise InputError(
            f"views = {views} must be from 2 to {MOST_VIEWS} with pattern 'none': one "
            f"camera alone measures nothing"
        )
    most = wishes.max_cameras
    if most is not None and most < views:
        raise InputError(
            f"views = {views} with max_cameras = {most}: what counts must be seen by "
            f"more cameras than there may be; ask for fewer, or allow more"
        )
    return views
