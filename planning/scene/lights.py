"""The two kinds of light, and all that differs between them for the planner.

Diverging light starts at the optical centre; its rings are cones R = tan(angle to the
ring axis). Parallel light runs along the device's +z; rings are cylinders, R in [m].
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import lengths
from geometry.devices import DeviceModel, ParallelModel, PinholeModel
from solvers.poses.axis_program import axis_direction

_Array = NDArray[np.float64]
_Mask = NDArray[np.bool_]

# Directions in which the width of a ring is looked at, and the change of R for it.
_AZIMUTHS, _STEP = 72, 1e-6


@dataclass(frozen=True, eq=False)
class RingSurface:
    """Ring surfaces through n points of the ring frame: R, and unit normals m.

    The stretch is their spacing along m for a gap of 1 in R.
    """

    coordinate: _Array
    normals: _Array
    stretch: _Array


@dataclass(frozen=True, eq=False)
class DivergingLight:
    """Light from one point, through a lens."""

    device: PinholeModel
    reach_words = "an image that reaches {:.0f} degrees off its middle on every side"
    offset_key = "tilt"
    bounded_over = "position and aim"

    def directions(self, pose: _Array, points: _Array) -> _Array:
        """Return unit L = (P - Q) / |P - Q|, (n, 3)."""
        offsets = points - pose[:3, 3]
        distances = lengths(offsets)
        return offsets / np.where(distances > 0, distances, 1.0)[:, None]

    def cosines(
        self, pose: _Array, offsets: _Array, normals: _Array, steep: _Array
    ) -> tuple[_Array, _Array, _Array]:
        """Return |P - Q|, -N.L and |T1.L| of columns P - Q, N and T1, (3, n)."""
        distances = np.sqrt(_dots(offsets, offsets))
        apart = np.where(distances > 0.0, distances, 1.0)
        incidence = _dots(normals, offsets) / -apart
        return distances, incidence, np.abs(_dots(steep, offsets)) / apart

    def common_direction(self, poses: _Array) -> None:
        """Return None: L depends on the point."""

    def within_ring(self, local: _Array, ring: float) -> _Mask:
        """Return which columns of the ring frame, (3, n), lie in the cone R <= ring."""
        x, y, z = local
        return (x * x + y * y <= (ring * z) ** 2) & (z > 0.0)

    def ring_coordinate(self, local: _Array) -> _Array:
        """Return R = rho / z of points (n, 3) of the ring frame; inf behind."""
        rho, z = np.hypot(local[:, 0], local[:, 1]), local[:, 2]
        return np.divide(rho, z, out=np.full_like(rho, np.inf), where=z > 0)

    def ring_surface(self, local: _Array) -> RingSurface:
        """Return cones: m = (x/rho, y/rho, -R)/sqrt(1 + R^2), h = z gap/sqrt(1+R^2)."""
        rho, radial = _radial(local)
        depth = np.maximum(local[:, 2], 1e-12)
        slope = rho / depth
        scale = np.sqrt(1.0 + slope**2)
        normals = np.column_stack([radial, -slope]) / scale[:, None]
        return RingSurface(slope, normals, depth / scale)

    def ring_rays(self, frame: _Array, flat: _Array) -> tuple[_Array, _Array]:
        """Return apex (3,) and unit rays (n, 3) at ring coordinates (n, 2)."""
        local = np.column_stack([flat, np.ones(len(flat))])
        local /= lengths(local)[:, None]
        return frame[:3, 3], local @ frame[:3, :3].T

    def ring_offset(self, tilt: float, standoff: float) -> float:
        """Return how far the ring axis is off the middle: turned by the tilt [rad]."""
        return tilt

    def ring_axis(self, offset: float, azimuth: float) -> _Array:
        """Return the axis a, `solvers.poses.axis_program`, so far off the middle."""
        return math.tan(0.5 * offset) * np.array([np.cos(azimuth), np.sin(azimuth)])

    def ring_frame(self, axis: _Array) -> _Array:
        """Return ``device_from_ring`` of an axis, z turned from the middle ray.

        Lens shift so doesn't move the rings off the object.
        """
        middle = _frame_along(self.device.middle_ray)
        return _frame_along(middle[:3, :3] @ axis_direction(axis))

    def axis_of(self, device_from_ring: _Array) -> _Array:
        """Return the axis of a ring frame: tan(tilt/2) towards where it is turned."""
        z = device_from_ring[:3, 2] @ _frame_along(self.device.middle_ray)[:3, :3]
        return z[:2] / (1.0 + z[2])

    def drawn_gaps(
        self, device_from_ring: _Array, coordinates: _Array, pixels: float
    ) -> _Array:
        """Return the gaps in R that are so many pixels wide or more all round, (n,).

        0 where a ring misses the image altogether: it isn't drawn.
        """
        angle = np.arange(_AZIMUTHS) * (2.0 * np.pi / _AZIMUTHS)
        spoke = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(_AZIMUTHS)])
        rays = coordinates[:, None, None] * spoke + np.array([0.0, 0.0, 1.0])
        image, beyond = (
            self.device.project(ray @ device_from_ring[:3, :3].T)
            for ray in (rays, rays + _STEP * spoke)
        )
        rate = lengths(beyond - image) / _STEP
        least = np.where(self.device.contains(image), rate, np.inf).min(axis=1)
        return np.where(np.isfinite(least), pixels / least, 0.0)

    def chord(self, before: _Array, after: _Array) -> _Array:
        """Return the height z of a chord in its middle: it is straight in 1/z."""
        return 2.0 / (1.0 / before + 1.0 / after)

    def stretch(self, coordinates: _Array) -> _Array:
        """Return lengths along the light for one of z."""
        return np.sqrt(1.0 + coordinates**2)

    def slope_chart(
        self, heights: _Array, coordinates: _Array
    ) -> tuple[_Array, _Array]:
        """Return log t, (n_c, n_a), and the angle to the axis, (n_c,).

        dt / (t dgamma) is the slope of the surface against the light.
        """
        far = heights * self.stretch(coordinates)[:, None]
        return np.log(far), np.arctan(coordinates)

    def image_ring(self, offset: float) -> float:
        """Return R that holds the image from any axis so far off; inf: no cone does.

        ``R = tan(max_corner angle + offset)``, without distortion.
        """
        corner = np.abs(self.device.sides()).max(axis=0)
        opening = math.atan(math.hypot(*corner)) + offset
        return math.tan(opening) if opening < 0.5 * math.pi else math.inf

    def object_ring(self, offset: float, radius: float, distance: float) -> float:
        """Return R that holds a ball in the middle, so far off at least; or inf."""
        if radius >= distance:
            return np.inf
        opening = offset + np.arcsin(radius / distance)
        return float(np.tan(opening)) if opening < 0.5 * np.pi else np.inf

    def ring_step(self, gap: float, standoff: float) -> float:
        """Return what a gap of rings in [m] at the standoff is of R."""
        return gap / standoff

    def off_axis(self, local: _Array) -> _Array:
        """Return the angle to the ray of the image's middle [deg]."""
        far = np.maximum(lengths(local), 1e-12)
        along = local @ self.device.middle_ray / far
        return np.degrees(np.arccos(np.clip(along, -1.0, 1.0)))


@dataclass(frozen=True, eq=False)
class ParallelLight:
    """The paper's ideal beam, along the device's +z."""

    device: ParallelModel
    reach_words = "a beam of {:.0f} mm about its axis"
    offset_key = "shift_m"
    bounded_over = "direction"

    def directions(self, pose: _Array, points: _Array) -> _Array:
        """Return +z of the device."""
        return np.broadcast_to(pose[:3, 2], points.shape)

    def cosines(
        self, pose: _Array, offsets: _Array, normals: _Array, steep: _Array
    ) -> tuple[_Array, _Array, _Array]:
        """Return z, -N.L and |T1.L|, shape (n,) each, of columns (3, n)."""
        along = pose[:3, 2]
        return along @ offsets, -(along @ normals), np.abs(along @ steep)

    def common_direction(self, poses: _Array) -> _Array:
        """Return L of poses (..., 4, 4), the same at every point, (..., 3)."""
        return poses[..., :3, 2]

    def within_ring(self, local: _Array, ring: float) -> _Mask:
        """Return which columns of the ring frame lie in the cylinder R <= ring."""
        x, y, _ = local
        return x * x + y * y <= ring * ring

    def ring_coordinate(self, local: _Array) -> _Array:
        """Return R = rho of points (n, 3) of the ring frame."""
        return np.hypot(local[:, 0], local[:, 1])

    def ring_surface(self, local: _Array) -> RingSurface:
        """Return cylinders: m = (x/rho, y/rho, 0), h = gap."""
        rho, radial = _radial(local)
        flat = np.column_stack([radial, np.zeros_like(rho)])
        return RingSurface(rho, flat, np.ones_like(rho))

    def ring_rays(self, frame: _Array, flat: _Array) -> tuple[_Array, _Array]:
        """Return origins (n, 3) and unit rays (n, 3) at ring coordinates (n, 2)."""
        origins = frame[:3, 3] + flat @ frame[:3, :2].T
        return origins, np.tile(frame[:3, 2], (len(flat), 1))

    def ring_offset(self, tilt: float, standoff: float) -> float:
        """Return the shift of the ring axis [m] that moves as far as the tilt would."""
        return standoff * math.tan(tilt)

    def ring_axis(self, offset: float, azimuth: float) -> _Array:
        """Return where the axis meets the device plane, so far off the middle [m]."""
        return offset * np.array([np.cos(azimuth), np.sin(azimuth)])

    def ring_frame(self, axis: _Array) -> _Array:
        """Return ``device_from_ring``, moved to an axis in the device plane."""
        frame = np.eye(4)
        frame[:2, 3] = axis
        return frame

    def axis_of(self, device_from_ring: _Array) -> _Array:
        """Return the axis of a ring frame [m]."""
        return device_from_ring[:2, 3]

    def drawn_gaps(
        self, device_from_ring: _Array, coordinates: _Array, pixels: float
    ) -> _Array:
        """Return the gaps in R that are so many pixels wide, (n,)."""
        return np.full(len(coordinates), pixels * self.device.pixel_pitch_m)

    def chord(self, before: _Array, after: _Array) -> _Array:
        """Return the height z of a chord in its middle."""
        return 0.5 * (before + after)

    def stretch(self, coordinates: _Array) -> _Array:
        """Return 1: z runs along the light."""
        return np.ones_like(coordinates)

    def slope_chart(
        self, heights: _Array, coordinates: _Array
    ) -> tuple[_Array, _Array]:
        """Return z and R: dz / dR is the slope of the surface against the light."""
        return heights, coordinates

    def image_ring(self, offset: float) -> float:
        """Return R that holds the beam from any axis so far off [m]."""
        corner = float(np.hypot(*self.device.half_panel))
        return min(corner, self.device.beam_reach) + offset

    def object_ring(self, offset: float, radius: float, distance: float) -> float:
        """Return R that holds a ball in the middle, from any axis so far off [m]."""
        return offset + radius

    def ring_step(self, gap: float, standoff: float) -> float:
        """Return what a gap of rings in [m] is of R."""
        return gap

    def off_axis(self, local: _Array) -> _Array:
        """Return the distance from the beam's axis [mm]."""
        return 1e3 * np.hypot(local[:, 0], local[:, 1])


Light = DivergingLight | ParallelLight


def light_of(device: DeviceModel) -> Light:
    """Return the light of a projector's optics."""
    if isinstance(device, ParallelModel):
        return ParallelLight(device)
    return DivergingLight(device)


def ring_frame(
    world_from_device: _Array, device: DeviceModel, offset: float, azimuth: float
) -> _Array:
    """Return ``world_from_ring``, its axis so far off the middle (`ring_offset`).

    The azimuth is counted from the device's +x towards +y [rad].
    """
    light = light_of(device)
    return world_from_device @ light.ring_frame(light.ring_axis(offset, azimuth))


def _frame_along(z: _Array) -> _Array:
    """Return a frame whose z is a unit vector and whose x lies across +y."""
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    frame = np.eye(4)
    frame[:3, :3] = np.column_stack([x, np.cross(z, x), z])
    return frame


def _radial(local: _Array) -> tuple[_Array, _Array]:
    """Return rho and the unit vector across the ring axis, (n,) and (n, 2)."""
    rho = np.hypot(local[:, 0], local[:, 1])
    return rho, local[:, :2] / np.maximum(rho, 1e-12)[:, None]


def _dots(a: _Array, b: _Array) -> _Array:
    """Return the scalar products of columns (3, n), shape (n,)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
