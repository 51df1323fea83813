"""How bright a pixel comes out: albedo, lens blur, exposure, noise, quantisation."""

from dataclasses import dataclass, replace

import numpy as np

from planning.model.light.drawn_edges import IN_FOCUS_M, LENS_PX
from planning.verify.reconstruction.arrays import Array, Grey, Images
from planning.verify.reconstruction.patterns.defocus import Defocus
from planning.verify.reconstruction.scanner import Scanner

from .lamp import Lamp

_WAVELENGTHS_M = (0.009, 0.017, 0.031)
# Rows that are blurred, or captured, at a time: what is between stays in the cache.
_STRIP = 64


@dataclass(frozen=True)
class Photometry:
    """The simulated light and sensor.

    Attributes:
        projector_blur_m: Standard deviation of the blur of a drawn edge in focus,
            across the beam at the object [m].
        camera_blur_px: Standard deviation of the lens's blur [px].
        ambient: Ambient light as a share of the projector's at normal incidence.
        albedo_variation: Amplitude of the texture, as a share of the mean albedo.
        full_well: Electrons at full scale.
        read_noise: Standard deviation of the read noise, in grey levels of 255.
        exposure: Share of full scale that the brightest pixels reach.
        noisy: Whether noise is added; frames are quantised to 8 bits if so.
        gamma: Of the camera: a share x of full scale is reported as x^(1 / gamma).
        darker_rim: Whether its lens is darker off its axis, by cos^4.
    """

    projector_blur_m: float = IN_FOCUS_M
    camera_blur_px: float = LENS_PX
    ambient: float = 0.05
    albedo_variation: float = 0.2
    full_well: float = 10_000.0
    read_noise: float = 1.0
    exposure: float = 0.85
    noisy: bool = True
    gamma: float = 1.0
    darker_rim: bool = False

    @property
    def pixel_noise(self) -> float:
        """Standard deviation of a half-bright pixel in grey levels of 255."""
        shot = 127.5 * 255.0 / self.full_well
        return float(np.sqrt(shot + self.read_noise**2)) if self.noisy else 0.0

    def through_lens(
        self, defocus: Defocus | None, away_m: float, focal_px: float
    ) -> "Photometry":
        """Return light as a camera records it whose object's middle is so far away.

        One blur for the whole image: across 200 mm of depth it changes by less than
        the lens's own.
        """
        if defocus is None or not away_m > 0.0:
            return self
        more = float(defocus.blur_m(np.array(away_m))) * focal_px / away_m
        return replace(self, camera_blur_px=float(np.hypot(self.camera_blur_px, more)))

    def gain(self, brightest: float) -> float:
        """Return grey levels in a unit of irradiance for the brightest one."""
        return self.exposure * 255.0 / max(brightest, 1e-9)

    def albedo(self, points: Array) -> Grey:
        """Return the albedo of world points (n, 3): a solid texture about 1."""
        waves = np.zeros(len(points), dtype=np.float32)
        for axis, length in enumerate(_WAVELENGTHS_M):
            along = points[:, axis] + 0.5 * points[:, (axis + 1) % 3]
            waves += np.sin((along * (2.0 * np.pi / length)).astype(np.float32))
        return 1.0 + np.float32(self.albedo_variation / 3.0) * waves

    def blur(self, image: Grey, fold: int = 1) -> Grey:
        """Return an image of `fold` cells a pixel under the lens's Gaussian."""
        if self.camera_blur_px == 0.0:
            return image
        blur = fold * self.camera_blur_px
        reach = max(1, int(np.ceil(3.5 * blur)))
        taps = np.exp(-0.5 * (np.arange(reach + 1) / blur) ** 2)
        taps = (taps / (2.0 * taps.sum() - taps[0])).astype(np.float32)
        blurred = np.empty_like(image)
        for first in range(0, len(image), _STRIP):
            last = min(first + _STRIP, len(image))
            strip = np.empty_like(image[first:last])
            _smooth(image, taps, first, last, strip)
            _smooth(strip.T, taps, 0, image.shape[1], blurred[first:last].T)
        return blurred

    def capture(self, grey: Grey, key: tuple[int, ...], gain: float) -> Images:
        """Return what the sensor reports of an image.

        Shot noise and read noise, ``var = 255 grey / full_well + read_noise^2`` in grey
        levels; clipped, put through gamma and rounded to 8 bits. Noise-free frames are
        not quantised.

        Args:
            grey: Irradiance, shape (h, w).
            key: Seeds the noise: one key, one noise, whatever the number of threads.
            gain: Grey levels in a unit of irradiance.
        """
        if not self.noisy:
            return self._reported(grey * np.float32(gain))
        rng = np.random.Generator(np.random.SFC64(np.random.SeedSequence(key)))
        captured = np.empty(grey.shape, dtype=np.uint8)
        for first in range(0, len(grey), _STRIP):
            level = grey[first : first + _STRIP] * np.float32(gain)
            variance = level * np.float32(255.0 / self.full_well)
            variance += np.float32(self.read_noise**2)
            noise = rng.standard_normal(level.shape, dtype=np.float32)
            level += noise * np.sqrt(variance)
            reported = self._reported(np.clip(level, 0.0, 255.0))
            captured[first : first + _STRIP] = np.rint(reported)
        return captured

    def _reported(self, level: Grey) -> Grey:
        if self.gamma == 1.0:
            return level
        share = np.maximum(level, 0.0) * np.float32(1.0 / 255.0)
        return np.float32(255.0) * share ** np.float32(1.0 / self.gamma)


def assumed_light(scanner: Scanner) -> Photometry:
    """Return light and sensor that a plan's check assumes: as stated, if it is.

    A stated albedo is that of all the surface, a range that of its texture.
    """
    light = scanner.light
    if light is None:
        return Photometry(ambient=scanner.limits.check.ambient)
    low, high = light.albedo
    middle = scanner.mesh.centre[None]
    white = [
        Lamp(light, 0.0).lux(projector, float(projector.pixel_m(middle)[0]))
        for projector in scanner.projectors
    ]
    return Photometry(
        ambient=light.room_lux / float(np.mean(white)),
        albedo_variation=(high - low) / (high + low),
        full_well=light.full_well_e / light.gain,
        read_noise=light.read_noise_e * light.grey_per_electron,
        darker_rim=True,
    )


def _smooth(image: Grey, taps: Grey, first: int, last: int, out: Grey) -> None:
    """Convolve rows first to last along axis 0; beyond the border it is dark."""
    n = len(image)
    np.multiply(image[first:last], taps[0], out=out)
    for k in range(1, min(len(taps), n)):
        # What rows give to those before them is what they give to those behind them.
        begin = max(first - k, 0)
        given = taps[k] * image[begin : last + k]
        low, high = max(first, k), min(last, n - k)
        if low < last:
            out[low - first :] += given[low - k - begin : last - k - begin]
        if high > first:
            out[: high - first] += given[first + k - begin : high + k - begin]
