"""The two kinds of light, as the audit sees them.

They differ in where light comes from and in what surface a ring is: one class each, and
nothing else of the audit asks which one it is.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.devices import ParallelModel, PinholeModel

from .audit_optics import in_frame, in_image, in_world, pixels_of, towards

_Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class DivergingRays:
    """Light from the optical centre; rings are cones x^2 + y^2 = (c z)^2."""

    device: PinholeModel
    pose: _Array

    def to_points(self, points: _Array) -> tuple[_Array, _Array]:
        """Return L (n, 3) and the length of the light's way to each point (n,) [m]."""
        return towards(points, self.pose[:3, 3])

    def leaves(self, points: _Array) -> NDArray[np.bool_]:
        """Return whether light towards points leaves the device, shape (n,)."""
        local = in_frame(self.pose, points)
        ahead = np.flatnonzero(local[:, 2] > 0)
        inside = np.zeros(len(points), dtype=bool)
        pixels = pixels_of(self.device, local[ahead])
        inside[ahead] = in_image(self.device.resolution, pixels)
        return inside

    def coordinate(self, ring: _Array) -> _Array:
        """Return c of points in ring coordinates, (n, 3) to (n,); inf behind."""
        ahead = ring[:, 2] > 0
        radius = np.hypot(ring[:, 0], ring[:, 1])
        return np.divide(
            radius, ring[:, 2], out=np.full_like(radius, np.inf), where=ahead
        )

    def gradient(self, ring: _Array) -> _Array:
        """Return the gradient of c in the ring frame, (n, 3) [1/m]."""
        radius, z = np.hypot(ring[:, 0], ring[:, 1]), ring[:, 2]
        outward = ring[:, :2] / radius[:, None]
        return np.column_stack([outward / z[:, None], -radius / z**2])

    def emitted(self, frame: _Array, spokes: _Array) -> tuple[_Array, _Array]:
        """Return origins and unit directions of rays through spokes (n, 3), z = 0."""
        along = in_world(frame, spokes + [0.0, 0.0, 1.0])
        along /= np.linalg.norm(along, axis=1)[:, None]
        return np.tile(frame[:3, 3], (len(along), 1)), along

    def run(self, c: _Array, z: _Array) -> tuple[_Array, _Array]:
        """Return (s, t) of points at c and z: |dt / ds| is tan(incidence) across rings.

        s is the angle of the ray to the axis, t the logarithm of its length.
        """
        return np.arctan(c), np.log(z * np.hypot(1.0, c))

    def chord_error(self, c: _Array, heights: tuple[_Array, _Array, _Array]) -> _Array:
        """Return how far the surface at c strays from the chord over it, in [m].

        Along the beam; 1/z is linear in c on a plane. Heights before, at and after c.
        """
        before, middle, after = heights
        chord = 2.0 / (1.0 / before + 1.0 / after)
        return np.abs(middle - chord) * np.hypot(1.0, c)

    def ring_frame_fault(self, frame: _Array) -> _Array:
        """Return how far ring frames (n, 4, 4) leave the optical centre, (n, k) [m]."""
        return frame[..., :3, 3] - self.pose[..., :3, 3]


@dataclass(frozen=True, eq=False)
class ParallelRays:
    """Light along the device's +z; rings are cylinders x^2 + y^2 = c^2."""

    device: ParallelModel
    pose: _Array

    def to_points(self, points: _Array) -> tuple[_Array, _Array]:
        """Return L (n, 3) and the length of the light's way to each point (n,) [m]."""
        axis = self.pose[:3, 2]
        return np.broadcast_to(axis, points.shape), (points - self.pose[:3, 3]) @ axis

    def leaves(self, points: _Array) -> NDArray[np.bool_]:
        """Return whether light towards points leaves the device, shape (n,)."""
        across = in_frame(self.pose, points)[:, :2]
        half = 0.5 * self.device.pixel_pitch_m * np.array(self.device.resolution)
        inside = np.all(np.abs(across) <= half, axis=1)
        if self.device.beam_radius is not None:
            inside &= (across**2).sum(axis=1) <= self.device.beam_radius**2
        return inside

    def coordinate(self, ring: _Array) -> _Array:
        """Return c of points in ring coordinates, (n, 3) to (n,) [m]."""
        return np.hypot(ring[:, 0], ring[:, 1])

    def gradient(self, ring: _Array) -> _Array:
        """Return the gradient of c in the ring frame, (n, 3)."""
        outward = ring[:, :2] / np.hypot(ring[:, 0], ring[:, 1])[:, None]
        return np.column_stack([outward, np.zeros(len(ring))])

    def emitted(self, frame: _Array, spokes: _Array) -> tuple[_Array, _Array]:
        """Return origins and unit directions of rays through spokes (n, 3), z = 0."""
        origins = frame[:3, 3] + in_world(frame, spokes)
        return origins, np.tile(frame[:3, 2], (len(origins), 1))

    def run(self, c: _Array, z: _Array) -> tuple[_Array, _Array]:
        """Return (s, t) of points at c and z: |dt / ds| is tan(incidence) across rings.

        s is the radius, t the height.
        """
        return c, z

    def chord_error(self, c: _Array, heights: tuple[_Array, _Array, _Array]) -> _Array:
        """Return how far the surface at c strays from the chord over it, in [m].

        Along the beam. Heights before, at and after c.
        """
        before, middle, after = heights
        return np.abs(middle - 0.5 * (before + after))

    def ring_frame_fault(self, frame: _Array) -> _Array:
        """Return how far ring frames (n, 4, 4) leave panel plane or axis, (n, k)."""
        axis = self.pose[..., :3, 2]
        shift = np.sum((frame[..., :3, 3] - self.pose[..., :3, 3]) * axis, axis=-1)
        return np.concatenate([shift[..., None], frame[..., :3, 2] - axis], axis=-1)


def light_from(
    device: PinholeModel | ParallelModel, pose: _Array
) -> DivergingRays | ParallelRays:
    """Return the light of a device at a pose (or poses (n, 4, 4))."""
    if isinstance(device, PinholeModel):
        return DivergingRays(device, pose)
    return ParallelRays(device, pose)
