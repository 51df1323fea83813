"""What all limits have in common, and the first that a sample violates."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from geometry.devices import DeviceModel
from planning.model.requirements import Requirements
from planning.scene.lights import light_of

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

View = TypeVar("View")
Cell = TypeVar("Cell")
Rules = TypeVar("Rules")

# Beyond this no limit of incidence is worth relaxing.
STEEPEST = float(np.radians(85.0))
# Cause of what an obstacle keeps from light or view.
BY_OBSTACLE = "blocked_by_obstacle"
# A field so many times as wide is as much as is worth asking for.
WIDEST = 3


@dataclass(frozen=True, eq=False)
class Focus:
    """How the range of a camera follows from its lens.

    Beside the range that the rig file allows; `circle_px` gives the blur at distances.
    """

    blur_px: float
    f_number: float
    allowed_m: tuple[float, float]
    circle_px: Callable[[Array], Array]


@dataclass(frozen=True, eq=False)
class RigFacts:
    """What relaxations are told of the rig file.

    The focus is of a camera whose range follows from it; `ring_gap_chosen` says whether
    the planner chose the distance of neighbouring rings at the standoff. Of several
    models the device is the first, and no range is told of any.
    """

    required: Requirements
    device: DeviceModel
    focus: Focus | None = None
    ring_gap_m: float = 0.0
    ring_gap_chosen: bool = False
    several_models: bool = False


@dataclass(frozen=True, eq=False)
class LimitRelaxation:
    """How one limit may give way, all others as they are.

    Attributes:
        cause: Name of the limit.
        ask: What samples ask of it, (n,): more where it must give way farther; inf
            where it is not worth it.
        rounded: Rounds what is asked outwards, to what people write.
        say: The limit with a rounded value, as a rig file names it.
    """

    cause: str
    ask: Callable[[Any], Array]
    rounded: Callable[[Array], Array]
    say: Callable[[float], str]


class Limit(Generic[View, Cell, Rules]):
    """One limit; a view holds samples as a device or a pair of them meets them.

    A cell holds the best that any pose in a cell of poses may have of them. The name is
    the cause in plan and summary, the words say it of samples that it forbids.
    """

    name: str
    words: str

    def holds(self, view: View, rules: Rules) -> Mask | None:
        """Return on which samples it holds, shape (n,); None: it doesn't bind."""
        raise NotImplementedError

    def may_hold(self, cell: Cell, rules: Rules) -> Mask | None:
        """Return a superset of where it holds from poses of a cell; None: of all."""
        return None

    def relaxations(self, facts: RigFacts) -> Iterator[LimitRelaxation]:
        """Yield how it may give way; nothing: nothing is advised."""
        yield from ()


@dataclass(frozen=True)
class InBetween(Limit[object, object, object]):
    """A limit that rays or bodies decide, on samples that pass the others."""

    name: str
    words: str

    def holds(self, view: object, rules: object) -> None:
        """Return None: what stands between isn't looked at."""


class RangedView(Protocol):
    """What a range asks of a view."""

    @property
    def device(self) -> DeviceModel:
        """Optics of a camera or a projector."""
        ...

    @property
    def distances(self) -> Array:
        """Of samples, shape (n,) [m]."""
        ...


class InRange(Limit[RangedView, Any, Any]):
    """Within the depth of field."""

    def holds(self, view: RangedView, rules: object) -> Mask:
        """Return which samples are sharp."""
        low, high = view.device.range_m
        return (view.distances >= low) & (view.distances <= high)


def wider_angle(
    name: str, limit: float, cosines: Callable[[Any], Array]
) -> LimitRelaxation:
    """Return a larger angle of incidence than the limit [rad], by a view's cosines."""
    least, key = np.cos(max(limit, STEEPEST)), name.replace("_", "_max_")
    return LimitRelaxation(
        name,
        lambda view: np.where(cosines(view) >= least, degrees(cosines(view)), np.inf),
        to_step(1.0),
        lambda value: f"limits.{key}_deg = {value:.0f} (now {np.degrees(limit):g})",
    )


def coarser(
    name: str, limit: float | None, distances: Callable[[Any], Array]
) -> Iterator[LimitRelaxation]:
    """Yield a larger distance of pixels on the surface than the limit [m], if any."""
    if limit is not None:
        yield LimitRelaxation(
            name,
            lambda view: 1e3 * distances(view),
            to_three_digits,
            lambda value: (
                f"limits.max_sample_distance_mm = {value:.3g} (now {1e3 * limit:g})"
            ),
        )


def causes(limits: Sequence[Limit[Any, Any, Any]]) -> tuple[str, ...]:
    """Return the names of limits."""
    return tuple(limit.name for limit in limits)


def first_violated(
    limits: Sequence[Limit[View, Any, Rules]], view: View, rules: Rules, n: int
) -> NDArray[np.int8]:
    """Return the index of the first limit that fails, their number where none does."""
    first = np.full(n, len(limits), dtype=np.int8)
    for index in range(len(limits) - 1, -1, -1):
        holds = limits[index].holds(view, rules)
        if holds is not None:
            np.copyto(first, np.int8(index), where=~holds)
    return first


def violated(
    limits: Sequence[Limit[View, Any, Rules]], view: View, rules: Rules, n: int
) -> Mask:
    """Return whether each limit fails, shape (n_limits, n)."""
    table = np.zeros((len(limits), n), dtype=bool)
    for index, limit in enumerate(limits):
        holds = limit.holds(view, rules)
        if holds is not None:
            table[index] = ~holds
    return table


def may_hold(
    limits: Sequence[Limit[Any, Cell, Rules]], cell: Cell, rules: Rules, n: int
) -> Mask:
    """Return a superset of the samples on which all limits hold from a cell, (n,)."""
    possible = np.ones(n, dtype=bool)
    for limit in limits:
        holds = limit.may_hold(cell, rules)
        if holds is not None:
            possible &= holds
    return possible


def range_ends(
    cause: str, device: str, ends: tuple[float, float], sharp: tuple[float, float]
) -> Iterator[LimitRelaxation]:
    """Yield relaxations of a range's near end, its far end, and both at once.

    Each is left out where that end isn't what binds: `ends` are those that a rig file
    may change, `sharp` those that hold [m].
    """
    low, high = 1e3 * sharp[0], 1e3 * sharp[1]

    def relaxed(
        ask: Callable[[Array], Array], say: Callable[[float], str]
    ) -> LimitRelaxation:
        words = f"a {device} sharp "
        return LimitRelaxation(
            cause,
            lambda view: ask(1e3 * view.distances),
            to_step(1.0),
            lambda value: words + say(value),
        )

    nearer = 0.0 < ends[0] and ends[0] >= sharp[0]
    farther = ends[1] < np.inf and ends[1] <= sharp[1]
    if nearer:
        yield relaxed(
            lambda away: np.where((away >= 0.0) & (away <= high), -away, np.inf),
            lambda value: f"from {-value:.0f} mm (now {low:.0f})",
        )
    if farther:
        yield relaxed(
            lambda away: np.where(away >= low, away, np.inf),
            lambda value: f"to {value:.0f} mm (now {high:.0f})",
        )
    if nearer and farther:
        yield relaxed(
            lambda away: np.maximum(low - away, away - high),
            lambda value: (
                f"from {max(low - value, 0.0):.0f} to {high + value:.0f} mm "
                f"(now {low:.0f} to {high:.0f})"
            ),
        )


def degrees(cosines: Array) -> Array:
    """Return angles of cosines in degrees."""
    return np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0)))


def to_step(step: float) -> Callable[[Array], Array]:
    """Return what rounds up to multiples of a step."""
    return lambda values: np.ceil(values / step - 1e-9) * step


def to_three_digits(values: Array) -> Array:
    """Round positive values up to three significant digits."""
    step = 10.0 ** (np.floor(np.log10(np.maximum(values, 1e-30))) - 2.0)
    return np.ceil(values / step - 1e-9) * step


def off_axis(device: DeviceModel, local: Array) -> Array:
    """Return how far samples (n, 3) are off the middle, inf beyond the widest field."""
    wide = device.widened(WIDEST)
    return np.where(wide.in_field(local), light_of(wide).off_axis(local), np.inf)
