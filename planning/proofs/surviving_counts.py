"""How many devices survival takes, what that costs, and what was proved of it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solvers.surviving.exchanges import Exchanges
from solvers.surviving.surviving_cover import SurvivingCover

# Devices beyond those taken that are kept at hand, for fresh samples that fall short.
_AT_HAND = 2


@dataclass(frozen=True, eq=False)
class SurvivingCount:
    """The devices of a kind that survival takes.

    Attributes:
        needed: So many were found to be enough, of however many are allowed.
        without: As many do without survival, of the same candidates.
        lower_bound: Proven least number of candidates.
        everywhere: Proven least number over all poses; None: not looked for.
        more: The best found of larger numbers.
        met: Whether those taken meet it on the cover's own samples.
    """

    needed: int
    without: int
    lower_bound: int
    everywhere: int | None
    more: Mapping[int, tuple[Any, ...]]
    met: bool


def larger_selections(
    cover: SurvivingCover, selected: NDArray[np.int64], most: int | None
) -> dict[int, NDArray[np.int64]]:
    """Return selections with a set more each, the one that leaves most to spare."""
    exchanges, found = Exchanges(cover), dict[int, NDArray[np.int64]]()
    for _ in range(_AT_HAND):
        better = exchanges.best_addition(selected)
        if better is None or len(selected) == most:
            break
        selected = np.sort(better[1])
        found[len(selected)] = selected
    return found
