"""Projectors and cameras as the audit sees them: poses, optics, light and rings."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from geometry.devices import ParallelModel, PinholeModel
from planning.model.plan import RigPlan
from planning.model.planned import PlannedCamera, PlannedProjector

from .audit_light import DivergingRays, ParallelRays, light_from
from .audit_optics import in_frame, in_world
from .occlusion import Block, bodies_but, bodies_of_reference

_Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class AuditProjector:
    """A projector at a pose: the plan's, or one of the reference set.

    Attributes:
        device: Its optics.
        world_from_device: Pose, shape (4, 4) [m].
        world_from_ring: Pose of the ring frame, shape (4, 4) [m].
        radii: Ring radii; of a reference pose the outermost alone.
        blocks: Bodies of other devices, which stand in its light.
    """

    device: PinholeModel | ParallelModel
    world_from_device: _Array
    world_from_ring: _Array
    radii: _Array
    blocks: tuple[Block, ...] = ()

    @cached_property
    def light(self) -> DivergingRays | ParallelRays:
        """Its kind of light."""
        return light_from(self.device, self.world_from_device)

    def ring_coordinate(self, points: _Array) -> _Array:
        """Return the coordinate c that is constant on each ring surface, (n,)."""
        return self.light.coordinate(in_frame(self.world_from_ring, points))

    def ring_gradient(self, points: _Array) -> _Array:
        """Return grad c in the world, (n, 3) [1/m or 1].

        The normal of the ring surface is m = grad c / |grad c|, and rings whose
        coordinates differ by `gap` stand gap / |grad c| apart along it.
        """
        ring = in_frame(self.world_from_ring, points)
        return in_world(self.world_from_ring, self.light.gradient(ring))

    def ring_gap(self, coordinate: _Array) -> _Array:
        """Return radii[k] - radii[k-1], k >= 1 the first with radii[k] >= c, (n,)."""
        upper = np.searchsorted(self.radii, coordinate, side="left")
        upper = np.clip(upper, 1, len(self.radii) - 1)
        return self.radii[upper] - self.radii[upper - 1]

    def ring_spacing(self, points: _Array) -> _Array:
        """Return the distance along m of the rings about each point, (n,) [m]."""
        gap = self.ring_gap(self.ring_coordinate(points))
        return gap / np.linalg.norm(self.ring_gradient(points), axis=1)

    def in_beam(self, points: _Array) -> NDArray[np.bool_]:
        """Return whether points lie in the beam and inside the last ring, (n,)."""
        return self.light.leaves(points) & (
            self.ring_coordinate(points) <= self.radii[-1]
        )


@dataclass(frozen=True, eq=False)
class AuditCamera:
    """A camera at a pose, and the bodies of other devices."""

    device: PinholeModel
    world_from_device: _Array
    blocks: tuple[Block, ...] = ()


def audit_projectors(plan: RigPlan) -> tuple[AuditProjector, ...]:
    """Return the plan's projectors."""
    return tuple(
        AuditProjector(
            p.device,
            p.world_from_device,
            p.world_from_ring,
            p.ring_radii,
            bodies_but(plan, p),
        )
        for p in plan.projectors
    )


def audit_cameras(plan: RigPlan) -> tuple[AuditCamera, ...]:
    """Return the plan's cameras."""
    return tuple(
        AuditCamera(c.device, c.world_from_device, bodies_but(plan, c))
        for c in plan.cameras
    )


def reference_projectors(plan: RigPlan) -> tuple[AuditProjector, ...]:
    """Return the reference projectors: the plan's model at every reference pose."""
    if not plan.projectors:
        return ()
    last = np.array([plan.requirements.workspace.reference_ring_radius])
    poses = plan.surface.reference_projectors
    bodies = bodies_of_reference(plan, "projector", poses)
    return tuple(
        AuditProjector(plan.projectors[0].device, pose, ring, last, blocks)
        for pose, ring, blocks in zip(
            poses, plan.surface.reference_rings, bodies, strict=True
        )
    )


def reference_cameras(plan: RigPlan) -> tuple[AuditCamera, ...]:
    """Return the reference cameras: the plan's model at every reference pose."""
    if not plan.cameras:
        return ()
    poses = plan.surface.reference_cameras
    bodies = bodies_of_reference(plan, "camera", poses)
    return tuple(
        AuditCamera(plan.cameras[0].device, pose, blocks)
        for pose, blocks in zip(poses, bodies, strict=True)
    )


def light_starts(
    device: PlannedProjector | PlannedCamera | AuditProjector, points: _Array
) -> _Array:
    """Return where light to points leaves a device, or views from them end, (n, 3)."""
    light = light_from(device.device, device.world_from_device)
    along, length = light.to_points(points)
    return points - length[:, None] * along
