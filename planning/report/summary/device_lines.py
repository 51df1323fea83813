"""Where every device stands and where it looks, for a person."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from planning.model.plan import RigPlan
from planning.model.planned import PlannedCamera, PlannedProjector

_AXES = "xyz"


def axis_name(up: Sequence[float] | NDArray[np.float64]) -> str:
    """Return the world axis that a direction is nearest to, with its sign."""
    index = int(np.argmax(np.abs(up)))
    return f"{'-' if up[index] < 0 else '+'}{_AXES[index]}"


def device_lines(plan: RigPlan) -> list[str]:
    """Return the table of poses, a line each."""
    lines = [
        "",
        "     position x, y, z [mm]            image centre aims along         roll"
        "   standoff",
        "                                      azimuth   elevation [deg]     [deg]   "
        "to centre [mm]",
    ]
    centre = np.array(plan.requirements.workspace.centre)
    up = np.array(plan.requirements.workspace.up)
    for device in (*plan.projectors, *plan.cameras):
        position = device.world_from_device[:3, 3]
        azimuth, elevation, roll = aim_angles(device, up)
        x, y, z = 1e3 * position
        distance = 1e3 * np.linalg.norm(position - centre)
        lines.append(
            f"{device.id:<4} {x:9.1f} {y:9.1f} {z:9.1f}    {azimuth:12.1f} "
            f"{elevation:10.1f}   {roll:12.1f}   {distance:10.1f}"
            + (f"   existing: {device.existing}" if device.existing else "")
        )
    k = int(np.argmax(np.abs(up)))
    lines.append(
        f"     azimuth counts about {axis_name(up)} from +{_AXES[(k + 1) % 3]}; the "
        f"axes are those of the mesh file"
    )
    return lines


def aim_angles(
    device: PlannedProjector | PlannedCamera, up: NDArray[np.float64]
) -> tuple[float, float, float]:
    """Return azimuth, elevation and roll of a device in degrees.

    Azimuth counts about `up` from the first world axis that isn't along it towards
    the next (x towards y for up z); elevation is the angle above the horizontal; roll
    turns the image clockwise as the device sees it, 0 with the image upright.
    """
    pose = device.world_from_device
    axis = pose[:3, :3] @ device.device.middle_ray
    k = int(np.argmax(np.abs(up)))
    e1 = np.eye(3)[(k + 1) % 3]
    e2 = np.cross(up, e1)
    azimuth = np.degrees(np.arctan2(axis @ e2, axis @ e1))
    elevation = np.degrees(np.arcsin(np.clip(axis @ up, -1.0, 1.0)))
    level = np.cross(axis, up)
    if np.linalg.norm(level) < 1e-6:
        return float(azimuth), float(elevation), 0.0
    level /= np.linalg.norm(level)
    roll = np.arctan2(pose[:3, 0] @ np.cross(axis, level), pose[:3, 0] @ level)
    return float(azimuth), float(elevation), float(np.degrees(roll)) + 0.0
