"""Obstacles as the lines that a draughtsman would draw: creases, borders, outline."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.topology import face_pairs
from planning.model.devices.bodies import Obstacle
from planning.model.plan import RigPlan

from .panel import Panel
from .picture_view import Colour

OBSTACLE: Colour = (96, 80, 64)
# Faces that meet under a larger angle share a line.
_CREASE = float(np.cos(np.radians(30.0)))


@dataclass(frozen=True, eq=False)
class ObstacleFigure:
    """What is drawn of one obstacle.

    Attributes:
        name: As in the rig file.
        mesh: Where it stands.
        near: Its corners, drawn in to where devices may stand [m], shape (n, 3).
    """

    name: str
    mesh: TriangleMesh
    near: NDArray[np.float64]

    def lines(self, towards: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the edges to draw for a viewer in a direction, (n, 2, 3) [m]."""
        edges = self.mesh.edges
        pairs, shared = face_pairs(edges)
        normals = self.mesh.face_normals
        one, other = normals[pairs[:, 0]], normals[pairs[:, 1]]
        bent = np.einsum("ij,ij->i", one, other) < _CREASE
        turns = (one @ towards > 0.0) != (other @ towards > 0.0)
        drawn = edges.border.copy()
        drawn[shared[bent | turns]] = True
        return self.mesh.vertices[edges.ends[drawn]]


def drawn_obstacles(plan: RigPlan) -> list[Obstacle]:
    """Return the obstacles that are shown, those that stand still at the first step.

    Not zones that block, which are shown as zones.
    """
    told = plan.document.stations
    first = told.stations[0].id if told is not None and told.stations else ""
    here = [o for o in plan.surface.obstacles if o.station in ("", first)]
    # Zones come after them, perhaps under the same names.
    return here[: len(plan.document.rig.obstacle)]


def obstacle_figures(plan: RigPlan, reach_m: float) -> list[ObstacleFigure]:
    """Return what is drawn of a plan's obstacles.

    Args:
        plan: The plan.
        reach_m: The picture follows them no farther from the workspace's centre.
    """
    centre = np.array(plan.requirements.workspace.centre)
    return [
        ObstacleFigure(
            solid.name,
            solid.mesh,
            centre + np.clip(solid.mesh.vertices - centre, -reach_m, reach_m),
        )
        for solid in drawn_obstacles(plan)
    ]


def draw_obstacles(
    panel: Panel, figures: Sequence[ObstacleFigure], towards: NDArray[np.float64]
) -> None:
    """Draw and name obstacles; lines are faint where the object hides them."""
    for figure in figures:
        for line in figure.lines(towards):
            panel.polyline(line, OBSTACLE, width=1.5, alpha=190)
        panel.label(figure.near.mean(axis=0), figure.name, OBSTACLE, size=13.0)
