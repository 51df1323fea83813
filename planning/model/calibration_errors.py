"""What a calibration leaves: how far each device isn't where it is taken to be."""

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


PERFECT = CalibrationErrors()
