"""Where devices may stand, drawn lightly: room, keep-out volumes, mounting planes."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

from geometry.rays.rays import RayCaster
from planning.model.plan import RigPlan
from planning.model.zones import Box

from .draw_marks import Panel
from .draw_views import Colour

# Kinds of zones as the legend names them, in the order in which they are drawn.
ZONES: dict[str, Colour] = {
    "room": (128, 128, 136),
    "mounting plane": (46, 132, 74),
    "keep out": (178, 34, 52),
}
_FILL, _EDGE = 14, 110
# Zones may reach far beyond the devices; the picture follows them no farther.
_ROOM = 1.03


@dataclass(frozen=True, eq=False)
class ZoneFigure:
    """What is drawn of one zone.

    Attributes:
        kind: A key of `ZONES`.
        name: As in the rig file.
        corners: In the world [m], shape (8, 3).
        edges: Pairs of corners, shape (12, 2, 3).
    """

    kind: str
    name: str
    corners: NDArray[np.float64]
    edges: NDArray[np.float64]


def zone_figures(plan: RigPlan) -> list[ZoneFigure]:
    """Return the zones of a plan's workspace, room first."""
    space = plan.requirements.workspace
    room = () if space.box is None else (space.box,)
    zones = zip(ZONES, (room, space.mounting, space.keep_out), strict=True)
    centre = np.array(space.centre)
    return [_figure(kind, box, centre) for kind, boxes in zones for box in boxes]


def seen_corners(
    plan: RigPlan, figures: Sequence[ZoneFigure]
) -> list[NDArray[np.float64]]:
    """Return the corners of zones, drawn in to where devices may stand, (8, 3) each."""
    space = plan.requirements.workspace
    reach = _ROOM * max(*space.projector_radius_m, *space.camera_radius_m)
    centre = np.array(space.centre)
    return [
        centre + np.clip(figure.corners - centre, -reach, reach) for figure in figures
    ]


def draw_zones(panel: Panel, figures: Sequence[ZoneFigure], caster: RayCaster) -> None:
    """Draw zones: a tint, and their edges where the object doesn't hide them."""
    for figure in figures:
        colour = ZONES[figure.kind]
        if figure.kind != "room":
            panel.tint(figure.corners, colour, alpha=_FILL)
        for edge in figure.edges:
            panel.polyline(edge, colour, width=1.0, caster=caster, alpha=_EDGE)


def _figure(kind: str, box: Box, centre: NDArray[np.float64]) -> ZoneFigure:
    signs = np.array(list(product((-1.0, 1.0), repeat=3)))
    corners = centre + box.centre_m + signs * box.half_m @ np.array(box.axes)
    edges = [
        (a, b)
        for a, b in combinations(range(8), 2)
        if np.count_nonzero(signs[a] != signs[b]) == 1
    ]
    return ZoneFigure(kind, box.name, corners, corners[np.array(edges)])
