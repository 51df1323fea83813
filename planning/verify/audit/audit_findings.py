"""Audit findings: the false claims of a plan, each as a sentence."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike


class AuditFindings:
    """The false claims of one plan: key, what is claimed, and what is true.

    Args:
        within: Key of the part of the plan that is looked at; keys that methods take
            are below it, and an empty one is that part itself.
    """

    def __init__(self, within: str = "") -> None:
        self._within = within
        self._failures: list[str] = []

    def at(self, key: str) -> "AuditFindings":
        """Return the same findings, to be told of a part of what they look at."""
        inner = AuditFindings(self._below(key))
        inner._failures = self._failures
        return inner

    @property
    def failures(self) -> tuple[str, ...]:
        """One sentence for each false claim, in the order in which they were met."""
        return tuple(self._failures)

    def fail(self, key: str, sentence: str) -> None:
        """Note a false claim."""
        self._failures.append(f"{self._below(key)}: {sentence}")

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
    ) -> None:
        """Note a false claim unless a number is claimed within a tolerance."""
        if claimed is None:
            self.fail(key, f"None is claimed, recomputed {recomputed:.6g} {unit}")
            return
        self.holds(
            abs(claimed - recomputed) <= tolerance,
            key,
            f"claimed {claimed:.6g} {unit}, recomputed {recomputed:.6g} {unit}, "
            f"tolerance {tolerance:.2g} {unit}".replace(" ,", ",").rstrip(),
        )

    def numbers(
        self, record: object, truths: Mapping[str, float], tolerance: float, unit: str
    ) -> None:
        """Check the numbers of a record that have these names."""
        for name, truth in truths.items():
            self.number(name, getattr(record, name), truth, tolerance, unit)

    def same(
        self,
        key: str,
        claimed: ArrayLike | None,
        truth: ArrayLike | None,
        whose: str,
        tolerance: float = 0.0,
    ) -> bool:
        """Note a false claim unless it is its source: numbers within a tolerance."""
        expected = _plain(truth)
        if claimed is None or truth is None or not _are_numbers(claimed, truth):
            agrees = _plain(claimed) == expected
        else:
            agrees = np.shape(claimed) == np.shape(truth) and np.allclose(
                claimed, truth, rtol=0.0, atol=tolerance
            )
        return self.holds(
            agrees, key, f"claimed {claimed!r}, but {whose} is {expected!r}"
        )

    def partition(
        self, key: str, groups: Sequence[Sequence[str]], names: Sequence[str]
    ) -> bool:
        """Note a false claim unless groups, none empty, share out the names."""
        return self.holds(
            sorted(name for group in groups for name in group) == sorted(names)
            and all(groups),
            key,
            f"{groups!r} must name each of {', '.join(names)} exactly once",
        )

    def _below(self, key: str) -> str:
        return ".".join(filter(None, (self._within, key)))


def _plain(value: object) -> object:
    """Return an array or a tuple as lists, and anything else as it is."""
    try:
        return np.asarray(value).tolist()
    except ValueError:
        return value


def _are_numbers(*values: object) -> bool:
    """Return whether all are numbers, or arrays of them; rig tables hold anything."""
    try:
        return all(np.asarray(value).dtype.kind in "biuf" for value in values)
    except ValueError:
        return False


def square_centimetres(area_m2: float) -> str:
    """Return an area as a person reads it: in cm², with two decimals."""
    return f"{1e4 * area_m2:.2f} cm²"
