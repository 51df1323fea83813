"""Which limits of where devices may stand those of an evaluated rig break."""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from geometry.poses import inverse, transform
from geometry.shapes.boxes import box_gap
from planning.model.devices.bodies import Box
from planning.model.document.device_records import Limit, ViolationRecord
from planning.model.requirements import Workspace
from planning.scene.placed_bodies import (
    Device,
    bodies_of,
    collide,
    kind_of,
    placed_box,
    touches_mesh,
)
from planning.scene.scene import Scene
from planning.scene.workspace.admissible import broken_by_body

# Positions are measured and typed to so much: what is broken by less is kept [m].
_TYPED_M = 1e-4


def violations(scene: Scene, devices: Sequence[Device]) -> tuple[ViolationRecord, ...]:
    """Return what devices with ids break, device by device."""
    return tuple(
        record
        for place, device in enumerate(devices)
        for record in (
            *_of_position(scene, device),
            *_of_body(scene, device, devices[:place]),
        )
    )


def _of_position(scene: Scene, device: Device) -> Iterator[ViolationRecord]:
    space = scene.requirements.workspace
    offset = device.world_from_device[:3, 3] - np.array(space.centre)
    shell = getattr(space, f"{kind_of(device)}_radius_m")
    for limit, what, by_m in _excesses(space, shell, offset):
        if by_m > _TYPED_M:
            yield ViolationRecord(device=device.id, limit=limit, what=what, by_m=by_m)
    for what, by_m in _out(scene, device):
        if by_m > _TYPED_M:
            yield ViolationRecord(device=device.id, limit="range", what=what, by_m=by_m)


def _excesses(
    space: Workspace, shell: tuple[float, float], offset: NDArray[np.float64]
) -> Iterator[tuple[Limit, str, float]]:
    """Each limit of a position, its zone, and how far it is broken [m]; <= 0 if kept.

    A zone is left by the farthest face, and entered by the nearest one.
    """
    distance = float(np.linalg.norm(offset))
    yield "standoff", "too near", shell[0] - distance
    yield "standoff", "too far", distance - shell[1]
    along = float(offset @ np.array(space.axis))
    across = float(np.linalg.norm(offset - along * np.array(space.axis)))
    beyond = float(np.arctan2(across, along)) - space.half_angle
    yield "cone", "", beyond * distance
    if space.floor_m is not None:
        yield "floor", "", space.floor_m - float(offset @ np.array(space.up))
    if space.box is not None:
        yield "box", space.box.name, _beyond(space.box, offset)
    if space.mounting:
        names = " or ".join(plane.name for plane in space.mounting)
        yield "mounting", names, min(_beyond(p, offset) for p in space.mounting)
    for zone in space.keep_out:
        yield "keep_out", zone.name, -_beyond(zone, offset)


def _beyond(box: Box, offset: NDArray[np.float64]) -> float:
    """How far a position lies beyond the faces of a box, negative inside [m]."""
    local = np.array(box.axes) @ (offset - np.array(box.centre_m))
    return float(np.max(np.abs(local) - np.array(box.half_m)))


def _out(scene: Scene, device: Device) -> Iterator[tuple[str, float]]:
    """How far out of a device's range the whole object lies [m]; <= 0 if not all."""
    local = transform(inverse(device.world_from_device), scene.mesh.vertices)
    lengths = np.linalg.norm(local - device.device.ray_starts(local), axis=1)
    low, high = device.device.range_m
    yield "too near", low - float(lengths.max())
    yield "too far", float(lengths.min()) - high


def _of_body(
    scene: Scene, device: Device, earlier: Sequence[Device]
) -> Iterator[ViolationRecord]:
    """What the housing touches or reaches into; of two devices the later one's."""
    if device.body is None:
        return
    box = placed_box(device.body, device.world_from_device)
    names = ["the object"] if touches_mesh(box, scene.mesh) else []
    names += broken_by_body(scene.requirements.workspace, box)
    bodies, apart = bodies_of(earlier), scene.requirements.workspace.clearance_m
    others = (*scene.obstructions, *bodies)
    names += [body.words for body in collide(device, others, 0.0)]
    for name in names:
        yield ViolationRecord(device=device.id, limit="body", what=name, by_m=None)
    for body in bodies:
        by_m = apart - box_gap(box, body.box)
        if body.words not in names and by_m > _TYPED_M:
            yield ViolationRecord(
                device=device.id, limit="clearance", what=body.words, by_m=by_m
            )
