"""White frames of several projectors, and how well tests of overlap tell them apart."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.verify.reconstruction.render.photometry import Photometry
from planning.verify.reconstruction.render.render import ImageCanvas
from planning.verify.reconstruction.render.rendered_light import Shown
from planning.verify.reconstruction.render.view import RenderedView

_LEVELS = 256


@dataclass(frozen=True, eq=False)
class Whites:
    """A camera's images of projectors' white frames.

    Attributes:
        dark: All projectors off, shape (h, w).
        alone: One projector on at a time, shape (n_projectors, h, w).
        together: All on at once, shape (h, w).
        corner: Pixel (u, v) of the top-left pixel.
    """

    dark: NDArray[np.uint8 | np.float32]
    alone: NDArray[np.uint8 | np.float32]
    together: NDArray[np.uint8 | np.float32]
    corner: tuple[int, int]


def render_whites(
    seen: RenderedView,
    shown: tuple[Shown, ...],
    photometry: Photometry,
    seed: tuple[int, ...],
) -> Whites:
    """Return one camera's images of several projectors' white, alone and together.

    The exposure suits each projector alone, so that what two light may saturate.

    Args:
        seen: What the camera sees.
        shown: The projectors.
        photometry: Light and sensor.
        seed: Of the noise of these images.
    """
    canvas = ImageCanvas.about(seen, np.zeros(0, dtype=np.int64))
    around = seen.albedo[canvas.inside] * np.float32(photometry.ambient)
    ambient = canvas.image(around, canvas.inside, photometry)
    lights = [one.light(seen, photometry.projector_blur_m) for one in shown]
    whites = [canvas.image(one.white, one.samples, photometry) for one in lights]
    brightest = max(float(np.percentile(white + ambient, 99.9)) for white in whites)
    gain = photometry.exposure * 255.0 / max(brightest, 1e-9)
    images = [ambient, *(white + ambient for white in whites), sum(whites, ambient)]
    dark, *alone, together = (
        photometry.capture(image, (*seed, k), gain) for k, image in enumerate(images)
    )
    return Whites(dark, np.stack(alone), together, canvas.corner)


def best_threshold(
    together: NDArray[np.uint8 | np.float32],
    dark: NDArray[np.uint8 | np.float32],
    lit: NDArray[np.int64],
) -> float:
    """Return the threshold of most balanced accuracy, for who knows the truth.

    Args:
        together: All projectors on, shape (h, w).
        dark: All off, shape (h, w).
        lit: By how many projectors each pixel is lit, shape (h, w).
    """
    light = np.subtract(together, dark, dtype=np.float32)
    tried = np.arange(1.0, _LEVELS) - 0.5
    scores = [balanced_accuracy(light > threshold, lit) for threshold in tried]
    return float(tried[int(np.argmax(scores))])


def balanced_accuracy(double: NDArray[np.bool_], lit: NDArray[np.int64]) -> float:
    """Return the mean of the shares of doubly and singly lit pixels told rightly.

    NaN where there are none of either.

    Args:
        double: Pixels said to be lit twice, shape (h, w).
        lit: By how many projectors each is lit; those by none don't count, (h, w).
    """
    twice, once = lit >= 2, lit == 1
    if not (twice.any() and once.any()):
        return float("nan")
    return 0.5 * (float(np.mean(double[twice])) + float(np.mean(~double[once])))
