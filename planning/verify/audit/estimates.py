"""Areas from samples, and how far apart two honest estimates of one area may lie."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .audit_samples import AuditSamples

# What is promised: 1 percentage point of the area that a claim is a share of.
POINT = 0.01
# A plan that states fewer samples than this earns no more tolerance for it.
_FEWEST_SAMPLES = 2000


@dataclass(frozen=True, eq=False)
class Estimator:
    """Estimates areas from the audit's samples.

    Attributes:
        samples: The samples.
        n_claimed: Samples behind the plan's claims, of the target as of the surface.
        area_m2: Area of the whole surface in [m²].
        target_m2: Area of the target in [m²].
    """

    samples: AuditSamples
    n_claimed: int
    area_m2: float
    target_m2: float

    def area(self, chosen: NDArray[np.bool_]) -> float:
        """Return the area that the chosen samples stand for, in [m²]."""
        return float(self.samples.weights[chosen].sum())

    def tolerance(
        self,
        chosen: NDArray[np.bool_],
        whole_m2: float,
        share_of_m2: float | None = None,
    ) -> float:
        """Return how far a claimed area may lie from the recomputed one, in [m²].

        1 % of `share_of_m2`, plus three standard errors of the difference of two
        estimates: the audit's, summed over its two parts, and the plan's. A share p of
        n samples has the variance p (1 - p)/n; one success and one failure are added to
        each count, so that an estimate of 0 or 1 isn't taken for certain.

        Args:
            chosen: Samples that make up the recomputed area, shape (n,).
            whole_m2: Area of the part that both sample, in [m²].
            share_of_m2: What the claim is a share of; default `whole_m2`.
        """
        share_of = whole_m2 if share_of_m2 is None else share_of_m2
        variance = self._own_variance(chosen)
        n = max(self.n_claimed, _FEWEST_SAMPLES)
        if whole_m2 > 0.0:
            p = (n * self.area(chosen) / whole_m2 + 1.0) / (n + 2.0)
            variance += whole_m2**2 * max(p * (1.0 - p), 0.0) / n
        return POINT * share_of + 3.0 * float(np.sqrt(variance))

    def _own_variance(self, chosen: NDArray[np.bool_]) -> float:
        variance = 0.0
        for part in (self.samples.in_target, ~self.samples.in_target):
            n = int(part.sum())
            if n == 0 or not np.any(chosen & part):
                continue
            p = (float((chosen & part).sum()) + 1.0) / (n + 2.0)
            variance += float(self.samples.weights[part].sum()) ** 2 * p * (1.0 - p) / n
        return variance
