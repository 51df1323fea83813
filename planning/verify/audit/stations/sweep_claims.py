"""Claims about a turn: whether all that turns with the part can turn all the way.

Radii and heights about the axis are the same at each step, so what stands is taken as
the part sees it at the first.
"""

from collections.abc import Iterator

import numpy as np

from geometry.arrays import Array
from planning.model.document.station_records import StationsRecord
from planning.model.plan import RigPlan
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.predicates.occlusion import block_of
from planning.verify.audit.predicates.turned_solids import (
    depth_of_turn,
    lowest_of_turn,
)

# Corners of the faces of a box, by the bits of their numbers.
_SIDES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4))
_FACES = np.array(
    [
        [side[0], side[k], side[k + 1]]
        for side in (*_SIDES, (1, 5, 7, 3))
        for k in (1, 2)
    ]
)
# What stands on the floor may be cut by it so far.
_CONTACT_M = 2e-4


def audit_sweep(plan: RigPlan, told: StationsRecord, findings: AuditFindings) -> None:
    """The part, and what turns with it, keep off all that stands, at every angle.

    Obstacles that stand still, housings, and the floor and walls that it doesn't reach
    through at angle 0. A table of one step doesn't turn.
    """
    table = plan.document.rig.turntable
    if table is None or table.steps == 1:
        return
    point, axis = np.array(told.point_m), np.array(told.axis)
    first = told.stations[0].id
    surface = plan.surface
    turning = {"the part": surface.mesh.corners}
    turning |= {
        f"obstacle {o.name!r}": o.mesh.corners
        for o in surface.obstacles
        if not o.station
    }
    standing = dict(_standing(plan, first))
    for what, faces in turning.items():
        for name, still in standing.items():
            depth = depth_of_turn(faces, still, point, axis)
            findings.holds(
                depth == 0.0,
                name,
                f"{what} turns {1e3 * depth:.1f} mm into it at some angle",
            )
        corners = faces.reshape(-1, 3)
        for name, inwards, place in _bounds(plan):
            level = float(inwards @ (place - point)) - _CONTACT_M
            at_first = float(((corners - point) @ inwards).min())
            least = lowest_of_turn(corners, inwards, point, axis)
            findings.holds(
                at_first < level or least >= level,
                name,
                f"{what} turns {1e3 * (level - least):.1f} mm through it",
            )


def _standing(plan: RigPlan, station: str) -> Iterator[tuple[str, Array]]:
    """Yield what stands, by its name: faces (n, 3, 3) as seen at a station."""
    for obstacle in plan.surface.obstacles:
        if obstacle.station == station:
            yield f"obstacle {obstacle.name!r}", obstacle.mesh.corners
    for device in (*plan.projectors, *plan.cameras):
        block = block_of(device)
        if device.station == station and block is not None:
            yield f"{device.id}.body", block.shrunk().corners[_FACES]


def _bounds(plan: RigPlan) -> Iterator[tuple[str, Array, Array]]:
    """Yield floor and walls in the room: name, inward normal, a point of it."""
    space = plan.requirements.workspace
    centre = np.array(space.centre)
    if space.floor_m is not None:
        up = np.array(space.up)
        yield "floor", up, centre + space.floor_m * up
    if space.box is not None:
        middle = centre + np.array(space.box.centre_m)
        for axis, half in zip(space.box.axes, space.box.half_m, strict=True):
            for inwards in (np.array(axis), -np.array(axis)):
                yield "box", inwards, middle - half * inwards
