"""Sensor heads as rig files write them: `[head]`, its devices, volume and figures.

Lengths are in millimetres, in the head's frame: x right, y down, z forward from its
origin into the measuring volume.
"""

from collections.abc import Callable, Mapping
from itertools import combinations
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from geometry.arrays import Array, Mask
from geometry.devices import DeviceModel
from planning.model.devices.bodies import Body, BodyTable
from planning.model.devices.device_poses import rounded_pose
from planning.model.devices.heads import (
    Head,
    HeadDevice,
    HeadFigures,
    Kind,
    MeasuringVolume,
)
from planning.model.table_types import (
    Axis,
    Name,
    Positive,
    PositivePair,
    Sides,
    SourcedTable,
    Table,
    WrittenPose,
    read_pose,
)
from planning.rig.workspace_tables import check_names
from planning.scene.workspace.candidates import aimed_poses

MOST_IN_HEAD = 16
# Nearer than that [mm] no two lenses are.
_APART_MM = 1.0
# Points of the volume, along each side, that sights are looked at for.
_SIGHTS = 5
_UP = np.array([0.0, -1.0, 0.0])
_UP.flags.writeable = False


class HeadDeviceTable(Table):
    """A projector or camera of a head, `[[head.projector]]` or `[[head.camera]]`."""

    name: Name
    position_mm: Axis | None = None
    aim_mm: Axis | None = None
    roll_deg: float = 0.0
    pose_mm: WrittenPose | None = None
    model: Name | None = None

    @model_validator(mode="after")
    def _check_pose(self) -> Self:
        if self.pose_mm is not None:
            if self.position_mm or self.aim_mm or "roll_deg" in self.model_fields_set:
                raise ValueError(
                    "has pose_mm beside position_mm, aim_mm or roll_deg; keep one way"
                )
            read_pose(self.pose_mm, "pose_mm")
        elif self.position_mm is None or self.aim_mm is None:
            raise ValueError("needs position_mm and aim_mm, or pose_mm")
        elif self.position_mm == self.aim_mm:
            raise ValueError(f"aim_mm = {self.aim_mm} must not be its position_mm")
        return self

    @property
    def place_mm(self) -> Array:
        """Its optical centre in the head's frame [mm], shape (3,)."""
        if self.pose_mm is not None:
            return np.array(self.pose_mm)[:3, 3]
        return np.array(self.position_mm)

    def device(self, kind: Kind, optics: DeviceModel) -> HeadDevice:
        """Return the device as it stands in the head, with the rig's optics of it."""
        if self.pose_mm is not None:
            pose = read_pose(self.pose_mm, "pose_mm")
            pose[:3, 3] *= 1e-3
        else:
            place, aim = 1e-3 * self.place_mm, 1e-3 * np.array(self.aim_mm)
            roll = float(np.radians(self.roll_deg))
            pose = aimed_poses(place[None], aim, _UP, optics, roll=roll)[0]
        pose = rounded_pose(pose)
        pose.flags.writeable = False
        return HeadDevice(kind, self.name, pose, self.model or "")


class StatedTable(Table):
    """What a maker states of a head, `[head.stated]`; nothing is planned with it."""

    at_mm: Positive | None = None
    point_distance_mm: Positive | None = None
    noise_mm: Positive | None = None
    accuracy_mm: Positive | None = None
    baseline_mm: Positive | None = None

    def figures(self, sources: dict[str, str]) -> HeadFigures:
        """Return them in metres."""
        metres = {
            key.replace("_mm", "_m"): 1e-3 * value
            for key, value in self.model_dump(exclude_none=True).items()
        }
        return HeadFigures(**metres, sources=dict(sources))


Devices = Annotated[list[HeadDeviceTable], Field(min_length=1, max_length=MOST_IN_HEAD)]


class HeadTable(SourcedTable):
    """A sensor head, `[head]`: one rigid body with its projectors and cameras."""

    name: Name
    cross: bool = False
    working_mm: Positive | None = None
    near_mm: Positive | None = None
    far_mm: Positive | None = None
    near_size_mm: PositivePair | None = None
    far_size_mm: PositivePair | None = None
    volume_mm: Sides | None = None
    body: BodyTable | None = None
    stated: StatedTable | None = None
    projector: Devices
    camera: Devices

    @model_validator(mode="after")
    def _check_volume(self) -> Self:
        frustum = (self.near_mm, self.far_mm, self.near_size_mm, self.far_size_mm)
        keys = "near_mm, far_mm, near_size_mm and far_size_mm"
        if self.volume_mm is not None:
            if frustum != (None,) * 4:
                raise ValueError(f"has volume_mm beside {keys}; keep one way")
            if self.working_mm is None:
                raise ValueError("needs working_mm beside volume_mm, to its middle")
            if not 0.5 * self.volume_mm[2] < self.working_mm:
                raise ValueError(
                    f"volume_mm = {self.volume_mm} reaches behind the head: half its "
                    f"depth must be less than working_mm = {self.working_mm:g}"
                )
            return self
        if None in frustum:
            raise ValueError(f"needs {keys}, or volume_mm and working_mm")
        near, far = self.depths_mm
        if not near < far:
            raise ValueError(f"near_mm = {near:g} must be less than far_mm = {far:g}")
        if not near <= self.stands_mm <= far:
            raise ValueError(
                f"working_mm = {self.working_mm:g} must lie between near_mm = "
                f"{near:g} and far_mm = {far:g}"
            )
        return self

    @model_validator(mode="after")
    def _check_devices(self) -> Self:
        devices = self.devices
        check_names("head", [device.name for _, device in devices])
        for (_, one), (_, other) in combinations(devices, 2):
            if not np.linalg.norm(one.place_mm - other.place_mm) >= _APART_MM:
                raise ValueError(
                    f"{one.name!r} and {other.name!r} stand at the same place; give "
                    f"each its own position_mm"
                )
        return self

    @model_validator(mode="after")
    def _check_body(self) -> Self:
        body = Body.of(self.body)
        if body is not None:
            check_housing(body, self.volume, self.places_m)
        return self

    @property
    def devices(self) -> list[tuple[Kind, HeadDeviceTable]]:
        """Its devices with their kinds, projectors first."""
        lamps: list[tuple[Kind, HeadDeviceTable]]
        lamps = [("projector", device) for device in self.projector]
        return [*lamps, *(("camera", device) for device in self.camera)]

    @property
    def places_m(self) -> dict[str, Array]:
        """Optical centres in the head's frame by the devices' names [m]."""
        return {device.name: 1e-3 * device.place_mm for _, device in self.devices}

    @property
    def depths_mm(self) -> tuple[float, float]:
        """Nearest and farthest depth of the measuring volume [mm]."""
        if self.volume_mm is not None and self.working_mm is not None:
            half = 0.5 * self.volume_mm[2]
            return self.working_mm - half, self.working_mm + half
        return self.near_mm or 0.0, self.far_mm or 0.0

    @property
    def stands_mm(self) -> float:
        """From the head's origin to the surface [mm]: as written, or the middle."""
        return self.working_mm or 0.5 * sum(self.depths_mm)

    @property
    def volume(self) -> MeasuringVolume:
        """The measuring volume in metres."""
        near, far = (1e-3 * depth for depth in self.depths_mm)
        box = self.volume_mm or [0.0, 0.0]
        sizes = (self.near_size_mm or box, self.far_size_mm or box)
        (a, b), (c, d) = ((1e-3 * x, 1e-3 * y) for x, y, *_ in sizes)
        return MeasuringVolume(near, far, (a, b), (c, d))

    def head(self, optics: Callable[[Kind, str], DeviceModel]) -> Head:
        """Return the head in metres; `optics` are of a kind and a model's name."""
        return Head(
            name=self.name,
            devices=tuple(
                device.device(kind, optics(kind, device.model or ""))
                for kind, device in self.devices
            ),
            volume=self.volume,
            working_m=1e-3 * self.stands_mm,
            body=Body.of(self.body),
            cross=self.cross,
            figures=(self.stated or StatedTable()).figures(self.sources),
        )


def check_housing(
    body: Body, volume: MeasuringVolume, places_m: Mapping[str, Array]
) -> None:
    """Refuse a housing that no head can have.

    Raises:
        ValueError: If it holds no device, stands in the measuring volume, or hides all
            of it from a device outside.
    """
    points = volume.samples(_SIGHTS)
    centre, half = 1e3 * np.array(body.centre_m), 2e3 * np.array(body.half_m)
    box = f"body of {half.round(6).tolist()} about {centre.round(6).tolist()} mm"
    if not any(_in_box(body, place).all() for place in places_m.values()):
        raise ValueError(
            f"{box} holds none of the optical centres; correct its centre_mm, which "
            f"counts from the head's origin"
        )
    if np.any(_in_box(body, points)):
        raise ValueError(
            f"{box} stands in the head's own measuring volume; make it less deep or "
            f"move it back"
        )
    for name, place in places_m.items():
        if not _in_box(body, place).all() and np.all(_hidden(body, place, points)):
            raise ValueError(
                f"{box} hides the whole measuring volume from {name!r}, which stands "
                f"outside; enlarge it or move {name!r}"
            )


def _in_box(body: Body, points: Array) -> Mask:
    off = np.abs(points - np.array(body.centre_m))
    return np.asarray((off <= np.array(body.half_m)).all(axis=-1))


def _hidden(body: Body, start: Array, points: Array) -> Mask:
    """Whether the sight from a start to each point passes the box, by its slabs."""
    along = points - start
    centre, half = np.array(body.centre_m), np.array(body.half_m)
    # Along a slab the ends are both at the same infinity outside, at either inside.
    with np.errstate(divide="ignore", invalid="ignore"):
        one, other = (centre - half - start) / along, (centre + half - start) / along
    enter = np.nanmax(np.minimum(one, other), axis=-1)
    leave = np.nanmin(np.maximum(one, other), axis=-1)
    return (enter < leave) & (leave > 0.0) & (enter < 1.0)
