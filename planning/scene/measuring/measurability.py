"""What a pair of projector and camera measures, and what forbids it.

A surface of equal code (a ring's cone or cylinder) gives one equation a pixel. With r
the viewing ray, t = |P - O|, N the surface normal, m the unit normal of the surface of
equal code, J_r = dr/d(u, v), v = r x (N x m) and g = J_r^T v::

    s_N^2 = (s_px t |g| / |r.m|)^2 + (s_R |N.r| / |r.m|)^2 + (s_L |N.r| / |r.m|)^2
    s_C^2 = (s_v / |r.m|)^2 + (s_m |N.r| / |r.m|)^2
    pitch = h |N.r| / (t |g|)

with s_px = s_0 / (-N.L), and the noise of the light beside it where the rig states that
(`light_terms`), h the spacing along m, and s_L what blur leaves of the panel's pixels
(`edge_terms`). Of coded pixels m follows from r (`codes.surfaces`), and beside s_R
stands the noise of the phase (`code_noise`). s_v and s_m are what errors of the
calibration move the viewing ray by along v, and the surface of equal code along m
(`calibration_terms`). `docs/reference/semantics.md`, "Measurable".
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from planning.model.devices.planned import PlannedCamera
from planning.model.requirements import CameraLimits, TriangulationLimits
from planning.scene.codes.surfaces import Coded, CodedPixels, PixelSurfaces
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
from planning.scene.limits.code_noise import code_noise, least_phase_px, together
from planning.scene.limits.limit import first_violated
from planning.scene.limits.pair_limits import PAIR_LIMITS
from planning.scene.limits.pair_quality import PairQuality, Term
from planning.scene.occlusion import Occlusion
from planning.scene.placed_bodies import Blocker, first_blocked
from planning.scene.samples import LightOnSamples, Target


def view(
    camera: PlannedCamera,
    target: Target,
    limits: CameraLimits,
    occlusion: Occlusion | None,
    bodies: Sequence[Blocker] = (),
) -> ViewedSamples:
    """Return how a camera sees samples; without `occlusion`, the mesh hides none."""
    rays = CameraRays.of(camera, target)
    first = first_violated(CAMERA_LIMITS, rays, limits, len(target))
    near = np.flatnonzero(first >= OCCLUDED)
    between = first_between(camera, target.take(near), occlusion, bodies)
    first[near] = np.minimum(first[near], between)
    jacobian, off_centre = np.zeros((len(target), 3, 2)), np.zeros((len(target), 2))
    seen, turn, device = first == SEEN, camera.world_from_device[:3, :3], camera.device
    local = rays.local[seen]
    jacobian[seen] = turn @ device.ray_jacobian(local)
    off_centre[seen] = device.project(local) - device.camera_matrix[:2, 2]
    return ViewedSamples(
        *(first, rays.rays, rays.distances, rays.facing, jacobian, off_centre),
        station=camera.station,
    )


def first_between(
    camera: PlannedCamera,
    target: Target,
    occlusion: Occlusion | None,
    bodies: Sequence[Blocker],
) -> NDArray[np.int8]:
    """Return the first limit that rays decide and samples violate; else `SEEN`."""
    points = target.samples.points
    first = first_blocked(bodies, camera, points, (BLOCKED, OBSTRUCTED), SEEN)
    if occlusion is not None:
        place = camera.world_from_device[:3, 3]
        first[occlusion.blocked(place, target)] = OCCLUDED
    return first


def pair_quality(
    normals: NDArray[np.float64],
    light: LightOnSamples,
    coded: Coded,
    seen: ViewedSamples,
    limits: TriangulationLimits,
) -> PairQuality:
    """Return |r.m|, the deviations and pitch of a pair at samples."""
    surfaces = coded.towards(seen.rays)
    r, m = seen.rays, surfaces.normals
    along = np.einsum("ij,ij->i", r, m)
    v = normals * along[:, None] + m * seen.facing[:, None]
    turned = np.einsum("ijk,ij->ik", seen.jacobian, v)
    gu, gv = turned.T
    g = np.sqrt(gu * gu + gv * gv)
    conditioning, facing = np.abs(along), np.abs(seen.facing)
    per = 1.0 / np.maximum(conditioning, 1e-12)
    reach = seen.distances * g
    noise = code_noise(light, surfaces, seen, reach / np.maximum(facing, 1e-12), limits)
    terms: dict[Term, NDArray[np.float64]] = {
        **{name: part * reach * per for name, part in noise.image_px.items()},
        **{name: part * facing * per for name, part in noise.surface_m.items()},
    }
    edge, drawn = (
        together(parts, len(g)) for parts in (noise.image_px, noise.surface_m)
    )
    sigma = np.hypot(edge * reach, drawn * facing) * per
    if (errors := limits.calibration) is not None:
        terms["camera"] = ray_deviation(errors, seen, v, turned) * per
        placed = surface_deviation(errors, surfaces.levers)
        terms["projector"] = placed * facing * per
    pitch = surfaces.spacing * facing / np.maximum(reach, 1e-15)
    met = surfaces.light_cos if isinstance(surfaces, PixelSurfaces) else None
    quality = PairQuality(
        *(conditioning, sigma, terms, pitch, seen, light, edge, drawn),
        grey=noise.grey,
        light_cos=met,
    )
    if errors is None or limits.accuracy_of == "noise":
        return quality
    return replace(quality, sigma=quality.total)


def expected_noise_px(
    limits: TriangulationLimits,
    light: LightOnSamples,
    coded: Coded,
    away_m: float,
) -> NDArray[np.float64]:
    """Return the noise of edges in a camera that looks squarely at samples [px], (n,).

    From so far away, along its axis: for programs, which propose.
    """
    edge = limits.noise_px / np.maximum(light.incidence_cos, 1e-9)
    if limits.light is None or isinstance(coded, CodedPixels):
        return edge
    n = len(edge)
    rays, distances, facing = np.zeros((3, n))
    jacobian, off_centre = np.zeros((2, n, 2))
    axis = ViewedSamples(
        *(np.full(n, SEEN, dtype=np.int8), rays, distances),
        *(facing, jacobian, off_centre),
    )
    image_px_m = np.full(n, away_m / limits.light.focal_px)
    return together(code_noise(light, coded, axis, image_px_m, limits).image_px, n)


def expected_sigma_m(
    limits: TriangulationLimits, light: LightOnSamples, coded: Coded
) -> NDArray[np.float64]:
    """Return how far surfaces of equal code are off along m on average [m], (n,).

    Beside what the calibration leaves; for programs, which propose.
    """
    if not isinstance(coded, CodedPixels):
        return np.full(len(light.incidence_cos), limits.ring_sigma_m or 0.0)
    told = least_phase_px(coded.code, limits, light.incidence_cos)
    return told * coded.on_average().levers[:, 2]


def first_pair_failure(
    quality: PairQuality, limits: TriangulationLimits
) -> NDArray[np.int8]:
    """Return the index in `CAUSES` of the first limit that fails, or `MEASURED`."""
    n = len(quality.sigma)
    return first_violated(PAIR_LIMITS, quality, limits, n) + np.int8(SEEN)
