"""What each camera of a plan sees of the object, by the audit's own predicates."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array, Ints
from planning.model.devices.planned import PlannedCamera
from planning.model.plan import RigPlan
from planning.verify.audit.audit_samples import AuditSamples, draw_samples
from planning.verify.audit.predicates.audit_devices import audit_projectors
from planning.verify.audit.predicates.audit_optics import (
    dot,
    in_frame,
    rays_of,
    towards,
)
from planning.verify.audit.predicates.examined import what_devices_do
from planning.verify.audit.predicates.occlusion import Shadow
from planning.verify.audit.predicates.predicates import MEASURED
from planning.verify.audit.predicates.recompute import Recomputed
from planning.verify.audit.predicates.recomputed_views import RecomputedViews
from planning.verify.audit.predicates.view_pairs import GOOD

_N_SAMPLES = 20_000
# Rays over the longer side of the image that tell how much of it the object fills.
_ACROSS = 200

Spread = tuple[float, float, float]


@dataclass(frozen=True)
class CameraFigures:
    """One camera; lengths in [m], angles in [rad].

    A spread is the least, the median and the largest over the samples that are
    measured; None where none is.

    Attributes:
        id: As in the plan.
        pixel_m: Side of a pixel across the axis, z / f, at the median of what it
            measures.
        filled: Share of its image that the object fills, seen past all obstacles.
        distance_m: Spread of the distance of what it measures.
        sharp_m: Nearest and farthest distance that is sharp.
        triangulation: Spread of the angle between view and light, by projector; of
            cameras alone between both views, by the other camera.
    """

    id: str
    pixel_m: float | None
    filled: float
    distance_m: Spread | None
    sharp_m: tuple[float, float]
    triangulation: dict[str, Spread | None]


def camera_figures(plan: RigPlan, *, threads: int) -> tuple[CameraFigures, ...]:
    """Recompute what each camera measures, on fresh samples of the whole surface."""
    target, seed = plan.requirements.target, plan.document.seed
    samples = draw_samples(plan.surface, target, _N_SAMPLES, seed)
    shadow = Shadow.of(plan, threads=threads)
    actual = what_devices_do(plan, samples, shadow)
    figures: list[CameraFigures] = []
    for c, camera in enumerate(plan.cameras):
        local = in_frame(camera.world_from_device, samples.points)
        mine = local[actual.measured_by[c]]
        angles = {
            name: _spread(_angles(light, camera, samples.points, both))
            for name, light, both in _lights(plan, actual, samples, c)
        }
        pixels = mine[:, 2] / camera.device.focal_px
        figures.append(
            CameraFigures(
                camera.id,
                float(np.median(pixels)) if len(mine) else None,
                _filled(camera, shadow),
                _spread(np.linalg.norm(mine, axis=1)),
                camera.device.range_m,
                angles,
            )
        )
    return tuple(figures)


def _lights(
    plan: RigPlan, actual: Recomputed, samples: AuditSamples, c: int
) -> Iterator[tuple[str, Array, Ints]]:
    """Yield id and rays of what a camera measures with, and which samples, (k,).

    Projectors, or the other cameras where there are none.
    """
    if isinstance(actual, RecomputedViews):
        for k, other in enumerate(plan.cameras):
            rays, _ = towards(samples.points, other.world_from_device[:3, 3])
            if k != c:
                yield other.id, rays, np.flatnonzero(actual.met[c, k] == GOOD)
        return
    for p, projector in enumerate(audit_projectors(plan)):
        light, _ = projector.light.to_points(samples.points)
        measured = np.flatnonzero(actual.pairs[p, c] == MEASURED)
        if plan.projectors[p].station in ("", plan.cameras[c].station):
            yield plan.projectors[p].id, light, measured


def _angles(light: Array, camera: PlannedCamera, points: Array, chosen: Ints) -> Array:
    light = light[chosen]
    view, _ = towards(points[chosen], camera.world_from_device[:3, 3])
    return np.arccos(np.clip(dot(light, view), -1.0, 1.0))


def _filled(camera: PlannedCamera, shadow: Shadow) -> float:
    size = np.array(camera.device.resolution)
    columns, rows = np.ceil(_ACROSS * size / size.max()).astype(int)
    u, v = np.meshgrid(np.arange(columns) + 0.5, np.arange(rows) + 0.5)
    pixels = np.column_stack([u.ravel(), v.ravel()]) / [columns, rows] * size - 0.5
    turn, origin = camera.world_from_device[:3, :3], camera.world_from_device[:3, 3]
    hit, _ = shadow.caster.first_hits(origin, rays_of(camera.device, pixels) @ turn.T)
    return float(np.mean(hit >= 0))


def _spread(values: Array) -> Spread | None:
    if not len(values):
        return None
    return float(values.min()), float(np.median(values)), float(values.max())
