"""What a plan says of the stations of its devices."""

from dataclasses import dataclass, replace

import numpy as np

from geometry.arrays import Array
from planning.model.device_poses import DECIMALS, rounded_pose
from planning.model.document.station_records import (
    StationCount,
    StationRecord,
    StationsRecord,
)
from planning.report.judged import Devices


@dataclass(frozen=True, eq=False)
class Placement:
    """A station: where it is, and how many of the devices in order are there."""

    id: str
    world_from_station: Array
    n_projectors: int
    n_cameras: int
    angle: float | None = None


@dataclass(frozen=True, eq=False)
class Stationed:
    """Stations of a plan in the making.

    Attributes:
        placements: In the order of the devices.
        record: All but the stations.
    """

    placements: tuple[Placement, ...]
    record: StationsRecord

    def counted(self, count: StationCount) -> "Stationed":
        """Return the same with another count."""
        return replace(self, record=self.record.changed(count=count))


def stations_record(stationed: Stationed, devices: Devices) -> StationsRecord:
    """Return the plan's `stations`, with its devices by their ids."""
    p = c = 0
    rows: list[StationRecord] = []
    for one in stationed.placements:
        pose = rounded_pose(one.world_from_station)
        turned = {} if one.angle is None else {"angle": round(one.angle, DECIMALS)}
        rows.append(
            StationRecord(
                id=one.id,
                world_from_station=np.asarray(pose).tolist(),
                projectors=tuple(
                    d.id for d in devices.projectors[p:][: one.n_projectors]
                ),
                cameras=tuple(d.id for d in devices.cameras[c:][: one.n_cameras]),
                **turned,
            )
        )
        p, c = p + one.n_projectors, c + one.n_cameras
    return stationed.record.changed(stations=tuple(rows))
