"""What one device more or fewer would change."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

from planning.model.document.coverage_records import CameraMarginal, ProjectorMarginal
from planning.model.planned import PlannedCamera, PlannedProjector
from planning.rings.ring_stage import RingStage
from planning.scene.scene import Scene

from .claims import Claims, Devices, lit_area, measured_area
from .partial_plan import PartialPlan

_D = TypeVar("_D")


def marginal_records(
    partial: PartialPlan, devices: Devices, claims: Claims
) -> tuple[ProjectorMarginal | CameraMarginal, ...]:
    """Return the plan's `marginal`: areas with 1, 2, ... devices of either kind."""
    # Rings are fine for the planned cameras; others would get their own.
    even, scene = _evenly_ringed(devices, partial.rings), partial.scene
    return (
        *_projector_table(scene, devices, partial.stage.by_count, claims),
        *_camera_table(scene, even, partial.camera_stage.by_count, claims),
    )


def _projector_table(
    scene: Scene,
    devices: Devices,
    by_count: Mapping[int, Sequence[PlannedProjector]],
    claims: Claims,
) -> tuple[ProjectorMarginal, ...]:
    """Return the lit areas with 1, 2, ... projectors, on the claims' own samples."""
    areas = _areas(
        by_count,
        len(devices.projectors),
        (claims.target.lit_m2, claims.surface.lit_m2),
        lambda projectors: lit_area(scene, projectors),
    )
    return tuple(
        ProjectorMarginal(n_projectors=n, lit_target_m2=target, lit_surface_m2=surface)
        for n, (target, surface) in areas.items()
    )


def _camera_table(
    scene: Scene,
    devices: Devices,
    by_count: Mapping[int, Sequence[PlannedCamera]],
    claims: Claims,
) -> tuple[CameraMarginal, ...]:
    """Return the measured areas with 1, 2, ... cameras, given the projectors."""
    areas = _areas(
        by_count,
        len(devices.cameras),
        (claims.target.measured_m2, claims.surface.measured_m2),
        lambda cameras: measured_area(scene, devices.projectors, cameras),
    )
    return tuple(
        CameraMarginal(
            n_cameras=n, measured_target_m2=target, measured_surface_m2=surface
        )
        for n, (target, surface) in areas.items()
    )


def _areas(
    by_count: Mapping[int, Sequence[_D]],
    planned: int,
    claimed: tuple[float, float],
    area_of: Callable[[Sequence[_D]], tuple[float, float]],
) -> dict[int, tuple[float, float]]:
    areas: dict[int, tuple[float, float]] = {}
    for n, devices in sorted(by_count.items()):
        target, surface = claimed if n == planned else area_of(devices)
        if n > planned:
            # A device added to the planned ones can't cover less than they do.
            target = max(target, areas[n - 1][0])
            surface = max(surface, areas[n - 1][1])
        areas[n] = (target, surface)
    return areas


def _evenly_ringed(devices: Devices, stage: RingStage | None) -> Devices:
    """Return the devices with evenly spaced rings, as for cameras not yet known."""
    if stage is None:
        return devices
    projectors = tuple(
        replace(projector, ring_radii=radii)
        for projector, radii in zip(devices.projectors, stage.even_radii, strict=True)
    )
    return replace(devices, projectors=projectors)
