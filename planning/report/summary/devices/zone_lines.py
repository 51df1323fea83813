"""The object and every zone about it, in the axes of the mesh, where one measures."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from planning.model.devices.bodies import Box
from planning.model.plan import RigPlan
from planning.model.requirements import Workspace
from planning.model.words import labelled, tenths

from .device_lines import axis_name


def zone_lines(plan: RigPlan) -> list[str]:
    """Return object, shell, floor, room, planes, volumes and obstacles, in [mm]."""
    space = plan.requirements.workspace
    centre = np.array(space.centre)
    low, high = plan.surface.mesh.bounds
    solid = {obstacle.rig_name for obstacle in plan.surface.obstacles}
    room = "" if space.box is None else _box(space.box, centre)
    return [
        "in the axes of the mesh file, in millimetres:",
        *labelled(
            "OBJECT",
            [
                _extent(low, high),
                f"centre {_mm(centre)}: of the smallest ball that holds it, radius "
                f"{1e3 * space.object_radius_m:.1f}",
            ],
        ),
        *labelled("STANDS", [*_shell(space), *([f"room: {room}"] if room else [])]),
        *labelled("MOUNTING", [_plane(plane, centre) for plane in space.mounting]),
        *labelled(
            "KEEP OUT",
            [
                f"{zone.name!r}: {_box(zone, centre)}"
                + ("; blocks light" if zone.name in solid else "; only ground")
                for zone in space.keep_out
            ],
        ),
        *labelled(
            "OBSTACLE",
            [
                f"{obstacle.name!r}: {_extent(*obstacle.mesh.bounds)}"
                for obstacle in plan.surface.obstacles
            ],
        ),
    ]


def _shell(space: Workspace) -> list[str]:
    lines = [
        f"optical centres of {kind} {1e3 * low:.1f} to {1e3 * high:.1f} from that "
        f"centre"
        for kind, (low, high) in (
            ("projectors", space.projector_radius_m),
            ("cameras", space.camera_radius_m),
        )
    ]
    if space.half_angle < np.pi:
        x, y, z = space.axis
        lines.append(
            f"within {np.degrees(space.half_angle):.1f} degrees of the axis ({x:.3g}, "
            f"{y:.3g}, {z:.3g}) from that centre"
        )
    if space.floor_m is not None:
        up = np.array(space.up)
        height = 1e3 * (float(up @ space.centre) + space.floor_m)
        name = axis_name(up)
        below = name[0] == "-"
        height = -height if below else height
        lines.append(f"floor: {name[1]} {'<=' if below else '>='} {height:.1f}")
    if space.clearance_m:
        lines.append(f"housings {1e3 * space.clearance_m:g} apart or more")
    return lines


def _plane(plane: Box, centre: NDArray[np.float64]) -> str:
    width, height, thickness = (2e3 * half for half in plane.half_m)
    along, _, normal = (tuple(axis) for axis in plane.axes)
    return (
        f"{plane.name!r}: centre {_mm(centre + plane.centre_m)}, normal "
        f"{_direction(normal)}; {width:g} along {_direction(along)}, {height:g} "
        f"across, {thickness:g} thick"
    )


def _box(box: Box, centre: NDArray[np.float64]) -> str:
    middle, half = centre + box.centre_m, np.array(box.half_m)
    turn = Rotation.from_matrix(np.array(box.axes).T).as_euler("xyz", degrees=True)
    turn = np.round(turn, 9) + 0.0
    if not turn.any():
        return _extent(middle - half, middle + half)
    size = " x ".join(f"{2e3 * side:g}" for side in half)
    return (
        f"{size} about {_mm(middle)}, turned {turn[0]:g}, {turn[1]:g}, {turn[2]:g} "
        f"degrees about x, then y, then z"
    )


def _extent(low: NDArray[np.float64], high: NDArray[np.float64]) -> str:
    ends = zip("xyz", tenths(1e3 * low), tenths(1e3 * high), strict=True)
    return ", ".join(f"{name} {a:.1f} to {b:.1f}" for name, a, b in ends)


def _direction(vector: Sequence[float]) -> str:
    return "(" + ", ".join(f"{part + 0.0:.4g}" for part in vector) + ")"


def _mm(point: NDArray[np.float64]) -> str:
    return ", ".join(f"{part:.1f}" for part in tenths(1e3 * point))
