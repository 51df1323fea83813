"""How much devices must cover of samples: of all, and of each region with a floor.

Members of a family are such regions, with the share of all as their floor.

With n the samples that candidates cover and n_r those of them on region r, a share S of
all and the floor F of every large region::

    covered >= ceil(S n)   and   covered_r >= ceil(F n_r)

A small region has few samples: a share of them is known to sqrt(F (1 - F) / n_r) only.
Whoever chooses aims so much above the floor, where it costs no device.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.scene.placed_bodies import Kind
from planning.scene.samples import Target
from planning.scene.scene import Scene

_Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class RegionFloors:
    """Which samples are of a region that has a floor.

    Attributes:
        row: Of each sample 0 where it is of none, else a number from 1, shape (n,).
        n_rows: Numbers, with 0.
        share: F.
    """

    row: NDArray[np.int64]
    n_rows: int = 1
    share: float = 0.0

    @classmethod
    def of(
        cls, scene: Scene, samples: Target, kind: Kind = "projector"
    ) -> "RegionFloors":
        """Return the floors of a scene's large regions, or members, on samples."""
        return cls(*scene.floor_rows(samples, kind))

    @classmethod
    def none(cls, n: int) -> "RegionFloors":
        """Return no floors of n samples."""
        return cls(np.zeros(n, dtype=np.int64))

    def take(self, chosen: NDArray[np.int64] | _Mask) -> "RegionFloors":
        """Return what is known of some of the samples."""
        return RegionFloors(self.row[chosen], self.n_rows, self.share)

    def counts(self, mask: _Mask) -> NDArray[np.int64]:
        """Return how many samples of a mask are of each number, (n_rows,)."""
        return np.bincount(self.row[mask], minlength=self.n_rows)


@dataclass(frozen=True, eq=False)
class Quotas:
    """Samples that must be covered, in all and of each region.

    Attributes:
        total: Of all.
        regions: Which sample is of which region with a floor.
        floors: Of each, 0 for those of none, shape (n_rows,).
    """

    total: int
    regions: RegionFloors
    floors: NDArray[np.int64]

    @classmethod
    def of(
        cls, regions: RegionFloors, reached: _Mask, share: float, *, spare: float = 0.0
    ) -> "Quotas":
        """Return what a share of the samples reached is, and the floors of regions.

        Floors are raised by `spare` standard errors.
        """
        n, floor = regions.counts(reached), regions.share
        aims = floor * n + spare * np.sqrt(floor * (1.0 - floor) * n)
        floors = np.minimum(np.ceil(aims - 1e-9), n).astype(np.int64)
        floors[0] = 0
        return cls(required_samples(reached, share), regions, floors)

    def lacking(self, covered: _Mask) -> int:
        """Return how many samples are lacking of all quotas together, at least 0."""
        short = np.clip(self.floors - self.regions.counts(covered), 0, None)
        return int(short.sum()) + max(0, self.total - int(covered.sum()))

    # Cameras ask this too: `covered` is then what they measure of samples that are lit,
    # and the quotas are those of `camera_cover.candidate_cover`.
    def enough(self, covered: _Mask) -> bool:
        """Return whether the total and every floor are met by samples covered, (n,)."""
        return self.lacking(covered) == 0

    def wanted(self, covered: _Mask) -> _Mask:
        """Return which samples are of a quota that isn't met, shape (n,)."""
        if int(covered.sum()) < self.total:
            return np.ones(len(covered), dtype=bool)
        return (self.regions.counts(covered) < self.floors)[self.regions.row]

    def as_far_as(self, covered: _Mask) -> "Quotas":
        """Return the quotas lowered to what is covered, which then meets them."""
        floors = np.minimum(self.floors, self.regions.counts(covered))
        return Quotas(min(self.total, int(covered.sum())), self.regions, floors)

    def part(self, some: NDArray[np.int64]) -> "Quotas":
        """Return the quotas in proportion, of some of the samples."""
        n, regions = len(self.regions.row), self.regions.take(some)
        return Quotas(
            self.total * len(some) // n, regions, self.floors * len(some) // n
        )


def required_samples(reached: _Mask, share: float) -> int:
    """Return how many samples a share of those that any candidate covers is."""
    return int(np.ceil(share * int(reached.sum()) - 1e-9))


def missed_shares(quotas: Quotas, counts: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the shares of quotas that are missed, added up, (k,).

    Of counts of each number of `RegionFloors`, (n_rows, k). Poses that move by an angle
    win in proportion to what there is, of a region as of all.
    """
    wanted = np.append(quotas.floors, quotas.total)[:, None]
    short = wanted - np.vstack([counts, counts.sum(axis=0)])
    return np.sum(np.clip(short, 0, None) / np.maximum(wanted, 1), axis=0)
