"""What projectors light of samples: which limit fails first, and with what margin."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from geometry.poses import inverse, transform
from geometry.rays.rays import equal_parts
from planning.model.devices.planned import PlannedProjector
from planning.model.requirements import ProjectorLimits
from planning.scene.limits.limit import first_violated
from planning.scene.limits.projector_limits import (
    BLOCKED,
    LIT,
    OBSTRUCTED,
    OCCLUDED,
    PROJECTOR_LIMITS,
    ProjectorView,
)

from .lights import light_of
from .occlusion import Occlusion
from .placed_bodies import Blocker, blocked_by, first_blocked
from .samples import LightOnSamples, SampleColumns, Target
from .scene import Scene

# Projectors that a thread takes on at a time.
_SHARED = 32


def light_on(projector: PlannedProjector, target: Target) -> LightOnSamples:
    """Return the light of a projector at samples, wherever they are."""
    points, normals = target.samples.points, target.samples.normals
    light = light_of(projector.device)
    pose = projector.world_from_device
    directions = light.directions(pose, points)
    return LightOnSamples(
        -np.einsum("ij,ij->i", normals, directions),
        np.abs(np.einsum("ij,ij->i", target.steep, directions)),
        points - pose[:3, 3],
    )


def first_failure(
    projector: PlannedProjector,
    target: Target,
    limits: ProjectorLimits,
    occlusion: Occlusion | None,
    *,
    bodies: Sequence[Blocker] = (),
) -> NDArray[np.int8]:
    """Return the index in `CAUSES` of the first limit that fails; `LIT` if none does.

    Shape (n,). Without `occlusion`, that by the mesh is left out.
    """
    first = _ignoring_occlusion(projector, SampleColumns.of(target), limits)
    if occlusion is not None:
        clear = np.flatnonzero(first == LIT)
        hidden = _in_shadow(projector, target.take(clear), occlusion)
        first[clear[hidden]] = OCCLUDED
    _mark_blocked(first, projector, target.samples.points, bodies)
    return first


def stands_between(
    scene: Scene, projector: PlannedProjector, target: Target
) -> NDArray[np.bool_]:
    """Return from which samples surface or bodies keep the light, shape (n,)."""
    hidden = _in_shadow(projector, target, scene.occlusion)
    blocked = blocked_by(scene.bodies, projector, target.samples.points)
    return hidden | blocked.any(axis=1)


def _in_shadow(
    projector: PlannedProjector, target: Target, occlusion: Occlusion
) -> NDArray[np.bool_]:
    """Return which samples the surface hides from a projector, shape (n,)."""
    pose = projector.world_from_device
    along = light_of(projector.device).common_direction(pose)
    return occlusion.blocked(pose[:3, 3], target, along=along)


def lit_stages(
    scene: Scene, projectors: Sequence[PlannedProjector], target: Target
) -> NDArray[np.int8]:
    """Return what `first_failure` does of each sample (row) and projector (column)."""
    samples, limits = SampleColumns.of(target), scene.requirements.projector
    stages = np.empty((len(projectors), len(target)), dtype=np.int8)

    def fill(part: slice) -> None:
        scene.check_cancelled()
        for row in range(part.start, part.stop):
            stages[row] = _ignoring_occlusion(projectors[row], samples, limits)

    scene.occlusion.share(fill, equal_parts(len(projectors), _SHARED))
    first = np.ascontiguousarray(stages.T)
    for kind in {projector.light: None for projector in projectors}:
        alike = [i for i, p in enumerate(projectors) if p.light == kind]
        poses = np.stack([projectors[i].world_from_device for i in alike])
        lit = first[:, alike] == LIT
        seen = scene.occlusion.seen(
            poses[:, :3, 3],
            target,
            along=light_of(projectors[alike[0]].device).common_direction(poses),
            candidates=np.ascontiguousarray(lit.T),
        )
        shadowed = lit & ~seen.T
        first[:, alike] = np.where(shadowed, np.int8(OCCLUDED), first[:, alike])
    for column, projector in enumerate(projectors):
        _mark_blocked(first[:, column], projector, target.samples.points, scene.bodies)
    return first


def _ignoring_occlusion(
    projector: PlannedProjector, samples: SampleColumns, limits: ProjectorLimits
) -> NDArray[np.int8]:
    view = ProjectorView.of(projector, samples)
    return first_violated(PROJECTOR_LIMITS, view, limits, samples.points.shape[1])


def _mark_blocked(
    first: NDArray[np.int8],
    projector: PlannedProjector,
    points: NDArray[np.float64],
    bodies: Sequence[Blocker],
) -> None:
    """Mark lit samples (n,) whose light meets a body or an obstacle."""
    if not bodies:
        return
    lit = np.flatnonzero(first == LIT)
    limits = BLOCKED, OBSTRUCTED
    first[lit] = first_blocked(bodies, projector, points[lit], limits, LIT)


def margins(light: LightOnSamples, limits: ProjectorLimits) -> NDArray[np.float64]:
    """Return min(theta_max - incidence, tangent angle - tau_min) in [rad], shape (n,).

    Where T1 is arbitrary, only the first term counts.
    """
    incidence = np.arccos(np.clip(light.incidence_cos, -1.0, 1.0))
    margin = limits.max_incidence - incidence
    tangent = np.arccos(np.clip(light.tangent_cos, 0.0, 1.0)) - limits.min_tangent_angle
    # An arbitrary T1 is stored as zero, so its cosine is exactly 0.
    return np.where(light.tangent_cos > 0, np.minimum(margin, tangent), margin)


def lit_margins(
    scene: Scene,
    projectors: Sequence[PlannedProjector],
    target: Target,
    lit: NDArray[np.bool_] | None = None,
) -> NDArray[np.float64]:
    """Return the smaller margin of each sample (row) and projector (column) [rad].

    It is -inf where a projector doesn't light a sample, if `lit` says which do.
    """
    if lit is None:
        lit = np.ones((len(target), len(projectors)), dtype=bool)
    margin = np.full(lit.shape, -np.inf)
    for column, projector in enumerate(projectors):
        chosen = np.flatnonzero(lit[:, column])
        light = light_on(projector, target.take(chosen))
        margin[chosen, column] = margins(light, scene.requirements.projector)
    return margin


def assigned_projectors(
    lit: NDArray[np.bool_], margin: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Return the projector that each sample is assigned to, -1 where none lights it.

    Of both arrays, shape (n, n_projectors), the larger margin; the lower index on ties.
    """
    ranked = np.where(lit, margin, -np.inf)
    return np.where(lit.any(axis=1), np.argmax(ranked, axis=1), -1)


def in_panel(
    projector: PlannedProjector, points: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Return whether points lie in the light that leaves the device, shape (n,)."""
    local = transform(inverse(projector.world_from_device), points)
    return projector.device.in_field(local)
