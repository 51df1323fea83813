"""Where the lines of one image of bright rings run, to sub-pixel.

Lines are found after Steger, "An unbiased detector of curvilinear structures", IEEE
PAMI 20(2), 1998: where the image, smoothed at the scale of the line, has a ridge.
"""

import numpy as np
from scipy.ndimage import convolve, gaussian_filter, map_coordinates

from planning.verify.reconstruction.arrays import Array, Mask
from planning.verify.reconstruction.decode.edges import ImageEdges
from planning.verify.reconstruction.patterns.ring_patterns import Frames

# Least brightness of a line above what lies beside it, in grey levels and in noises.
_MIN_CONTRAST = 10.0
_MIN_NOISES = 6.0
# A bar of width w smoothed at w / (2 sqrt 3) has this much times height / scale^2 for
# its second derivative.
_BAR = 2.0 * np.sqrt(3.0) / np.sqrt(2.0 * np.pi) * np.exp(-1.5)
_MIN_SCALE_PX = 1.0
# Share of a line's brightness that it must fall by on both sides.
_MIN_FALL = 0.4
# Second differences in both directions: blind to everything but noise.
_NOISE_MASK = np.array([[1.0, -2.0, 1.0], [-2.0, 4.0, -2.0], [1.0, -2.0, 1.0]])


def find_lines(frames: Frames, width_px: float) -> ImageEdges:
    """Return points on the middles of bright lines in an image, without labels.

    With I smoothed by a Gaussian of sigma = w / (2 sqrt 3) and n the direction of its
    most negative second derivative, the ridge is at ``-(n.grad I) / (n.H n)`` from the
    pixel's centre along n; a point belongs to the pixel that it lies in.

    Args:
        frames: One image, shape (1, h, w).
        width_px: Width w of a line in the image [px].
    """
    image = frames.stack[0].astype(np.float64)
    scale = max(_MIN_SCALE_PX, width_px / (2.0 * np.sqrt(3.0)))
    along_v, along_u, vv, uv, uu = (
        gaussian_filter(image, scale, order)  # pyright: ignore[reportArgumentType]
        for order in ((1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
    )
    # The eigenvalue of the Hessian that is most negative across a bright line.
    bend = 0.5 * (uu + vv) - np.hypot(0.5 * (uu - vv), uv)
    noise = _grey_noise(image, bend, scale)
    contrast = -bend * (scale * scale / _BAR)
    bright = contrast >= max(_MIN_CONTRAST, _MIN_NOISES * noise)
    i, j = np.nonzero(bright)
    curve = bend[i, j]
    across = _direction(uu[i, j] - curve, vv[i, j] - curve, uv[i, j])
    slope = across[:, 0] * along_u[i, j] + across[:, 1] * along_v[i, j]
    step = (-slope / curve)[:, None] * across
    inside = np.all(np.abs(step) <= 0.5, axis=1)
    places = np.column_stack([j, i]) + step
    reach = np.sqrt(12.0) * scale * across
    smooth = gaussian_filter(image, scale)
    inside &= _falls(smooth, places, reach, _MIN_FALL * contrast[i, j])
    # A derivative of white noise, smoothed, varies by 1 / (8 pi scale^4).
    spread = noise / (np.sqrt(8.0 * np.pi) * scale * scale * np.abs(curve[inside]))
    pixels = places[inside] + np.array(frames.corner)
    ring, root = np.full(len(pixels), -1), np.zeros(len(pixels), dtype=np.int8)
    unknown = np.full(len(pixels), np.nan)
    return ImageEdges(
        pixels, ring, root, across[inside], spread, unknown, np.zeros(len(ring))
    )


def _falls(smooth: Array, places: Array, reach: Array, least: Array) -> Mask:
    """Whether it is darker on both sides, a width away; beside an edge it isn't."""
    here, before, after = (
        map_coordinates(
            smooth, (places + side * reach).T[::-1], order=1, mode="nearest"
        )
        for side in (0.0, -1.0, 1.0)
    )
    return (here - before >= least) & (here - after >= least)


def _direction(a: Array, c: Array, b: Array) -> Array:
    """Eigenvectors across a line, (n, 2), of matrices less that eigenvalue."""
    # [[a, b], [b, c]] is singular; its null vector is orthogonal to its larger row.
    first = np.abs(a) >= np.abs(c)
    x, y = np.where(first, -b, -c), np.where(first, a, b)
    length = np.maximum(np.hypot(x, y), 1e-30)
    return np.column_stack([x / length, y / length])


def _grey_noise(image: Array, bend: Array, scale: float) -> float:
    """Standard deviation of a pixel on the lines, in grey levels."""
    lines = -bend * (scale * scale / _BAR) >= _MIN_CONTRAST
    if np.count_nonzero(lines) < 100:
        return 1.0
    rough = np.abs(convolve(image, _NOISE_MASK))[lines]
    return max(float(np.sqrt(0.5 * np.pi) * np.mean(rough) / 6.0), 1e-3)
