"""Boxes: housings that move with a device, and zones that say where devices may stand.

Only values, as rig files and plans hold them; what follows from them the planner
(`placed_bodies`, `admissible`) and the checkers each work out alone.
"""

from dataclasses import dataclass, replace
from typing import Self

from .table_types import Axis, Sides, Table

Triple = tuple[float, float, float]
Axes = tuple[Triple, Triple, Triple]


class BodyTable(Table):
    """A body in a rig file, `[camera.body]` and so on.

    Attributes:
        size_mm: Width, height and depth: its extent along the device's x, y and z.
        centre_mm: Its middle in device coordinates.
    """

    size_mm: Sides
    centre_mm: Axis


@dataclass(frozen=True)
class Body:
    """A box in device coordinates: x right, y down, z forward from the optical centre.

    Parallel light: from the middle of the panel.

    Attributes:
        centre_m: Its middle [m].
        half_m: Half of its extent along x, y and z [m].

    Raises:
        ValueError: If a side isn't positive.
    """

    centre_m: Triple
    half_m: Triple

    @classmethod
    def of(cls, table: BodyTable | None) -> Self | None:
        """Return the body of a rig file's table; None where there is none."""
        if table is None:
            return None
        x, y, z = (1e-3 * value for value in table.centre_mm)
        width, height, depth = (0.5e-3 * value for value in table.size_mm)
        return cls((x, y, z), (width, height, depth))

    def __post_init__(self) -> None:
        if not min(self.half_m) > 0.0:
            raise ValueError(f"body: half_m = {self.half_m} must be positive")


@dataclass(frozen=True)
class Box:
    """A box, of any turn. A mounting plane is a thin one.

    Position Q is in it iff |a_i . (Q - workspace centre - centre_m)| <= half_m_i for
    its three directions a_i.

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

    def moved(self, by_m: Triple) -> "Box":
        """Return the box displaced."""
        (a, b, c), (x, y, z) = self.centre_m, by_m
        return replace(self, centre_m=(a + x, b + y, c + z))

    def grown(self, by_m: float) -> "Box":
        """Return the box with every face moved outwards, or inwards if negative."""
        x, y, z = (max(half + by_m, 0.0) for half in self.half_m)
        return replace(self, half_m=(x, y, z))
