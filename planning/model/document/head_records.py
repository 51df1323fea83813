"""Heads, turntables and stations in a plan file, in metres, and read back from it."""

from collections.abc import Iterator
from dataclasses import asdict
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from planning.model.devices.bodies import Body
from planning.model.devices.heads import (
    Head,
    HeadDevice,
    HeadFigures,
    MeasuringVolume,
    Stations,
    Turntable,
)

from .part import Interval, Part, Pose, Vector3


class HeadDeviceRecord(Part):
    """A projector or camera of a head; `model` as of a device of the plan."""

    kind: Literal["projector", "camera"]
    name: str
    head_from_device: Pose
    model: str = ""

    def device(self) -> HeadDevice:
        """Return the value."""
        pose = np.array(self.head_from_device)
        pose.flags.writeable = False
        return HeadDevice(self.kind, self.name, pose, self.model)


class VolumeRecord(Part):
    """A frustum about the head's z, `MeasuringVolume`."""

    near_m: float
    far_m: float
    near_size_m: Interval
    far_size_m: Interval


class StatedRecord(Part):
    """What the maker of a head states, `HeadFigures`."""

    at_m: float | None = None
    point_distance_m: float | None = None
    noise_m: float | None = None
    accuracy_m: float | None = None
    baseline_m: float | None = None
    sources: dict[str, str] = Field(default={})


class HeadRecord(Part):
    """The sensor head of a rig; its frame is x right, y down, z into the volume."""

    name: str
    devices: Annotated[tuple[HeadDeviceRecord, ...], Field(min_length=2)]
    volume: VolumeRecord
    working_m: float
    body: Body | None = None
    cross: bool = False
    figures: StatedRecord = StatedRecord()

    def head(self) -> Head:
        """Return the value.

        Raises:
            ValueError: If there can't be such a head.
        """
        volume, figures = self.volume, self.figures
        return Head(
            self.name,
            tuple(device.device() for device in self.devices),
            MeasuringVolume(
                volume.near_m, volume.far_m, volume.near_size_m, volume.far_size_m
            ),
            self.working_m,
            self.body,
            self.cross,
            HeadFigures(**{key: getattr(figures, key) for key in _FIGURES}),
        )


class TurntableRecord(Part):
    """A table that turns the part; its point as places of the rig file count."""

    point_m: Vector3
    axis: Vector3
    steps: int | None = None
    max_steps: int | None = None
    still: tuple[str, ...] = ()
    seconds_per_step: float | None = None

    def turntable(self) -> Turntable:
        """Return the value.

        Raises:
            ValueError: If its axis is none.
        """
        return Turntable(
            self.point_m,
            self.axis,
            self.steps,
            self.max_steps,
            self.still,
            self.seconds_per_step,
        )


class CarrierRecord(Part):
    """What carries a head, and how often it may be set down."""

    max: int | None = None
    carrier: Literal["robot", "tripod"]
    seconds_per_metre: float | None = None
    seconds_per_station: float | None = None

    def stations(self) -> Stations:
        """Return the value."""
        return Stations(
            self.max, self.carrier, self.seconds_per_metre, self.seconds_per_station
        )


def carried_records(
    head: Head | None, turntable: Turntable | None, stations: Stations | None
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield `head`, `turntable` and `stations` of a plan's rig, what there is."""
    if head is not None:
        devices = [
            {
                "kind": device.kind,
                "name": device.name,
                "head_from_device": device.head_from_device.tolist(),
                **({"model": device.model} if device.model else {}),
            }
            for device in head.devices
        ]
        yield (
            "head",
            {
                "name": head.name,
                "devices": devices,
                "volume": _plain(head.volume),
                "working_m": head.working_m,
                **({} if head.body is None else {"body": _plain(head.body)}),
                "cross": head.cross,
                "figures": _plain(head.figures),
            },
        )
    if turntable is not None:
        yield "turntable", _plain(turntable)
    if stations is not None:
        yield "stations", _plain(stations)


_FIGURES = tuple(StatedRecord.model_fields)


def _plain(value: Any) -> dict[str, Any]:  # noqa: ANN401 - of any of these
    """Plain JSON values of a dataclass, without what isn't said."""
    given = {key: each for key, each in asdict(value).items() if each is not None}
    return {
        key: [*each] if isinstance(each, tuple) else each for key, each in given.items()
    }
