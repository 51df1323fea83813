"""What light and views meet but the object: bodies of devices, and obstacles.

A body blocks the beams and the views of every device but its own; an obstacle blocks
all. What stands at a station is in the way of devices of that station alone.

Light leaves a point, or in parallel light the plane of the panel, and ends at the
sample.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from geometry.mesh.mesh import TriangleMesh
from geometry.poses import inverse, transform
from geometry.rays.rays import RayCaster
from geometry.shapes.boxes import (
    OrientedBox,
    box_gap,
    boxes_overlap,
    lines_cross,
    triangles_touch,
)
from planning.model.devices.bodies import Body, Existing, Obstacle
from planning.model.devices.device_poses import moved_to
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.requirements import Requirements

Device = PlannedProjector | PlannedCamera
Kind = Literal["projector", "camera"]
_D = TypeVar("_D", PlannedProjector, PlannedCamera)

# What is planned stays this far apart: positions are rounded to 0.01 mm afterwards.
CLEARANCE_M = 1e-4
# Samples of a surface that lies on an obstacle's don't meet it there: in half diagonals
# of the object, as `geometry.rays.visibility` has it.
_CONTACT = 2e-6


@dataclass(frozen=True, eq=False)
class Obstruction:
    """An obstacle that light and views meet, unless within `contact_m` of a sample."""

    name: str
    mesh: TriangleMesh
    contact_m: float
    threads: int | None = None
    station: str = ""

    @classmethod
    def about(
        cls, mesh: TriangleMesh, obstacles: Iterable[Obstacle], threads: int
    ) -> tuple["Obstruction", ...]:
        """Return what stands about an object."""
        low, high = mesh.bounds
        contact = _CONTACT * 0.5 * float(np.linalg.norm(high - low))
        return tuple(
            cls(each.name, each.mesh, contact, threads, each.station)
            for each in obstacles
        )

    @property
    def words(self) -> str:
        """What messages call it."""
        return f"obstacle {self.name!r}"

    def concerns(self, device: Device) -> bool:
        """Return whether it is in the way of a device: it stands where that does."""
        return self.station in ("", device.station)

    def crossed(
        self, starts: NDArray[np.float64], points: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        """Return which lines from starts, (n, 3) or (3,), to points meet it, (n,)."""
        ways = starts - points
        lengths = np.linalg.norm(ways, axis=1)
        along = ways / np.where(lengths > 0.0, lengths, 1.0)[:, None]
        begin = points + self.contact_m * along
        reach = np.maximum(lengths - self.contact_m, 0.0)
        return self._caster.occluded(begin, along, reach)

    def touches(self, box: OrientedBox) -> bool:
        """Return whether a box shares a point with its surface."""
        return touches_mesh(box, self.mesh)

    @cached_property
    def _caster(self) -> RayCaster:
        return RayCaster(self.mesh, threads=self.threads)


def touches_mesh(box: OrientedBox, mesh: TriangleMesh) -> bool:
    """Return whether a box shares a point with a surface."""
    low, high = mesh.bounds
    near = (box.centre - box.radius <= high) & (box.centre + box.radius >= low)
    return bool(near.all() and triangles_touch(box, mesh.corners).any())


@dataclass(frozen=True, eq=False)
class PlacedBody:
    """A body in the world, with kind, pose and name (if it has one) of its device.

    `stands` says whether the device stands already; `station` is the device's.
    """

    kind: str
    world_from_device: NDArray[np.float64]
    box: OrientedBox
    name: str = ""
    stands: bool = False
    station: str = ""

    @property
    def words(self) -> str:
        """What messages call it."""
        return f"the body of {self.name or 'another device'}"

    def is_of(self, device: Device) -> bool:
        """Return whether this is a device's own body."""
        return self.kind == kind_of(device) and np.array_equal(
            self.world_from_device, device.world_from_device
        )

    def concerns(self, device: Device) -> bool:
        """Return whether it is in a device's way: another's, that stands there too."""
        return self.station in ("", device.station) and not self.is_of(device)

    def crossed(
        self, starts: NDArray[np.float64], points: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        """Return which straight lines to points (n, 3) meet it, shape (n,)."""
        return lines_cross(self.box, starts, points)

    def touches(self, box: OrientedBox) -> bool:
        """Return whether it shares a point with a box."""
        return boxes_overlap(box, self.box)


Blocker = PlacedBody | Obstruction


def kind_of(device: Device) -> Kind:
    """Return `projector` or `camera`."""
    return "projector" if isinstance(device, PlannedProjector) else "camera"


def placed_box(body: Body, world_from_device: NDArray[np.float64]) -> OrientedBox:
    """Return a body in the world."""
    turn, origin = world_from_device[:3, :3], world_from_device[:3, 3]
    centre = origin + turn @ np.array(body.centre_m)
    return OrientedBox(centre, turn.T, np.array(body.half_m))


def bodies_of(devices: Iterable[Device]) -> tuple[PlacedBody, ...]:
    """Return the bodies of the devices that have one."""
    return tuple(
        PlacedBody(
            kind_of(device),
            device.world_from_device,
            placed_box(device.body, device.world_from_device),
            device.id or device.existing,
            bool(device.existing),
            device.station,
        )
        for device in devices
        if device.body is not None
    )


def moves_bodies(devices: Iterable[Device]) -> bool:
    """Return whether any device that doesn't stand already has a body."""
    return any(d.body is not None and not d.existing for d in devices)


def existing_devices(required: Requirements, templates: Sequence[_D]) -> tuple[_D, ...]:
    """Return the devices of a kind that stand already, like their models'."""

    def placed(device: Existing) -> _D:
        pose = np.array(device.world_from_device)
        (template,) = (t for t in templates if t.model == device.model)
        stands = replace(
            moved_to(template, pose), existing=device.name, body=device.body
        )
        if isinstance(stands, PlannedCamera) or device.world_from_ring is None:
            return stands
        return replace(
            stands,
            world_from_ring=np.array(device.world_from_ring),
            ring_radii=np.array(device.ring_radii),
            keeps_rings=True,
        )

    kind = kind_of(templates[0])
    return tuple(placed(device) for device in required.existing_of(kind))


def movable(devices: Sequence[_D]) -> list[_D]:
    """Return the devices that don't stand already."""
    return [device for device in devices if not device.existing]


def existing_bodies(required: Requirements) -> tuple[PlacedBody, ...]:
    """Return the bodies of the devices that stand already."""
    poses = [np.array(device.world_from_device) for device in required.existing]
    return tuple(
        PlacedBody(device.kind, pose, placed_box(device.body, pose), device.name, True)
        for device, pose in zip(required.existing, poses, strict=True)
        if device.body is not None
    )


def blocked_by(
    bodies: Sequence[Blocker], device: Device, points: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Return what stands between a device and points, shape (n, n_bodies).

    The device's own body never does, nor what stands at another station.
    """
    blocked = np.zeros((len(points), len(bodies)), dtype=bool)
    if not bodies:
        return blocked
    pose = device.world_from_device
    local = transform(inverse(pose), points)
    starts = transform(pose, device.device.ray_starts(local))
    for column, body in enumerate(bodies):
        if body.concerns(device):
            blocked[:, column] = body.crossed(starts, points)
    return blocked


def first_blocked(
    bodies: Sequence[Blocker],
    device: Device,
    points: NDArray[np.float64],
    limits: tuple[int, int],
    none: int,
) -> NDArray[np.int8]:
    """Return which limit points violate first by what is between, shape (n,).

    `limits` are the indices of those that bodies, and that obstacles decide; `none`
    stands where nothing is between.
    """
    first = np.full(len(points), none, dtype=np.int8)
    if bodies:
        blocked = blocked_by(bodies, device, points)
        solid = np.array([isinstance(body, Obstruction) for body in bodies])
        for limit, among in zip(reversed(limits), (solid, ~solid), strict=True):
            first[blocked[:, among].any(axis=1)] = limit
    return first


def collide(
    device: Device, bodies: Sequence[Blocker], clearance_m: float
) -> list[Blocker]:
    """Return the bodies and obstacles that a device's own body comes too near to.

    Bodies keep the clearance [m], unless both stand already.
    """
    if device.body is None:
        return []
    box = placed_box(device.body, device.world_from_device).grown(CLEARANCE_M)
    wide = box.grown(clearance_m)

    def too_near(body: Blocker) -> bool:
        if isinstance(body, Obstruction) or (body.stands and device.existing):
            return body.touches(box)
        if not body.touches(wide):
            return False
        return not clearance_m or box_gap(box, body.box) < clearance_m

    return [body for body in bodies if body.concerns(device) and too_near(body)]
