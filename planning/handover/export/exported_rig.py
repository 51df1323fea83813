"""A rig as exporters take it: all devices and the object in one frame."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import BinaryIO, Protocol

import numpy as np

from geometry.arrays import Array
from geometry.devices import DeviceModel, ParallelModel, PinholeModel
from geometry.mesh.mesh import TriangleMesh
from geometry.poses import inverse, transform
from geometry.shapes.boxes import OrientedBox
from planning.model.devices.bodies import Body
from planning.model.devices.device_poses import moved_to
from planning.model.devices.planned import PlannedCamera
from planning.model.plan import RigPlan
from planning.scene.placed_bodies import Device, kind_of, placed_box

from .export_frames import ExportFrame

Content = bytes | Callable[[BinaryIO], object]
# From OpenCV's camera axes to those of glTF, USD and Blender: x right, y up, -z ahead.
DEVICE_FROM_GL = np.diag([1.0, -1.0, -1.0, 1.0])
# Faces of `OrientedBox.corners`, counterclockwise from outside.
BOX_QUADS = (
    *((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1)),
    *((2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)),
)
BOX_TRIANGLES = np.array(
    [[q[i] for i in half] for q in BOX_QUADS for half in ((0, 1, 2), (0, 2, 3))]
)
# Principal points this near to the middle are in it [px].
_CENTRED_PX = 1e-9


@dataclass(frozen=True, eq=False)
class ExportedDevice:
    """A camera or projector in the frame of an export.

    Attributes:
        planned: The device with its pose in the frame.
        kind: `camera` or `projector`.
        world_from_mount: Pose of its thread or flange; None: the rig doesn't say.
        reach_m: Distance to the object's centre [m].
    """

    planned: Device
    kind: str
    world_from_mount: Array | None
    reach_m: float

    @property
    def id(self) -> str:
        """Its name in the plan."""
        return self.planned.id

    @property
    def world_from_device(self) -> Array:
        """Pose of its optics in the frame, OpenCV axes, shape (4, 4) [m]."""
        return self.planned.world_from_device

    @property
    def model(self) -> DeviceModel:
        """Its optics."""
        return self.planned.device

    @property
    def body(self) -> Body | None:
        """Its housing in device coordinates; None: it takes no room."""
        return self.planned.body

    @property
    def lens(self) -> PinholeModel | None:
        """Its optics if they are a pinhole's; None in parallel light."""
        return self.model if isinstance(self.model, PinholeModel) else None

    @cached_property
    def device_from_world(self) -> Array:
        """Inverse of its pose, shape (4, 4)."""
        return inverse(self.world_from_device)

    @property
    def device_from_mount(self) -> Array | None:
        """Pose of its mount in its own axes; None: the rig doesn't say."""
        mount = self.world_from_mount
        return None if mount is None else self.device_from_world @ mount

    @property
    def distortion(self) -> tuple[float, ...]:
        """k1, k2, p1, p2, k3; zeros where nothing distorts."""
        return (0.0,) * 5 if self.lens is None else self.lens.distortion

    @property
    def panel_matrix(self) -> Array:
        """From panel coordinates to pixels, (3, 3): of x/z, y/z, or of x, y in [m]."""
        if isinstance(self.model, PinholeModel):
            return self.model.camera_matrix
        width, height = self.model.resolution
        scale = 1.0 / self.model.pixel_pitch_m
        return np.array(
            [
                [scale, 0.0, 0.5 * (width - 1)],
                [0.0, scale, 0.5 * (height - 1)],
                [0.0, 0.0, 1.0],
            ]
        )

    @property
    def lens_shift(self) -> Array:
        """Middle of the image less principal point [px], shape (2,)."""
        middle = 0.5 * (np.array(self.model.resolution) - 1.0)
        return middle - self.panel_matrix[:2, 2]

    def project(self, points: Array) -> Array:
        """Return pixels (n, 2) of points (n, 3) of the frame."""
        local = transform(self.device_from_world, points)
        if isinstance(self.model, PinholeModel):
            return self.model.project(local)
        matrix = self.panel_matrix
        return local[:, :2] * matrix[0, 0] + matrix[:2, 2]

    @property
    def box(self) -> OrientedBox | None:
        """Its housing in the frame; None: it takes no room."""
        if self.body is None:
            return None
        return placed_box(self.body, self.world_from_device)

    @cached_property
    def frustum(self) -> Array:
        """Four rays of light or sight at the image's corners, (4, 2, 3): start, end.

        Clockwise as the device looks, down to the depth of the object's centre.
        """
        reach = self.reach_m
        if isinstance(self.model, PinholeModel):
            corners = self.model.corners[[0, 1, 3, 2]]
            rays = self.model.rays(corners)
            depth = reach * self.model.middle_ray[2]
            starts, ends = np.zeros((4, 3)), rays * (depth / rays[:, 2:])
        else:
            across, down = self.model.half_panel
            signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
            starts = np.column_stack([signs * [across, down], np.zeros(4)])
            ends = starts + [0.0, 0.0, reach]
        both = transform(self.world_from_device, np.concatenate([starts, ends]))
        return both.reshape(2, 4, 3).transpose(1, 0, 2)

    @property
    def frustum_lines(self) -> Array:
        """Segments of the frustum, (8, 2, 3): its edges, then its far side."""
        far = self.frustum[:, 1]
        side = np.stack([far, np.roll(far, -1, axis=0)], axis=1)
        return np.concatenate([self.frustum, side])


@dataclass(frozen=True, eq=False)
class ExportedRig:
    """Everything an exporter writes about, in one frame.

    Attributes:
        plan: Where it is from, in the mesh's axes.
        frame: What all below is expressed in.
        devices: Projectors, then cameras.
        mesh: The object.
        obstacles: What else stands about, by name.
        up: The frame's own axis for up, a unit vector: that of the mesh, of one name.
        centre: The object's centre.
        datums: Corners of the object's bounding box, put down onto the floor or else
            onto the box's lowest face, shape (4, 3): D1 to D4 of a tape measure.
    """

    plan: RigPlan
    frame: ExportFrame
    devices: tuple[ExportedDevice, ...]
    mesh: TriangleMesh
    obstacles: Mapping[str, TriangleMesh]
    up: Array
    centre: Array
    datums: Array

    def standing_at(self, station: str) -> list[TriangleMesh]:
        """Return the obstacles that are there where devices of a station measure."""
        return [
            self.obstacles[each.name]
            for each in self.plan.surface.obstacles
            if each.station in ("", station)
        ]

    @classmethod
    def of(cls, plan: RigPlan, frame: ExportFrame) -> "ExportedRig":
        """Return a plan's devices and object in a frame."""
        move, workspace = frame.frame_from_mesh, plan.requirements.workspace
        up, centre = np.array(workspace.up), np.array(workspace.centre)
        records = (*plan.document.projectors, *plan.document.cameras)
        devices = [
            ExportedDevice(
                _moved_device(device, move),
                kind_of(device),
                None
                if record.world_from_mount is None
                else move @ np.array(record.world_from_mount),
                float(np.linalg.norm(device.world_from_device[:3, 3] - centre)),
            )
            for record, device in zip(
                records, (*plan.projectors, *plan.cameras), strict=True
            )
        ]
        mesh = plan.surface.mesh
        datums = _datums(mesh, up, centre, workspace.floor_m)
        return cls(
            plan,
            frame,
            tuple(devices),
            _moved(mesh, move),
            {each.name: _moved(each.mesh, move) for each in plan.surface.obstacles},
            up,
            transform(move, centre[None])[0],
            transform(move, datums),
        )

    @property
    def distorted(self) -> list[ExportedDevice]:
        """Devices whose lens distorts."""
        return [each for each in self.devices if any(each.distortion)]

    @property
    def shifted(self) -> list[ExportedDevice]:
        """Devices with lens shift: whose principal point isn't the image's middle."""
        return [
            each for each in self.devices if np.abs(each.lens_shift).max() > _CENTRED_PX
        ]

    @property
    def lacks(self) -> list[str]:
        """Return a sentence where the plan itself lacks what its rig file says."""
        terms = self.plan.document.rig.projector.figures.distortion
        new = [
            each
            for each in self.devices
            if each.kind == "projector" and not each.planned.existing
        ]
        if not (terms and any(terms) and new):
            return []
        words = ", ".join(f"{term:g}" for term in terms)
        return [
            f"{id_words(new)}: without the rig file's distortion of projectors "
            f"({words}), a plan's projectors have none"
        ]

    @property
    def parallel(self) -> list[ExportedDevice]:
        """Projectors of parallel light."""
        return [each for each in self.devices if isinstance(each.model, ParallelModel)]


class ExportFormat(Protocol):
    """What a file in this room says of its format.

    Attributes:
        name: As `--to` has it.
        what: Kind of files, as README.txt has it.
        notes: For README.txt: axes, unit, what is where.
    """

    name: str
    what: str
    notes: str

    def lacks(self, rig: ExportedRig) -> list[str]:
        """Return a sentence for each thing of this rig that the format can't hold."""
        ...

    def files(self, rig: ExportedRig) -> dict[str, Content]:
        """Return the files by their paths inside the export's folder."""
        ...


def id_words(devices: Iterable[ExportedDevice]) -> str:
    """Return the names of devices."""
    return ", ".join(device.id for device in devices)


def numbers(values: Sequence[float] | Array, between: str = ", ") -> str:
    """Return numbers with all their digits."""
    flat = np.asarray(values, dtype=np.float64).ravel() + 0.0
    return between.join(repr(float(value)) for value in flat)


def _moved_device(device: Device, motion: Array) -> Device:
    pose = motion @ device.world_from_device
    if isinstance(device, PlannedCamera):
        return moved_to(device, pose)
    return moved_to(device, pose)


def _moved(mesh: TriangleMesh, motion: Array) -> TriangleMesh:
    return TriangleMesh(transform(motion, mesh.vertices), mesh.faces)


def _datums(
    mesh: TriangleMesh, up: Array, centre: Array, floor_m: float | None
) -> Array:
    low, high = mesh.bounds
    axis = int(np.argmax(np.abs(up)))
    base = low if up[axis] > 0.0 else high
    points = np.tile(base, (4, 1))
    if floor_m is not None:
        points[:, axis] = (centre + floor_m * up)[axis]
    first, second = (axis + 1) % 3, (axis + 2) % 3
    points[:, first] = np.array([low, high, high, low])[:, first]
    points[:, second] = np.array([low, low, high, high])[:, second]
    return points
