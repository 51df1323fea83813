"""What the cameras record under a projector's patterns."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.verify.reconstruction.calibration import ProjectorCalibration
from planning.verify.reconstruction.patterns.ring_patterns import (
    Frames,
    Images,
    RingPatterns,
)

from .canvas import ImageCanvas
from .defocus import Defocus
from .occluders import Occluder
from .photometry import Photometry
from .rendered_light import Blur, RenderedLight, shine
from .view import RenderedView


@dataclass(frozen=True, eq=False)
class Shown:
    """A projector that shows its patterns.

    Attributes:
        projector: As it really stands.
        design: As the patterns were drawn for it.
        patterns: What is drawn.
        caster: Of the mesh, and the bodies, that really stand there.
        defocus: Of the projector; None: equally sharp everywhere.
    """

    projector: ProjectorCalibration
    design: ProjectorCalibration
    patterns: RingPatterns
    caster: Occluder
    defocus: Defocus | None = None

    def light(self, seen: RenderedView, photometry: Photometry) -> RenderedLight:
        """Return its light on the samples of a view."""
        blur = Blur(photometry.projector_blur_m, self.defocus)
        devices = self.projector, self.design, self.patterns, self.caster
        return shine(seen, *devices, blur)


def render_pair(
    seen: RenderedView,
    projector: ProjectorCalibration,
    design: ProjectorCalibration,
    patterns: RingPatterns,
    caster: Occluder,
    photometry: Photometry,
    seed: tuple[int, ...],
    defocus: Defocus | None = None,
    beside: tuple[Shown, ...] = (),
) -> Frames:
    """Return the frames of one camera under one projector.

    Args:
        seen: What the camera sees.
        projector: As it really stands.
        design: As the patterns were drawn for it.
        patterns: What is drawn.
        caster: Of the mesh, and the bodies, that really stand there.
        photometry: Light and sensor.
        seed: Of the noise of this pair.
        defocus: Of the projector; None: equally sharp everywhere.
        beside: Other projectors that are on at the same time, in step: white with
            white, each bit and each camera's disc with its like; their light adds up.
            The exposure is that of the one projector.
    """
    one = Shown(projector, design, patterns, caster, defocus)
    light = one.light(seen, photometry)
    others = [(other.patterns, other.light(seen, photometry)) for other in beside]
    reached = [light.samples, *(other.samples for _, other in others)]
    canvas = ImageCanvas.about(seen, np.concatenate(reached))
    around = seen.albedo[canvas.inside] * np.float32(photometry.ambient)
    ambient = canvas.image(around, canvas.inside, photometry)
    white = canvas.image(light.white, light.samples, photometry)
    brightest = float(np.percentile(white + ambient, 99.9))
    gain = photometry.exposure * 255.0 / max(brightest, 1e-9)

    levels = [_level(patterns.bit(bit), light) for bit in range(patterns.n_bits)]
    more = [
        _added(canvas, other, drawn, patterns.n_bits, photometry)
        for drawn, other in others
    ]
    white = sum((images[0] for images in more), white)
    kind = np.uint8 if photometry.noisy else np.float32
    stack: Images = np.empty((patterns.n_frames, *canvas.shape), dtype=kind)
    stack[0] = photometry.capture(white + ambient, (*seed, 0), gain)
    stack[1] = photometry.capture(ambient, (*seed, 1), gain)
    for index, level in enumerate([*levels, light.root]):
        bright = canvas.image(light.white * level, light.samples, photometry)
        bright = sum((images[1 + index] for images in more), bright)
        first = 2 + 2 * index
        stack[first] = photometry.capture(bright + ambient, (*seed, first), gain)
        dark = white - bright + ambient
        stack[first + 1] = photometry.capture(dark, (*seed, first + 1), gain)
    return Frames(stack, canvas.corner)


def _added(
    canvas: ImageCanvas,
    light: RenderedLight,
    patterns: RingPatterns,
    n_bits: int,
    photometry: Photometry,
) -> list[NDArray[np.float32]]:
    """Images of a projector's white, so many bits and disc; what it lacks is dark."""
    none = np.zeros_like(light.white)
    levels = [
        _level(patterns.bit(bit), light) if bit < patterns.n_bits else none
        for bit in range(n_bits)
    ]
    values = [light.white, *(light.white * level for level in [*levels, light.root])]
    return [canvas.image(value, light.samples, photometry) for value in values]


def render_lines(
    seen: RenderedView,
    shown: Sequence[Shown],
    photometry: Photometry,
    seed: tuple[int, ...],
) -> Frames:
    """Return one image of bright rings, under projectors that shine at once.

    Where the light of several falls on a surface, it adds up.

    Args:
        seen: What the camera sees.
        shown: The projectors; the odd annuli of their patterns are bright.
        photometry: Light and sensor.
        seed: Of the noise.
    """
    everything = np.arange(len(seen.cells))
    canvas = ImageCanvas.about(seen, everything)
    around = seen.albedo * np.float32(photometry.ambient)
    image = canvas.image(around, everything, photometry)
    for one in shown:
        light = one.light(seen, photometry)
        bright = (np.arange(one.patterns.n_annuli) % 2).astype(np.float32)
        level = light.white * _level(bright, light)
        image += canvas.image(level, light.samples, photometry)
    # Lines may cover little of the image; the brightest are exposed for all the same.
    brightest = float(np.percentile(image[image > 0.0], 99.0)) if image.any() else 1.0
    gain = photometry.exposure * 255.0 / max(brightest, 1e-9)
    return Frames(photometry.capture(image, seed, gain)[None], canvas.corner)


def _level(bright: NDArray[np.float32], light: RenderedLight) -> NDArray[np.float32]:
    """Blurred brightness of a bit's frame at each lit sample."""
    inwards = np.concatenate([bright[:1], bright[:-1]]) - bright
    outwards = np.concatenate([bright[1:], bright[-1:]]) - bright
    k = light.annulus
    level = bright[k] + inwards[k] * light.inner + outwards[k] * light.outer
    return level.astype(np.float32, copy=False)
