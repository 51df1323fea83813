"""How far devices aren't where they should be, and where they are taken to be."""

from dataclasses import dataclass
from math import sqrt


@dataclass(frozen=True)
class CalibrationErrors:
    """Errors of every device, each by itself, unknown but the same over all its points.

    Root mean squares: over the axes of space a turn and a displacement are a third of
    their squares each, over those of the image a shift is half of its square each.

    Attributes:
        angle: Rotation about the optical centre [rad].
        position_m: Displacement of the optical centre [m].
        focal: Error of the focal length, or of the panel's scale, as a share.
        principal_px: Displacement of the principal point in the image [px].
    """

    angle: float = 0.0
    position_m: float = 0.0
    focal: float = 0.0
    principal_px: float = 0.0

    @property
    def about_axis(self) -> float:
        """Standard deviation of the rotation about any one axis [rad]."""
        return self.angle / sqrt(3.0)

    @property
    def along_axis_m(self) -> float:
        """Standard deviation of the displacement along any one axis [m]."""
        return self.position_m / sqrt(3.0)

    @property
    def along_line_px(self) -> float:
        """Standard deviation of the principal point along any one line [px]."""
        return self.principal_px / sqrt(2.0)

    def times(self, scale: float) -> "CalibrationErrors":
        """Return errors so many times as large."""
        return CalibrationErrors(
            scale * self.angle,
            scale * self.position_m,
            scale * self.focal,
            scale * self.principal_px,
        )


PERFECT = CalibrationErrors()


# No focal length is off by a larger share; drawn ones stay positive.
MOST_FOCAL = 0.1


@dataclass(frozen=True)
class Mounting:
    """How far devices may stand beside their planned poses; known once calibrated.

    Half widths, each uniformly distributed: a drawing gives a tolerance as bounds.

    Attributes:
        position_m: Of the displacement along each axis of the device [m].
        angle: Of the rotation about each axis of the device [rad].
        focal: Of the focal length, or of the panel's scale, as a share.
    """

    position_m: float = 0.0
    angle: float = 0.0
    focal: float = 0.0

    def times(self, scale: float) -> "Mounting":
        """Return bounds so many times as wide."""
        return Mounting(scale * self.position_m, scale * self.angle, scale * self.focal)


AS_PLANNED = Mounting()


@dataclass(frozen=True)
class Robust:
    """What enough rigs must meet that aren't built exactly as planned.

    The requirements of such a plan are tighter, by as much as that takes.

    Attributes:
        quantile: Share of drawn rigs that must meet what was asked.
        mounting: How far their devices stand beside their poses.
        dominant_coverage: As it was asked, like those below.
        coverage: Measured area / area reachable by cameras.
        region_coverage: Floor of each large region.
        max_sigma_m: Largest standard deviation [m]; None: no limit.
    """

    quantile: float
    mounting: Mounting
    dominant_coverage: float
    coverage: float
    region_coverage: float
    max_sigma_m: float | None


@dataclass(frozen=True)
class Survival:
    """What is asked of a plan beyond being measured once, with all devices there.

    Attributes:
        views: Pairs of projector and camera, at least, that must measure what counts.
        survive: Devices, 0 or 1, of which any may be lost: the rest must still meet
            the requirements.
    """

    views: int = 1
    survive: int = 0

    @property
    def asks(self) -> bool:
        """Whether anything is asked at all."""
        return self.views > 1 or self.survive > 0
