"""When a drawn rig meets what is asked of a plan.

`docs/reference/semantics.md`, "Drawn rigs", has the definition: areas against what the
plan's own reference poses reach, the root mean square of the errors of measured points
against the accuracy, which is a standard deviation too.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from planning.model.requirements import Requirements

# Equal up to rounding is enough.
_SLACK = 1e-9
# What is told of a drawn rig.
FIGURES = {
    "lit": "lit / reachable by projectors",
    "coverage": "measured / reachable by cameras",
    "worst_region": "least of both over the large regions",
    "completeness": "of what the plan measures, within tau",
    "rms_m": "error along the normal, rms [mm]",
    "p95_m": "error along the normal, 95 % within [mm]",
}


@dataclass(frozen=True)
class Figures:
    """What a rig reaches on the target.

    Attributes:
        lit: Lit area / reachable by projectors.
        coverage: Measured area / reachable by cameras.
        worst_region: Least of both shares over the large regions; 1 where there is
            none.
        completeness: Of what the plan measures, the share that has a point within tau.
        rms_m: Root mean square of the points' errors along the normal [m]; None where
            nothing is measured, likewise below.
        p95_m: 95th percentile of their absolute values [m].
        lost: Share of the measured whose viewing ray passes its ring by.
    """

    lit: float
    coverage: float
    worst_region: float
    completeness: float
    rms_m: float | None
    p95_m: float | None
    lost: float = 0.0


@dataclass(frozen=True)
class Asked:
    """What a drawn rig must reach, as `Figures` has it; None: nothing is asked."""

    lit: float
    coverage: float
    worst_region: float
    completeness: float
    rms_m: float | None

    @classmethod
    def of(cls, required: Requirements) -> "Asked":
        """Return what is asked of a plan."""
        required = as_asked(required)
        limits = required.triangulation
        return cls(
            required.dominant_coverage,
            required.coverage,
            required.region_coverage,
            required.check.min_completeness,
            limits.max_sigma_m if limits.accuracy_of == "total" else None,
        )

    def missed(self, figures: Figures) -> tuple[str, ...]:
        """Return the names of the figures that miss what is asked."""
        return tuple(self._missed(figures))

    def _missed(self, figures: Figures) -> Iterator[str]:
        for name in ("lit", "coverage", "worst_region", "completeness"):
            if not getattr(figures, name) >= getattr(self, name) - _SLACK:
                yield name
        if self.rms_m is None:
            return
        if figures.rms_m is None or not figures.rms_m <= self.rms_m * (1.0 + _SLACK):
            yield "rms_m"


def as_asked(required: Requirements) -> Requirements:
    """Return the requirements before they were tightened to be met robustly."""
    robust = required.robust
    if robust is None:
        return required
    return replace(
        required,
        dominant_coverage=robust.dominant_coverage,
        coverage=robust.coverage,
        region_coverage=robust.region_coverage,
        triangulation=replace(required.triangulation, max_sigma_m=robust.max_sigma_m),
    )
