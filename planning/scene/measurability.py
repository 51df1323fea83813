"""What a pair of projector and camera measures, and what forbids it.

A surface of equal code (a ring's cone or cylinder) gives one equation a pixel. With r
the viewing ray, t = |P - O|, N the surface normal, m the unit normal of the surface of
equal code, J_r = dr/d(u, v), v = r x (N x m) and g = J_r^T v::

    s_N^2 = (s_px t |g| / |r.m|)^2 + (s_R |N.r| / |r.m|)^2 + (s_L |N.r| / |r.m|)^2
    s_C^2 = (s_v / |r.m|)^2 + (s_m |N.r| / |r.m|)^2
    pitch = h |N.r| / (t |g|)

with s_px = s_0 / (-N.L), and the noise of the light beside it where the rig states that
(`light_terms`), h the spacing along m, and s_L what blur leaves of the panel's pixels
(`edge_terms`); s_v and s_m are what errors of the
calibration move the viewing ray by along v, and the surface of equal code along m
(`calibration_terms`). `formulation.md`, sections 3 and 8.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from geometry.rays.visibility import Visibility
from planning.model.light.drawn_edges import DrawnEdges
from planning.model.planned import PlannedCamera
from planning.model.requirements import CameraLimits, TriangulationLimits
from planning.scene.limits.calibration_terms import ray_deviation, surface_deviation
from planning.scene.limits.camera_limits import (
    BLOCKED,
    CAMERA_LIMITS,
    OBSTRUCTED,
    OCCLUDED,
    SEEN,
    CameraRays,
    ViewedSamples,
)
from planning.scene.limits.edge_terms import edge_linearity_m, edge_width_px
from planning.scene.limits.light_terms import GreyLevels, electrons, grey_levels
from planning.scene.limits.limit import first_violated
from planning.scene.limits.pair_limits import PAIR_LIMITS, PairQuality, Term
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
    jacobian, off_centre = np.zeros((len(target), 3, 2)), np.zeros((len(target), 2))
    seen, turn, device = first == SEEN, camera.world_from_device[:3, :3], camera.device
    local = rays.local[seen]
    jacobian[seen] = turn @ device.ray_jacobian(local)
    off_centre[seen] = device.project(local) - device.camera_matrix[:2, 2]
    return ViewedSamples(
        first, rays.rays, rays.distances, rays.facing, jacobian, off_centre
    )


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
    """Return |r.m|, the deviations and pitch of a pair at samples."""
    r, m = seen.rays, surfaces.normals
    along = np.einsum("ij,ij->i", r, m)
    v = normals * along[:, None] + m * seen.facing[:, None]
    turned = np.einsum("ijk,ij->ik", seen.jacobian, v)
    gu, gv = turned.T
    g = np.sqrt(gu * gu + gv * gv)
    conditioning, facing = np.abs(along), np.abs(seen.facing)
    per = 1.0 / np.maximum(conditioning, 1e-12)
    reach = seen.distances * g
    edge = limits.noise_px / np.maximum(light.incidence_cos, 1e-9)
    drawn = np.full_like(edge, limits.ring_sigma_m or 0.0)
    terms: dict[Term, NDArray[np.float64]] = {"edges": edge * reach * per}
    image_px_m = reach / np.maximum(facing, 1e-12)
    grey = _grey(light, surfaces, seen, image_px_m, limits)
    if grey is not None:
        terms["light"] = grey.noise_px * reach * per
        edge = np.hypot(edge, grey.noise_px)
    if limits.ring_sigma_m is not None:
        terms["rings"] = drawn * facing * per
    if (blurred := limits.drawn_edges) is not None:
        squares = edge_linearity_m(
            blurred, surfaces.depths, surfaces.pixel_m, image_px_m
        )
        terms["linearity"] = squares * facing * per
        drawn = np.hypot(drawn, squares)
    sigma = np.hypot(edge * reach, drawn * facing) * per
    if (errors := limits.calibration) is not None:
        terms["camera"] = ray_deviation(errors, seen, v, turned) * per
        placed = surface_deviation(errors, surfaces.levers)
        terms["projector"] = placed * facing * per
    pitch = surfaces.spacing * facing / np.maximum(reach, 1e-15)
    quality = PairQuality(
        *(conditioning, sigma, terms, pitch, seen, light, edge, drawn, grey)
    )
    if errors is None or limits.accuracy_of == "noise":
        return quality
    return replace(quality, sigma=quality.total)


def _grey(
    light: LightOnSamples,
    surfaces: CodeSurfaces,
    seen: ViewedSamples,
    image_px_m: NDArray[np.float64],
    limits: TriangulationLimits,
) -> GreyLevels | None:
    """How bright samples come out in a camera's image; None: nothing says."""
    budget = limits.light
    if budget is None:
        return None
    width = edge_width_px(
        limits.drawn_edges or DrawnEdges(),
        *(surfaces.depths, surfaces.pixel_m, image_px_m),
    )
    off = np.square(seen.off_centre).sum(axis=1) / budget.focal_px**2
    squarely = surfaces.lux_per_lm * np.maximum(light.incidence_cos, 0.0)
    lit, dark = electrons(budget, squarely, surfaces.exposure_s)
    return grey_levels(budget, lit, dark, 1.0 / np.sqrt(1.0 + off), width)


def expected_noise_px(
    limits: TriangulationLimits,
    light: LightOnSamples,
    surfaces: CodeSurfaces,
    away_m: float,
) -> NDArray[np.float64]:
    """Return the noise of edges in a camera that looks squarely at samples [px], (n,).

    From so far away, along its axis: for programs, which propose.
    """
    edge = limits.noise_px / np.maximum(light.incidence_cos, 1e-9)
    if limits.light is None:
        return edge
    n = len(edge)
    axis = ViewedSamples(
        np.full(n, SEEN, dtype=np.int8), *np.zeros((3, n)), *np.zeros((2, n, 2))
    )
    image_px_m = np.full(n, away_m / limits.light.focal_px)
    grey = _grey(light, surfaces, axis, image_px_m, limits)
    return edge if grey is None else np.hypot(edge, grey.noise_px)


def first_pair_failure(
    quality: PairQuality, limits: TriangulationLimits
) -> NDArray[np.int8]:
    """Return the index in `CAUSES` of the first limit that fails, or `MEASURED`."""
    n = len(quality.sigma)
    return first_violated(PAIR_LIMITS, quality, limits, n) + np.int8(SEEN)
