"""How bright samples come out, again, from `docs/reference/semantics.md`."""

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array
from geometry.devices import ParallelModel
from planning.model.light.light_budget import LightBudget

from .audit_devices import AuditCamera, AuditProjector
from .audit_optics import dot, in_frame, pixels_of

# Planck's constant times the speed of light [J m]; 555 nm.
_HC, _GREEN = 6.62607015e-34 * 299792458.0, 555e-9


@dataclass(frozen=True, eq=False)
class LightLevels:
    """Electrons of a white surface on the axis, lit and dark, shape (n,) each."""

    light: LightBudget
    lit: Array
    dark: Array

    @classmethod
    def of(
        cls, light: LightBudget, projector: AuditProjector, points: Array, normal: Array
    ) -> "LightLevels":
        """Look at points (n, 3) under a projector's light for as long as planned."""
        exposed = projector.exposure_s or 0.0
        image = light.lumens * _lux_of_a_lumen(projector, points, normal)
        # Of the exitance of a white surface, through the lens, on a pixel [lm].
        share = light.transmission * light.pixel_m**2 / (4.0 * light.f_number**2)
        photons = exposed * share / light.lumens_per_watt * _GREEN / _HC
        each = photons * light.quantum_efficiency
        return cls(
            light,
            each * (image + light.room_lux),
            each * (image / light.contrast + light.room_lux),
        )

    def grey(self, electrons: Array) -> Array:
        """Return grey levels of 255."""
        return electrons * self.light.gain / self.light.full_well_e * 255.0

    def seen(self, camera: AuditCamera, points: Array) -> "LightLevels":
        """Return them as they reach a camera's pixels, by cos^4 of the lens."""
        local = in_frame(camera.world_from_device, points)
        off = pixels_of(camera.device, local) - camera.device.camera_matrix[:2, 2]
        dim = (1.0 + (off**2).sum(axis=1) / self.light.focal_px**2) ** -2
        return LightLevels(self.light, dim * self.lit, dim * self.dark)

    @property
    def brightest(self) -> Array:
        """Grey levels of lit surface of the largest albedo, (n,)."""
        return self.grey(self.light.albedo[1] * self.lit)

    @property
    def contrast(self) -> Array:
        """Grey levels between lit and dark surface of the least albedo, (n,)."""
        return self.grey(self.light.albedo[0] * (self.lit - self.dark))

    @property
    def _half_lit(self) -> Array:
        """Noise of a pixel between lit and dark [electrons], (n,)."""
        light = self.light
        half = light.albedo[0] * (self.lit + self.dark) / 2.0
        level = light.full_well_e / light.gain / (2.0**light.bits - 1.0)
        return np.sqrt(half + light.read_noise_e**2 + level**2 / 12.0)

    def phase_noise(self, shifts: int) -> Array:
        """Return the noise of the phase of so many unblurred sinusoids [rad], (n,)."""
        amplitude = self.light.albedo[0] * (self.lit - self.dark) / 2.0
        return np.sqrt(2.0 / shifts) * self._half_lit / np.maximum(amplitude, 1e-9)

    def noise_px(self, blur_px: Array) -> Array:
        """Return the noise of edges blurred by so much [px], (n,)."""
        light, noise = self.light, self._half_lit
        steepness = light.albedo[0] * (self.lit - self.dark) / np.sqrt(2.0 * np.pi)
        # Frame less inverse: the noise of two over a slope twice as steep; and as much
        # as two pixels weighed evenly by all places between them have.
        noise *= np.sqrt(0.5 * 2.0 / 3.0)
        return noise * blur_px / np.maximum(steepness, 1e-9)


def _lux_of_a_lumen(projector: AuditProjector, points: Array, normals: Array) -> Array:
    """Return the illuminance of surface by one lumen, shape (n,) [1/m²].

    A lumen fills the image evenly: w h z² / (f_x f_y) on a plane at depth z, or the
    panel in parallel light.
    """
    device, pose = projector.device, projector.world_from_device
    width, height = device.resolution
    along, _ = projector.light.to_points(points)
    squarely = np.maximum(-dot(normals, along), 0.0)
    if isinstance(device, ParallelModel):
        return squarely / (width * height * device.pixel_pitch_m**2)
    z = (points - pose[:3, 3]) @ pose[:3, 2]
    fx, fy = np.diag(device.camera_matrix)[:2]
    return fx * fy / (width * height * z**2) * squarely / (along @ pose[:3, 2])
