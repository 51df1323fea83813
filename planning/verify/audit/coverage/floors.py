"""A second prediction: what can be measured at all, not what a plan counts on."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from planning.model.plan import RigPlan
from planning.model.requirements import Requirements
from planning.verify.audit.audit_samples import AuditSamples
from planning.verify.audit.predicates.audit_optics import (
    in_frame,
    in_world,
    ring_gradient,
)
from planning.verify.audit.predicates.occlusion import Shadow
from planning.verify.audit.predicates.predicates import (
    MEASURED,
    AuditCamera,
    AuditProjector,
)
from planning.verify.audit.predicates.recompute import (
    audit_cameras,
    audit_projectors,
    recompute,
)

_INCIDENCE = float(np.deg2rad(85.0))
# Below it hardly any label is right: study-reconstruction.md, section 3.2 [px].
_PITCH_PX = 3.0
# A decoder takes edges that recede faster along a ring for a step of depth: 65 degrees,
# or 5 degrees less than the incidence at which the plan counts on cameras.
_SLANT, _SLANT_MARGIN = float(np.deg2rad(65.0)), float(np.deg2rad(5.0))


def at_floors(requirements: Requirements) -> Requirements:
    """Return requirements with the limits at which light and edges fail in fact.

    Planning limits are stricter, for accuracy: incidence 85 degrees instead, no tangent
    limit, a pitch of 3 px, no limit on s_N or the sampling distance. |r.m| stays, since
    the decoder keeps it (formulation.md, section 7).
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


def possible_at_floors(
    plan: RigPlan, samples: AuditSamples, *, threads: int
) -> NDArray[np.bool_]:
    """Return whether each camera could measure each sample, shape (n_c, n)."""
    shadow = Shadow(plan.surface.mesh, threads=threads)
    pairs = recompute(plan, samples, shadow, at_floors(plan.requirements)).pairs
    steepest = plan.requirements.camera.max_incidence - _SLANT_MARGIN
    most = np.sin(max(steepest, _SLANT))
    possible = np.zeros(pairs.shape[1:], dtype=bool)
    for row, lamp in enumerate(audit_projectors(plan)):
        for column, eye in enumerate(audit_cameras(plan)):
            able = np.flatnonzero(pairs[row, column] == MEASURED)
            along = receding(lamp, eye, samples.take(able))
            possible[column, able[along <= most]] = True
    return possible


def receding(
    lamp: AuditProjector, eye: AuditCamera, samples: AuditSamples
) -> NDArray[np.float64]:
    """Return |r.T|, T = N x m / |N x m|: the sine of the slant along a ring, (n,)."""
    ring = in_frame(lamp.world_from_ring, samples.points)
    with np.errstate(divide="ignore", invalid="ignore"):
        m = in_world(lamp.world_from_ring, ring_gradient(ring, lamp.diverging))
        tangent = np.cross(samples.normals, m)
        tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    rays = samples.points - eye.world_from_device[:3, 3]
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    return np.abs(np.einsum("ij,ij->i", rays, tangent))
