"""Devices that stand already: from the rig file to candidates that are always taken."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from planning.model.bodies import Body
from planning.model.device_poses import ring_frame
from planning.model.planned import PlannedCamera, PlannedProjector
from planning.model.requirements import Requirements

_D = TypeVar("_D", PlannedProjector, PlannedCamera)


def existing_projectors(
    required: Requirements,
    template: PlannedProjector,
    ring_offset: tuple[float, float],
) -> tuple[PlannedProjector, ...]:
    """Return the projectors that stand already.

    Args:
        required: It lists them.
        template: Optics, light and rings.
        ring_offset: Tilt and azimuth of the ring axis, as `ring_frame` takes them.
    """
    return tuple(
        replace(
            template,
            world_from_device=pose,
            world_from_ring=ring_frame(pose, template.device, *ring_offset),
            existing=name,
            body=body,
        )
        for name, pose, body in _poses(required, "projector")
    )


def existing_cameras(
    required: Requirements, template: PlannedCamera
) -> tuple[PlannedCamera, ...]:
    """Return the cameras that stand already, of a template's optics."""
    return tuple(
        replace(template, world_from_device=pose, existing=name, body=body)
        for name, pose, body in _poses(required, "camera")
    )


def movable(devices: Sequence[_D]) -> list[_D]:
    """Return the devices that don't stand already."""
    return [device for device in devices if not device.existing]


def _poses(
    required: Requirements, kind: str
) -> list[tuple[str, NDArray[np.float64], Body | None]]:
    return [
        (device.name, np.array(device.world_from_device), device.body)
        for device in required.existing_of(kind)
    ]
