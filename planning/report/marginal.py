"""What one device more or fewer would change."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from planning.model.document.coverage_records import CameraMarginal, ProjectorMarginal
from planning.model.planned import PlannedCamera, PlannedProjector
from planning.rings.ring_stage import RingStage
from planning.scene.draws import DRAWS
from planning.scene.lighting import lit_stages
from planning.scene.limits.projector_limits import LIT
from planning.scene.measured import lit_samples, measured_by
from planning.scene.samples import Target
from planning.scene.scene import Scene

from .claims import Claims
from .judged import Devices
from .partial_plan import PartialPlan

_D = TypeVar("_D")
_Mask = NDArray[np.bool_]


def marginal_records(
    partial: PartialPlan, devices: Devices, claims: Claims
) -> tuple[ProjectorMarginal | CameraMarginal, ...]:
    """Return the plan's `marginal`: areas with 1, 2, ... devices of either kind."""
    scene, projectors = partial.scene, _evenly_ringed(devices, partial.rings)
    target, surface = claims.coverage.target, claims.coverage.surface

    def lit(lights: Sequence[PlannedProjector], samples: Target) -> _Mask:
        stages = lit_stages(scene.among(lights), lights, samples)
        return np.any(stages == LIT, axis=1)

    def measured(cameras: Sequence[PlannedCamera], samples: Target) -> _Mask:
        among = scene.among((*projectors, *cameras))
        light = lit_samples(among, projectors, samples)
        return np.any(measured_by(among, cameras, light), axis=1)

    def worst_region(n: int) -> tuple[int, float] | None:
        samples = claims.region_samples
        if n == len(devices.projectors):
            return samples.worst(samples.lit)
        return samples.worst(lit(partial.stage.by_count[n], samples.target))

    lights = _areas(
        scene,
        partial.stage.by_count,
        {len(devices.projectors): (target.lit_m2, surface.lit_m2)},
        lit,
    )
    views = _areas(
        scene,
        partial.camera_stage.by_count,
        {len(devices.cameras): (target.measured_m2, surface.measured_m2)},
        measured,
    )
    return (
        *(
            ProjectorMarginal(
                n_projectors=n,
                lit_target_m2=a,
                lit_surface_m2=b,
                worst_region=worst[0],
                worst_region_lit=worst[1],
            )
            for n, (a, b) in lights.items()
            for worst in (worst_region(n) or (None, None),)
        ),
        *(
            CameraMarginal(n_cameras=n, measured_target_m2=a, measured_surface_m2=b)
            for n, (a, b) in views.items()
        ),
    )


def _areas(
    scene: Scene,
    by_count: Mapping[int, Sequence[_D]],
    claimed: Mapping[int, tuple[float, float]],
    covered: Callable[[Sequence[_D], Target], _Mask],
) -> dict[int, tuple[float, float]]:
    """Covered areas of target and surface by the number of devices, [m²]."""
    sets = scene.target_samples(DRAWS.claims), scene.surface_samples(DRAWS.claims)
    areas: dict[int, tuple[float, float]] = {}
    for n, devices in sorted(by_count.items()):
        a, b = claimed.get(n) or (
            float(s.samples.weight * covered(devices, s).sum()) for s in sets
        )
        if n > max(claimed):
            # A device added to the planned ones can't cover less than they do.
            a, b = max(a, areas[n - 1][0]), max(b, areas[n - 1][1])
        areas[n] = (a, b)
    return areas


def _evenly_ringed(
    devices: Devices, stage: RingStage | None
) -> tuple[PlannedProjector, ...]:
    """The projectors with even rings: fine ones belong to the planned cameras."""
    if stage is None:
        return devices.projectors
    pairs = zip(devices.projectors, stage.even_radii, strict=True)
    return tuple(replace(projector, ring_radii=radii) for projector, radii in pairs)
