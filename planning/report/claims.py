"""What a plan may claim: areas recomputed from its poses on fresh samples."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.repair.hollow import lies_inside
from planning.model.document.coverage_records import Areas
from planning.model.planned import PlannedCamera, PlannedProjector
from planning.scene import lighting
from planning.scene.camera_views import view_of
from planning.scene.draws import DRAWS
from planning.scene.lighting import lit_stages, margins_of
from planning.scene.limits import camera_limits, pair_limits, projector_limits
from planning.scene.limits.projector_limits import INCIDENCE, LIT
from planning.scene.measured import (
    LitSamples,
    furthest_failure,
    lit_samples,
    measured_by,
)
from planning.scene.obstructions import Obstruction
from planning.scene.placed_bodies import Device, blocked_by
from planning.scene.samples import Target
from planning.scene.scene import Scene


@dataclass(frozen=True, eq=False)
class Devices:
    """The devices of a plan and the reference sets that reachability refers to."""

    projectors: tuple[PlannedProjector, ...]
    cameras: tuple[PlannedCamera, ...]
    reference_projectors: tuple[PlannedProjector, ...]
    reference_cameras: tuple[PlannedCamera, ...]


@dataclass(frozen=True)
class RegionLight:
    """Projectors that samples of a region are assigned to, and its lit share."""

    lit_by: tuple[str, ...]
    lit_fraction: float


@dataclass(frozen=True, eq=False)
class Claims:
    """All that a plan claims about areas.

    Attributes:
        surface: Areas of the whole surface.
        target: Areas of the target.
        uncovered_by_cause: Target area that isn't measured, by cause [m²].
        unreachable_by_cause: Target area that no reference projector lights [m²].
        unreachable_inside_m2: The part of it that lies inside the body.
        lit_area_m2: Target area that each projector lights.
        min_margin_rad: Least margin over what each projector serves, None for nothing.
        seen_area_m2: Target area that each camera measures.
        sole_area_m2: Target area that only this camera measures.
        regions: `lit_by` and `lit_fraction` of each region.
        target_samples: The samples behind the target's figures.
        measured_by: Which camera measures which of those, (n, n_cameras).
        blocked_by_body_m2: Target area that isn't measured and from which the body of
            each device keeps light or a view.
        blocked_by_obstacle_m2: The same of each obstacle, and what it alone keeps all
            reference projectors from.
    """

    surface: Areas
    target: Areas
    uncovered_by_cause: dict[str, float]
    unreachable_by_cause: dict[str, float]
    unreachable_inside_m2: float
    lit_area_m2: tuple[float, ...]
    min_margin_rad: tuple[float | None, ...]
    seen_area_m2: tuple[float, ...]
    sole_area_m2: tuple[float, ...]
    regions: tuple[RegionLight, ...]
    target_samples: Target
    measured_by: NDArray[np.bool_]
    blocked_by_body_m2: dict[str, float]
    blocked_by_obstacle_m2: dict[str, float]


def make_claims(scene: Scene, devices: Devices) -> Claims:
    """Recompute every area from poses as they will be written."""
    planned = scene.among((*devices.projectors, *devices.cameras))
    target = scene.target_samples(DRAWS.claims)
    weight = target.samples.weight
    stages = lit_stages(planned, devices.projectors, target)
    lit = stages == LIT
    seen = _measured_by(planned, devices, target, lit)
    measured = _any(seen)
    reachable, furthest = _reachable_by_projectors(scene, devices, target, _any(lit))
    obstructed = ~reachable & (furthest == projector_limits.OBSTRUCTED)
    areas = _areas(scene, devices, target, reachable, lit, measured)
    served = lighting.assigned_projectors(
        lit, margins_of(scene, devices.projectors, target)
    )
    return Claims(
        _surface_areas(scene, devices),
        areas,
        _by_cause(_uncovered(planned, devices, target, stages, measured), weight),
        _by_cause(
            [projector_limits.CAUSES[stage] for stage in furthest[~reachable]], weight
        ),
        weight * _n_inside(scene, target.take(~reachable)),
        tuple(weight * lit.sum(axis=0)),
        _least_margins(scene, devices, target, served),
        tuple(weight * seen.sum(axis=0)),
        tuple(weight * (seen & (seen.sum(axis=1) == 1)[:, None]).sum(axis=0)),
        _regions(scene, devices, target, lit, served),
        target,
        seen,
        *_blocked(planned, devices, target, stages, measured, obstructed),
    )


def lit_area(
    scene: Scene, projectors: Sequence[PlannedProjector]
) -> tuple[float, float]:
    """Return the area of target and surface that projectors light, in [m²]."""
    among = scene.among(projectors)
    return _union(scene, lambda target: _lit(among, projectors, target))


def measured_area(
    scene: Scene,
    projectors: Sequence[PlannedProjector],
    cameras: Sequence[PlannedCamera],
) -> tuple[float, float]:
    """Return the area of target and surface that devices measure, in [m²]."""
    among = scene.among((*projectors, *cameras))

    def measured(target: Target) -> NDArray[np.bool_]:
        samples = lit_samples(among, projectors, target)
        return _any(measured_by(among, cameras, samples))

    return _union(scene, measured)


def _union(
    scene: Scene, covered: Callable[[Target], NDArray[np.bool_]]
) -> tuple[float, float]:
    sets = (
        scene.target_samples(DRAWS.claims),
        scene.surface_samples(DRAWS.claims),
    )
    a, b = (float(s.samples.weight * covered(s).sum()) for s in sets)
    return a, b


def _surface_areas(scene: Scene, devices: Devices) -> Areas:
    surface = scene.surface_samples(DRAWS.claims)
    planned = scene.among((*devices.projectors, *devices.cameras))
    lit = lit_stages(planned, devices.projectors, surface) == LIT
    measured = _any(_measured_by(planned, devices, surface, lit))
    reachable, _ = _reachable_by_projectors(scene, devices, surface, _any(lit))
    return _areas(scene, devices, surface, reachable, lit, measured)


def _areas(
    scene: Scene,
    devices: Devices,
    target: Target,
    reachable: NDArray[np.bool_],
    lit: NDArray[np.bool_],
    measured: NDArray[np.bool_],
) -> Areas:
    weight = target.samples.weight
    by_cameras = measured.copy()
    # Another camera needn't stand among those that were chosen.
    among = scene.among(devices.projectors)
    for camera in devices.reference_cameras:
        pending = np.flatnonzero(_any(lit) & ~by_cameras)
        if not len(pending):
            break
        samples = LitSamples.of(devices.projectors, target.take(pending), lit[pending])
        by_cameras[pending] = measured_by(among, [camera], samples)[:, 0]
    return Areas(
        area_m2=weight * len(target),
        reachable_by_projectors_m2=weight * int(reachable.sum()),
        lit_m2=weight * int(_any(lit).sum()),
        reachable_by_cameras_m2=weight * int(by_cameras.sum()),
        measured_m2=weight * int(measured.sum()),
    )


def _lit(
    scene: Scene, projectors: Sequence[PlannedProjector], target: Target
) -> NDArray[np.bool_]:
    return _any(lit_stages(scene, projectors, target) == LIT)


def _measured_by(
    scene: Scene, devices: Devices, target: Target, lit: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    return measured_by(
        scene, devices.cameras, LitSamples.of(devices.projectors, target, lit)
    )


def _reachable_by_projectors(
    scene: Scene, devices: Devices, target: Target, lit: NDArray[np.bool_]
) -> tuple[NDArray[np.bool_], NDArray[np.int8]]:
    """Which samples some pose lights, and how far the others came over all poses."""
    reachable = lit.copy()
    furthest = np.zeros(len(target), dtype=np.int8)
    for projector in devices.reference_projectors:
        pending = np.flatnonzero(~reachable)
        if not len(pending):
            break
        dark = target.take(pending)
        # What shows its back comes no further than it did before.
        idle = furthest[pending] >= INCIDENCE
        idle &= lighting.shows_back(projector, dark)
        pending, dark = pending[~idle], dark.take(~idle)
        stage = lighting.first_failure(
            projector,
            dark,
            scene.requirements.projector,
            scene.visibility,
            bodies=scene.bodies,
        )
        reachable[pending] = stage == LIT
        furthest[pending] = np.maximum(furthest[pending], stage)
    return reachable, furthest


def _least_margins(
    scene: Scene, devices: Devices, target: Target, served: NDArray[np.int64]
) -> tuple[float | None, ...]:
    margin = margins_of(scene, devices.projectors, target)
    return tuple(
        float(margin[served == p, p].min()) if np.any(served == p) else None
        for p in range(len(devices.projectors))
    )


def _uncovered(
    scene: Scene,
    devices: Devices,
    target: Target,
    stages: NDArray[np.int8],
    measured: NDArray[np.bool_],
) -> list[str]:
    """The cause of each sample that isn't measured."""
    lit = stages == LIT
    dark = ~_any(lit)
    causes = [projector_limits.CAUSES[stage] for stage in stages[dark].max(axis=1)]
    pending = np.flatnonzero(_any(lit) & ~measured)
    samples = LitSamples.of(devices.projectors, target.take(pending), lit[pending])
    furthest = furthest_failure(scene, devices.cameras, samples)
    return causes + [pair_limits.CAUSES[stage] for stage in furthest]


def _blocked(
    scene: Scene,
    devices: Devices,
    target: Target,
    stages: NDArray[np.int8],
    measured: NDArray[np.bool_],
    obstructed: NDArray[np.bool_],
) -> tuple[dict[str, float], dict[str, float]]:
    """Unmeasured area that each body, and each obstacle, keeps light or a view from.

    Of bodies and obstacles alike where nothing else stops a device of the plan; of
    obstacles also where nothing else stops a reference projector, and none lights it.

    Args:
        scene: With the bodies of the plan.
        devices: The plan's, and the reference sets.
        target: Samples.
        stages: First limit that fails of each projector, shape (n, n_projectors).
        measured: Shape (n,).
        obstructed: Samples at which an obstacle is what stops reference projectors.
    """
    if not scene.bodies:
        return {}, {}
    stopped = np.zeros((len(target), len(scene.bodies)), dtype=bool)

    def note(device: Device, samples: NDArray[np.int64]) -> None:
        points = target.samples.points[samples]
        stopped[samples] |= blocked_by(scene.bodies, device, points)

    for p, projector in enumerate(devices.projectors):
        dark = stages[:, p] >= projector_limits.BLOCKED
        note(projector, np.flatnonzero(~measured & dark & (stages[:, p] < LIT)))
    pending = np.flatnonzero(~measured & _any(stages == LIT))
    for camera in devices.cameras:
        stage = view_of(scene, camera, target.take(pending)).first_violated
        between = camera_limits.BLOCKED, camera_limits.OBSTRUCTED
        note(camera, pending[np.isin(stage, between)])
    limits, dark = scene.requirements.projector, np.flatnonzero(obstructed)
    for projector in devices.reference_projectors if len(dark) else ():
        stage = lighting.first_failure(
            projector,
            target.take(dark),
            limits,
            scene.visibility,
            bodies=scene.obstructions,
        )
        note(projector, dark[stage == projector_limits.OBSTRUCTED])
    areas = (target.samples.weight * stopped.sum(axis=0)).tolist()
    every = (*devices.projectors, *devices.cameras)
    by_body: dict[str, float] = {}
    by_obstacle: dict[str, float] = {}
    for body, area in zip(scene.bodies, areas, strict=True):
        if isinstance(body, Obstruction):
            by_obstacle[body.name] = area
        else:
            by_body[next(d.id for d in every if body.is_of(d))] = area
    return by_body, by_obstacle


def _n_inside(scene: Scene, target: Target) -> int:
    """How many samples lie inside the body, where no pose can be expected to reach."""
    if not len(target):
        return 0
    samples = target.samples
    caster = scene.visibility.caster
    return int(lies_inside(caster, samples.faces, samples.points).sum())


def _any(table: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether any column holds, for each row."""
    return np.asarray(np.any(table, axis=1))


def _by_cause(causes: list[str], weight: float) -> dict[str, float]:
    order = dict.fromkeys(projector_limits.CAUSES + pair_limits.CAUSES)
    return {c: weight * causes.count(c) for c in order if c in causes}


def _regions(
    scene: Scene,
    devices: Devices,
    target: Target,
    lit: NDArray[np.bool_],
    served: NDArray[np.int64],
) -> tuple[RegionLight, ...]:
    region = scene.region[target.samples.faces]
    lights: list[RegionLight] = []
    for index in range(int(scene.region.max()) + 1):
        inside = region == index
        by = np.unique(served[inside & (served >= 0)])
        share = float(lit[inside].any(axis=1).mean()) if inside.any() else 0.0
        lights.append(RegionLight(tuple(devices.projectors[p].id for p in by), share))
    return tuple(lights)
