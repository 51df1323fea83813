"""The loosest mounting at which enough drawn rigs still meet what is asked.

One scale for all bounds is sought by doubling and bisection, over the drawn rigs and as
many other ones, each of which must do; a rig differs from one scale to the next by its
bounds alone. A rig that met what is asked at a scale is taken to meet it at every
smaller one, and one that missed it to miss it at every larger one. That needn't be so:
the scale found is looked at once more, and taken back where it isn't.

Where no mounting will do, the calibration is at fault: its scale is sought likewise.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from math import ceil, inf

from geometry.parallel import mapped, n_threads
from planning.model.devices.calibration_errors import (
    MOST_FOCAL,
    PERFECT,
    CalibrationErrors,
    Mounting,
)
from planning.model.progress import Report

from .asked import Asked
from .built_case import BuiltCase
from .drawn_rigs import CONFIRMING, DRAWN, Deviates

# The largest scale tried, and the smallest, by powers of two.
_DOUBLINGS, _HALVINGS = 5, 6
_BISECTIONS = 5
# Where a scale that was found doesn't hold, it is taken back so far, so often.
_BACK, _TIMES_BACK = 0.97, 20

_At = Callable[[float], tuple[BuiltCase, Mounting]]


@dataclass(frozen=True)
class Loosest:
    """A mounting that still meets what is asked.

    Attributes:
        scale: Of the bounds stated; 0: none does, not even none at all.
        mounting: These bounds.
        n_met: Of the rigs, the drawn ones and as many others, those that meet it there.
        n_rigs: How many they are.
        largest_tried: Whether no looser one was tried.
        of_calibration: Where none does: of the calibration's errors, the scale at which
            the stated mounting does; 0: none; 1: not sought.
        calibration: These errors.
    """

    scale: float
    mounting: Mounting
    n_met: int
    n_rigs: int
    largest_tried: bool
    of_calibration: float
    calibration: CalibrationErrors


class _Scales:
    """Which of the same rigs meet what is asked, scale by scale."""

    def __init__(
        self, at: _At, asked: Asked, *, n: int, seed: int, stream: int, threads: int
    ) -> None:
        self._at, self._asked, self._threads = at, asked, threads
        self._seed, self._stream = seed, stream
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

    def met(self, scale: float) -> int:
        """Return how many meet it; all are looked at."""
        return sum(self._meet(scale, range(len(self._met))))

    def _meet(self, scale: float, rigs: list[int] | range) -> list[bool]:
        case, mounting = self._at(scale)
        sizes = len(case.rig.devices), len(case.target)

        def meets(index: int) -> bool:
            deviates = Deviates.drawn(
                *sizes, seed=self._seed, stream=self._stream, index=index
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
    threads: int | None = None,
    report: Report = lambda line: None,
) -> Loosest:
    """Return the largest scale of a mounting that so many of n rigs meet, twice."""
    cores = threads or n_threads()

    def sought(at: _At, words: str, focal: float) -> tuple[float, int]:
        each = [
            _Scales(at, asked, n=n, seed=seed, stream=stream, threads=cores)
            for stream in (DRAWN, CONFIRMING)
        ]
        most = MOST_FOCAL / focal if focal else inf
        least = ceil(quantile * n)
        return _largest(each, least, most, lambda s: report(words.format(s)))

    scale, n_met = sought(
        lambda scale: (case, mounting.times(scale)),
        "mounting {:.3g} times as loose",
        mounting.focal,
    )
    found = Loosest(
        scale,
        mounting.times(scale),
        n_met,
        2 * n,
        scale == 2.0**_DOUBLINGS,
        1.0,
        case.calibration,
    )
    if scale > 0.0 or case.calibration == PERFECT:
        return found

    @cache
    def calibrated(scale: float) -> tuple[BuiltCase, Mounting]:
        return case.calibrated(scale), mounting

    scale, n_met = sought(
        calibrated,
        "mounted as stated, errors of the calibration {:.3g} times as large",
        case.calibration.focal,
    )
    return replace(
        found,
        n_met=n_met,
        of_calibration=scale,
        calibration=case.calibration.times(scale),
    )


def _largest(
    rigs: list[_Scales], least: int, most: float, report: Callable[[float], None]
) -> tuple[float, int]:
    """The largest scale that so many of either rigs meet, and how many of all do."""

    def enough(scale: float) -> bool:
        if scale > max(most, 1.0):
            return False
        report(scale)
        return all(each.enough(scale, least) for each in rigs)

    low, high = _bracket(enough)
    for _ in range(_BISECTIONS if 0.0 < low < high else 0):
        middle = (low * high) ** 0.5
        low, high = (middle, high) if enough(middle) else (low, middle)
    for _ in range(_TIMES_BACK):
        n_met = [each.met(low) for each in rigs]
        if min(n_met) >= least or low == 0.0:
            return low, sum(n_met)
        low *= _BACK
        report(low)
    return 0.0, sum(each.met(0.0) for each in rigs)


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
