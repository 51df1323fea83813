"""What stands in the way of light and sight: the surface itself, and bodies.

A line from a to b misses a box about the origin iff its middle m and half way d leave
one of six directions free between them: for x, y and z ``|m_i| > h_i + |d_i|``, for the
products of the line with these ``|(m x d)_i| > h_j |d_k| + h_k |d_j|``. Two boxes share
a point iff an edge of one meets the other.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from scipy.optimize import lsq_linear

from geometry.arrays import Array, Ints, Mask
from geometry.mesh.mesh import TriangleMesh
from geometry.rays.rays import RayCaster
from planning.model.devices.bodies import Box, Obstacle
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.plan import RigPlan

_Device = PlannedProjector | PlannedCamera
# Positions are written to 0.01 mm, so bodies in contact may overlap by as much.
_SLACK_M = 2e-5
_POSE = 1e-9


@dataclass(frozen=True, eq=False)
class Block:
    """A solid box.

    Attributes:
        name: What messages call it.
        turn: Its axes, the columns of a rotation.
        middle: In the world [m], shape (3,).
        half: Half of its sides [m], shape (3,).
    """

    name: str
    turn: Array
    middle: Array
    half: Array

    def local(self, points: Array) -> Array:
        """Return points (n, 3) in the frame of its axes, from its middle."""
        return (points - self.middle) @ self.turn

    @property
    def corners(self) -> Array:
        """Shape (8, 3) [m]; those whose numbers differ in one bit share an edge."""
        bits = (np.arange(8)[:, None] >> np.arange(3)) & 1
        local = (2.0 * bits - 1.0) * self.half
        return local @ self.turn.T + self.middle

    @property
    def edges(self) -> tuple[Array, Array]:
        """Both ends of the twelve edges, (12, 3) each."""
        ends = [(i, i | 1 << k) for k in range(3) for i in range(8) if not i >> k & 1]
        first, last = np.array(ends).T
        return self.corners[first], self.corners[last]

    def meets(self, starts: Array, ends: Array) -> Mask:
        """Return which straight lines share a point with the box, shape (n,)."""
        a, b = self.local(starts), self.local(ends)
        middle, way = 0.5 * (a + b), 0.5 * (b - a)
        reach = np.abs(way)
        met = np.all(np.abs(middle) <= self.half + reach, axis=1)
        turned = np.abs(np.cross(middle, way))
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            across = self.half[j] * reach[:, k] + self.half[k] * reach[:, j]
            met &= turned[:, i] <= across
        return met

    def overlaps(self, other: "Block") -> bool:
        """Return whether two boxes share a point."""
        return bool(self.meets(*other.edges).any() or other.meets(*self.edges).any())

    def gap(self, other: "Block") -> float:
        """Return the distance of the nearest points of two boxes [m].

        The least |x - y| over x = a + A u in one and y = b + B v in the other is a
        least-squares problem with bounds, |u| and |v| at most half their sides.
        """
        system = np.hstack([self.turn, -other.turn])
        reach = np.concatenate([self.half, other.half])
        found = lsq_linear(system, other.middle - self.middle, (-reach, reach))
        return float(np.sqrt(2.0 * found.cost))

    def moved(self, pose: Array) -> "Block":
        """Return the box where a pose (4, 4) takes it."""
        middle = pose[:3, :3] @ self.middle + pose[:3, 3]
        return replace(self, turn=pose[:3, :3] @ self.turn, middle=middle)

    def shrunk(self) -> "Block":
        """Return the box less what rounding a position may have added."""
        return replace(self, half=np.maximum(self.half - _SLACK_M, 0.0))


def block_of(device: _Device) -> Block | None:
    """Return a device's body in the world; None where it has none."""
    if device.body is None:
        return None
    turn, origin = device.world_from_device[:3, :3], device.world_from_device[:3, 3]
    middle = origin + turn @ np.array(device.body.centre_m)
    return Block(device.id, turn, middle, np.array(device.body.half_m))


def block_of_zone(zone: Box, centre: Array) -> Block:
    """Return a zone in the frame in which the workspace's centre is at `centre`."""
    middle, turn = centre + zone.centre_m, np.array(zone.axes).T
    return Block(zone.name, turn, middle, np.array(zone.half_m))


def bodies_but(plan: RigPlan, device: _Device) -> tuple[Block, ...]:
    """Return the bodies of all devices of a plan but one, that stand where it does."""
    every = (*plan.projectors, *plan.cameras)
    return _bodies(
        other
        for other in every
        if other.id != device.id and other.station in ("", device.station)
    )


def bodies_about(plan: RigPlan, kind: str, pose: Array) -> tuple[Block, ...]:
    """Return the bodies among which a reference pose covers what it does.

    Those of existing devices, and for a camera those of the projectors, at no station.
    A device that stands at the pose is itself.
    """
    projectors = [p for p in plan.projectors if kind == "camera" or p.existing]
    standing = [*projectors, *(camera for camera in plan.cameras if camera.existing)]
    return _bodies(
        d
        for d in standing
        if not d.station and np.abs(d.world_from_device - pose).max() > _POSE
    )


class Hindrance:
    """An obstacle: what no light and no view passes.

    With a `station` it is in the way of that station's devices alone.

    Args:
        obstacle: The plan's.
        threads: Worker threads of the ray caster.
    """

    def __init__(self, obstacle: Obstacle, *, threads: int) -> None:
        self.name, self.station = obstacle.name, obstacle.station
        self.caster = RayCaster(obstacle.mesh, threads=threads)

    def meets(self, starts: Array, ends: Array) -> Mask:
        """Return which straight lines meet it more than 0.02 mm before their ends."""
        return _hits(self.caster, starts, ends, _SLACK_M)


def free_of(
    blocks: Sequence[Block | Hindrance], points: Array, along: Array, lengths: Array
) -> Mask:
    """Return which segments that end at points (n, 3) meet none of them, (n,)."""
    free = np.ones(len(points), dtype=bool)
    if len(points):
        for block in blocks:
            free &= ~block.meets(points - lengths[:, None] * along, points)
    return free


def touches(block: Block, caster: RayCaster) -> bool:
    """Return whether a body meets a mesh: an edge of either a face of the other."""
    corners = caster.mesh.corners
    for k in range(3):
        if block.meets(corners[:, k], corners[:, (k + 1) % 3]).any():
            return True
    return bool(_hits(caster, *block.edges, 0.0).any())


def _hits(caster: RayCaster, starts: Array, ends: Array, slack: float) -> Mask:
    """Whether lines meet a mesh and the slack [m] before their ends, (n,)."""
    way = ends - starts
    length = np.linalg.norm(way, axis=1)
    # Of a body that rounding alone makes no edge is left.
    along = way / np.where(length > 0.0, length, 1.0)[:, None]
    _, distance = caster.first_hits(starts, along)
    return (length > 0.0) & (distance <= length - slack)


def _bodies(devices: Iterable[_Device]) -> tuple[Block, ...]:
    blocks = (block_of(device) for device in devices)
    return tuple(block for block in blocks if block is not None)


# In units of the object's radius: 80 roundings of the float32 that rays are cast in.
_SLACK = 1e-5


class Shadow:
    """Tests segments against one mesh.

    A ray starts where its segment enters the sphere about the object (or at the device,
    if that stands inside), so that its length, and with it every rounding error, is in
    proportion to the object whatever the distance of the device. The segment is free if
    the first face met is the sample's own, or lies no nearer than the sample less 1e-5
    of the object's radius, or if nothing is met.

    Args:
        mesh: The occluder.
        threads: Worker threads of the ray caster.
        obstacles: In the way of every device, or of those of a station.

    Attributes:
        slack_m: Nearer to a sample nothing blocks.
    """

    def __init__(
        self, mesh: TriangleMesh, *, threads: int, obstacles: Sequence[Obstacle] = ()
    ) -> None:
        self.hindrances = [Hindrance(each, threads=threads) for each in obstacles]
        self.caster = RayCaster(mesh, threads=threads)
        self._centre = mesh.centre
        self._radius = 1.05 * mesh.reach
        self.slack_m = _SLACK * mesh.radius

    @classmethod
    def of(cls, plan: RigPlan, *, threads: int) -> Self:
        """Return what stands in the way about a plan's object, but devices."""
        surface = plan.surface
        return cls(surface.mesh, threads=threads, obstacles=surface.obstacles)

    def about(self, station: str) -> list[Hindrance]:
        """Return the obstacles in the way of devices of a station; "": of none."""
        return [one for one in self.hindrances if one.station in ("", station)]

    def free(self, points: Array, faces: Ints, along: Array, lengths: Array) -> Mask:
        """Return whether segments (n,) along unit directions are free.

        They end at samples of the mesh, whose faces are known.
        """
        if len(points) == 0:
            return np.zeros(0, dtype=bool)
        offset = points - self._centre
        b = np.einsum("ij,ij->i", offset, along)
        inside = self._radius**2 - np.einsum("ij,ij->i", offset, offset)
        back = np.minimum(lengths, b + np.sqrt(b * b + inside))
        hit, distance = self.caster.first_hits(points - back[:, None] * along, along)
        return (hit == faces) | (distance >= back - self.slack_m)
