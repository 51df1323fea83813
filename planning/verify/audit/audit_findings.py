"""Audit findings: the false claims of a plan, each as a sentence."""

import numpy as np
from numpy.typing import ArrayLike


class AuditFindings:
    """The false claims of one plan: key, what is claimed, and what is true."""

    def __init__(self) -> None:
        self._failures: list[str] = []

    @property
    def failures(self) -> tuple[str, ...]:
        """One sentence for each false claim, in the order in which they were met."""
        return tuple(self._failures)

    def fail(self, key: str, sentence: str) -> None:
        """Note a false claim."""
        self._failures.append(f"{key}: {sentence}")

    def holds(self, truth: object, key: str, sentence: str) -> bool:
        """Note a false claim unless it holds; return whether it does."""
        if not truth:
            self.fail(key, sentence)
        return bool(truth)

    def number(
        self,
        key: str,
        claimed: float | None,
        recomputed: float,
        tolerance: float,
        unit: str = "m²",
    ) -> bool:
        """Note a false claim unless a number is claimed within a tolerance."""
        if claimed is None:
            self.fail(key, f"None is claimed, recomputed {recomputed:.6g} {unit}")
            return False
        return self.holds(
            abs(claimed - recomputed) <= tolerance,
            key,
            f"claimed {claimed:.6g} {unit}, recomputed {recomputed:.6g} {unit}, "
            f"tolerance {tolerance:.2g} {unit}".replace(" ,", ",").rstrip(),
        )

    def array(
        self,
        key: str,
        claimed: object,
        truth: ArrayLike,
        tolerance: float,
        whose: str,
    ) -> bool:
        """Note a false claim unless an array equals its source within a tolerance."""
        expected = np.asarray(truth, dtype=np.float64)
        try:
            value = np.asarray(claimed, dtype=np.float64)
        except (TypeError, ValueError):
            value = np.full(1, np.nan)
        same = value.shape == expected.shape and bool(
            np.all(np.abs(value - expected) <= tolerance)
        )
        return self.holds(
            same, key, f"claimed {claimed!r}, but {whose} is {expected.tolist()}"
        )


def square_centimetres(area_m2: float) -> str:
    """Return an area as a person reads it: in cm², with two decimals."""
    return f"{1e4 * area_m2:.2f} cm²"
