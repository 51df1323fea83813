"""What a plan may claim: areas recomputed from its poses on fresh samples."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.repair.hollow import lies_inside
from planning.model.devices.planned import PlannedProjector
from planning.model.document.coverage_records import Areas, Coverage
from planning.rings.ring_pitch import widest_gap
from planning.scene.draws import DRAWS
from planning.scene.lighting import (
    assigned_projectors,
    first_failure,
    lit_margins,
)
from planning.scene.limits import camera_limits, projector_limits
from planning.scene.limits.projector_limits import LIT
from planning.scene.measuring.camera_views import view_of
from planning.scene.measuring.measured import widest_pixel
from planning.scene.placed_bodies import Blocker, Device, Obstruction, blocked_by
from planning.scene.samples import Target
from planning.scene.scene import Scene

from .error_budget import error_budget
from .judged import Devices, Judged, by_cause
from .region_claims import RegionClaim, RegionSamples, claim_regions

_BETWEEN_LIGHT = projector_limits.BLOCKED, projector_limits.OBSTRUCTED
_BETWEEN_VIEW = camera_limits.BLOCKED, camera_limits.OBSTRUCTED


# A point must be found within a ring gap, or so many pixels of the panel: at steps and
# borders a decoder leaves some out.
_TAU_PIXELS = 4.0


@dataclass(frozen=True, eq=False)
class Claims:
    """All that a plan claims about areas; those of devices are on the target [m²].

    Attributes:
        coverage: The plan's, without what would help.
        lit_area_m2: Area that each projector lights.
        min_margin_rad: Least margin over what each projector serves, None for nothing.
        seen_area_m2: Area that each camera measures.
        sole_area_m2: Area that only this camera measures.
        regions: Of each, in their order.
        target_samples: The samples behind the target's figures.
        measured_by: Which camera measures which of those, (n, n_cameras).
        region_samples: The samples behind the regions' figures.
    """

    coverage: Coverage
    lit_area_m2: tuple[float, ...]
    min_margin_rad: tuple[float | None, ...]
    seen_area_m2: tuple[float, ...]
    sole_area_m2: tuple[float, ...]
    regions: tuple[RegionClaim, ...]
    target_samples: Target
    measured_by: NDArray[np.bool_]
    region_samples: RegionSamples


def make_claims(scene: Scene, devices: Devices) -> Claims:
    """Recompute every area from poses as they will be written."""
    planned = scene.among((*devices.projectors, *devices.cameras))
    target = Judged.of(scene, devices, scene.target_samples(DRAWS.claims))
    surface = Judged.of(scene, devices, scene.surface_samples(DRAWS.claims))
    samples, area, seen = target.target, target.area, target.measured_by
    weight = samples.samples.weight
    unreachable = target.furthest < LIT
    inside = _inside(scene, samples.take(~target.lit).take(unreachable))
    coverage = Coverage(
        samples=len(samples),
        surface=_areas(surface),
        target=_areas(target),
        uncovered_by_cause=by_cause(target.causes(scene, devices), weight),
        unreachable_by_cause=by_cause(
            np.array(projector_limits.CAUSES)[target.furthest[unreachable]], weight
        ),
        unreachable_inside_m2=area(inside),
        sigma=error_budget(planned, devices, target),
    )
    coverage = coverage.changed(**_blocked(planned, devices, target))
    lit, margin = target.first == LIT, lit_margins(scene, devices.projectors, samples)
    served = assigned_projectors(lit, margin)
    region_samples = RegionSamples.of(scene, devices, target, margin)
    alone = seen & (seen.sum(axis=1) == 1)[:, None]
    return Claims(
        coverage,
        tuple(area(column) for column in lit.T),
        tuple(
            float(column[served == p].min()) if np.any(served == p) else None
            for p, column in enumerate(margin.T)
        ),
        tuple(area(column) for column in seen.T),
        tuple(area(column) for column in alone.T),
        claim_regions(devices, region_samples),
        samples,
        seen,
        region_samples,
    )


def tau_m(
    scene: Scene, projectors: Sequence[PlannedProjector], claims: Claims
) -> float:
    """Return within what distance of a sample the check must find a point [m]."""
    samples = claims.target_samples
    if scene.requirements.pattern == "rings":
        return round(widest_gap(scene, projectors, samples), 6)
    return round(_TAU_PIXELS * widest_pixel(scene, projectors, samples), 6)


def _areas(judged: Judged) -> Areas:
    return Areas(
        area_m2=judged.target.samples.weight * len(judged.target),
        reachable_by_projectors_m2=judged.area(judged.by_projectors),
        lit_m2=judged.area(judged.lit),
        reachable_by_cameras_m2=judged.area(judged.by_cameras),
        measured_m2=judged.area(judged.measured),
    )


def _blocked(
    scene: Scene, devices: Devices, target: Judged
) -> dict[str, dict[str, float]]:
    """Unmeasured area that bodies and obstacles keep light or a view from, by name.

    Where nothing else stops a device of the plan; of obstacles also where no reference
    projector lights it, and nothing else stops one. By key of `coverage`.
    """
    if not scene.bodies:
        return {}
    samples = target.target
    stopped = np.zeros((len(samples), len(scene.bodies)), dtype=bool)

    def note(
        device: Device, dark: NDArray[np.int64], bodies: Sequence[Blocker]
    ) -> None:
        points = samples.samples.points[dark]
        # Obstacles come first among all bodies.
        stopped[dark, : len(bodies)] |= blocked_by(bodies, device, points)

    for projector, first in zip(devices.projectors, target.first.T, strict=True):
        dark = ~target.measured & np.isin(first, _BETWEEN_LIGHT)
        note(projector, np.flatnonzero(dark), scene.bodies)
    pending = np.flatnonzero(~target.measured & target.lit)
    for camera in devices.cameras:
        first = view_of(scene, camera, samples.take(pending)).first_violated
        note(camera, pending[np.isin(first, _BETWEEN_VIEW)], scene.bodies)
    dark = np.flatnonzero(~target.lit)[target.furthest == projector_limits.OBSTRUCTED]
    # As in `furthest_lit`: a reference projector stands among no planned device.
    standing = scene.among(())
    for projector in devices.reference_projectors if len(dark) else ():
        first = first_failure(
            projector,
            samples.take(dark),
            scene.requirements.projector,
            scene.occlusion,
            bodies=standing.bodies,
        )
        obstructed = dark[first == projector_limits.OBSTRUCTED]
        note(projector, obstructed, scene.obstructions)
    blocked: dict[str, dict[str, float]] = {}
    every = (*devices.projectors, *devices.cameras)
    for body, column in zip(scene.bodies, stopped.T, strict=True):
        if isinstance(body, Obstruction):
            key, name = "blocked_by_obstacle_m2", body.name
        else:
            key, name = "blocked_by_body_m2", next(d.id for d in every if body.is_of(d))
        blocked.setdefault(key, {})[name] = target.area(column)
    return blocked


def _inside(scene: Scene, target: Target) -> NDArray[np.bool_]:
    """Which samples lie inside the body, where no pose can be expected to reach."""
    if not len(target):
        return np.zeros(0, dtype=bool)
    samples = target.samples
    return scene.in_run.recall(
        "lies_inside",
        (scene.mesh, samples.faces, samples.points),
        lambda: lies_inside(scene.visibility.caster, samples.faces, samples.points),
    )
