"""How bright samples must come out in the image of a pair's camera."""

from collections.abc import Iterator

import numpy as np

from planning.model.light.light_budget import SATURATED
from planning.model.requirements import TriangulationLimits

from .limit import Array, Limit, LimitRelaxation, Mask, RigFacts, to_three_digits
from .pair_quality import PairCell, PairQuality

# More or less light by more than this is another rig.
_MOST_LIGHT = 30.0


class TooDark(Limit[PairQuality, PairCell, TriangulationLimits]):
    """Lit less dark >= min_contrast, where the surface is darkest."""

    name = "too_dark"
    words = "too dark in the image"

    def holds(self, view: PairQuality, rules: TriangulationLimits) -> Mask | None:
        """Return where lit and dark can be told apart."""
        if view.grey is None or rules.light is None:
            return None
        return view.grey.contrast >= rules.light.min_contrast

    def relaxations(self, facts: RigFacts) -> Iterator[LimitRelaxation]:
        """Yield more light: of the projector, through the lens, or for longer."""
        light = facts.required.triangulation.light
        if light is None:
            return
        least, lumens, number = light.min_contrast, light.lumens, light.f_number
        longest, step = 1e3 * light.max_exposure_s, 1e3 * (light.period_s or 0.0)

        def exposed(times: float) -> float:
            return step * np.ceil(times * longest / step) if step else times * longest

        yield LimitRelaxation(
            self.name,
            lambda pair: _within(least / np.maximum(pair.grey.contrast, 1e-9)),
            to_three_digits,
            lambda times: (
                f"photometry.lumens = {times * lumens:.4g} (now {lumens:g}), "
                f"camera.focus.f_number = {number / times**0.5:.3g} (now {number:g}) "
                f"or photometry.max_exposure_ms = {exposed(times):.4g} (now "
                f"{longest:.3g})"
            ),
        )


class Clipped(Limit[PairQuality, PairCell, TriangulationLimits]):
    """Lit surface below full scale, where it is brightest."""

    name = "clipped"
    words = "too bright for the sensor"

    def holds(self, view: PairQuality, rules: TriangulationLimits) -> Mask | None:
        """Return what doesn't clip."""
        return None if view.grey is None else view.grey.white < SATURATED

    def relaxations(self, facts: RigFacts) -> Iterator[LimitRelaxation]:
        """Yield less light."""
        light = facts.required.triangulation.light
        if light is None:
            return
        lumens, number = light.lumens, light.f_number
        yield LimitRelaxation(
            self.name,
            lambda pair: _within(pair.grey.white / SATURATED),
            to_three_digits,
            lambda times: (
                f"camera.focus.f_number = {number * times**0.5:.3g} (now {number:g}) "
                f"or photometry.lumens = {lumens / times:.4g} (now {lumens:g})"
            ),
        )


def _within(times: Array) -> Array:
    return np.where(times <= _MOST_LIGHT, times, np.inf)
