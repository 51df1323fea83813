"""Windows of two images matched by least squares, far below a pixel.

With I_1 and I_2 the grey levels, gain and offset of the second image and a plane are
fitted to each window::

    I_1(o) = g I_2(u(o)) + h,    u(o) by d(o) = d + d_u o_u + d_v o_v

by Gauss-Newton: the window moves with d by s = grad I_2 . du/dd, so that the unknowns
of a step are h, g, and g times the changes of d, d_u and d_v, of the regressors 1, I_2,
s, s o_u and s o_v (A. Gruen, Adaptive least squares correlation, 1985). What is left
over is noise of both images, and what a plane and a pixel grid don't show; it gives the
standard deviation of d.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import map_coordinates, spline_filter

from planning.verify.reconstruction.arrays import Array, Grey, Mask
from planning.verify.reconstruction.calibration import CameraCalibration

from .level_image import LevelImage, between_pixels
from .two_views import TwoViews

# Pixels of a round window.
REACH_PX = 5
# Steps, and those of them that needn't know the image between pixels so exactly.
_STEPS, _ROUGH = 4, 2
# Windows at once: they stay in the cache.
_CHUNK = 1 << 11
_UNKNOWNS = 5


@dataclass(frozen=True, eq=False)
class Fitted:
    """Windows as they fit best, shape (n,) each.

    Attributes:
        planes: d, d_u, d_v in [1/m] and [1/(m px)], shape (n, 3).
        sigma: Standard deviation of d, by what the fit leaves over [1/m].
        scores: Correlation of both windows.
        moved: What a position in the second image moves by with d [px m].
        lit: Whether no pixel of either window is dark.
    """

    planes: Array
    sigma: Array
    scores: Array
    moved: Array
    lit: Mask


class WindowFit:
    """Fits windows of a first image to a second one."""

    def __init__(
        self,
        cameras: tuple[CameraCalibration, CameraCalibration],
        images: tuple[LevelImage, LevelImage],
        dark: float,
    ) -> None:
        self._cameras, self._images, self._dark = cameras, images, dark
        reach = np.arange(-REACH_PX, REACH_PX + 1, dtype=np.float64)
        square = np.stack(np.meshgrid(reach, reach), axis=-1).reshape(-1, 2)
        self._offsets = square[np.hypot(*square.T) <= REACH_PX + 0.5]
        grey = images[1].grey.astype(np.float64)
        self._spline = spline_filter(grey).astype(np.float32)
        by_row, by_column = np.gradient(grey)
        self._slopes: tuple[Grey, Grey] = (
            np.asarray(by_column, dtype=np.float32),
            np.asarray(by_row, dtype=np.float32),
        )

    def fitted(self, pixels: Array, planes: Array) -> Fitted:
        """Return the best fit near planes (n, 3) of windows about pixels (n, 2)."""
        parts = [
            self._chunk(pixels[start : start + _CHUNK], planes[start : start + _CHUNK])
            for start in range(0, len(pixels), _CHUNK)
        ]
        columns = zip(*(vars(part).values() for part in parts), strict=True)
        return Fitted(*(np.concatenate(column) for column in columns))

    def _chunk(self, pixels: Array, planes: Array) -> Fitted:
        views = TwoViews.of(*self._cameras, pixels)
        rows, columns = self._images[0].places(
            *(pixels[:, None, k] + self._offsets[:, k] for k in (0, 1))
        )
        taken = map_coordinates(self._images[0].grey, [rows, columns], order=0)
        first: Grey = np.asarray(taken, dtype=np.float32)
        planes = planes.copy()
        for number in range(_STEPS):
            second, slope, _ = self._second(views, planes, smooth=number >= _ROUGH)
            inverse, right = _normal_equations(first, second, slope, self._offsets)
            found = np.einsum("nij,nj->ni", inverse, right)
            gain = np.where(np.abs(found[:, 1:2]) > 0.1, found[:, 1:2], np.inf)
            planes += found[:, 2:] / gain / _scales(slope)
        second, slope, moved = self._second(views, planes, smooth=True)
        inverse, right = _normal_equations(first, second, slope, self._offsets)
        return self._judged(planes, first, second, inverse, right, slope, moved)

    def _second(
        self, views: TwoViews, planes: Array, *, smooth: bool
    ) -> tuple[Grey, Grey, Array]:
        """Grey levels of the second windows, what they change by with d, and du/dd."""
        u, v, du, dv = views.seen_at(planes, self._offsets, with_slope=True)
        at = self._images[1].places(u, v)
        grey = between_pixels(self._images[1].grey, *at)
        if smooth:
            fine = map_coordinates(self._spline, at, order=3, prefilter=False, cval=0.0)
            grey = np.asarray(fine, dtype=np.float32)
        along, down = (between_pixels(s, *at) for s in self._slopes)
        middle = len(self._offsets) // 2
        slope: Grey = np.asarray(along * du + down * dv, dtype=np.float32)
        return grey, slope, np.hypot(du[:, middle], dv[:, middle])

    def _judged(
        self,
        planes: Array,
        first: Grey,
        second: Grey,
        inverse: Array,
        right: Array,
        slope: Grey,
        moved: Array,
    ) -> Fitted:
        """Say how well windows fit, and how exactly they tell d."""
        found = np.einsum("nij,nj->ni", inverse, right)
        centred = first - first.mean(axis=1, keepdims=True)
        whole = np.einsum("nm,nm->n", centred, centred)
        # Of the gain and the offset alone: no step of the plane is left.
        rest = first - found[:, :1] - found[:, 1:2] * second
        left = np.einsum("nm,nm->n", rest, rest)
        freedom = first.shape[1] - _UNKNOWNS
        gain = np.maximum(np.abs(found[:, 1]), 0.1)
        variance = left / freedom * inverse[:, 2, 2]
        scale = _scales(slope)[:, 0]
        return Fitted(
            planes,
            np.sqrt(np.maximum(variance, 0.0)) / gain / scale,
            np.sqrt(np.clip(1.0 - left / np.maximum(whole, 1e-9), 0.0, 1.0)),
            moved,
            (first.min(axis=1) > self._dark) & (second.min(axis=1) > self._dark),
        )


def _scales(slope: Grey) -> Array:
    """Return what columns of d, d_u, d_v are divided by, so that all are near 1."""
    size = np.sqrt(np.mean(np.square(slope, dtype=np.float64), axis=1))
    size = np.maximum(size, 1e-12)[:, None]
    return size * np.array([1.0, REACH_PX, REACH_PX])


def _normal_equations(
    first: Grey, second: Grey, slope: Grey, offsets: Array
) -> tuple[Array, Array]:
    """Return the inverse of A^T A and A^T I_1 of the fits, (n, 5, 5) and (n, 5)."""
    n, m = first.shape
    regressors = np.empty((n, m, _UNKNOWNS), dtype=np.float32)
    regressors[:, :, 0] = 1.0
    regressors[:, :, 1] = second
    scale = _scales(slope)
    for k, factor in enumerate((np.ones(m), *offsets.T)):
        regressors[:, :, 2 + k] = slope * factor / scale[:, k : k + 1]
    turned = regressors.transpose(0, 2, 1)
    matrix = (turned @ regressors).astype(np.float64)
    right = (turned @ first[:, :, None])[:, :, 0].astype(np.float64)
    # Windows that tell nothing have no inverse: a trace of the identity gives them one.
    matrix += 1e-9 * np.einsum("nii->n", matrix)[:, None, None] * np.eye(_UNKNOWNS)
    return np.linalg.inv(matrix), right
