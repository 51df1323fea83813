"""The loosest mounting at which enough drawn rigs still meet what is asked.

One scale for all bounds is sought by doubling and bisection over the same drawn rigs,
so that a rig differs from one scale to the next by its bounds alone. A rig that met
what is asked at a scale is taken to meet it at every smaller one, and one that missed
it to miss it at every larger one. That needn't be so, so the scale is confirmed on
other rigs, and taken back until they agree.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil

from geometry.parallel import mapped
from planning.model.calibration_errors import Mounting
from planning.model.progress import Report

from .asked import Asked
from .built_case import BuiltCase
from .drawn_rigs import CONFIRMING, DRAWN, Deviates

# The largest scale tried, and the smallest, by powers of two.
_DOUBLINGS, _HALVINGS = 5, 6
_BISECTIONS = 5
# Where other rigs don't confirm a scale, it is taken back so far, so often.
_BACK, _TIMES_BACK = 0.9, 6


@dataclass(frozen=True)
class Loosest:
    """A mounting that still meets what is asked.

    Attributes:
        scale: Of the bounds stated; 0: none does, not even none at all.
        mounting: These bounds.
        n_met: Of the confirming rigs, those that meet what is asked there.
        n_confirming: How many they are.
        largest_tried: Whether no looser one was tried.
    """

    scale: float
    mounting: Mounting
    n_met: int
    n_confirming: int
    largest_tried: bool = False


class _Scales:
    """Which of the same rigs meet what is asked, scale by scale."""

    def __init__(
        self,
        case: BuiltCase,
        asked: Asked,
        mounting: Mounting,
        *,
        n: int,
        seed: int,
        threads: int,
    ) -> None:
        self._case, self._asked, self._mounting = case, asked, mounting
        self._seed, self._threads = seed, threads
        self._met, self._missed = [-1.0] * n, [float("inf")] * n

    def enough(self, scale: float, least: int) -> bool:
        """Return whether so many meet it; no more rigs are looked at than decide."""
        n = len(self._met)
        unknown = [k for k in range(n) if self._met[k] < scale < self._missed[k]]
        n_met = sum(met >= scale for met in self._met)
        while unknown and n_met < least <= n_met + len(unknown):
            some, unknown = unknown[: 4 * self._threads], unknown[4 * self._threads :]
            for index, meets in zip(some, self._meet(scale, some), strict=True):
                if meets:
                    self._met[index], n_met = scale, n_met + 1
                else:
                    self._missed[index] = scale
        return n_met >= least

    def confirmed(self, scale: float) -> int:
        """Return how many of as many other rigs meet it."""
        return sum(self._meet(scale, range(len(self._met)), CONFIRMING))

    def _meet(
        self, scale: float, rigs: list[int] | range, stream: int = DRAWN
    ) -> list[bool]:
        case, mounting = self._case, self._mounting.times(scale)
        sizes = len(case.rig.devices), len(case.target)

        def meets(index: int) -> bool:
            deviates = Deviates.drawn(
                *sizes, seed=self._seed, stream=stream, index=index
            )
            return not self._asked.missed(case.drawn(mounting, deviates))

        return mapped(meets, rigs, self._threads)


def loosest(
    case: BuiltCase,
    asked: Asked,
    mounting: Mounting,
    quantile: float,
    *,
    n: int,
    seed: int,
    threads: int = 2,
    report: Report = lambda line: None,
) -> Loosest:
    """Return the largest scale of a mounting that so many of n rigs meet."""
    scales = _Scales(case, asked, mounting, n=n, seed=seed, threads=threads)
    least = ceil(quantile * n)

    def enough(scale: float) -> bool:
        report(f"mounting {scale:.3g} times as loose")
        return scales.enough(scale, least)

    low, high = _bracket(enough)
    for _ in range(_BISECTIONS if 0.0 < low < high else 0):
        middle = (low * high) ** 0.5
        low, high = (middle, high) if enough(middle) else (low, middle)
    n_met = scales.confirmed(low)
    for _ in range(_TIMES_BACK):
        if n_met >= least or low == 0.0:
            break
        low *= _BACK
        report(f"other rigs don't confirm it: {low:.3g} times")
        n_met = scales.confirmed(low)
    if n_met < least:
        low = 0.0
        n_met = scales.confirmed(low)
    return Loosest(low, mounting.times(low), n_met, n, low == 2.0**_DOUBLINGS)


def _bracket(enough: Callable[[float], bool]) -> tuple[float, float]:
    """Return a scale that will do and one that won't, twice as large; equal: no larger
    one was tried; 0: none will do.
    """  # noqa: D205 - as short as it gets
    scale = 1.0
    if enough(scale):
        while scale < 2.0**_DOUBLINGS:
            if not enough(2.0 * scale):
                return scale, 2.0 * scale
            scale *= 2.0
        return scale, scale
    # Where devices stand as planned and that isn't enough, the calibration is at fault.
    for _ in range(_HALVINGS if enough(0.0) else 0):
        scale *= 0.5
        if enough(scale):
            return scale, 2.0 * scale
    return 0.0, 0.0
