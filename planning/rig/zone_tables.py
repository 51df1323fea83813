"""Zones of a rig file, in millimetres and degrees, turned into boxes in metres."""

from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from planning.model.bodies import Axes, Box, Triple

from .workspace_tables import KeepOutTable, MountingTable, WorkspaceTable

_IDENTITY: Axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
# Sine below which a direction is square to no level line.
_LEVEL = 1e-9


def build_zones(table: WorkspaceTable, up: Triple) -> dict[str, Any]:
    """Return `box`, `keep_out` and `mounting` of `Workspace`.

    Args:
        table: As written.
        up: Unit vector that points up, for planes that don't say where they run.
    """
    return {
        "box": _room(table),
        "keep_out": tuple(_keep_out(zone) for zone in table.keep_out),
        "mounting": tuple(_mounting(plane, up) for plane in table.mounting),
    }


def _room(table: WorkspaceTable) -> Box | None:
    if table.min_mm is None or table.max_mm is None:
        return None
    low, high = np.array(table.min_mm), np.array(table.max_mm)
    return Box("box", _metres(low + high, 0.5), _metres(high - low, 0.5), _IDENTITY)


def _keep_out(table: KeepOutTable) -> Box:
    # Lower-case letters turn about the fixed axes, in this order.
    turn = Rotation.from_euler("xyz", table.turn_deg, degrees=True).as_matrix()
    return Box(
        table.name,
        _metres(np.array(table.centre_mm)),
        _metres(np.array(table.size_mm), 0.5),
        _rows(turn.T),
    )


def _mounting(table: MountingTable, up: Triple) -> Box:
    normal = np.array(table.normal) / np.linalg.norm(table.normal)
    first = np.array(table.along or _level(normal, np.array(up)))
    first = first - (first @ normal) * normal
    first /= np.linalg.norm(first)
    sizes = np.array([*table.extent_mm, table.thickness_mm])
    axes = np.stack([first, np.cross(normal, first), normal])
    centre = _metres(np.array(table.centre_mm))
    return Box(table.name, centre, _metres(sizes, 0.5), _rows(axes))


def _level(normal: NDArray[np.float64], up: NDArray[np.float64]) -> list[float]:
    """A level direction in a plane; where the plane is level, x, or y if up is x."""
    level = np.cross(up, normal)
    if np.linalg.norm(level) > _LEVEL:
        return level.tolist()
    return [0.0, 1.0, 0.0] if up[0] else [1.0, 0.0, 0.0]


def _metres(millimetres: NDArray[np.float64], factor: float = 1.0) -> Triple:
    return cast(Triple, tuple((1e-3 * factor * millimetres).tolist()))


def _rows(axes: NDArray[np.float64]) -> Axes:
    # Sines of right angles are zero but for rounding; a plan should say so.
    return cast(Axes, tuple(tuple(row) for row in (np.round(axes, 15) + 0.0).tolist()))
