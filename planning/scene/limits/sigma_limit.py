"""How exactly samples must be measured, whoever measures them."""

from collections.abc import Iterator
from typing import Any, Protocol

from planning.model.requirements import TriangulationLimits

from .limit import Array, Limit, LimitRelaxation, Mask, RigFacts, to_three_digits


class DeviatingView(Protocol):
    """What a limit of the deviation asks of a view."""

    @property
    def sigma(self) -> Array:
        """Deviation along the normal [m], shape (n,)."""
        ...


class MaxSigma(Limit[DeviatingView, Any, TriangulationLimits]):
    """s_N, or with the calibration's s_C sqrt(s_N^2 + s_C^2), <= max_sigma."""

    def holds(self, view: DeviatingView, rules: TriangulationLimits) -> Mask | None:
        """Return which samples are measured exactly enough."""
        limit = rules.max_sigma_m
        return None if limit is None else view.sigma <= limit

    def relaxations(self, facts: RigFacts) -> Iterator[LimitRelaxation]:
        """Yield a larger deviation."""
        limit = facts.required.triangulation.max_sigma_m
        if limit is None:
            return
        yield LimitRelaxation(
            self.name,
            lambda pair: 1e3 * pair.sigma,
            to_three_digits,
            lambda value: f"--accuracy {value:.3g} (now {1e3 * limit:g} mm)",
        )
