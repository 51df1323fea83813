"""Audit findings: the false claims of a plan, each as a sentence."""

from collections.abc import Mapping, Sequence
from typing import Any

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

    def is_number(
        self, key: str, claimed: object, recomputed: float, unit: str
    ) -> float | None:
        """Return a claimed number; None, and a false claim, where it isn't one."""
        value = as_number(claimed)
        if value is None:
            self.fail(
                key, f"{claimed!r} is claimed, recomputed {recomputed:.6g} {unit}"
            )
        return value

    def number(
        self,
        key: str,
        claimed: object,
        recomputed: float,
        tolerance: float,
        unit: str = "m²",
    ) -> bool:
        """Note a false claim unless a number is claimed within a tolerance."""
        value = self.is_number(key, claimed, recomputed, unit)
        return value is not None and self.holds(
            abs(value - recomputed) <= tolerance,
            key,
            f"claimed {value:.6g} {unit}, recomputed {recomputed:.6g} {unit}, "
            f"tolerance {tolerance:.2g} {unit}".replace(" ,", ",").rstrip(),
        )

    def numbers(
        self,
        key: str,
        claims: Mapping[str, Any],
        recomputed: Mapping[str, float],
        tolerance: float,
        unit: str,
    ) -> None:
        """Note each number of a table that isn't claimed within a tolerance."""
        for name, truth in recomputed.items():
            self.number(f"{key}.{name}", claims.get(name), truth, tolerance, unit)

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


def as_number(value: object) -> float | None:
    """Return a finite number of the document as float; None for anything else."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    return float(value) if np.isfinite(value) else None


def square_centimetres(area_m2: float) -> str:
    """Return an area as a person reads it: in cm², with two decimals."""
    return f"{1e4 * area_m2:.2f} cm²"


def entries(value: object) -> Sequence[Mapping[str, Any]]:
    """Return the tables of a list of the document; anything else is left out."""
    if not isinstance(value, list):
        return ()
    return [item for item in value if isinstance(item, dict)]
