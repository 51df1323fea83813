"""What a pair of projector and camera measures with rings, and what forbids it.

A ring gives one equation a pixel. With r the viewing ray, t = |P - O|, N the surface
normal, m the unit normal of the ring surface, J_r = dr/d(u, v), v = r x (N x m) and
g = J_r^T v::

    s_N^2 = (s_px t |g| / |r.m|)^2 + (s_R |N.r| / |r.m|)^2
    pitch = h |N.r| / (t |g|)

with s_px = s_0 / (-N.L) and h the ring spacing along m. `formulation.md`, section 3.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.lengths import lengths
from geometry.poses import inverse, transform
from geometry.rays.visibility import Visibility
from planning.model.planned import PlannedCamera, PlannedProjector
from planning.model.requirements import CameraLimits, TriangulationLimits

from .lighting import LightOnSamples
from .samples import Target
from .standing import Standing, blocked_by

SEEN_CAUSES = (
    "camera_field",
    "camera_range",
    "camera_incidence",
    "camera_occlusion",
    "camera_body",
    "sample_distance",
)
PAIR_CAUSES = ("conditioning", "sigma", "pitch")
CAUSES = SEEN_CAUSES + PAIR_CAUSES
SEEN = len(SEEN_CAUSES)
MEASURED = len(CAUSES)
BLOCKED = CAUSES.index("camera_body")
_OCCLUDED, _COARSE = BLOCKED - 1, BLOCKED + 1


@dataclass(frozen=True, eq=False)
class ViewedSamples:
    """One camera's view of n samples.

    Attributes:
        stage: Index in `SEEN_CAUSES` of the first limit that fails, `SEEN` if none.
        rays: Unit viewing rays r, shape (n, 3).
        distances: t in [m], shape (n,).
        facing: -N.r, shape (n,).
        jacobian: J_r in the world in [1/px], shape (n, 3, 2); 0 where a limit fails.
    """

    stage: NDArray[np.int8]
    rays: NDArray[np.float64]
    distances: NDArray[np.float64]
    facing: NDArray[np.float64]
    jacobian: NDArray[np.float64]

    def take(self, chosen: NDArray[np.int64]) -> "ViewedSamples":
        """Return the view of some of the samples."""
        return ViewedSamples(
            self.stage[chosen],
            self.rays[chosen],
            self.distances[chosen],
            self.facing[chosen],
            self.jacobian[chosen],
        )


def view(
    camera: PlannedCamera,
    target: Target,
    limits: CameraLimits,
    visibility: Visibility | None,
    bodies: Sequence[Standing] = (),
) -> ViewedSamples:
    """Return how a camera sees samples; without `visibility`, occlusion is left out.

    Args:
        camera: Pose and optics.
        target: Samples.
        limits: Of incidence and sampling distance.
        visibility: Occlusion by the mesh.
        bodies: Of devices, which stand in the way as well.
    """
    points, normals = target.samples.points, target.samples.normals
    pose, device = camera.world_from_device, camera.device
    offsets = points - pose[:3, 3]
    distances = lengths(offsets)
    rays = offsets / np.where(distances > 0, distances, 1.0)[:, None]
    facing = -np.einsum("ij,ij->i", normals, rays)
    local = transform(inverse(pose), points)
    within = device.contains(device.project(local))
    low, high = device.range_m
    stage = np.full(len(points), SEEN, dtype=np.int8)
    if limits.max_sample_distance_m is not None:
        step = local[:, 2] / (device.focal_px * np.maximum(facing, 1e-9))
        stage[~(step <= limits.max_sample_distance_m)] = _COARSE
    tests = (
        within,
        (distances >= low) & (distances <= high),
        facing >= np.cos(limits.max_incidence),
    )
    clear = np.flatnonzero(np.logical_and.reduce(tests))
    if bodies:
        between = blocked_by(bodies, camera, points[clear]).any(axis=1)
        stage[clear[between]] = BLOCKED
    if visibility is not None:
        blocked = visibility.blocked(pose[:3, 3], points[clear], normals[clear])
        stage[clear[blocked]] = _OCCLUDED
    for index in range(len(tests) - 1, -1, -1):
        np.copyto(stage, np.int8(index), where=~tests[index])
    jacobian = np.zeros((len(points), 3, 2))
    seen = stage == SEEN
    jacobian[seen] = pose[:3, :3] @ device.ray_jacobian(local[seen])
    return ViewedSamples(stage, rays, distances, facing, jacobian)


@dataclass(frozen=True, eq=False)
class Rings:
    """One projector's ring surfaces at n samples.

    Attributes:
        normals: m, unit normals of the ring surfaces in the world, shape (n, 3).
        spacing: h, ring spacing along m in [m], shape (n,).
    """

    normals: NDArray[np.float64]
    spacing: NDArray[np.float64]

    def take(self, chosen: NDArray[np.int64]) -> "Rings":
        """Return the rings at some of the points."""
        return Rings(self.normals[chosen], self.spacing[chosen])


def rings_at(projector: PlannedProjector, points: NDArray[np.float64]) -> Rings:
    """Return ring normals and spacings of a projector at points.

    In ring coordinates Y with rho = |(Y_x, Y_y)|: a cylinder (parallel light) has
    m = (Y_x, Y_y, 0)/rho and h = gap; the cone R = rho/Y_z has
    m = (Y_x/rho, Y_y/rho, -R)/sqrt(1 + R^2) and h = Y_z gap/sqrt(1 + R^2).
    """
    ring = transform(inverse(projector.world_from_ring), points)
    rho = np.hypot(ring[:, 0], ring[:, 1])
    radial = ring[:, :2] / np.maximum(rho, 1e-12)[:, None]
    radii = projector.ring_radii
    if projector.light == "parallel":
        coordinate, slope, stretch = rho, np.zeros_like(rho), np.ones_like(rho)
    else:
        depth = np.maximum(ring[:, 2], 1e-12)
        coordinate = slope = rho / depth
        stretch = depth / np.sqrt(1.0 + slope**2)
    local = np.column_stack([radial, -slope]) / np.sqrt(1.0 + slope**2)[:, None]
    index = np.clip(np.searchsorted(radii, coordinate), 1, len(radii) - 1)
    gaps = radii[index] - radii[index - 1]
    return Rings(local @ projector.world_from_ring[:3, :3].T, gaps * stretch)


@dataclass(frozen=True, eq=False)
class PairQuality:
    """How well a pair triangulates n samples.

    Attributes:
        conditioning: |r.m|, shape (n,).
        sigma: s_N in [m], shape (n,).
        pitch: Distance of neighbouring rings in the image in [px], shape (n,).
    """

    conditioning: NDArray[np.float64]
    sigma: NDArray[np.float64]
    pitch: NDArray[np.float64]


def pair_quality(
    normals: NDArray[np.float64],
    light: LightOnSamples,
    rings: Rings,
    seen: ViewedSamples,
    limits: TriangulationLimits,
) -> PairQuality:
    """Return |r.m|, s_N and pitch of a pair at samples."""
    r, m = seen.rays, rings.normals
    along = np.einsum("ij,ij->i", r, m)
    v = normals * along[:, None] + m * seen.facing[:, None]
    gu, gv = np.einsum("ijk,ij->ik", seen.jacobian, v).T
    g = np.sqrt(gu * gu + gv * gv)
    conditioning = np.abs(along)
    safe = np.maximum(conditioning, 1e-12)
    noise = limits.noise_px / np.maximum(light.incidence_cos, 1e-9)
    spread = noise * seen.distances * g / safe
    placement = (limits.ring_sigma_m or 0.0) * np.abs(seen.facing) / safe
    pitch = rings.spacing * np.abs(seen.facing) / np.maximum(seen.distances * g, 1e-15)
    return PairQuality(conditioning, np.hypot(spread, placement), pitch)


def first_pair_failure(
    quality: PairQuality, limits: TriangulationLimits
) -> NDArray[np.int8]:
    """Return the index in `CAUSES` of the first limit that fails, or `MEASURED`."""
    stage = np.full(len(quality.sigma), MEASURED, dtype=np.int8)
    if limits.min_ring_pitch_px is not None:
        stage[~(quality.pitch >= limits.min_ring_pitch_px)] = SEEN + 2
    if limits.max_sigma_m is not None:
        stage[~(quality.sigma <= limits.max_sigma_m)] = SEEN + 1
    stage[~(quality.conditioning >= limits.min_conditioning)] = SEEN
    return stage
