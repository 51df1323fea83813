"""What must stay lit and measured when any one device is lost, and K-fold at all.

After a loss the rest is held to the requirements as any plan is. Of projectors that is
a share of what any could light, which no loss changes. Of cameras it is a share of what
the projectors that are left light and any cameras could measure with them, K-fold.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.model.devices.calibration_errors import Survival
from planning.scene.measuring.measured import (
    measured_fold,
    without_camera,
    without_projector,
)

from .quotas import Quotas, RegionFloors

_Mask = NDArray[np.bool_]


def light_survives(quotas: Quotas, lit: _Mask) -> bool:
    """Return whether enough stays lit without any one projector.

    `lit` says which projector lights which sample, shape (n, n_projectors).
    """
    return all(
        quotas.enough(np.any(np.delete(lit, p, axis=1), axis=1))
        for p in range(lit.shape[1])
    )


def light_kept(quotas: Quotas, lit: _Mask) -> tuple[Quotas, ...]:
    """Return the quotas, lowered to what each loss leaves, (n_projectors,)."""
    return tuple(
        quotas.as_far_as(np.any(np.delete(lit, p, axis=1), axis=1))
        for p in range(lit.shape[1])
    )


def still_lit(kept: tuple[Quotas, ...], lit: _Mask) -> bool:
    """Return whether each loss leaves what it left before."""
    return all(
        quotas.enough(np.any(np.delete(lit, p, axis=1), axis=1))
        for p, quotas in enumerate(kept)
    )


@dataclass(frozen=True, eq=False)
class PairDemand:
    """What pairs must measure of lit samples.

    Attributes:
        asked: How often, and after which losses.
        quotas: With all projectors; then without each, if one may be lost.
    """

    asked: Survival
    quotas: tuple[Quotas, ...]

    @classmethod
    def of(
        cls,
        asked: Survival,
        regions: RegionFloors,
        reached: _Mask,
        share: float,
        *,
        spare: float = 0.0,
    ) -> "PairDemand":
        """Return a share of what is reached in each case, (n, 1 + n_projectors)."""
        quotas = (
            Quotas.of(regions, column, share, spare=spare) for column in reached.T
        )
        return cls(asked, tuple(quotas))

    def losses(self, pairs: _Mask) -> Iterator[tuple[int, _Mask]]:
        """Yield the case and what is measured K-fold after each loss, (n,).

        By pairs of n samples with cameras and projectors, (n, n_cameras, n_projectors).
        """
        views = self.asked.views
        if not self.asked.survive:
            yield 0, measured_fold(pairs, views)
            return
        for c in range(pairs.shape[1]):
            yield 0, measured_fold(without_camera(pairs, c), views)
        for p in range(pairs.shape[2]):
            yield 1 + p, measured_fold(without_projector(pairs, p), views)

    def met(self, pairs: _Mask) -> bool:
        """Return whether enough is measured, K-fold, after every loss."""
        return all(self.quotas[case].enough(left) for case, left in self.losses(pairs))

    def kept(self, pairs: _Mask) -> tuple[Quotas, ...]:
        """Return what is asked of each loss, lowered to what it leaves of pairs."""
        return tuple(
            self.quotas[case].as_far_as(left) for case, left in self.losses(pairs)
        )

    def upheld(self, kept: tuple[Quotas, ...], pairs: _Mask) -> bool:
        """Return whether each loss leaves what `kept` asks for."""
        losses = zip(kept, self.losses(pairs), strict=True)
        return all(quotas.enough(left) for quotas, (_, left) in losses)
