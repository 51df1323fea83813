"""That so many devices, wherever they stand, serve too few samples: cells are split.

Of samples i each is served once, `least` of them must be, and each has a multiplier
lambda_i >= 0. If no pose serves samples of more than M together, K poses serve samples
of no more than K M; `least` samples cost no less than the cheapest ones do::

    K M < sum of the `least` smallest lambda_i      then K poses are too few

So cells are split until what their poses may serve costs no more than the largest such
M. For two devices it is also looked at all pairs of cells, a cell with itself among
them. All of it are sums of whole numbers. What isn't known to be small enough when
cells are as small as they get is left open: that is no proof of the contrary.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from geometry.arrays import Array, Ints, Mask

from .sphere_cells import Cells

# Cells split at a time; smallest side of one [rad], as it adds to psi.
_BATCH, _FINEST = 64, 2e-3
# Cells that are looked at in all, and of which all pairs are.
_MOST, _MOST_PAIRED = 400_000, 6_000
_ROWS = 512
# Cells left open that are told of.
_LEFT = 8


class OptimisticCells(Protocol):
    """Says what poses of cells may serve."""

    def serve(self, cells: Cells, may: Mask, /) -> Mask:
        """Return which samples they may serve, of those that may be, (cells, n)."""
        ...


@dataclass(frozen=True, eq=False)
class Outcome:
    """Whether so many devices were shown to be too few.

    Attributes:
        too_few: Whether they were.
        how: By how many cells, or why not.
        left: Cells that multipliers left open, as small as they get; None: none.
    """

    too_few: bool
    how: str
    left: Cells | None = None


@dataclass(frozen=True, eq=False)
class Question:
    """Whether so many devices can serve so many samples.

    Attributes:
        roots: Cells that hold all poses together.
        cells: What poses of a cell may serve.
        n_samples: Samples.
        object_m: Farthest a sample is from the centre of the workspace [m].
        tick: Called now and then, with cells looked at.
    """

    roots: Cells
    cells: OptimisticCells
    n_samples: int
    object_m: float
    tick: Callable[[int], None]

    def by_multipliers(self, most: int, multipliers: Ints) -> Outcome:
        """Split cells until no pose serves samples of more than `most` together."""
        if most < 0:
            return Outcome(False, "its multipliers ask for nothing")
        waiting = self._costly(self.roots, None, multipliers, most)
        looked_at = len(self.roots.low_m)
        while len(waiting.cells.low_m):
            if looked_at > _MOST:
                return Outcome(False, f"{looked_at} cells weren't enough")
            # The costliest of the last ones first: what can't be closed shows soon.
            part, waiting = waiting.cut(_BATCH)
            widths = part.cells.widths(self.object_m).max(axis=1)
            if np.any(narrow := widths < _FINEST):
                left = part.cells.take(np.flatnonzero(narrow)[-_LEFT:])
                return Outcome(False, f"{looked_at} cells left some open", left)
            halves = part.cells.halves(self.object_m)
            may = np.repeat(part.served, 2, axis=0)
            waiting = waiting.with_more(self._costly(halves, may, multipliers, most))
            looked_at += len(halves.low_m)
            self.tick(looked_at)
        return Outcome(True, f"{looked_at} cells")

    def by_pairs(self, least: int) -> Outcome:
        """Split cells until no two, or one taken twice, may serve so many."""
        cells, served = self.roots, self._served(self.roots, None)
        looked_at = len(cells.low_m)
        while True:
            open_ones = in_open_pairs(served, least)
            if not open_ones.size:
                return Outcome(True, f"all pairs, {looked_at} cells")
            cells, served = cells.take(open_ones), served[open_ones]
            widths = cells.widths(self.object_m).max(axis=1)
            if len(widths) > _MOST_PAIRED or np.any(widths < _FINEST):
                return Outcome(False, f"pairs of {looked_at} cells left some open")
            cells = cells.halves(self.object_m)
            served = self._served(cells, np.repeat(served, 2, axis=0))
            looked_at += len(cells.low_m)
            self.tick(looked_at)

    def _served(self, cells: Cells, may: Mask | None) -> Mask:
        if may is None:
            may = np.ones((len(cells.low_m), self.n_samples), dtype=bool)
        n = len(may)
        parts = [np.arange(b, min(n, b + 2 * _BATCH)) for b in range(0, n, 2 * _BATCH)]
        return np.concatenate([self.cells.serve(cells.take(p), may[p]) for p in parts])

    def _costly(
        self, cells: Cells, may: Mask | None, multipliers: Ints, most: int
    ) -> "_Waiting":
        served = self._served(cells, may)
        costs = served @ multipliers
        order = np.argsort(costs, kind="stable")
        costly = order[costs[order] > most]
        return _Waiting(cells.take(costly), served[costly])


@dataclass(frozen=True, eq=False)
class _Waiting:
    """Cells that cost too much, and what they may serve."""

    cells: Cells
    served: Mask

    def cut(self, n: int) -> tuple["_Waiting", "_Waiting"]:
        """Return the last n, and the others."""
        at = np.arange(len(self.served))
        last, rest = at[-n:], at[:-n]
        return (
            _Waiting(self.cells.take(last), self.served[last]),
            _Waiting(self.cells.take(rest), self.served[rest]),
        )

    def with_more(self, other: "_Waiting") -> "_Waiting":
        """Return these, then others."""
        columns = zip(self.cells, other.cells, strict=True)
        return _Waiting(
            Cells(*(np.concatenate(both) for both in columns)),
            np.concatenate([self.served, other.served]),
        )


def most_of_one(n_devices: int, least: int, multipliers: Ints) -> int:
    """Return the most M that one pose may serve where so many are too few; < 0: none.

    The largest whole number with K M < sum of the `least` smallest multipliers.
    """
    if least > len(multipliers):
        return int(multipliers.sum())
    need = sum(np.sort(multipliers)[:least].tolist())
    return (need - 1) // n_devices if n_devices else need - 1


def in_open_pairs(served: Mask, least: int) -> Ints:
    """Return the cells that with another, or taken twice, may serve so many, (k,)."""
    counts = served.sum(axis=1)
    # Sums in single precision are exact below 2^24.
    ones: Array = served.astype(np.float32)  # type: ignore[assignment]
    open_ones = np.zeros(len(served), dtype=bool)
    for begin in range(0, len(served), _ROWS):
        part = slice(begin, begin + _ROWS)
        both = counts[part, None] + counts - ones[part] @ ones.T
        open_ones[part] = np.any(both >= least, axis=1)
    return np.flatnonzero(open_ones)
