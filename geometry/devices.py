"""Optical models of devices: a pinhole with lens distortion, and a parallel beam.

Device frames follow OpenCV: +x right, +y down, +z along the optical axis; the centre of
the top-left pixel is (u, v) = (0, 0), so an image w pixels wide spans -0.5 to w - 0.5.
A projector is an inverse camera and uses the same pinhole. Both models answer the same
questions about their field, so that callers needn't ask which one they have.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from . import distortion as lens
from .arrays import Array, Length, Mask, lengths

_UNDISTORT_STEPS = 12
# Of the fold.
_WELL_BEFORE = 0.8
_AHEAD = np.array([0.0, 0.0, 1.0])
_AHEAD.flags.writeable = False


@dataclass(frozen=True, eq=False)
class PinholeModel:
    """A camera or diverging projector.

    Attributes:
        camera_matrix: K in [px], shape (3, 3); no skew.
        resolution: Width and height in [px].
        range_m: Nearest and farthest distance |P - O| that is sharp, in [m].
        distortion: Brown-Conrady k1, k2, p1, p2, k3, as in OpenCV.
    """

    camera_matrix: Array
    resolution: tuple[int, int]
    range_m: tuple[float, float]
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)

    @property
    def focal_px(self) -> float:
        """Geometric mean of the two focal lengths in [px]."""
        return float(np.sqrt(self.camera_matrix[0, 0] * self.camera_matrix[1, 1]))

    def project(self, points: Array) -> Array:
        """Return pixels (u, v) of points in the device frame; (..., 3) to (..., 2).

        Points at or behind the optical centre, or beyond the fold, give NaN.
        """
        z = points[..., 2]
        front = z > 0
        scale = np.divide(1.0, z, out=np.full_like(z, np.nan), where=front)
        normalised = points[..., :2] * scale[..., None]
        if any(self.distortion):
            beyond = lengths(normalised) >= self.fold
            normalised = lens.distorted(normalised, self.distortion)
            normalised[beyond] = np.nan
        return normalised * self._focal + self._principal

    @cached_property
    def fold(self) -> float:
        """As of `distortion.fold`: no ray farther off the axis is in the image."""
        return lens.fold(self.distortion)

    def contains(self, pixels: Array) -> Mask:
        """Return whether pixels (..., 2) lie inside the image; NaN doesn't."""
        u, v = pixels[..., 0], pixels[..., 1]
        width, height = self.resolution
        # Column by column: numpy is slow to reduce over an axis of two.
        across = (u >= -0.5) & (u <= width - 0.5)
        return across & (v >= -0.5) & (v <= height - 0.5)

    def in_field(self, points: Array) -> Mask:
        """Return whether points (..., 3) of the device frame lie in its image."""
        return self.contains(self.project(points))

    @property
    def middle_ray(self) -> Array:
        """Unit direction in which the middle of the image looks, shape (3,)."""
        return self.rays(0.5 * (np.array(self.resolution) - 1.0))

    @property
    def corners(self) -> Array:
        """Corners of the image in [px], shape (4, 2)."""
        width, height = self.resolution
        u, v = np.array([-0.5, width - 0.5]), np.array([-0.5, height - 0.5])
        return np.stack(np.meshgrid(u, v), axis=-1).reshape(4, 2)

    def sides(self, spare_px: float = 0.0) -> Array:
        """Return the least and the largest x/z and y/z in the image, shape (2, 2).

        Without distortion; so many pixels stay free at its border.
        """
        high = np.array(self.resolution) - 0.5 - spare_px
        return (np.array([[spare_px - 0.5] * 2, high]) - self._principal) / self._focal

    @property
    def beam_reach(self) -> float:
        """As of `ParallelModel`: the light of a lens is bounded by its image alone."""
        return np.inf

    @property
    def half_angle(self) -> float:
        """Angle from the middle of the image to the nearest middle of its sides."""
        corners = self.corners.reshape(2, 2, 2)
        rays = self.rays(np.concatenate([corners.mean(axis=0), corners.mean(axis=1)]))
        return float(np.arccos(np.clip(rays @ self.middle_ray, -1.0, 1.0)).min())

    def holds_ball(self, radius: float, distance: float) -> bool:
        """Return whether a sphere about the aim, so far away, lies inside the image."""
        return bool(
            radius < distance and np.arcsin(radius / distance) <= self.half_angle
        )

    def holds_more_on_side(self, radius: float, distance: float) -> bool:
        """Return whether a quarter turn may show more of a sphere about the aim."""
        return not self.holds_ball(radius, distance)

    def half_rectangle(self, distance: float) -> Array:
        """Return half the sides of a rectangle in the field, in [m], shape (2,).

        It is across the line of sight at a distance in [m], sides along the image's,
        its middle on the aim.
        """
        across = self.rays(self.corners) @ turned_to(self.middle_ray).T
        # With lens shift the image is a trapezoid across the line of sight.
        return distance * np.min(np.abs(across[:, :2] / across[:, 2:]), axis=0)

    def pixel_m(self, distance: Length) -> Length:
        """Return the side of a pixel on a surface across the axis [m]."""
        return distance / self.focal_px

    def widened(self, times: int) -> "PinholeModel":
        """Return optics so many times as wide and high."""
        width, height = self.resolution
        matrix = self.camera_matrix.copy()
        matrix[:2, 2] += 0.5 * (times - 1) * np.array([width, height])
        size = (times * width, times * height)
        return replace(self, camera_matrix=matrix, resolution=size)

    def to_document(self) -> dict[str, Any]:
        """Return plain values; None for what only the other kind of optics has."""
        return {
            "K": self.camera_matrix.tolist(),
            "resolution": list(self.resolution),
            "distortion": list(self.distortion),
            "range_m": list(self.range_m),
            "pixel_pitch_m": None,
            "beam_radius": None,
        }

    def ray_starts(self, points: Array) -> Array:
        """Return where the rays to points (..., 3) of the device frame start."""
        return np.zeros_like(points)

    def rays(self, pixels: Array) -> Array:
        """Return unit viewing directions in the device frame; (..., 2) to (..., 3)."""
        target = (np.asarray(pixels, dtype=np.float64) - self._principal) / self._focal
        normalised = target
        if any(self.distortion):
            # From beyond the fold steps would lead away from the image.
            far = np.maximum(lengths(target)[..., None], 1e-300)
            normalised = target * np.minimum(1.0, _WELL_BEFORE * self.fold / far)
            for _ in range(_UNDISTORT_STEPS):
                error = lens.distorted(normalised, self.distortion) - target
                slope = lens.slope(normalised, self.distortion)
                step = np.linalg.solve(slope, error[..., None])
                normalised = normalised - step[..., 0]
        rays = np.concatenate(
            [normalised, np.ones((*normalised.shape[:-1], 1))], axis=-1
        )
        return rays / lengths(rays)[..., None]

    def ray_jacobian(self, points: Array) -> Array:
        """Return J_r = dr/d(u, v) in [1/px] at points in the device frame, (n, 3, 2).

        With p = (x/z, y/z), q(p) the distorted p and r = (p, 1)/|(p, 1)|::

            J_r = dr/dp (dq/dp)^-1 diag(1/fx, 1/fy)
        """
        p = points[:, :2] / points[:, 2:]
        # Column by column, several times as fast as over axes of three and two.
        x, y = p.T
        norm = np.sqrt(1.0 + (x * x + y * y))
        r = (x / norm, y / norm, 1.0 / norm)
        dr_dp = np.empty((len(p), 3, 2))
        for i, j in np.ndindex(3, 2):
            dr_dp[:, i, j] = (float(i == j) - r[i] * r[j]) / norm
        if any(self.distortion):
            dr_dp = dr_dp @ np.linalg.inv(lens.slope(p, self.distortion))
        return dr_dp / self._focal

    @property
    def _focal(self) -> Array:
        return np.array([self.camera_matrix[0, 0], self.camera_matrix[1, 1]])

    @property
    def _principal(self) -> Array:
        return self.camera_matrix[:2, 2]


@dataclass(frozen=True, eq=False)
class ParallelModel:
    """A projector of parallel light, the paper's ideal beam.

    Light leaves the panel in the device's plane z = 0 and runs along +z.

    Attributes:
        resolution: Width and height of the panel in [px].
        pixel_pitch_m: Side of a panel pixel, which is also its side on the object [m].
        range_m: Nearest and farthest z that is sharp, in [m].
        beam_radius: Radius of the beam about the panel's centre in [m]; None: no limit
            beside the panel's edges.
    """

    resolution: tuple[int, int]
    pixel_pitch_m: float
    range_m: tuple[float, float]
    beam_radius: float | None = None

    @property
    def half_panel(self) -> Array:
        """Half width and half height of the panel in [m], shape (2,)."""
        return 0.5 * self.pixel_pitch_m * np.array(self.resolution, dtype=np.float64)

    @property
    def beam_reach(self) -> float:
        """Radius that the beam fills in [m], inf where only the panel bounds it."""
        return np.inf if self.beam_radius is None else self.beam_radius

    def sides(self, spare_px: float = 0.0) -> Array:
        """As of `PinholeModel`, x and y in [m], up to the edges of the panel."""
        return np.array([-self.half_panel, self.half_panel])

    def in_field(self, points: Array) -> Mask:
        """Return whether points (..., 3) of the device frame lie in its beam."""
        x, y = points[..., 0], points[..., 1]
        across, down = self.half_panel
        inside = (np.abs(x) <= across) & (np.abs(y) <= down)
        if self.beam_radius is not None:
            inside &= np.hypot(x, y) <= self.beam_radius
        return inside

    @property
    def middle_ray(self) -> Array:
        """Unit direction of the light, shape (3,)."""
        return np.array([0.0, 0.0, 1.0])

    def holds_ball(self, radius: float, distance: float) -> bool:
        """As of `PinholeModel`, at any distance."""
        return bool(radius <= min(float(self.half_panel.min()), self.beam_reach))

    def holds_more_on_side(self, radius: float, distance: float) -> bool:
        """As of `PinholeModel`; a round beam shows the same however it is turned."""
        return radius > float(self.half_panel.min())

    def half_rectangle(self, distance: float) -> Array:
        """As of `PinholeModel`; in a round beam the one nearest to a square."""
        half, beam = self.half_panel, self.beam_reach
        if beam >= np.hypot(*half):
            return half
        short = min(float(half.min()), beam / np.sqrt(2.0))
        return np.minimum(half, max(short, np.sqrt(beam**2 - short**2)))

    def pixel_m(self, distance: object) -> float:
        """As of `PinholeModel`, whatever the distance."""
        return self.pixel_pitch_m

    def widened(self, times: int) -> "ParallelModel":
        """Return optics so many times as wide and high, in no round beam."""
        width, height = self.resolution
        return replace(
            self, resolution=(times * width, times * height), beam_radius=None
        )

    def to_document(self) -> dict[str, Any]:
        """As of `PinholeModel`."""
        return {
            "K": None,
            "resolution": list(self.resolution),
            "distortion": None,
            "range_m": list(self.range_m),
            "pixel_pitch_m": self.pixel_pitch_m,
            "beam_radius": self.beam_radius,
        }

    def ray_starts(self, points: Array) -> Array:
        """As of `PinholeModel`."""
        return points * [1.0, 1.0, 0.0]


DeviceModel = PinholeModel | ParallelModel


def turned_to(direction: Array, ends: Array = _AHEAD) -> Array:
    """Return the smallest rotations of a unit direction to unit ends (Rodrigues).

    Ends are (..., 3), the rotations (..., 3, 3).
    """
    x, y, z = np.moveaxis(np.cross(direction, ends), -1, 0)
    none = np.zeros_like(x)
    rows = [[none, -z, y], [z, none, -x], [-y, x, none]]
    skew = np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
    turned = skew @ skew / (1.0 + ends @ direction)[..., None, None]
    return np.eye(3) + skew + turned
