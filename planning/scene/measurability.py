"""What a pair of projector and camera measures, and what forbids it.

A surface of equal code (a ring's cone or cylinder) gives one equation a pixel. With r
the viewing ray, t = |P - O|, N the surface normal, m the unit normal of the surface of
equal code, J_r = dr/d(u, v), v = r x (N x m) and g = J_r^T v::

    s_N^2 = (s_px t |g| / |r.m|)^2 + (s_R |N.r| / |r.m|)^2
    pitch = h |N.r| / (t |g|)

with s_px = s_0 / (-N.L) and h the spacing along m. `formulation.md`, section 3.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from geometry.rays.visibility import Visibility
from planning.model.planned import PlannedCamera
from planning.model.requirements import CameraLimits, TriangulationLimits
from planning.scene.limits.camera_limits import (
    BLOCKED,
    CAMERA_LIMITS,
    OBSTRUCTED,
    OCCLUDED,
    SEEN,
    CameraRays,
    ViewedSamples,
)
from planning.scene.limits.limit import first_violated
from planning.scene.limits.pair_limits import PAIR_LIMITS, PairQuality
from planning.scene.patterns import CodeSurfaces

from .placed_bodies import Blocker, first_blocked
from .samples import LightOnSamples, Target


def view(
    camera: PlannedCamera,
    target: Target,
    limits: CameraLimits,
    visibility: Visibility | None,
    bodies: Sequence[Blocker] = (),
) -> ViewedSamples:
    """Return how a camera sees samples; without `visibility`, the mesh hides none."""
    rays = CameraRays.of(camera, target)
    first = first_violated(CAMERA_LIMITS, rays, limits, len(target))
    near = np.flatnonzero(first >= OCCLUDED)
    between = first_between(camera, target.take(near), visibility, bodies)
    first[near] = np.minimum(first[near], between)
    jacobian = np.zeros((len(target), 3, 2))
    seen, turn = first == SEEN, camera.world_from_device[:3, :3]
    jacobian[seen] = turn @ camera.device.ray_jacobian(rays.local[seen])
    return ViewedSamples(first, rays.rays, rays.distances, rays.facing, jacobian)


def first_between(
    camera: PlannedCamera,
    target: Target,
    visibility: Visibility | None,
    bodies: Sequence[Blocker],
) -> NDArray[np.int8]:
    """Return the first limit that rays decide and samples violate; else `SEEN`."""
    points = target.samples.points
    first = first_blocked(bodies, camera, points, (BLOCKED, OBSTRUCTED), SEEN)
    if visibility is not None:
        place, normals = camera.world_from_device[:3, 3], target.samples.normals
        first[visibility.blocked(place, points, normals)] = OCCLUDED
    return first


def pair_quality(
    normals: NDArray[np.float64],
    light: LightOnSamples,
    surfaces: CodeSurfaces,
    seen: ViewedSamples,
    limits: TriangulationLimits,
) -> PairQuality:
    """Return |r.m|, s_N and pitch of a pair at samples."""
    r, m = seen.rays, surfaces.normals
    along = np.einsum("ij,ij->i", r, m)
    v = normals * along[:, None] + m * seen.facing[:, None]
    gu, gv = np.einsum("ijk,ij->ik", seen.jacobian, v).T
    g = np.sqrt(gu * gu + gv * gv)
    conditioning, facing = np.abs(along), np.abs(seen.facing)
    safe = np.maximum(conditioning, 1e-12)
    noise = limits.noise_px / np.maximum(light.incidence_cos, 1e-9)
    spread = noise * seen.distances * g / safe
    placement = (limits.ring_sigma_m or 0.0) * facing / safe
    pitch = surfaces.spacing * facing / np.maximum(seen.distances * g, 1e-15)
    sigma = np.hypot(spread, placement)
    return PairQuality(conditioning, sigma, pitch, seen, light)


def first_pair_failure(
    quality: PairQuality, limits: TriangulationLimits
) -> NDArray[np.int8]:
    """Return the index in `CAUSES` of the first limit that fails, or `MEASURED`."""
    n = len(quality.sigma)
    return first_violated(PAIR_LIMITS, quality, limits, n) + np.int8(SEEN)
