"""Projectors and cameras as the audit sees them: poses, optics, light and rings.

Where light comes from and what surface a ring is differ by the kind of light.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from geometry.arrays import Array, Mask, lengths
from geometry.devices import ParallelModel, PinholeModel
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.light.dense_code import DenseCode
from planning.model.plan import RigPlan

from .audit_optics import (
    in_frame,
    in_image,
    in_world,
    lens_shifts,
    pixel_gradient,
    towards,
)
from .occlusion import Block, bodies_but

# Steps after which the ball is a few thousandths too large at most.
_BALL_STEPS = 400


def _ball(points: Array) -> tuple[Array, float]:
    """Return the smallest ball about points (n, 3), by steps to the farthest of them.

    Badoiu and Clarkson, "Smaller core-sets for balls", 2003.
    """
    centre = points.mean(axis=0)
    squares = np.sum(points**2, axis=1)
    for step in range(2, _BALL_STEPS):
        # |p - c|^2 but for |c|^2, which is the same for all.
        far = points[np.argmax(squares - 2.0 * (points @ centre))]
        centre = centre + (far - centre) / step
    return centre, float(np.sqrt(np.sum((points - centre) ** 2, axis=1).max()))


@dataclass(frozen=True, eq=False)
class DivergingRays:
    """Light from the optical centre; rings are cones x^2 + y^2 = (c z)^2."""

    device: PinholeModel
    pose: Array

    def to_points(self, points: Array) -> tuple[Array, Array]:
        """Return L (n, 3) and the length of the light's way to each point (n,) [m]."""
        return towards(points, self.pose[:3, 3])

    def leaves(self, points: Array) -> Mask:
        """Return whether light towards points leaves the device, shape (n,)."""
        return in_image(self.device, in_frame(self.pose, points))

    def coordinate(self, ring: Array) -> Array:
        """Return c of points in ring coordinates, (n, 3) to (n,); inf behind."""
        ahead = ring[:, 2] > 0
        radius = np.hypot(ring[:, 0], ring[:, 1])
        return np.divide(
            radius, ring[:, 2], out=np.full_like(radius, np.inf), where=ahead
        )

    def gradient(self, ring: Array) -> Array:
        """Return the gradient of c in the ring frame, (n, 3) [1/m]."""
        radius, z = np.hypot(ring[:, 0], ring[:, 1]), ring[:, 2]
        outward = ring[:, :2] / radius[:, None]
        return np.column_stack([outward / z[:, None], -radius / z**2])

    def emitted(self, frame: Array, spokes: Array) -> tuple[Array, Array]:
        """Return origins and unit directions of rays through spokes (n, 3), z = 0."""
        along = in_world(frame, spokes + [0.0, 0.0, 1.0])
        along /= lengths(along)[:, None]
        return np.tile(frame[:3, 3], (len(along), 1)), along

    def run(self, c: Array, z: Array) -> tuple[Array, Array]:
        """Return (s, t) of points at c and z: |dt / ds| is tan(incidence) across rings.

        s is the angle of the ray to the axis, t the logarithm of its length.
        """
        return np.arctan(c), np.log(z * np.hypot(1.0, c))

    def chord_error(self, c: Array, heights: tuple[Array, Array, Array]) -> Array:
        """Return how far the surface at c strays from the chord over it, in [m].

        Along the beam; 1/z is linear in c on a plane. Heights before, at and after c.
        """
        before, middle, after = heights
        chord = 2.0 / (1.0 / before + 1.0 / after)
        return np.abs(middle - chord) * np.hypot(1.0, c)

    def ring_frame_fault(self, frame: Array) -> Array:
        """Return how far ring frames (n, 4, 4) leave the optical centre, (n, k) [m]."""
        return frame[..., :3, 3] - self.pose[..., :3, 3]

    def narrowest_ring(self, points: Array) -> float:
        """Return the tangent of the narrowest cone, about any axis, that holds them."""
        rays, _ = self.to_points(points)
        axis, _ = _ball(rays)
        return float(np.tan(np.arccos((rays @ axis).min() / np.linalg.norm(axis))))

    def coordinate_of(self, length_m: float, standoff_m: float) -> float:
        """Return what a length across the light at the standoff is of c."""
        return length_m / standoff_m

    def panel_shifts(self, local: Array, m: Array) -> tuple[Array, Array]:
        """Return what a panel twice as wide, and 1 px, shift along m [m], (n,) each."""
        gradient = pixel_gradient(self.device, local, m)
        return lens_shifts(self.device, local, gradient)

    def pixel_sides(self, z: Array) -> Array:
        """Return how wide the panel's pixels are at depths (n,) [m]."""
        return z / np.sqrt(np.prod(np.diag(self.device.camera_matrix)[:2]))


@dataclass(frozen=True, eq=False)
class ParallelRays:
    """Light along the device's +z; rings are cylinders x^2 + y^2 = c^2."""

    device: ParallelModel
    pose: Array

    def to_points(self, points: Array) -> tuple[Array, Array]:
        """Return L (n, 3) and the length of the light's way to each point (n,) [m]."""
        axis = self.pose[:3, 2]
        return np.broadcast_to(axis, points.shape), (points - self.pose[:3, 3]) @ axis

    def leaves(self, points: Array) -> Mask:
        """Return whether light towards points leaves the device, shape (n,)."""
        across = in_frame(self.pose, points)[:, :2]
        half = 0.5 * self.device.pixel_pitch_m * np.array(self.device.resolution)
        inside = np.all(np.abs(across) <= half, axis=1)
        if self.device.beam_radius is not None:
            inside &= (across**2).sum(axis=1) <= self.device.beam_radius**2
        return inside

    def coordinate(self, ring: Array) -> Array:
        """Return c of points in ring coordinates, (n, 3) to (n,) [m]."""
        return np.hypot(ring[:, 0], ring[:, 1])

    def gradient(self, ring: Array) -> Array:
        """Return the gradient of c in the ring frame, (n, 3)."""
        outward = ring[:, :2] / np.hypot(ring[:, 0], ring[:, 1])[:, None]
        return np.column_stack([outward, np.zeros(len(ring))])

    def emitted(self, frame: Array, spokes: Array) -> tuple[Array, Array]:
        """Return origins and unit directions of rays through spokes (n, 3), z = 0."""
        origins = frame[:3, 3] + in_world(frame, spokes)
        return origins, np.tile(frame[:3, 2], (len(origins), 1))

    def run(self, c: Array, z: Array) -> tuple[Array, Array]:
        """Return (s, t) of points at c and z: the radius and the height."""
        return c, z

    def chord_error(self, c: Array, heights: tuple[Array, Array, Array]) -> Array:
        """Return how far the surface at c strays from the chord over it, in [m]."""
        before, middle, after = heights
        return np.abs(middle - 0.5 * (before + after))

    def ring_frame_fault(self, frame: Array) -> Array:
        """Return how far ring frames (n, 4, 4) leave panel plane or axis, (n, k)."""
        axis = self.pose[..., :3, 2]
        shift = np.sum((frame[..., :3, 3] - self.pose[..., :3, 3]) * axis, axis=-1)
        return np.concatenate([shift[..., None], frame[..., :3, 2] - axis], axis=-1)

    def narrowest_ring(self, points: Array) -> float:
        """Return the radius of the narrowest cylinder along the light, [m]."""
        flat = in_frame(self.pose, points) * [1.0, 1.0, 0.0]
        return _ball(flat)[1]

    def coordinate_of(self, length_m: float, standoff_m: float) -> float:
        """Return what a length across the light is of c."""
        return length_m

    def panel_shifts(self, local: Array, m: Array) -> tuple[Array, Array]:
        """Return what a panel twice as wide, and 1 px, shift along m [m], (n,) each."""
        per_px = self.device.pixel_pitch_m * np.hypot(m[:, 0], m[:, 1])
        return m[:, 0] * local[:, 0] + m[:, 1] * local[:, 1], per_px

    def pixel_sides(self, z: Array) -> Array:
        """Return how wide the panel's pixels are at depths (n,) [m]."""
        return np.full(len(z), self.device.pixel_pitch_m)


def light_from(
    device: PinholeModel | ParallelModel, pose: Array
) -> DivergingRays | ParallelRays:
    """Return the light of a device at a pose (or poses (n, 4, 4))."""
    if isinstance(device, PinholeModel):
        return DivergingRays(device, pose)
    return ParallelRays(device, pose)


@dataclass(frozen=True, eq=False)
class AuditProjector:
    """A projector at a pose: the plan's, or one of the reference set.

    `radii` are of its rings, of a reference pose the outermost alone; `blocks` are the
    bodies of other devices, which stand in its light. `exposure_s` is what its frames
    are exposed for [s], where the plan counts light. With a `code` all its pixels are
    told, and there are no rings. `station` is where it stands with the cameras that it
    measures with; empty: with any.
    """

    device: PinholeModel | ParallelModel
    world_from_device: Array
    world_from_ring: Array
    radii: Array
    blocks: tuple[Block, ...] = ()
    exposure_s: float | None = None
    code: DenseCode | None = None
    station: str = ""

    @cached_property
    def light(self) -> DivergingRays | ParallelRays:
        """Its kind of light."""
        return light_from(self.device, self.world_from_device)

    def ring_coordinate(self, points: Array) -> Array:
        """Return the coordinate c that is constant on each ring surface, (n,)."""
        return self.light.coordinate(in_frame(self.world_from_ring, points))

    def ring_gradient(self, points: Array) -> Array:
        """Return grad c in the world, (n, 3) [1/m or 1].

        The normal of the ring surface is m = grad c / |grad c|, and rings whose
        coordinates differ by `gap` stand gap / |grad c| apart along it.
        """
        ring = in_frame(self.world_from_ring, points)
        return in_world(self.world_from_ring, self.light.gradient(ring))

    def ring_gap(self, coordinate: Array) -> Array:
        """Return radii[k] - radii[k-1], k >= 1 the first with radii[k] >= c, (n,)."""
        upper = np.searchsorted(self.radii, coordinate, side="left")
        upper = np.clip(upper, 1, len(self.radii) - 1)
        return self.radii[upper] - self.radii[upper - 1]

    def ring_spacing(self, points: Array) -> Array:
        """Return the distance along m of the rings about each point, (n,) [m]."""
        gap = self.ring_gap(self.ring_coordinate(points))
        return gap / lengths(self.ring_gradient(points))

    def in_beam(self, points: Array) -> Mask:
        """Return whether points lie in the beam and inside the last ring, (n,)."""
        leaves = self.light.leaves(points)
        if self.code is not None:
            return leaves
        return leaves & (self.ring_coordinate(points) <= self.radii[-1])


@dataclass(frozen=True, eq=False)
class AuditCamera:
    """A camera at a pose, and the bodies of other devices; `station` as above."""

    device: PinholeModel
    world_from_device: Array
    blocks: tuple[Block, ...] = ()
    station: str = ""

    def works_with(self, projector: AuditProjector) -> bool:
        """Return whether both stand at one station, or either at none."""
        return "" in (self.station, projector.station) or (
            self.station == projector.station
        )


def audit_projectors(plan: RigPlan) -> tuple[AuditProjector, ...]:
    """Return the plan's projectors."""
    return tuple(
        AuditProjector(
            p.device,
            p.world_from_device,
            p.world_from_ring,
            p.ring_radii,
            bodies_but(plan, p),
            p.exposure_s,
            p.code,
            p.station,
        )
        for p in plan.projectors
    )


def audit_cameras(plan: RigPlan) -> tuple[AuditCamera, ...]:
    """Return the plan's cameras."""
    return tuple(
        AuditCamera(c.device, c.world_from_device, bodies_but(plan, c), c.station)
        for c in plan.cameras
    )


def light_starts(
    device: PlannedProjector | PlannedCamera | AuditProjector, points: Array
) -> Array:
    """Return where light to points leaves a device, or views from them end, (n, 3)."""
    light = light_from(device.device, device.world_from_device)
    along, length = light.to_points(points)
    return points - length[:, None] * along
