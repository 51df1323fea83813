"""What turns with a table: what it must keep off, at every angle of a turn.

That is the part, and obstacles that turn with it. A table of one step doesn't turn.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from geometry.arrays import Array
from geometry.shapes.boxes import OrientedBox
from geometry.shapes.primitives import box
from geometry.shapes.swept import (
    Meeting,
    deepest_meeting,
    in_frame,
    lowest,
    spacing_m,
)
from planning.model.devices.heads import Turntable
from planning.model.errors import InfeasibleLimitsError
from planning.model.requirements import Workspace
from planning.scene.placed_bodies import Obstruction
from planning.scene.scene import Scene

# How near surfaces come that touch [m].
_CONTACT_M = 1e-4


@dataclass(frozen=True, eq=False)
class TableSweep:
    """What turns about an axis.

    Attributes:
        table: The turntable, in the world.
        turning: Corners of faces at angle 0 by what messages call them, (n, 3, 3) [m].
    """

    table: Turntable
    turning: dict[str, Array]

    @classmethod
    def of(
        cls, scene: Scene, turning: Sequence[Obstruction], table: Turntable
    ) -> "TableSweep":
        """Return the sweep of a scene's part and of what turns with it."""
        every = {"the part": scene.mesh.corners}
        every |= {solid.words: solid.mesh.corners for solid in turning}
        return cls(table, every)

    def clears(self, solid: OrientedBox) -> bool:
        """Return whether what turns keeps off a box, at every angle."""
        if not self._turns:
            return True
        return not any(
            deepest_meeting(faces, self._framed(_faces(solid.grown(2.0 * step))), step)
            for faces, step in self._sweeps.values()
        )

    def check(self, still: Sequence[Obstruction], space: Workspace) -> None:
        """Refuse what turns into what stands still, the floor or walls of the room.

        Obstacles may touch it. A floor or wall through which it reaches at angle 0 is
        none to it: it binds devices alone.

        Raises:
            InfeasibleLimitsError: It names both, the angle, how far, and what to do.
        """
        if not self._turns:
            return
        for what, (faces, step) in self._sweeps.items():
            for solid in still:
                met = deepest_meeting(faces, self._framed(solid.mesh.corners), step)
                if met is not None:
                    raise InfeasibleLimitsError(_told(what, solid.words, met))
            for name, met in self._beyond(faces, space):
                raise InfeasibleLimitsError(_told(what, name, met))

    def _beyond(self, faces: Array, space: Workspace) -> Iterator[tuple[str, Meeting]]:
        """Yield the floor and walls that it turns through, and reaches none at 0."""
        points = faces.reshape(-1, 3)
        for name, inwards, place in _planes(space):
            normal = self._framed(inwards + self._point)
            level = float(normal @ self._framed(place))
            least, angle = lowest(points, normal)
            stands = float((points @ normal).min()) >= level - _CONTACT_M
            if stands and least < level - _CONTACT_M:
                yield name, Meeting(level - least, angle)

    @property
    def _turns(self) -> bool:
        return self.table.steps != 1

    @cached_property
    def _sweeps(self) -> dict[str, tuple[Array, float]]:
        """Faces in the axis's frame, and how finely they are compared."""
        framed = {what: self._framed(faces) for what, faces in self.turning.items()}
        return {
            what: (faces, spacing_m(faces.reshape(-1, 3)))
            for what, faces in framed.items()
        }

    @property
    def _point(self) -> Array:
        return np.array(self.table.point_m)

    def _framed(self, corners: Array) -> Array:
        return in_frame(corners, self._point, np.array(self.table.axis))


def _planes(space: Workspace) -> Iterator[tuple[str, Array, Array]]:
    """Yield what bounds the room: its name, its inward normal, and a point of it."""
    centre = np.array(space.centre)
    if space.floor_m is not None:
        up = np.array(space.up)
        yield "the floor (workspace.floor_mm)", up, centre + space.floor_m * up
    if space.box is not None:
        middle = centre + np.array(space.box.centre_m)
        for axis, half in zip(space.box.axes, space.box.half_m, strict=True):
            for inwards in (np.array(axis), -np.array(axis)):
                yield "a wall of the room", inwards, middle - half * inwards


def _faces(solid: OrientedBox) -> Array:
    """Faces of a box, (12, 3, 3)."""
    x, y, z = (2.0 * solid.half).tolist()
    return box((x, y, z)).corners @ solid.axes + solid.centre


def _told(what: str, still: str, met: Meeting) -> str:
    return (
        f"turntable: {what} turns {1e3 * met.depth:.1f} mm into {still} when it has "
        f"turned by {np.degrees(met.angle):.0f} degrees, and must clear it at every "
        f"angle of a turn; move one of them, or the axis"
    )
