"""Slanted windows of one image as another camera sees them.

About a pixel of the first image a window is taken for a plane: the inverse of its depth
changes linearly across it. With x the panel coordinates of the pixel, d = 1 / z, and
offsets o = (o_u, o_v) from the pixel::

    d(o) = d + d_u o_u + d_v o_v
    P(o) ~ R (x(o), 1) + d(o) t,    R = R_2^T R_1,   t = R_2^T (C_1 - C_2)

in homogeneous coordinates of the second camera, so that P is linear in o but for a
product that is far below a pixel.
"""

from dataclasses import dataclass

import numpy as np

from planning.verify.reconstruction.arrays import Array, Indices
from planning.verify.reconstruction.calibration import CameraCalibration
from planning.verify.reconstruction.patterns.lens import bent

# Step of derivatives of the lens [px].
_STEP_PX = 0.5


@dataclass(frozen=True, eq=False)
class TwoViews:
    """Pixels of a first camera as a second one may see them, shape (n, 3) each.

    Attributes:
        second: The second camera.
        middle: R (x, 1).
        by_u: What R (x, 1) changes by with a pixel along rows.
        by_v: Likewise along columns.
        t: Of the second camera, shape (3,) [m].
    """

    second: CameraCalibration
    middle: Array
    by_u: Array
    by_v: Array
    t: Array

    @classmethod
    def of(
        cls, first: CameraCalibration, second: CameraCalibration, pixels: Array
    ) -> "TwoViews":
        """Look at pixels (n, 2) of the first camera."""
        turn = first.world_from_device[:3, :3].T @ second.world_from_device[:3, :3]
        steps = _STEP_PX * np.eye(2)
        middle = homogeneous(first, pixels) @ turn
        by_u, by_v = (
            (homogeneous(first, pixels + s) - homogeneous(first, pixels - s)) @ turn
            for s in steps
        )
        offset = first.centre - second.centre
        return cls(
            second, middle, by_u, by_v, offset @ second.world_from_device[:3, :3]
        )

    def take(self, chosen: Indices) -> "TwoViews":
        """Return some of the pixels."""
        middle, by_u, by_v = (p[chosen] for p in (self.middle, self.by_u, self.by_v))
        return TwoViews(self.second, middle, by_u, by_v, self.t)

    def seen_at(
        self, planes: Array, offsets: Array, *, with_slope: bool = False
    ) -> tuple[Array, Array, Array, Array]:
        """Return where the second camera sees windows (u, v), (n, m) each [px].

        And what these change by with d, in [px m], zeros unless `with_slope`.

        Args:
            planes: d, d_u, d_v in [1/m] and [1/(m px)], shape (n, 3).
            offsets: Of the window's pixels, shape (m, 2).
            with_slope: Whether the latter are wanted.
        """
        corners = np.stack(
            [
                self.middle + planes[:, :1] * self.t,
                self.by_u + planes[:, 1:2] * self.t,
                self.by_v + planes[:, 2:] * self.t,
            ],
            axis=1,
        )
        across = np.column_stack([np.ones(len(offsets)), offsets]).T
        kind = np.float64 if with_slope else np.float32
        # A window moves by far less than it is away from the optical axis.
        turned = corners.transpose(2, 0, 1).astype(kind)
        x, y, z = turned @ across.astype(kind)
        z = np.reciprocal(z, out=z)
        flat_x, flat_y = x * z, y * z
        matrix, lens = self.second.matrix, self.second.distortion
        u, v = flat_x, flat_y
        if any(lens):
            both = bent(np.column_stack([flat_x.ravel(), flat_y.ravel()]), lens)
            u, v = both.T.reshape(2, *flat_x.shape)
        u, v = matrix[0, 0] * u + matrix[0, 2], matrix[1, 1] * v + matrix[1, 2]
        if not with_slope:
            return u, v, np.zeros(0), np.zeros(0)
        # The lens bends so little across a window that it is left out of the slope.
        slope_u = matrix[0, 0] * (self.t[0] - flat_x * self.t[2]) * z
        slope_v = matrix[1, 1] * (self.t[1] - flat_y * self.t[2]) * z
        return u, v, slope_u, slope_v


def plane_normals(camera: CameraCalibration, pixels: Array, planes: Array) -> Array:
    """Return unit normals in the world of planes at pixels, off the camera, (n, 3).

    With a plane N.X = c the inverse depth is N.(x, 1) / c.
    """
    local = homogeneous(camera, pixels)
    slopes = planes[:, 1:] * np.diag(camera.matrix)[:2]
    along = planes[:, 0] - np.einsum("ij,ij->i", local[:, :2], slopes)
    normals = np.column_stack([slopes, along])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    return normals @ camera.world_from_device[:3, :3].T


def homogeneous(camera: CameraCalibration, pixels: Array) -> Array:
    """Return rays of pixels (n, 2) in the camera's frame, of depth 1, (n, 3)."""
    rays = camera.rays(pixels) @ camera.world_from_device[:3, :3]
    return rays / rays[:, 2:]
