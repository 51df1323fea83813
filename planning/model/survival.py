"""How often a plan must measure, and what it must stand the loss of."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Survival:
    """What is asked of a plan beyond being measured once, with all devices there.

    Attributes:
        views: Pairs of projector and camera, at least, that must measure what counts.
        survive: Devices, 0 or 1, of which any may be lost: the rest must still meet
            the requirements.
    """

    views: int = 1
    survive: int = 0

    @property
    def asks(self) -> bool:
        """Whether anything is asked at all."""
        return self.views > 1 or self.survive > 0
