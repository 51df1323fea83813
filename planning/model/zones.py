"""Boxes that say where devices may stand: a room, keep-out volumes, mounting planes.

Only values, as the plan file holds them (`requirements.workspace`); what follows from
them the planner (`admissible`) and the audit (`audit.zones`) each work out alone.
"""

from dataclasses import dataclass, replace

Triple = tuple[float, float, float]
Axes = tuple[Triple, Triple, Triple]


@dataclass(frozen=True)
class Box:
    """A box, of any turn. A mounting plane is a thin one.

    A position Q is in it iff ``|a_i . (Q - centre of the workspace - centre_m)| <=
    half_m_i`` for its three directions a_i.

    Attributes:
        name: What messages call it.
        centre_m: Its middle, from the object's centre [m].
        half_m: Half of each side [m].
        axes: Unit directions of the sides in the world, right-handed.
    """

    name: str
    centre_m: Triple
    half_m: Triple
    axes: Axes

    def grown(self, by_m: float) -> "Box":
        """Return the box with every face moved outwards, or inwards if negative."""
        x, y, z = (max(half + by_m, 0.0) for half in self.half_m)
        return replace(self, half_m=(x, y, z))
