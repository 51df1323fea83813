"""When two cameras measure a sample by each other's images, `--pattern none`."""

from collections.abc import Iterator
from typing import Any, Protocol

import numpy as np

from planning.model.requirements import TriangulationLimits

from .angle_limit import wider_angles
from .camera_limits import SEEN_CAUSES
from .limit import Array, Limit, LimitRelaxation, Mask, RigFacts, causes
from .sigma_limit import MaxSigma


class MetRays(Protocol):
    """What the limits ask of two cameras' rays at n samples."""

    @property
    def cosine(self) -> Array:
        """Of the angle at which they meet, shape (n,)."""
        ...


class TooFewViews(Limit[Any, Any, TriangulationLimits]):
    """Enough cameras see it; counted, not looked at pair by pair."""

    name = "few_views"
    words = "seen by too few cameras"

    def holds(self, view: Any, rules: TriangulationLimits) -> None:  # noqa: ANN401
        """Return None: a pair says nothing of it."""


class ViewAngle(Limit[MetRays, Any, TriangulationLimits]):
    """min_angle <= angle of the two rays <= max_angle."""

    name = "view_angle"
    words = "where cameras meet at too small or too large an angle"

    def holds(self, view: MetRays, rules: TriangulationLimits) -> Mask:
        """Return which samples lie between both."""
        low, high = rules.angles
        return (view.cosine <= np.cos(low)) & (view.cosine >= np.cos(high))

    def relaxations(self, facts: RigFacts) -> Iterator[LimitRelaxation]:
        """Yield a smaller least angle, and a larger largest one."""
        yield from wider_angles(self.name, facts, lambda pair: pair.cosine)


class ViewSigma(MaxSigma):
    """By two cameras."""

    name = "view_sigma"
    words = "measured by cameras with too large a deviation"


VIEW_PAIR_LIMITS: tuple[Limit[Any, Any, TriangulationLimits], ...] = (
    TooFewViews(),
    ViewAngle(),
    ViewSigma(),
)
VIEW_CAUSES = SEEN_CAUSES + causes(VIEW_PAIR_LIMITS)
FEW_VIEWS = len(SEEN_CAUSES)
MEASURED_BY_VIEWS = len(VIEW_CAUSES)
