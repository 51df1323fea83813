"""What a plan says of the stations of its devices."""

import numpy as np

from planning.model.devices.device_poses import DECIMALS, rounded_pose
from planning.model.document.station_records import (
    Stationed,
    StationRecord,
    StationsRecord,
)
from planning.report.claims.judged import Devices


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
