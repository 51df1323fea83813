"""Which cells may hold a place where a device may stand."""

import numpy as np

from geometry.arrays import Mask
from planning.model.requirements import Workspace
from planning.verify.audit.devices.zone_claims import zone_excess

from .sphere_cells import Cells

_ROUNDING = 1e-9


def may_stand(space: Workspace, cells: Cells, aside: float = 0.0) -> Mask:
    """Return which cells no single limit of the workspace forbids wholly, (n,).

    How far a place is below the floor, or breaks a zone, changes by no more than the
    place does: what the middle of a ball breaks by more than its radius all of it
    breaks.

    Args:
        space: The workspace.
        cells: Of its shell, about its centre.
        aside: Angle by which places may lie off their cell's directions [rad].
    """
    axis = np.array(space.axis) / np.linalg.norm(space.axis)
    middle, angle = cells.middle, cells.angle + aside
    off_axis = np.arccos(np.clip(middle @ axis, -1.0, 1.0))
    allowed = off_axis - angle <= space.half_angle + _ROUNDING
    places = 0.5 * (cells.low_m + cells.high_m)[:, None] * middle
    across = 2.0 * cells.high_m * np.sin(np.minimum(0.5 * angle, 0.5 * np.pi))
    reach = 0.5 * (cells.high_m - cells.low_m) + across + _ROUNDING
    excess = zone_excess(places, space)
    if space.floor_m is not None:
        excess.append(space.floor_m - places @ np.array(space.up))
    for broken in excess:
        allowed &= broken <= reach
    return allowed
