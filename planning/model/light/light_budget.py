"""What reaches a camera's sensor of a projector's light, and how noisily it is told."""

from dataclasses import dataclass
from math import floor

# Largest grey level of 255 that the decoder doesn't take for clipped.
SATURATED = 254.5
# hc [J m], and the wavelength of what the eye sees best: photons of white light [m].
_PLANCK_LIGHT, _WAVELENGTH_M = 1.98644586e-25, 555e-9
# Share of full scale that a planned exposure fills at most.
_FULLEST = 0.95


@dataclass(frozen=True)
class LightBudget:
    """Light of a projector, a matt surface, and a camera that sees it.

    Grey levels are of 255, whatever the bits.

    Attributes:
        lumens: Luminous flux of a white image (ANSI) [lm].
        contrast: Of a white over a black image; what is dark is lit by that share.
        albedo: Least and largest of the surface.
        room_lux: Illuminance by all other light, from everywhere [lux].
        lumens_per_watt: Luminous efficacy of the radiation [lm/W].
        f_number: N of the camera's lens.
        focal_px: Its focal length [px].
        transmission: Share of light that passes it.
        pixel_m: Side of the sensor's pixels [m].
        quantum_efficiency: Electrons for a photon on a pixel.
        full_well_e: Electrons at full scale without gain.
        read_noise_e: Temporal noise in the dark [electrons].
        gain: So many times as bright as without.
        bits: Of a pixel.
        min_contrast: Least difference of lit and dark that is decoded [grey levels].
        max_exposure_s: Longest exposure [s].
        period_s: A refresh of the projector, of which an exposure is a whole number
            [s]; None: it isn't known, and any exposure is taken.
    """

    lumens: float
    contrast: float
    albedo: tuple[float, float]
    room_lux: float
    lumens_per_watt: float
    f_number: float
    focal_px: float
    transmission: float
    pixel_m: float
    quantum_efficiency: float
    full_well_e: float
    read_noise_e: float
    gain: float
    bits: int
    min_contrast: float
    max_exposure_s: float
    period_s: float | None = None

    @property
    def electrons_per_lux_s(self) -> float:
        """Electrons of a pixel on the axis for 1 lux second on a white surface.

        A matt surface under E has the radiance E / pi, whatever the direction, and
        makes pi / (4 N^2) times that in the image, T of it through the glass; a pixel
        of the side a turns photons of h c / lambda into electrons::

            T a^2 eta lambda / (4 N^2 h c K)
        """
        photons = _WAVELENGTH_M / (_PLANCK_LIGHT * self.lumens_per_watt)
        through = self.transmission / (4.0 * self.f_number**2)
        return through * self.pixel_m**2 * self.quantum_efficiency * photons

    @property
    def grey_per_electron(self) -> float:
        """Grey levels of 255 for an electron."""
        return 255.0 * self.gain / self.full_well_e

    @property
    def own_variance(self) -> float:
        """Variance of a pixel in the dark: read noise, and rounding to its bits [e^2].

        ``sigma_d^2 + (step in electrons)^2 / 12``, EMVA 1288.
        """
        step = self.full_well_e / self.gain / (2**self.bits - 1)
        return self.read_noise_e**2 + step**2 / 12.0

    def exposure_s(self, brightest: float) -> float:
        """Return the longest exposure that doesn't clip, one refresh at least [s].

        `brightest` is the grey level that a second gives the brightest sample.
        """
        longest = min(self.max_exposure_s, 255.0 * _FULLEST / max(brightest, 1e-12))
        if self.period_s is None:
            return longest
        return max(floor(longest / self.period_s + 1e-9), 1) * self.period_s
