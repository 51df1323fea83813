"""Eq. (2) with margins: what a projector lights, and which limit forbids it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.lengths import lengths
from geometry.poses import inverse, transform
from geometry.rays.visibility import Visibility
from planning.model.planned import PlannedProjector
from planning.model.requirements import ProjectorLimits

from .samples import Target
from .standing import Standing, blocked_by

CAUSES = (
    "projector_beam",
    "projector_range",
    "projector_incidence",
    "tangent_angle",
    "projector_occlusion",
    "projector_body",
)
LIT = len(CAUSES)
OCCLUDED = CAUSES.index("projector_occlusion")
BLOCKED = CAUSES.index("projector_body")
INCIDENCE = CAUSES.index("projector_incidence")


@dataclass(frozen=True, eq=False)
class LightOnSamples:
    """One projector's light on n samples, before occlusion.

    Attributes:
        directions: Unit L(P), shape (n, 3).
        distances: |P - Q| (diverging) or z (parallel) in [m], shape (n,).
        incidence_cos: -N.L, shape (n,).
        tangent_cos: |T1.L|, 0 where T1 is arbitrary, shape (n,).
        ring_coordinate: R = tangent (diverging) or radius in [m] (parallel), (n,).
    """

    directions: NDArray[np.float64]
    distances: NDArray[np.float64]
    incidence_cos: NDArray[np.float64]
    tangent_cos: NDArray[np.float64]
    ring_coordinate: NDArray[np.float64]

    def take(self, chosen: NDArray[np.int64]) -> "LightOnSamples":
        """Return the light on some of the samples."""
        return LightOnSamples(
            self.directions[chosen],
            self.distances[chosen],
            self.incidence_cos[chosen],
            self.tangent_cos[chosen],
            self.ring_coordinate[chosen],
        )


def light_on(projector: PlannedProjector, target: Target) -> LightOnSamples:
    """Return the light of a projector at samples, wherever they are."""
    points, normals = target.samples.points, target.samples.normals
    pose = projector.world_from_device
    offsets = points - pose[:3, 3]
    if projector.light == "parallel":
        directions = np.broadcast_to(pose[:3, 2], points.shape)
        distances = offsets @ pose[:3, 2]
    else:
        distances = lengths(offsets)
        directions = offsets / np.where(distances > 0, distances, 1.0)[:, None]
    return LightOnSamples(
        directions,
        distances,
        -np.einsum("ij,ij->i", normals, directions),
        np.abs(np.einsum("ij,ij->i", target.steep, directions)),
        ring_coordinate(projector, points),
    )


def ring_coordinate(
    projector: PlannedProjector, points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return each point's ring radius (parallel, [m]) or tangent (diverging).

    Points behind a diverging projector get inf.
    """
    ring = transform(inverse(projector.world_from_ring), points)
    rho = np.hypot(ring[:, 0], ring[:, 1])
    if projector.light == "parallel":
        return rho
    front = ring[:, 2] > 0
    return np.divide(rho, ring[:, 2], out=np.full_like(rho, np.inf), where=front)


def first_failure(
    projector: PlannedProjector,
    target: Target,
    limits: ProjectorLimits,
    visibility: Visibility,
    *,
    light: LightOnSamples | None = None,
    bodies: Sequence[Standing] = (),
) -> NDArray[np.int8]:
    """Return the index in `CAUSES` of the first limit that fails; `LIT` if none does.

    Args:
        projector: Pose, optics and rings.
        target: Samples.
        limits: Margins of eq. (2).
        visibility: Occlusion.
        light: What `light_on` returned, to save computing it again.
        bodies: Of devices, which stand in the way of light as well.

    Returns:
        Shape (n,).
    """
    stage = first_failure_ignoring_occlusion(projector, target, limits, light=light)
    clear = np.flatnonzero(stage == LIT)
    samples, pose = target.samples, projector.world_from_device
    blocked = visibility.blocked(
        pose[:3, 3],
        samples.points[clear],
        samples.normals[clear],
        along=pose[:3, 2] if projector.light == "parallel" else None,
    )
    stage[clear[blocked]] = OCCLUDED
    mark_blocked(stage, projector, samples.points, bodies)
    return stage


def mark_blocked(
    stage: NDArray[np.int8],
    projector: PlannedProjector,
    points: NDArray[np.float64],
    bodies: Sequence[Standing],
) -> None:
    """Set the stage of lit samples (n,) whose light meets a body to `BLOCKED`."""
    if not bodies:
        return
    lit = np.flatnonzero(stage == LIT)
    blocked = blocked_by(bodies, projector, points[lit]).any(axis=1)
    stage[lit[blocked]] = BLOCKED


def first_failure_ignoring_occlusion(
    projector: PlannedProjector,
    target: Target,
    limits: ProjectorLimits,
    *,
    light: LightOnSamples | None = None,
) -> NDArray[np.int8]:
    """Return what `first_failure` does, were there nothing in between."""
    light = light_on(projector, target) if light is None else light
    low, high = projector.device.range_m
    tests = (
        _in_beam(projector, target.samples.points, light),
        (light.distances >= low) & (light.distances <= high),
        light.incidence_cos >= np.cos(limits.max_incidence),
        light.tangent_cos <= np.cos(limits.min_tangent_angle),
    )
    stage = np.full(len(target), LIT, dtype=np.int8)
    for index in range(len(tests) - 1, -1, -1):
        np.copyto(stage, np.int8(index), where=~tests[index])
    return stage


def faces_away(projector: PlannedProjector, target: Target) -> NDArray[np.bool_]:
    """Return which samples surely show light their back, shape (n,).

    N.(Q - P) < 0, or N.L > 0 in parallel light, by more than rounding: beyond every
    limit of incidence, so that `first_failure` is at most `INCIDENCE`.
    """
    points, normals = target.samples.points, target.samples.normals
    pose = projector.world_from_device
    if projector.light == "parallel":
        return normals @ pose[:3, 2] > 1e-9
    offsets = points - pose[:3, 3]
    behind = np.einsum("ij,ij->i", normals, offsets)
    return behind > 1e-9 * np.abs(offsets).max(axis=0, initial=0.0).sum()


def margins(light: LightOnSamples, limits: ProjectorLimits) -> NDArray[np.float64]:
    """Return min(theta_max - incidence, tangent angle - tau_min) in [rad], shape (n,).

    Where T1 is arbitrary, only the first term counts.
    """
    incidence = np.arccos(np.clip(light.incidence_cos, -1.0, 1.0))
    margin = limits.max_incidence - incidence
    tangent = np.arccos(np.clip(light.tangent_cos, 0.0, 1.0)) - limits.min_tangent_angle
    # An arbitrary T1 is stored as zero, so its cosine is exactly 0.
    return np.where(light.tangent_cos > 0, np.minimum(margin, tangent), margin)


def assigned_projectors(
    lit: NDArray[np.bool_], margin: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Return the projector that serves each sample, -1 where none lights it.

    Args:
        lit: Shape (n, n_projectors).
        margin: Smaller margin of each pair in [rad], same shape.

    Returns:
        Shape (n,); the lower index on ties.
    """
    ranked = np.where(lit, margin, -np.inf)
    return np.where(lit.any(axis=1), np.argmax(ranked, axis=1), -1)


def in_panel(
    projector: PlannedProjector, points: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Return whether points lie in the light that leaves the device, shape (n,)."""
    local = transform(inverse(projector.world_from_device), points)
    return projector.device.in_field(local)


def _in_beam(
    projector: PlannedProjector, points: NDArray[np.float64], light: LightOnSamples
) -> NDArray[np.bool_]:
    inside = light.ring_coordinate <= projector.ring_radii[-1]
    return inside & in_panel(projector, points)
