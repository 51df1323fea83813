"""The housing of a device, as rig files and plans hold it: a box that moves with it.

Only values; what follows from them the planner (`placed_bodies`) and the checkers each
work out alone.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

from .table_types import Axis, Sides, Table

Triple = tuple[float, float, float]


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

    @classmethod
    def read(cls, entry: Mapping[str, Any]) -> Self | None:
        """Read `body` of a plan's table; None where it has none.

        Raises:
            KeyError: If a key is missing.
            ValueError: If there aren't three numbers each, or a side isn't positive.
        """
        table = entry.get("body")
        if table is None:
            return None
        x, y, z = (float(value) for value in table["centre_m"])
        width, height, depth = (float(value) for value in table["half_m"])
        if not min(width, height, depth) > 0.0:
            raise ValueError(f"body: half_m = {table['half_m']} must be positive")
        return cls((x, y, z), (width, height, depth))


def body_entry(body: Body | None) -> dict[str, Any]:
    """Return `body` of a plan's table; no key where there is none."""
    if body is None:
        return {}
    return {"body": {"centre_m": list(body.centre_m), "half_m": list(body.half_m)}}
