"""What stands about the object and isn't a device: a robot, a table, a sitter, a clamp.

Only values, as plans hold them; what they stand in the way of, planner and checkers
each work out alone.
"""

from dataclasses import dataclass

from geometry.mesh.mesh import TriangleMesh


@dataclass(frozen=True, eq=False)
class Obstacle:
    """A surface through which no light and no view passes.

    Attributes:
        name: As in the rig file.
        mesh: Where it stands, in the world [m].
    """

    name: str
    mesh: TriangleMesh
