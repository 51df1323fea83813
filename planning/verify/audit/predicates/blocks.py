"""Bodies of devices, judged anew: what a straight line or another body meets.

A line from a to b misses a box about the origin iff its middle m and half way d leave
one of six directions free between them: for x, y and z ``|m_i| > h_i + |d_i|``, for the
products of the line with these ``|(m x d)_i| > h_j |d_k| + h_k |d_j|``. Two boxes share
a point iff an edge of one meets the other.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from geometry.devices import ParallelModel
from planning.model.bodies import Body
from planning.model.plan import RigPlan
from planning.model.planned import PlannedCamera, PlannedProjector
from planning.model.zones import Box
from planning.verify.audit.ledger import Ledger

from .audit_optics import in_frame
from .occlusion import Shadow

_Array = NDArray[np.float64]
_Device = PlannedProjector | PlannedCamera
# Positions are written to 0.01 mm, so bodies in contact may overlap by as much.
_SLACK_M = 2e-5
_POSE = 1e-9


@dataclass(frozen=True, eq=False)
class Block:
    """A solid box.

    Attributes:
        name: What messages call it.
        world_from_box: Its frame, the origin in its middle, shape (4, 4).
        half: Half of its sides [m], shape (3,).
    """

    name: str
    world_from_box: _Array
    half: _Array

    @property
    def corners(self) -> _Array:
        """Shape (8, 3) [m]; those whose numbers differ in one bit share an edge."""
        bits = (np.arange(8)[:, None] >> np.arange(3)) & 1
        local = (2.0 * bits - 1.0) * self.half
        return local @ self.world_from_box[:3, :3].T + self.world_from_box[:3, 3]

    @property
    def edges(self) -> tuple[_Array, _Array]:
        """Both ends of the twelve edges, (12, 3) each."""
        ends = [(i, i | 1 << k) for k in range(3) for i in range(8) if not i >> k & 1]
        first, last = np.array(ends).T
        return self.corners[first], self.corners[last]

    def meets(self, starts: _Array, ends: _Array) -> NDArray[np.bool_]:
        """Return which straight lines share a point with the box, shape (n,)."""
        a, b = (in_frame(self.world_from_box, p) for p in (starts, ends))
        middle, way = 0.5 * (a + b), 0.5 * (b - a)
        reach = np.abs(way)
        met = np.all(np.abs(middle) <= self.half + reach, axis=1)
        turned = np.abs(np.cross(middle, way))
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            met &= (
                turned[:, i]
                <= self.half[j] * reach[:, k] + self.half[k] * (reach[:, j])
            )
        return met

    def overlaps(self, other: "Block") -> bool:
        """Return whether two boxes share a point."""
        return bool(self.meets(*other.edges).any() or other.meets(*self.edges).any())

    def shrunk(self) -> "Block":
        """Return the box less what rounding a position may have added."""
        return replace(self, half=np.maximum(self.half - _SLACK_M, 0.0))


def block_of(device: _Device) -> Block | None:
    """Return a device's body in the world; None where it has none."""
    return _placed(device.id, device.body, device.world_from_device)


def blocks_beside(plan: RigPlan, own: _Device) -> tuple[Block, ...]:
    """Return the bodies of all devices of a plan but one."""
    every = (*plan.projectors, *plan.cameras)
    found = (block_of(device) for device in every if device.id != own.id)
    return tuple(block for block in found if block is not None)


def blocks_before(plan: RigPlan, kind: str, pose: _Array) -> tuple[Block, ...]:
    """Return the bodies among which a reference pose reaches what it does.

    Those of devices that stand already, and for a camera those of the projectors.

    Args:
        plan: The plan.
        kind: `projector` or `camera`.
        pose: Of the reference device; a device of its kind that stands there is itself.
    """
    cameras = [camera for camera in plan.cameras if camera.existing]
    projectors = [p for p in plan.projectors if kind == "camera" or p.existing]
    alike = projectors if kind == "projector" else cameras
    itself = {
        device.id
        for device in alike
        if np.abs(device.world_from_device - pose).max() <= _POSE
    }
    found = (block_of(d) for d in (*projectors, *cameras) if d.id not in itself)
    return tuple(block for block in found if block is not None)


def free_of(
    blocks: Sequence[Block], points: _Array, along: _Array, lengths: _Array
) -> NDArray[np.bool_]:
    """Return which segments that end at points (n, 3) meet no body, shape (n,)."""
    free = np.ones(len(points), dtype=bool)
    if len(points):
        for block in blocks:
            free &= ~block.meets(points - lengths[:, None] * along, points)
    return free


def way_to(device: _Device, points: _Array) -> _Array:
    """Return where light to points leaves a device, or views from them end, (n, 3)."""
    pose = device.world_from_device
    if isinstance(device.device, ParallelModel):
        local = in_frame(pose, points)
        local[:, 2] = 0.0
        return local @ pose[:3, :3].T + pose[:3, 3]
    return np.broadcast_to(pose[:3, 3], points.shape)


def audit_room(plan: RigPlan, shadow: Shadow, ledger: Ledger) -> None:
    """Check that bodies keep off each other, the object, the floor and the zones.

    Floor and zones don't bind devices that stand already.
    """
    devices = (*plan.projectors, *plan.cameras)
    blocks = [(device, block_of(device)) for device in devices]
    standing = [(d, block.shrunk()) for d, block in blocks if block is not None]
    for (_, one), (_, other) in combinations(standing, 2):
        ledger.holds(
            not one.overlaps(other),
            f"{one.name}.body",
            f"overlaps the body of {other.name}",
        )
    for device, block in standing:
        key = f"{device.id}.body"
        ledger.holds(
            not _touches(block, shadow), key, "touches the object; it must stand off it"
        )
        if not device.existing:
            _audit_zones(key, block, plan, ledger)


def _placed(name: str, body: Body | None, pose: _Array) -> Block | None:
    if body is None:
        return None
    frame = pose.copy()
    frame[:3, 3] += pose[:3, :3] @ np.array(body.centre_m)
    return Block(name, frame, np.array(body.half_m))


def _touches(block: Block, shadow: Shadow) -> bool:
    """An edge of the mesh meets the box, or an edge of the box a face of the mesh."""
    corners = shadow.caster.mesh.corners
    for k in range(3):
        if block.meets(corners[:, k], corners[:, (k + 1) % 3]).any():
            return True
    starts, ends = block.edges
    way = ends - starts
    length = np.linalg.norm(way, axis=1)
    # Of a body that rounding alone makes no edge is left.
    long = length > 0.0
    along = way[long] / length[long, None]
    _, distance = shadow.caster.first_hits(starts[long], along)
    return bool(np.any(distance <= length[long]))


def _audit_zones(key: str, block: Block, plan: RigPlan, ledger: Ledger) -> None:
    space = plan.requirements.workspace
    offsets = block.corners - np.array(space.centre)
    if space.floor_m is not None:
        lowest = float((offsets @ np.array(space.up)).min())
        ledger.holds(
            lowest >= space.floor_m,
            key,
            f"reaches {1e3 * (space.floor_m - lowest):.3g} mm below the floor",
        )
    if space.box is not None:
        room = _zone(space.box, plan)
        beyond = np.abs(in_frame(room.world_from_box, block.corners)) - room.half
        out = float(beyond.max())
        ledger.holds(
            out <= 0.0, key, f"reaches {1e3 * out:.3g} mm out of requirements' box"
        )
    for zone in space.keep_out:
        ledger.holds(
            not block.overlaps(_zone(zone, plan)),
            key,
            f"reaches into the keep-out volume {zone.name!r}",
        )


def _zone(zone: Box, plan: RigPlan) -> Block:
    frame = np.eye(4)
    frame[:3, :3] = np.array(zone.axes).T
    frame[:3, 3] = np.array(plan.requirements.workspace.centre) + zone.centre_m
    return Block(zone.name, frame, np.array(zone.half_m))
