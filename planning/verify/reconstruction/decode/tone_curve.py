"""Cameras whose grey levels aren't in proportion to light, made good from their images.

Light adds up, whatever a camera makes of it: with h from its grey levels to light,
``h(I) + h(I_inv) = h(W) + h(K)`` in every pixel of every frame that has its inverse.
"""

import numpy as np
from scipy.optimize import nnls

from planning.verify.reconstruction.arrays import Array, Grey, Images, Mask

_LEVELS = 255.0
# Straight pieces of h, pixels that it is fitted to, and how smooth it is where these
# don't say: the change of its slope weighs so much against the contrast of all pixels.
_PIECES, _MOST_PIXELS, _SMOOTH = 24, 4000, 1e-5


def tone_curve(stack: Images, good: Mask) -> Array:
    """Return light at grey levels 0 to 255, rising to 255, shape (256,).

    Increments of h over pieces of equal length, none negative (non-negative least
    squares), of which the mean contrast of white is what it is in grey levels.

    Args:
        stack: White, black, then frames each with its inverse, shape (n_frames, h, w).
        good: Pixels that are lit and not clipped.
    """
    pixels = stack[:, good]
    pixels = pixels[:, :: max(1, pixels.shape[1] // _MOST_PIXELS)].astype(np.float64)
    white, black = (_pieces(pixels[k]) for k in (0, 1))
    n = pixels.shape[1]
    terms = np.zeros((_PIECES, _PIECES))
    for one, other in zip(pixels[2::2], pixels[3::2], strict=True):
        rest = _pieces(one) + _pieces(other) - white - black
        terms += rest.T @ rest
    contrast = (white - black).mean(axis=0)
    mean = float((pixels[0] - pixels[1]).mean())
    bend = np.diff(np.eye(_PIECES), axis=0)
    weight = _SMOOTH * n * len(pixels)
    terms += weight * float(contrast @ contrast) * bend.T @ bend
    # The constraint weighs as much as all pixels, many times.
    heavy = 1e4 * np.trace(terms) / float(contrast @ contrast)
    terms += heavy * np.outer(contrast, contrast)
    root = np.linalg.cholesky(terms + 1e-12 * np.trace(terms) * np.eye(_PIECES)).T
    aim = np.linalg.solve(root.T, heavy * mean * contrast)
    steps, _ = nnls(root, aim)
    light = _pieces(np.arange(_LEVELS + 1.0)) @ steps
    return light * (_LEVELS / light[-1])


def in_light(stack: Images, light: Array) -> Grey:
    """Return images with light in place of grey levels, from a table of it (256,)."""
    levels = np.arange(_LEVELS + 1.0)
    table = light.astype(np.float32)
    if stack.dtype == np.uint8:
        return table[stack.astype(np.uint8)]
    return np.interp(stack, levels, light).astype(np.float32)


def _pieces(levels: Array) -> Array:
    """How much of each piece lies below grey levels (n,), shape (n, pieces)."""
    place = levels * (_PIECES / _LEVELS)
    return np.clip(place[:, None] - np.arange(_PIECES), 0.0, 1.0)
