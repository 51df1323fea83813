"""What a plan's poses should measure: by its limits, and at all."""

from dataclasses import replace

import numpy as np

from geometry.arrays import Array, Mask
from geometry.parallel import n_threads
from planning.model.plan import RigPlan
from planning.model.requirements import Requirements
from planning.verify.audit.audit_samples import AuditSamples, draw_samples
from planning.verify.audit.predicates.audit_devices import (
    AuditCamera,
    AuditProjector,
    audit_cameras,
    audit_projectors,
)
from planning.verify.audit.predicates.audit_optics import dot, towards
from planning.verify.audit.predicates.examined import what_devices_do
from planning.verify.audit.predicates.occlusion import Shadow
from planning.verify.audit.predicates.predicates import MEASURED
from planning.verify.audit.predicates.recompute import Recomputed, recompute

_INCIDENCE = float(np.deg2rad(85.0))
# Below it hardly any label is right: study-reconstruction.md, section 3.2 [px].
_PITCH_PX = 3.0
# A decoder takes edges that recede faster along a ring for a step of depth: 65 degrees,
# or 5 degrees less than the incidence at which the plan counts on cameras.
_SLANT, _SLANT_MARGIN = float(np.deg2rad(65.0)), float(np.deg2rad(5.0))


def predict_measured(
    plan: RigPlan, *, seed: int, n_samples: int = 20_000, threads: int | None = None
) -> Recomputed:
    """Return what the poses of a plan should measure of samples of the target.

    These are those of `audit_plan` with the same seed, n_samples on the whole surface.

    Raises:
        PlanFileError: If the target has no area.
    """
    threads = threads or n_threads()
    drawn = draw_samples(plan.surface, plan.requirements.target, n_samples, seed)
    samples = drawn.take(drawn.in_target)
    return what_devices_do(plan, samples, Shadow.of(plan, threads=threads))


def possible_at_floors(plan: RigPlan, samples: AuditSamples, *, threads: int) -> Mask:
    """Return whether each camera could measure each sample, shape (n_c, n)."""
    if plan.requirements.pattern == "none":
        return _seen_at_floors(plan, samples, threads=threads)
    shadow = Shadow.of(plan, threads=threads)
    floors = {"requirements": _at_floors(plan.requirements)}
    relaxed = RigPlan(plan.document.model_copy(update=floors), plan.surface)
    pairs = recompute(relaxed, samples, shadow).pairs
    steepest = plan.requirements.camera.max_incidence - _SLANT_MARGIN
    most = np.sin(max(steepest, _SLANT))
    possible = np.zeros(pairs.shape[1:], dtype=bool)
    for p, projector in enumerate(audit_projectors(plan)):
        for c, camera in enumerate(audit_cameras(plan)):
            able = np.flatnonzero(pairs[p, c] == MEASURED)
            along = receding(projector, camera, samples.take(able))
            possible[c, able[along <= most]] = True
    return possible


def _seen_at_floors(plan: RigPlan, samples: AuditSamples, *, threads: int) -> Mask:
    """Return whether each camera is of a pair that could measure a sample, (n_c, n)."""
    floors = {"requirements": _at_floors(plan.requirements)}
    relaxed = RigPlan(plan.document.model_copy(update=floors), plan.surface)
    shadow = Shadow.of(plan, threads=threads)
    return what_devices_do(relaxed, samples, shadow).measured_by


def receding(
    projector: AuditProjector, camera: AuditCamera, samples: AuditSamples
) -> Array:
    """Return |r.T|, T = N x m / |N x m|: the sine of the slant along a ring, (n,).

    0 where there are no rings.
    """
    if projector.code is not None:
        return np.zeros(len(samples))
    with np.errstate(divide="ignore", invalid="ignore"):
        tangent = np.cross(samples.normals, projector.ring_gradient(samples.points))
        tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    rays, _ = towards(samples.points, camera.world_from_device[:3, 3])
    return np.abs(dot(rays, tangent))


def _at_floors(requirements: Requirements) -> Requirements:
    """Return requirements with the limits at which light and edges fail in fact.

    Planning limits are stricter, for accuracy: incidence 85 degrees instead, no tangent
    limit, a pitch of 3 px, no limit on s_N or the sampling distance. |r.m| stays, since
    the decoder keeps it.
    """
    return replace(
        requirements,
        projector=replace(
            requirements.projector, max_incidence=_INCIDENCE, min_tangent_angle=0.0
        ),
        camera=replace(
            requirements.camera, max_incidence=_INCIDENCE, max_sample_distance_m=None
        ),
        triangulation=replace(
            requirements.triangulation, max_sigma_m=None, min_ring_pitch_px=_PITCH_PX
        ),
    )
