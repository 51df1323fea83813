"""What a camera sees of an object with texture, under even light and no projector.

The texture is fixed in the object, so that all views agree: an albedo

    1 + C sqrt(2 / n) sum_i cos(k_i . P + phi_i),   clipped to [1/5, 9/5]

of n waves whose directions are uniform on the sphere and whose lengths are uniform in
their logarithm between 6 and 96 pixels of the cameras at the object: the finest that
foreshortening doesn't soon take from an image, and coarse ones by which a search
begins.
"""

from dataclasses import dataclass, replace

import numpy as np

from geometry.rays.rays import RayCaster
from planning.verify.reconstruction.arrays import Array, Grey
from planning.verify.reconstruction.calibration import CameraCalibration
from planning.verify.reconstruction.decode.views.view_decode import ObjectImage
from planning.verify.reconstruction.scanner import Scanner

from .occluders import obstacles_of
from .photometry import Photometry
from .render import ImageCanvas
from .view import view

# Root mean square of the albedo about its mean, and where it is clipped.
CONTRAST = 0.25
_MOST = 0.8
_WAVES = 64
_WAVELENGTHS_PX = (6.0, 96.0)
# Points whose waves are added up at once: they stay in the cache.
_CHUNK = 1 << 14
_STREAM = 20_261_125


@dataclass(frozen=True, eq=False)
class SolidTexture:
    """Waves of a solid texture.

    Attributes:
        vectors: k in [rad/m], shape (n, 3).
        phases: phi [rad], shape (n,).
    """

    vectors: Array
    phases: Array

    @classmethod
    def drawn(cls, pixel_m: float, seed: int) -> "SolidTexture":
        """Return a texture for cameras whose pixels are so wide at the object."""
        rng = np.random.default_rng((_STREAM, seed))
        ways = rng.standard_normal((_WAVES, 3))
        ways /= np.linalg.norm(ways, axis=1)[:, None]
        # Stratified: every octave has its share of so few waves.
        share = (np.arange(_WAVES) + rng.random(_WAVES)) / _WAVES
        fine, coarse = _WAVELENGTHS_PX
        lengths = fine * (coarse / fine) ** share * pixel_m
        phases = rng.uniform(0.0, 2.0 * np.pi, _WAVES)
        return cls(ways * (2.0 * np.pi / lengths)[:, None], phases)

    def albedo(self, points: Array) -> Grey:
        """Return the albedo at points (n, 3), about 1, shape (n,)."""
        albedo = np.empty(len(points), dtype=np.float32)
        scale = np.float32(CONTRAST * np.sqrt(2.0 / len(self.phases)))
        for first in range(0, len(points), _CHUNK):
            part = slice(first, first + _CHUNK)
            angle = points[part] @ self.vectors.T + self.phases
            waves = np.cos(angle, dtype=np.float32, casting="same_kind").sum(axis=1)
            albedo[part] = 1.0 + np.clip(scale * waves, -_MOST, _MOST)
        return albedo


def typical_pixel(scanner: Scanner, centre: Array) -> float:
    """Return how wide a pixel of the cameras is at the middle of the object [m]."""
    sizes = [
        float((centre - camera.centre) @ camera.axis) / camera.focal_px
        for camera in scanner.cameras
    ]
    return float(np.median(sizes))


def render_textured(
    truth: Scanner,
    camera: CameraCalibration,
    caster: RayCaster,
    texture: SolidTexture,
    photometry: Photometry,
    key: tuple[int, ...],
) -> ObjectImage | None:
    """Return what a camera of those that stand there records; None: nothing.

    Light falls evenly from all sides; what is beside the object is dark.
    """
    away = float((truth.mesh.centre - camera.centre) @ camera.axis)
    lens = photometry.through_lens(camera.focus, away, camera.focal_px)
    # Nothing is drawn: the lens alone makes the image soft, and cells must show it.
    lens = replace(lens, projector_blur_m=0.0, albedo_variation=0.0)
    seen = view(camera, truth.mesh, caster, lens, obstacles_of(truth, camera.id))
    if seen is None:
        return None
    every = np.arange(len(seen.cells))
    canvas = ImageCanvas.about(seen, every)
    grey = canvas.image(seen.albedo * texture.albedo(seen.points), every, lens)
    gain = lens.gain(float(np.percentile(grey[grey > 0.0], 99.9)))
    recorded = lens.capture(grey, key, gain)
    return ObjectImage(recorded.astype(np.float32), canvas.corner)
