"""At which angles ray and light, or two rays, may meet."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from planning.model.requirements import TriangulationLimits

from .camera_limits import ROUNDING
from .limit import Array, Limit, LimitRelaxation, Mask, RigFacts, degrees, to_step
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

        def cosines(pair: PairQuality) -> Array:
            return np.ones(0) if pair.light_cos is None else pair.light_cos

        yield from wider_angles(self.name, facts, cosines)


def wider_angles(
    name: str, facts: RigFacts, cosines: Callable[[Any], Array]
) -> Iterator[LimitRelaxation]:
    """Yield a smaller least angle and a larger largest one, by a view's cosines."""
    low, high = np.degrees(facts.required.triangulation.angles)

    def smaller(view: object) -> Array:
        met = degrees(cosines(view))
        return np.where((met >= _LEAST_ANGLE) & (met < low), -met, np.inf)

    def larger(view: object) -> Array:
        met = degrees(cosines(view))
        return np.where(met > high, met, np.inf)

    yield LimitRelaxation(
        name,
        smaller,
        to_step(1.0),
        lambda value: f"limits.min_angle_deg = {-value:.0f} (now {low:g})",
    )
    yield LimitRelaxation(
        name,
        larger,
        to_step(1.0),
        lambda value: f"limits.max_angle_deg = {value:.0f} (now {high:g})",
    )
