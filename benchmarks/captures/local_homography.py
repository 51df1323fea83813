"""Codes between pixels, by a homography of the pixels around (Moreno and Taubin).

A flat board maps a camera's pixels onto a projector's by a homography, but for both
lenses, which bend little over a few pixels: D. Moreno and G. Taubin, "Simple, accurate,
and robust projector-camera calibration", 3DIMPVT 2012, section 3.3.
"""

import numpy as np

from planning.verify.reconstruction.arrays import Array
from planning.verify.reconstruction.decode.code_map import CodeMap

# Pixels to either side, as there; and codes that fewer tell aren't told.
HALF_PX = 23
_FEWEST = 50
# Codes so many times the median residual off are of something else.
_OUTLIERS, _ROUNDS = 4.0, 2


def codes_at(codes: CodeMap, pixels: Array, half_px: int = HALF_PX) -> Array:
    """Return pixels of the projector (n, 2) at positions of the image (n, 2).

    NaN where too few pixels around tell a code.
    """
    height, width = codes.codes.shape[:2]
    found = np.full((len(pixels), 2), np.nan)
    for k, place in enumerate(pixels - np.array(codes.corner)):
        u, v = np.rint(place).astype(int).tolist()
        left, top = max(0, u - half_px), max(0, v - half_px)
        right, bottom = min(width, u + half_px + 1), min(height, v + half_px + 1)
        if left >= right or top >= bottom:
            continue
        part = codes.codes[top:bottom, left:right].astype(np.float64)
        told = np.isfinite(part[:, :, 0])
        if np.count_nonzero(told) < _FEWEST:
            continue
        rows, columns = np.nonzero(told)
        around = np.column_stack([columns + left, rows + top]) - place
        found[k] = _at_origin(around / half_px, part[told])
    return found


def _at_origin(places: Array, codes: Array) -> Array:
    """Where a homography of places (n, 2) to codes (n, 2) maps the origin, (2,)."""
    centre, size = codes.mean(axis=0), codes.std()
    image = (codes - centre) / max(size, 1e-12)
    used = np.ones(len(places), dtype=bool)
    mapped = np.eye(3)
    for _ in range(_ROUNDS):
        mapped = homography(places[used], image[used])
        flat = np.column_stack([places, np.ones(len(places))]) @ mapped.T
        off = np.linalg.norm(flat[:, :2] / flat[:, 2:] - image, axis=1)
        used = off <= _OUTLIERS * np.median(off)
    return mapped[:2, 2] / mapped[2, 2] * size + centre


def homography(points: Array, image: Array) -> Array:
    """Return the matrix (3, 3) that maps points (n, 2) to image (n, 2).

    By the direct linear transform: both of about unit size.
    """
    x, y = points.T
    one, zero = np.ones(len(points)), np.zeros((len(points), 3))
    flat = np.column_stack([x, y, one])
    rows = np.concatenate(
        [
            np.column_stack([flat, zero, -image[:, :1] * flat]),
            np.column_stack([zero, flat, -image[:, 1:] * flat]),
        ]
    )
    _, vectors = np.linalg.eigh(rows.T @ rows)
    return vectors[:, 0].reshape(3, 3)
