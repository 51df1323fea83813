"""Areas from samples, and how far apart two honest estimates of one area may lie."""

from dataclasses import dataclass

import numpy as np
from scipy.special import betaln, ndtr

from geometry.arrays import Array, Mask

from .audit_findings import AuditFindings
from .audit_samples import AuditSamples

# What is promised: 1 percentage point of the area that a claim is a share of.
POINT = 0.01
# How surely a claim is false that is called so: three standard errors of a normal one.
DOUBT = float(ndtr(-3.0))
# Room for the rounding of written numbers, as a share.
ROUNDING = 1e-6
# A plan that states fewer samples than this earns no more tolerance for it.
_FEWEST_SAMPLES = 2000


@dataclass(frozen=True, eq=False)
class Estimator:
    """Estimates areas from the audit's samples.

    Attributes:
        n_claimed: Samples behind the plan's claims, of the target as of the surface.
        area_m2: Area of the whole surface in [m²].
        target_m2: Area of the target in [m²].
    """

    samples: AuditSamples
    n_claimed: int
    area_m2: float
    target_m2: float

    def wholes(self) -> dict[str, tuple[Mask, float]]:
        """Return the samples and the area of `surface` and `target`."""
        return {
            "surface": (np.ones(len(self.samples), dtype=bool), self.area_m2),
            "target": (self.samples.in_target, self.target_m2),
        }

    @property
    def n_earned(self) -> int:
        """Samples of the plan as tolerances count them: stating fewer earns none."""
        return max(self.n_claimed, _FEWEST_SAMPLES)

    def area(self, chosen: Mask) -> float:
        """Return the area that the chosen samples stand for, in [m²]."""
        return float(self.samples.weights[chosen].sum())

    def audit(
        self,
        key: str,
        claimed: float,
        chosen: Mask,
        findings: AuditFindings,
        *,
        part: str = "target",
    ) -> None:
        """Hold a claimed area of `target` or `surface` against the chosen samples."""
        within, whole = self.wholes()[part]
        chosen = chosen & within
        tolerance = self.tolerance(chosen, whole)
        findings.number(key, claimed, self.area(chosen), tolerance)

    def tolerance(self, chosen: Mask, whole_m2: float) -> float:
        """Return how far a claimed area may lie from the recomputed one, in [m²].

        1 % of the whole, plus three standard errors of the difference of two
        estimates: the audit's, summed over its two parts, and the plan's. A share p of
        n samples has the variance p (1 - p)/n; one success and one failure are added to
        each count, so that an estimate of 0 or 1 isn't taken for certain.
        """
        variance = 0.0
        for within in (self.samples.in_target, ~self.samples.in_target):
            if np.any(chosen & within):
                n, k = int(within.sum()), int((chosen & within).sum())
                variance += self.area(within) ** 2 * _variance(k / n, n)
        if whole_m2 > 0.0:
            share = self.area(chosen) / whole_m2
            variance += whole_m2**2 * _variance(share, self.n_earned)
        return POINT * whole_m2 + 3.0 * float(np.sqrt(variance))


def share_error(count: Array, n: int, n_claimed: int) -> Array:
    """Return the standard error of the difference of two estimates of a share.

    Of n samples of the audit, `count` of which are successes, and n_claimed samples of
    the plan. One success and one failure are added, as in `Estimator.tolerance`.
    """
    return _of_difference((count + 1.0) / (n + 2.0), n, max(n_claimed, 1))


def pooled_error(count: float, n: int, claimed: float, n_claimed: float) -> float:
    """Return the standard error of the difference of a claimed share and one's own.

    Of the share of both samples together, n of the audit's, `count` of which are
    successes, and n_claimed of the plan's: of a handful either may have none. One
    success and one failure are added, as in `Estimator.tolerance`.
    """
    p = (count + claimed * n_claimed + 1.0) / (n + n_claimed + 2.0)
    return float(_of_difference(np.clip(p, 0.0, 1.0), n, n_claimed))


def chance_below(most: float, n: int, rank: int, n_claimed: int) -> float:
    """Return the chance that at most so many of n samples lie below one of the plan's.

    Below the `rank`-th, from 1, of its n_claimed, whatever the distribution, without
    ties: a beta-binomial number. Each order of all of them is as likely, so with
    m = n_claimed, r = rank::

        P(i lie below) = C(n, i) B(i + r, n - i + m + 1 - r) / B(r, m + 1 - r)

    That is skewed where the rank is near an end, and wide where the plan's are few.
    """
    # SciPy's own law is in `scipy.stats`, which takes as long to import as an audit.
    i = np.arange(int(np.clip(np.floor(most), -1, n)) + 1, dtype=np.float64)
    above = n_claimed + 1 - rank
    ways = betaln(i + rank, n - i + above) - betaln(i + 1.0, n - i + 1.0)
    return float(np.exp(ways - betaln(rank, above)).sum() / (n + 1))


def _of_difference(p: Array, n: int, n_claimed: float) -> Array:
    """Return the standard error of the difference of two shares about p."""
    return np.sqrt(p * (1.0 - p) * (1.0 / n + 1.0 / n_claimed))


def _variance(share: float, n: int) -> float:
    p = (n * share + 1.0) / (n + 2.0)
    return max(p * (1.0 - p), 0.0) / n
