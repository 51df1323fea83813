"""Collects false claims as sentences, and reads claims without trusting them."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray


class Ledger:
    """The list of false claims of one plan.

    Args:
        document: The plan's JSON document.
    """

    def __init__(self, document: Mapping[str, Any]) -> None:
        self._document = document
        self._failures: list[str] = []

    @property
    def failures(self) -> tuple[str, ...]:
        """One sentence for each false claim, in the order found."""
        return tuple(self._failures)

    def fail(self, key: str, sentence: str) -> None:
        """Note a false claim."""
        self._failures.append(f"{key}: {sentence}")

    def holds(self, truth: object, key: str, sentence: str) -> bool:
        """Note a false claim unless it holds; return whether it does."""
        if not truth:
            self.fail(key, sentence)
        return bool(truth)

    def read(self, *path: str | int) -> Any:  # noqa: ANN401 - any JSON value
        """Return the value at a path of the document, None where there is none."""
        value: Any = self._document
        for step in path:
            try:
                value = value[step]
            except (KeyError, IndexError, TypeError):
                return None
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
        value = as_number(claimed)
        if value is None:
            self.fail(
                key, f"{claimed!r} is claimed, recomputed {recomputed:.6g} {unit}"
            )
            return False
        return self.holds(
            abs(value - recomputed) <= tolerance,
            key,
            f"claimed {value:.6g} {unit}, recomputed {recomputed:.6g} {unit}, "
            f"tolerance {tolerance:.2g} {unit}".replace(" ,", ",").rstrip(),
        )

    def array(
        self,
        key: str,
        claimed: object,
        truth: NDArray[np.float64],
        tolerance: float,
        whose: str,
    ) -> bool:
        """Note a false claim unless an array equals its source within a tolerance."""
        try:
            value = np.asarray(claimed, dtype=np.float64)
        except (TypeError, ValueError):
            value = np.full(1, np.nan)
        same = value.shape == truth.shape and bool(
            np.all(np.abs(value - truth) <= tolerance)
        )
        return self.holds(
            same, key, f"claimed {claimed!r}, but {whose} is {truth.tolist()}"
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
