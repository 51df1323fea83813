"""What each limit must be, all others as they are, for samples to be lit or measured.

A sample that exactly one limit forbids asks something of that limit; one that two
forbid is helped by neither alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.scene.lighting import stands_between
from planning.scene.limits.camera_limits import (
    CAMERA_LIMITS,
    SEEN,
    CameraRays,
    ViewedSamples,
)
from planning.scene.limits.limit import LimitRelaxation, violated
from planning.scene.limits.pair_limits import CAUSES, PAIR_LIMITS
from planning.scene.limits.projector_limits import CAUSES as PROJECTOR_CAUSES
from planning.scene.limits.projector_limits import PROJECTOR_LIMITS, ProjectorView
from planning.scene.measuring import measurability
from planning.scene.measuring.measured import LitSamples, pairs_of
from planning.scene.samples import SampleColumns, Target
from planning.scene.scene import Scene


@dataclass(frozen=True, eq=False)
class Demands:
    """One camera and every projector on n lit samples.

    Attributes:
        furthest: Index in `CAUSES` of the limit at which the sample comes furthest,
            `MEASURED` where it is measured, shape (n,).
        demanded: What a sample asks of each relaxation: -inf where it is measured as it
            is, inf where the relaxation alone doesn't help, shape (n_relaxations, n).
    """

    furthest: NDArray[np.int8]
    demanded: NDArray[np.float64]


def light_demands(
    scene: Scene,
    projector: PlannedProjector,
    target: Target,
    relaxations: Sequence[LimitRelaxation],
) -> NDArray[np.float64]:
    """Return what samples ask of a projector's limits, shape (n_relaxations, n).

    It is inf where another limit fails as well, or something stands in between.
    """
    scene.check_cancelled()
    rules = scene.requirements.projector
    view = ProjectorView.of(projector, SampleColumns.of(target))
    failed = violated(PROJECTOR_LIMITS, view, rules, len(target))
    demanded = np.empty((len(relaxations), len(target)))
    for k, relaxation in enumerate(relaxations):
        others = np.delete(failed, PROJECTOR_CAUSES.index(relaxation.cause), axis=0)
        demanded[k] = np.where(others.any(axis=0), np.inf, relaxation.ask(view))
    near = np.flatnonzero(np.isfinite(demanded).any(axis=0))
    demanded[:, near[stands_between(scene, projector, target.take(near))]] = np.inf
    return demanded


def demands(
    scene: Scene,
    camera: PlannedCamera,
    samples: LitSamples,
    relaxations: Sequence[LimitRelaxation],
) -> Demands:
    """Return what lit samples ask of the limits at a camera's pose."""
    scene.check_cancelled()
    required, target = scene.requirements, samples.target
    rays = CameraRays.of(camera, target)
    failed = violated(CAMERA_LIMITS, rays, required.camera, len(target))
    causes = [CAUSES.index(relaxation.cause) for relaxation in relaxations]
    asks = np.full((len(relaxations), len(target)), np.inf)
    for k, (cause, relaxation) in enumerate(zip(causes, relaxations, strict=True)):
        if cause < SEEN:
            asks[k] = np.where(failed[cause], relaxation.ask(rays), np.inf)
    seen = np.logical_not(failed.any(axis=0))
    furthest = np.where(seen, SEEN, np.argmax(failed, axis=0)).astype(np.int8)
    # Where no camera limit fails, or one alone that may give way so far.
    hopeful = (failed.sum(axis=0) == 1) & np.isfinite(asks).any(axis=0)
    near = np.flatnonzero(hopeful | (furthest >= measurability.OCCLUDED))
    between = measurability.first_between(
        camera, target.take(near), scene.occlusion, scene.bodies
    )
    furthest[near] = np.minimum(furthest[near], between)
    near = near[(between == SEEN) & (hopeful | seen)[near]]
    demanded = np.full_like(asks, np.inf)
    view = _viewed(camera, CameraRays.of(camera, target.take(near)))
    for pair in pairs_of(required.triangulation, samples, view, samples=near):
        indices, quality = pair.samples, pair.quality
        beyond = indices[seen[indices]]
        furthest[beyond] = np.maximum(
            furthest[beyond], pair.first_violated[seen[indices]]
        )
        of_pair = violated(PAIR_LIMITS, quality, required.triangulation, len(indices))
        table = np.concatenate([failed[:, indices], of_pair])
        count = table.sum(axis=0)
        demanded[:, indices[count == 0]] = -np.inf
        for k, (cause, relaxation) in enumerate(zip(causes, relaxations, strict=True)):
            alone = table[cause] & (count == 1)
            ask = asks[k, indices] if cause < SEEN else relaxation.ask(quality)
            least = np.minimum(demanded[k, indices], ask)
            demanded[k, indices] = np.where(alone, least, demanded[k, indices])
    return Demands(furthest, demanded)


def _viewed(camera: PlannedCamera, rays: CameraRays) -> ViewedSamples:
    """The view of samples, as if no limit forbade any."""
    turn = camera.world_from_device[:3, :3]
    return ViewedSamples(
        np.full(len(rays.distances), SEEN, dtype=np.int8),
        rays.rays,
        rays.distances,
        rays.facing,
        turn @ camera.device.ray_jacobian(rays.local),
        camera.device.project(rays.local) - camera.device.camera_matrix[:2, 2],
        station=camera.station,
    )
