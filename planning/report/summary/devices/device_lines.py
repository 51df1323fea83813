"""Where every device stands and how its housing is turned, as one mounts it."""

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from geometry.devices import turned_to
from geometry.poses import horizontal_axes, pan_tilt_roll
from geometry.shapes.boxes import box_gap
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.document.plan_document import PlanDocument
from planning.model.plan import RigPlan
from planning.model.words import count_words, tenths
from planning.scene.placed_bodies import bodies_of

from .station_lines import device_counts

_AXES = "xyz"


def devices_words(plan: RigPlan, between: str = " and ") -> str:
    """Return how many devices of each kind a plan has; no projectors aren't told."""
    n_projectors, n_cameras = device_counts(plan)
    cameras = count_words(n_cameras, "camera")
    if plan.cameras_alone:
        return cameras
    return f"{count_words(n_projectors, 'projector')}{between}{cameras}"


def device_lines(plan: RigPlan) -> list[str]:
    """Return a line for each device: position, angles of housing and image, standoff.

    The housing's axis is the optical axis, the device's +z. The middle of the image
    looks elsewhere where the lens is shifted.
    """
    lines = [
        "",
        "     position x, y, z [mm]            housing's pan    tilt    roll    image "
        "centre aims along      standoff",
        "                                               [deg]   [deg]   [deg]    "
        "azimuth  elevation [deg]   to centre [mm]",
    ]
    workspace = plan.requirements.workspace
    centre, up = np.array(workspace.centre), np.array(workspace.up)
    for device, numbers in standing(plan):
        x, y, z, pan, tilt, roll, azimuth, elevation, distance = tenths(numbers)
        lines.append(
            f"{device.id:<4} {x:9.1f} {y:9.1f} {z:9.1f}    {pan:15.1f} {tilt:7.1f} "
            f"{roll:7.1f}   {azimuth:8.1f} {elevation:10.1f}   {distance:18.1f}"
            + (f"   {device.station}" if device.station else "")
            + (f"   {device.model}" if device.model else "")
            + (f"   existing: {device.existing}" if device.existing else "")
        )
    x, y, z = tenths(1e3 * centre)
    first = axis_name(horizontal_axes(up)[0])
    return [
        *lines,
        f"     pan and azimuth count about {axis_name(up)} from {first}, tilt and "
        f"elevation from the horizon; roll is clockwise as the device looks",
        f"     in the axes of the mesh file; the object's centre is at {x:.1f}, "
        f"{y:.1f}, {z:.1f} mm",
    ]


def standing(
    plan: RigPlan,
) -> Iterator[tuple[PlannedProjector | PlannedCamera, list[float]]]:
    """Yield each device, and how it stands, in nine numbers.

    Position x, y, z [mm]; pan, tilt and roll of its housing, azimuth and elevation of
    the middle of its image [degrees]; distance from the object's centre [mm].
    """
    workspace = plan.requirements.workspace
    centre, up = np.array(workspace.centre), np.array(workspace.up)
    for device in (*plan.projectors, *plan.cameras):
        place = device.world_from_device[:3, 3]
        distance = 1e3 * float(np.linalg.norm(place - centre))
        yield device, [*(1e3 * place).tolist(), *standing_angles(device, up), distance]


def standing_angles(
    device: PlannedProjector | PlannedCamera, up: NDArray[np.float64]
) -> list[float]:
    """Return a housing's pan, tilt, roll and its aim's azimuth, elevation [deg]."""
    housing = np.degrees(pan_tilt_roll(device.world_from_device[:3, :3], up))
    return [*housing.tolist(), *aim_angles(device, up)[:2]]


def mount_lines(plan: RigPlan) -> list[str]:
    """Return where mounts are and point to, a line each; none that the rig lacks."""
    lines: list[str] = []
    for record in (*plan.document.projectors, *plan.document.cameras):
        if record.world_from_mount is not None:
            pose = np.array(record.world_from_mount)
            x, y, z = tenths(1e3 * pose[:3, 3])
            ways = "   ".join(_direction(pose[:3, axis]) for axis in (2, 0))
            lines.append(f"{record.id:<4} {x:9.1f} {y:9.1f} {z:9.1f}   {ways}")
    if not lines:
        return []
    return [
        "",
        "     mount x, y, z [mm]              axis, out of the device     forward, "
        "square to it",
        *lines,
    ]


def _direction(vector: NDArray[np.float64]) -> str:
    x, y, z = np.round(vector, 4) + 0.0
    return f"({x:7.4f}, {y:7.4f}, {z:7.4f})"


def gap_lines(plan: RigPlan) -> list[str]:
    """Return which two housings stand nearest to each other; none of fewer than two."""
    boxes = bodies_of((*plan.projectors, *plan.cameras))
    if len(boxes) < 2:
        return []
    gaps = [(box_gap(a.box, b.box), a, b) for a, b in combinations(boxes, 2)]
    gap, a, b = min(gaps, key=lambda pair: pair[0])
    return [f"     the nearest housings are {a.name} and {b.name}, {1e3 * gap:.1f} mm"]


def aim_angles(
    device: PlannedProjector | PlannedCamera, up: NDArray[np.float64]
) -> tuple[float, float, float]:
    """Return azimuth, elevation and roll of the middle of the image in degrees.

    As `pan_tilt_roll` has them, had the middle ray been the optical axis.
    """
    straight = turned_to(device.device.middle_ray).T
    angles = pan_tilt_roll(device.world_from_device[:3, :3] @ straight, up)
    azimuth, elevation, roll = np.degrees(angles).tolist()
    return azimuth, elevation, roll


def axis_name(direction: Sequence[float] | NDArray[np.float64]) -> str:
    """Return the world axis that a direction is nearest to, with its sign."""
    index = int(np.argmax(np.abs(direction)))
    return f"{'-' if direction[index] < 0 else '+'}{_AXES[index]}"


def used_up(document: PlanDocument, kind: str) -> str:
    """Return which counted models of a `projector` or a `camera` none is left of.

    Empty where some are.
    """
    models, records = document.rig.models(kind), getattr(document, f"{kind}s")
    taken = Counter(record.model for record in records)
    gone = [
        f"{model.name} ({model.count})"
        for model in models
        if model.count is not None
        and taken[model.name if len(models) > 1 else ""] >= model.count
    ]
    return " and ".join(gone)


def models_line(document: PlanDocument) -> str:
    """Return which device is of which of several models; empty of one."""
    of_models: dict[str, list[str]] = {}
    for record in (*document.projectors, *document.cameras):
        if record.model:
            of_models.setdefault(record.model, []).append(record.id)
    return "; ".join(f"{', '.join(ids)}: {of}" for of, ids in of_models.items())
