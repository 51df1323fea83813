"""What is lit, seen and measured, again, from `docs/reference/semantics.md`.

Each predicate returns how many of its limits a sample passes in the order of the page,
so that the first limit that fails, and the device that came furthest, are both known.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.devices import ParallelModel, PinholeModel
from planning.model.requirements import (
    CameraLimits,
    ProjectorLimits,
    TriangulationLimits,
)
from planning.verify.audit.audit_samples import AuditSamples

from .audit_optics import (
    in_frame,
    in_image,
    in_world,
    pixel_gradient,
    pixels_of,
    ring_coordinate,
    ring_gradient,
)
from .blocks import Block, free_of
from .occlusion import Shadow

LIGHT_CAUSES = (
    "projector_beam",
    "projector_range",
    "projector_incidence",
    "tangent_angle",
    "projector_occlusion",
    "projector_body",
)
SIGHT_CAUSES = (
    "camera_field",
    "camera_range",
    "camera_incidence",
    "camera_occlusion",
    "camera_body",
    "sample_distance",
)
PAIR_CAUSES = ("conditioning", "sigma", "pitch")
LIT, SEEN, MEASURED = (
    len(LIGHT_CAUSES),
    len(SIGHT_CAUSES),
    len(SIGHT_CAUSES + PAIR_CAUSES),
)
PROJECTOR_BODY = LIGHT_CAUSES.index("projector_body")
CAMERA_BODY = SIGHT_CAUSES.index("camera_body")


@dataclass(frozen=True, eq=False)
class AuditProjector:
    """A projector at a pose: the plan's own, or one of the reference set.

    Attributes:
        device: Its optics.
        world_from_device: Pose, shape (4, 4) [m].
        world_from_ring: Pose of the ring frame, shape (4, 4) [m].
        radii: Ring radii; of a reference pose the outermost alone.
        blocks: Bodies of other devices, which stand in its light.
    """

    device: PinholeModel | ParallelModel
    world_from_device: NDArray[np.float64]
    world_from_ring: NDArray[np.float64]
    radii: NDArray[np.float64]
    blocks: tuple[Block, ...] = ()

    @property
    def diverging(self) -> bool:
        """Whether light comes from one point."""
        return isinstance(self.device, PinholeModel)


@dataclass(frozen=True, eq=False)
class AuditCamera:
    """A camera at a pose, and the bodies of other devices."""

    device: PinholeModel
    world_from_device: NDArray[np.float64]
    blocks: tuple[Block, ...] = ()


def light_of(
    lamp: AuditProjector, points: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return L (n, 3) and the length of the light's way to each point (n,) [m]."""
    if lamp.diverging:
        return _towards(points, lamp.world_from_device[:3, 3])
    axis = lamp.world_from_device[:3, 2]
    length = (points - lamp.world_from_device[:3, 3]) @ axis
    return np.broadcast_to(axis, points.shape), length


def light_steps(
    lamp: AuditProjector, samples: AuditSamples, limits: ProjectorLimits, shadow: Shadow
) -> NDArray[np.int8]:
    """Return how many limits of *lit* each sample passes, shape (n,); `LIT`: lit."""
    steps = np.zeros(len(samples), dtype=np.int8)
    alive = np.flatnonzero(in_beam(lamp, samples.points))
    steps[alive] = 1
    along, length = light_of(lamp, samples.points[alive])
    near, far = lamp.device.range_m
    normals, steep = samples.normals[alive], samples.steep[alive]
    passed = np.cumprod(
        [
            (length >= near) & (length <= far),
            -_dot(normals, along) >= np.cos(limits.max_incidence),
            np.abs(_dot(steep, along)) <= np.cos(limits.min_tangent_angle),
        ],
        axis=0,
        dtype=np.int8,
    )
    steps[alive] += passed.sum(axis=0, dtype=np.int8)
    left = passed[-1] > 0
    rest = alive[left]
    free = shadow.free(
        samples.points[rest], samples.faces[rest], along[left], length[left]
    )
    clear = free_of(lamp.blocks, samples.points[rest], along[left], length[left])
    steps[rest] += free + (free & clear).astype(np.int8)
    return steps


def light_margin(
    lamp: AuditProjector, samples: AuditSamples, limits: ProjectorLimits
) -> NDArray[np.float64]:
    """Return min(theta_max - incidence, tangent angle - tau_min) [rad], shape (n,).

    Only the first term counts where `steep` is zero.
    """
    along, _ = light_of(lamp, samples.points)
    squarely = limits.max_incidence - _angle(-_dot(samples.normals, along))
    tangent = _angle(np.abs(_dot(samples.steep, along))) - limits.min_tangent_angle
    binds = np.any(samples.steep != 0.0, axis=1)
    return np.where(binds, np.minimum(squarely, tangent), squarely)


def sight_steps(
    eye: AuditCamera, samples: AuditSamples, limits: CameraLimits, shadow: Shadow
) -> NDArray[np.int8]:
    """Return how many limits of *seen* each sample passes, shape (n,); `SEEN`: seen."""
    steps = np.zeros(len(samples), dtype=np.int8)
    local = in_frame(eye.world_from_device, samples.points)
    alive = np.flatnonzero(local[:, 2] > 0)
    pixels = pixels_of(eye.device, local[alive])
    alive = alive[in_image(eye.device.resolution, pixels)]
    steps[alive] = 1
    along, length = _towards(samples.points[alive], eye.world_from_device[:3, 3])
    near, far = eye.device.range_m
    squarely = -_dot(samples.normals[alive], along)
    in_range = (length >= near) & (length <= far)
    frontal = squarely >= np.cos(limits.max_incidence)
    steps[alive] += in_range + (in_range & frontal).astype(np.int8)
    left = in_range & frontal
    rest = alive[left]
    free = shadow.free(
        samples.points[rest], samples.faces[rest], along[left], length[left]
    )
    focal = np.sqrt(eye.device.camera_matrix[0, 0] * eye.device.camera_matrix[1, 1])
    distance = local[rest, 2] / (focal * squarely[left])
    limit = (
        np.inf if limits.max_sample_distance_m is None else limits.max_sample_distance_m
    )
    clear = free & free_of(eye.blocks, samples.points[rest], along[left], length[left])
    steps[rest] += free.astype(np.int8) + clear + (clear & (distance <= limit))
    return steps


def pair_steps(
    lamp: AuditProjector,
    eye: AuditCamera,
    samples: AuditSamples,
    limits: TriangulationLimits,
) -> NDArray[np.int8]:
    """Return how many limits of *measurable* lit and seen samples pass, shape (n,)."""
    light, _ = light_of(lamp, samples.points)
    r, t = _towards(samples.points, eye.world_from_device[:3, 3])
    ring = in_frame(lamp.world_from_ring, samples.points)
    with np.errstate(divide="ignore", invalid="ignore"):
        gradient = in_world(lamp.world_from_ring, ring_gradient(ring, lamp.diverging))
        steepness = np.linalg.norm(gradient, axis=1)
        m = gradient / steepness[:, None]
        normal = samples.normals
        v = normal * _dot(r, m)[:, None] - m * _dot(r, normal)[:, None]
        turn = eye.world_from_device[:3, :3]
        local = in_frame(eye.world_from_device, samples.points)
        g = np.linalg.norm(pixel_gradient(eye.device, local, v @ turn), axis=1)
        conditioning = np.abs(_dot(r, m))
        edge = limits.noise_px / -_dot(normal, light)
        placement = (limits.ring_sigma_m or 0.0) * _dot(normal, r)
        sigma = np.hypot(edge * t * g, placement) / conditioning
        spacing = _gap(lamp, ring) / steepness
        pitch = spacing * np.abs(_dot(normal, r)) / (t * g)
    conditions = [
        conditioning >= limits.min_conditioning,
        sigma <= (np.inf if limits.max_sigma_m is None else limits.max_sigma_m),
        pitch
        >= (-np.inf if limits.min_ring_pitch_px is None else limits.min_ring_pitch_px),
    ]
    passed = np.cumprod(conditions, axis=0, dtype=np.int8)
    return passed.sum(axis=0, dtype=np.int8)


def in_beam(lamp: AuditProjector, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return whether points lie in the image or beam and the last ring, shape (n,)."""
    device, last = lamp.device, lamp.radii[-1]
    local = in_frame(lamp.world_from_device, points)
    ring = in_frame(lamp.world_from_ring, points)
    if isinstance(device, PinholeModel):
        ahead = (local[:, 2] > 0) & (ring[:, 2] > 0)
        inside = np.zeros(len(points), dtype=bool)
        inside[ahead] = in_image(device.resolution, pixels_of(device, local[ahead])) & (
            ring_coordinate(ring[ahead], True) <= last
        )
        return inside
    width, height = device.resolution
    x, y = local[:, 0], local[:, 1]
    inside = (np.abs(x) <= width * device.pixel_pitch_m / 2) & (
        np.abs(y) <= height * device.pixel_pitch_m / 2
    )
    if device.beam_radius is not None:
        inside &= x * x + y * y <= device.beam_radius**2
    return inside & (ring_coordinate(ring, False) <= last)


def _gap(lamp: AuditProjector, ring: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance of the two rings about each point in their coordinate, shape (n,)."""
    coordinate = ring_coordinate(ring, lamp.diverging)
    upper = np.searchsorted(lamp.radii, coordinate, side="left")
    upper = np.clip(upper, 1, len(lamp.radii) - 1)
    return lamp.radii[upper] - lamp.radii[upper - 1]


def _towards(
    points: NDArray[np.float64], origin: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    offset = points - origin
    length = np.linalg.norm(offset, axis=1)
    with np.errstate(invalid="ignore"):
        return offset / length[:, None], length


def _dot(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.einsum("ij,ij->i", a, b)


def _angle(cosine: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.arccos(np.clip(cosine, -1.0, 1.0))
