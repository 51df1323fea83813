"""When two cameras measure a sample by each other's images, `--pattern none`."""

from collections.abc import Iterator
from typing import Any, Protocol

import numpy as np

from planning.model.requirements import TriangulationLimits

from .camera_limits import SEEN_CAUSES
from .limit import (
    Array,
    Limit,
    LimitRelaxation,
    Mask,
    RigFacts,
    causes,
    degrees,
    to_step,
    to_three_digits,
)

# Below this no limit is worth relaxing: first-order errors hold no longer [degrees].
_LEAST_ANGLE = 3.0


class MetRays(Protocol):
    """What the limits ask of two cameras' rays at n samples."""

    @property
    def cosine(self) -> Array:
        """Of the angle at which they meet, shape (n,)."""
        ...

    @property
    def sigma(self) -> Array:
        """Deviation along the normal [m], shape (n,)."""
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
        low, high = np.degrees(facts.required.triangulation.angles)
        yield LimitRelaxation(
            self.name,
            lambda pair: np.where(
                (degrees(pair.cosine) >= _LEAST_ANGLE) & (degrees(pair.cosine) < low),
                -degrees(pair.cosine),
                np.inf,
            ),
            to_step(1.0),
            lambda value: f"limits.min_angle_deg = {-value:.0f} (now {low:g})",
        )
        yield LimitRelaxation(
            self.name,
            lambda pair: np.where(
                degrees(pair.cosine) > high, degrees(pair.cosine), np.inf
            ),
            to_step(1.0),
            lambda value: f"limits.max_angle_deg = {value:.0f} (now {high:g})",
        )


class ViewSigma(Limit[MetRays, Any, TriangulationLimits]):
    """s_N, or with the calibration's s_C sqrt(s_N^2 + s_C^2), <= max_sigma."""

    name = "view_sigma"
    words = "measured by cameras with too large a deviation"

    def holds(self, view: MetRays, rules: TriangulationLimits) -> Mask | None:
        """Return which samples are measured exactly enough."""
        limit = rules.max_sigma_m
        return None if limit is None else view.sigma <= limit

    def relaxations(self, facts: RigFacts) -> Iterator[LimitRelaxation]:
        """Yield a larger deviation."""
        limit = facts.required.triangulation.max_sigma_m
        if limit is None:
            return
        yield LimitRelaxation(
            self.name,
            lambda pair: 1e3 * pair.sigma,
            to_three_digits,
            lambda value: f"--accuracy {value:.3g} (now {1e3 * limit:g} mm)",
        )


VIEW_PAIR_LIMITS: tuple[Limit[Any, Any, TriangulationLimits], ...] = (
    TooFewViews(),
    ViewAngle(),
    ViewSigma(),
)
VIEW_CAUSES = SEEN_CAUSES + causes(VIEW_PAIR_LIMITS)
FEW_VIEWS = len(SEEN_CAUSES)
MEASURED_BY_VIEWS = len(VIEW_CAUSES)
