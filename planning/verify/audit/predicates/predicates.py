"""What is lit, seen and measured, again, from `docs/reference/semantics.md`.

Each predicate returns how many of its limits a sample passes in the order of the page,
so that the first limit that fails, and the device that came furthest, are both known.
"""

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array, Mask
from planning.model.requirements import (
    CameraLimits,
    ProjectorLimits,
    TriangulationLimits,
)
from planning.verify.audit.audit_samples import AuditSamples

from .audit_devices import AuditCamera, AuditProjector
from .audit_optics import dot, in_frame, in_image, towards
from .error_terms import NOISE_TERMS, PairGeometry, deviation, error_terms
from .occlusion import Shadow, free_of

Steps = NDArray[np.int8]
LIGHT_CAUSES = (
    "projector_beam",
    "projector_range",
    "projector_incidence",
    "tangent_angle",
    "pixel_distance",
    "projector_occlusion",
    "projector_body",
    "blocked_by_obstacle",
)
SIGHT_CAUSES = (
    "camera_field",
    "camera_range",
    "camera_incidence",
    "camera_occlusion",
    "camera_body",
    "blocked_by_obstacle",
    "sample_distance",
)
PAIR_CAUSES = ("too_dark", "clipped", "conditioning", "angle", "sigma", "pitch")
LIT, SEEN = len(LIGHT_CAUSES), len(SIGHT_CAUSES)
MEASURED = SEEN + len(PAIR_CAUSES)
OCCLUDED = LIGHT_CAUSES.index("projector_occlusion")
PROJECTOR_BODY = LIGHT_CAUSES.index("projector_body")
CAMERA_BODY = SIGHT_CAUSES.index("camera_body")
LIGHT_OBSTACLE = LIGHT_CAUSES.index("blocked_by_obstacle")
SIGHT_OBSTACLE = SIGHT_CAUSES.index("blocked_by_obstacle")


def light_steps(
    projector: AuditProjector,
    samples: AuditSamples,
    limits: ProjectorLimits,
    shadow: Shadow,
) -> Steps:
    """Return how many limits of *lit* each sample passes, shape (n,); `LIT`: lit."""
    along, length = projector.light.to_points(samples.points)
    near, far = projector.device.range_m
    steps = _passed(
        projector.in_beam(samples.points),
        (length >= near) & (length <= far),
        -dot(samples.normals, along) >= np.cos(limits.max_incidence),
        np.abs(dot(samples.steep, along)) <= np.cos(limits.min_tangent_angle),
        _pixels_on(projector, samples, along)
        <= _or(limits.max_sample_distance_m, np.inf),
    )
    _pass_free(steps, OCCLUDED, projector, samples, (along, length), shadow)
    return steps


def _pixels_on(projector: AuditProjector, samples: AuditSamples, along: Array) -> Array:
    """Return how wide the panel's pixels come out on the surface, shape (n,) [m]."""
    z = in_frame(projector.world_from_device, samples.points)[:, 2]
    squarely = np.maximum(-dot(samples.normals, along), 1e-9)
    return projector.light.pixel_sides(z) / squarely


def light_margin(
    projector: AuditProjector, samples: AuditSamples, limits: ProjectorLimits
) -> Array:
    """Return min(theta_max - incidence, tangent angle - tau_min) [rad], shape (n,).

    Only the first term counts where `steep` is zero.
    """
    along, _ = projector.light.to_points(samples.points)
    squarely = limits.max_incidence - _angle(-dot(samples.normals, along))
    tangent = _angle(np.abs(dot(samples.steep, along))) - limits.min_tangent_angle
    binds = np.any(samples.steep != 0.0, axis=1)
    return np.where(binds, np.minimum(squarely, tangent), squarely)


def sight_steps(
    camera: AuditCamera, samples: AuditSamples, limits: CameraLimits, shadow: Shadow
) -> Steps:
    """Return how many limits of *seen* each sample passes, shape (n,); `SEEN`: seen."""
    local = in_frame(camera.world_from_device, samples.points)
    along, length = towards(samples.points, camera.world_from_device[:3, 3])
    near, far = camera.device.range_m
    squarely = -dot(samples.normals, along)
    steps = _passed(
        in_image(camera.device, local),
        (length >= near) & (length <= far),
        squarely >= np.cos(limits.max_incidence),
    )
    _pass_free(steps, 3, camera, samples, (along, length), shadow)
    focal = np.sqrt(np.prod(np.diag(camera.device.camera_matrix)[:2]))
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = local[:, 2] / (focal * squarely)
        fine = distance <= _or(limits.max_sample_distance_m, np.inf)
    steps[(steps == SEEN - 1) & fine] = SEEN
    return steps


def pair_steps(
    projector: AuditProjector,
    camera: AuditCamera,
    samples: AuditSamples,
    limits: TriangulationLimits,
) -> Steps:
    """Return how many limits of *measurable* lit and seen samples pass, shape (n,)."""
    pair = PairGeometry.of(projector, camera, samples)
    figures = pair_figures(pair, error_terms(pair, limits), limits)
    return _passed(*pair_holds(figures, limits))


def pair_figures(
    pair: PairGeometry, terms: dict[str, Array], limits: TriangulationLimits
) -> Array:
    """Return what each limit of `PAIR_CAUSES` looks at, (6, n); NaN where unlimited.

    Grey levels between lit and dark, the brightest one, |r.m|, the angle between ray
    and light [rad], the deviation [m] and the pitch [px].
    """
    names = NOISE_TERMS if limits.accuracy_of == "noise" else None
    unsaid = np.full(len(pair.points), np.nan)
    levels = None if limits.light is None else pair.levels(limits.light)
    return np.array(
        [
            unsaid if levels is None else levels.contrast,
            unsaid if levels is None else levels.brightest,
            pair.conditioning,
            pair.met,
            deviation(terms, names),
            pair.pitch,
        ]
    )


def pair_holds(figures: Array, limits: TriangulationLimits) -> Mask:
    """Return which limits of `PAIR_CAUSES` those figures keep, (6, n)."""
    contrast, brightest, conditioning, met, sigma, pitch = figures
    light, every = limits.light, np.ones(len(sigma), dtype=bool)
    return np.array(
        [
            every if light is None else contrast >= light.min_contrast,
            every if light is None else brightest < 254.5,
            conditioning >= limits.min_conditioning,
            (met >= _or(limits.min_angle, 0.0)) & (met <= _or(limits.max_angle, np.pi)),
            sigma <= _or(limits.max_sigma_m, np.inf),
            pitch >= _or(limits.min_ring_pitch_px, -np.inf),
        ]
    )


def _passed(*conditions: Mask) -> Steps:
    """How many conditions hold for each sample before the first that doesn't, (n,)."""
    return np.cumprod(conditions, axis=0, dtype=np.int8).sum(axis=0, dtype=np.int8)


def _pass_free(
    steps: Steps,
    before: int,
    device: AuditProjector | AuditCamera,
    samples: AuditSamples,
    way: tuple[Array, Array],
    shadow: Shadow,
) -> None:
    """Take samples at `before` past surface, bodies and obstacles, in place."""
    chosen = np.flatnonzero(steps == before)
    points = samples.points[chosen]
    along, length = (of[chosen] for of in way)
    free = shadow.free(points, samples.faces[chosen], along, length)
    steps[chosen] += free
    for solids in (device.blocks, shadow.about(device.station)):
        free &= free_of(solids, points, along, length)
        steps[chosen] += free


def _or(limit: float | None, otherwise: float) -> float:
    return otherwise if limit is None else limit


def _angle(cosine: Array) -> Array:
    return np.arccos(np.clip(cosine, -1.0, 1.0))
