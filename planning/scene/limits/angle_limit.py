"""At which angles ray and light, or two rays, may meet."""

from collections.abc import Iterator

import numpy as np

from planning.model.requirements import TriangulationLimits

from .camera_limits import ROUNDING
from .limit import Array, Limit, LimitRelaxation, Mask, RigFacts, to_step
from .pair_quality import PairCell, PairQuality

# Beyond it no least angle is worth relaxing: first-order errors hold no longer [deg].
_LEAST_ANGLE = 3.0


class Angle(Limit[PairQuality, PairCell, TriangulationLimits]):
    """Ray and light meet at min_angle to max_angle, of coded pixels."""

    name = "angle"
    words = "where ray and light meet at too small or too large an angle"

    def holds(self, view: PairQuality, rules: TriangulationLimits) -> Mask | None:
        """Return which samples lie between both."""
        if view.light_cos is None:
            return None
        low, high = rules.angles
        return (view.light_cos <= np.cos(low)) & (view.light_cos >= np.cos(high))

    def may_hold(self, cell: PairCell, rules: TriangulationLimits) -> Mask | None:
        """Return which may, of all angles that a cell leaves."""
        if cell.angles is None:
            return None
        (least, largest), (low, high) = cell.angles, rules.angles
        return (largest >= low - ROUNDING) & (least <= high + ROUNDING)

    def relaxations(self, facts: RigFacts) -> Iterator[LimitRelaxation]:
        """Yield a smaller least angle, and a larger largest one; of rings neither."""
        if facts.required.pattern == "rings":
            return
        low, high = facts.required.triangulation.angles

        def met(pair: PairQuality) -> Array:
            cosine = np.ones(0) if pair.light_cos is None else pair.light_cos
            return np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))

        yield LimitRelaxation(
            self.name,
            lambda pair: np.where(
                (met(pair) >= _LEAST_ANGLE) & (met(pair) < np.degrees(low)),
                -met(pair),
                np.inf,
            ),
            to_step(1.0),
            lambda value: (
                f"limits.min_angle_deg = {-value:.0f} (now {np.degrees(low):g})"
            ),
        )
        yield LimitRelaxation(
            self.name,
            lambda pair: np.where(met(pair) > np.degrees(high), met(pair), np.inf),
            to_step(1.0),
            lambda value: (
                f"limits.max_angle_deg = {value:.0f} (now {np.degrees(high):g})"
            ),
        )
