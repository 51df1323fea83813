"""What a projector shows that codes every pixel: Gray code, then phase shifts."""

from dataclasses import dataclass
from math import radians

# Periods and stripes are whole powers of two, so that they begin together.
_FEWEST_SHIFTS = 3


@dataclass(frozen=True)
class DenseCode:
    """A sequence that tells each pixel of a panel, across and then down.

    Of either direction the bits of the Gray code of the pixel's number come, the
    highest first and each followed by its inverse, down to stripes of `finest_px`; then
    white and black; then of either direction `shifts` sinusoids::

        I_k(u) = 1/2 + 1/2 cos(2 pi (u / period_px - k / shifts)),   k = 0 ... shifts-1

    Without shifts that is the sequence of OpenCV's `GrayCodePattern` with the images
    for its shadow mask behind it, and a code is told to a pixel.

    Attributes:
        shifts: Sinusoids of either direction, 3 or more; 0: none.
        period_px: Of the sinusoids, a power of two, 4 or more [px of the panel].
        phase_noise: Standard deviation of the phase where the light comes in squarely
            and a rig states nothing of its light [rad].
    """

    shifts: int = 4
    period_px: int = 16
    phase_noise: float = radians(1.0)

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            ValueError: If there are 1 or 2 shifts, or the period is no power of two.
        """
        if self.shifts and not self.shifts >= _FEWEST_SHIFTS:
            raise ValueError(
                f"shifts = {self.shifts} don't tell a phase: write 0, or "
                f"{_FEWEST_SHIFTS} or more"
            )
        if self.period_px < 4 or self.period_px & (self.period_px - 1):
            raise ValueError(
                f"period_px = {self.period_px} must be a power of two, 4 or more"
            )

    @property
    def finest_px(self) -> int:
        """Width of the finest stripe that a code tells: half a period, or a pixel."""
        return self.period_px // 2 if self.shifts else 1

    def bits(self, n_pixels: int) -> int:
        """Return how many bits of the Gray code of so many pixels are shown.

        All ``ceil(log2 n)``, less those of stripes finer than `finest_px`.
        """
        every = max(1, (n_pixels - 1).bit_length())
        return max(1, every - (self.finest_px.bit_length() - 1))

    def n_frames(self, resolution: tuple[int, int]) -> int:
        """Return how many frames a panel (width, height) shows."""
        stripes = sum(2 * self.bits(n) for n in resolution)
        return stripes + 2 + 2 * self.shifts
