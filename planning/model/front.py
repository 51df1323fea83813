"""What each number of projectors and cameras gives: the points of a front."""

import math
from typing import Annotated

from pydantic import Field

from planning.model.document.part import Count, Part
from planning.model.document.ring_records import AxisTaken

# Standard errors by which a bound of samples is raised, to speak of others too.
_ERRORS = 2.0


class FrontPoint(Part):
    """The best rig found of so many projectors and cameras.

    Areas and deviations are of fresh samples of the target, from rounded poses.

    Attributes:
        reachable_by_cameras_m2: Lit, and measured by some camera of the candidates.
        at_most_m2: No candidates of this number measured more of the matrix's samples.
        at_most_of_these_m2: No cameras of this number did with these projectors.
        sigma_median_m: Standard deviation along the normal of the median measured
            sample's best pair; None: nothing is measured.
        sigma_p95_m: Likewise of the sample that 5 % of what is measured exceed.
        frames: That all projectors show, one after the other.
        pixels: That all cameras read of them.
        meets: Whether these samples meet what is asked of coverage.
        on_front: Whether no point is as good in all four and better in one.
        lights: Candidates of projectors taken, by their places in the kept matrix.
        views: Likewise of cameras.
        axes: Where ring axes stand; None: the pattern has none.
    """

    projectors: Count
    cameras: Count
    lit_m2: float
    measured_m2: float
    reachable_by_cameras_m2: float
    at_most_m2: float
    at_most_of_these_m2: float | None
    sigma_median_m: float | None
    sigma_p95_m: float | None
    frames: Count
    pixels: Count
    meets: bool
    on_front: bool
    lights: tuple[Count, ...]
    views: tuple[Count, ...]
    axes: AxisTaken | None

    @property
    def count(self) -> tuple[int, int]:
        """Projectors and cameras."""
        return self.projectors, self.cameras


class Front(Part):
    """Points of each number of projectors and cameras, from one matrix.

    Attributes:
        area_m2: Of the target.
        reachable_by_projectors_m2: Lit by some projector of the candidates.
        samples: Of the matrix; `at_most_m2` is of these.
        fresh_samples: Behind every other figure.
        asked: Shares that `meets` speaks of.
    """

    area_m2: Annotated[float, Field(gt=0.0)]
    reachable_by_projectors_m2: float
    samples: Count
    fresh_samples: Count
    projector_candidates: Count
    camera_candidates: Count
    asked: dict[str, float]
    points: Annotated[tuple[FrontPoint, ...], Field(min_length=1)]

    def at_most_share(self, point: FrontPoint) -> float:
        """Return the share of the target that no so many candidates exceed.

        That of the matrix's samples, and two standard errors for any others: with b of
        n samples sqrt(b (1 - b) / n) each.
        """
        share = point.at_most_m2 / self.area_m2
        error = math.sqrt(max(share * (1.0 - share), 0.0) / self.samples)
        return min(1.0, share + _ERRORS * error)

    def point(self, projectors: int, cameras: int) -> FrontPoint | None:
        """Return the point of so many devices; None: it wasn't looked at."""
        for one in self.points:
            if one.count == (projectors, cameras):
                return one
        return None


def marked(points: tuple[FrontPoint, ...], area_m2: float) -> tuple[FrontPoint, ...]:
    """Return the points, told which no other one dominates."""

    def figures(one: FrontPoint) -> tuple[float, ...]:
        sigma = one.sigma_p95_m
        # As they are printed: of a product, which no quotient rounds like.
        exact = math.inf if sigma is None else round(1e3 * sigma, 3)
        covered = round(100.0 * (one.measured_m2 / area_m2), 1)
        return one.projectors, one.cameras, -covered, exact

    every = [figures(one) for one in points]

    def dominated(mine: tuple[float, ...]) -> bool:
        return any(
            theirs != mine and all(a <= b for a, b in zip(theirs, mine, strict=True))
            for theirs in every
        )

    return tuple(
        one.changed(on_front=not dominated(mine) and one.measured_m2 > 0.0)
        for one, mine in zip(points, every, strict=True)
    )
