"""Boxes that say where devices may stand: a room, keep-out volumes, mounting planes.

Only values, as the plan file holds them (`requirements.workspace`); what follows from
them the planner (`zone_limits`) and the audit (`audit.zones`) each work out alone.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

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

    @classmethod
    def read(cls, table: Mapping[str, Any]) -> "Box":
        """Read the dictionary of a plan file.

        Raises:
            KeyError: If a key is missing.
            ValueError: If a value isn't a number, or of a row not three are given.
        """
        first, second, third = (_triple(row) for row in table["axes"])
        return cls(
            str(table["name"]),
            _triple(table["centre_m"]),
            _triple(table["half_m"]),
            (first, second, third),
        )


def read_zones(workspace: Mapping[str, Any]) -> dict[str, Any]:
    """Return the zones of a plan's `requirements.workspace`, as `Workspace` has them.

    Raises:
        KeyError: If a box lacks a key.
        TypeError: If a zone isn't a table or a list of tables.
        ValueError: If a value isn't a number.
    """
    box = workspace.get("box")
    return {
        "box": None if box is None else Box.read(box),
        "keep_out": tuple(Box.read(table) for table in workspace.get("keep_out", ())),
        "mounting": tuple(Box.read(table) for table in workspace.get("mounting", ())),
    }


def _triple(values: Any) -> Triple:  # noqa: ANN401 - any JSON value
    x, y, z = (float(value) for value in values)
    return x, y, z
