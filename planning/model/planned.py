"""Planned devices: projectors with their rings, and cameras."""

from dataclasses import dataclass
from typing import Literal

from geometry.arrays import Array
from geometry.devices import ParallelModel, PinholeModel

from .bodies import Body


@dataclass(frozen=True, eq=False)
class PlannedProjector:
    """One projector of a plan.

    Attributes:
        id: Name, `P1` and so on.
        light: `diverging` or `parallel`.
        world_from_device: Pose, shape (4, 4) [m].
        world_from_ring: Pose of the ring frame, shape (4, 4) [m].
        device: Its optics.
        ring_radii: Tangents R = x/z (diverging) or radii in [m] (parallel) of the ring
            edges, increasing, shape (n_rings,).
        existing: Name of the device that stands already; empty: it is planned.
        body: Its housing; None: it takes no room.
        pattern: What it shows, as in `Requirements`.
        keeps_rings: Whether its rings stay as they are.
    """

    id: str
    light: Literal["diverging", "parallel"]
    world_from_device: Array
    world_from_ring: Array
    device: PinholeModel | ParallelModel
    ring_radii: Array
    existing: str = ""
    body: Body | None = None
    pattern: Literal["rings", "dense", "none"] = "rings"
    keeps_rings: bool = False


def code_bits(n_rings: int) -> int:
    """Return how many bits number the annuli that so many rings part."""
    return max(1, n_rings.bit_length())


@dataclass(frozen=True, eq=False)
class PlannedCamera:
    """One camera of a plan.

    Attributes:
        id: Name, `C1` and so on.
        world_from_device: Pose, shape (4, 4) [m].
        device: Its optics.
        existing: Name of the device that stands already; empty: it is planned.
        body: Its housing; None: it takes no room.
    """

    id: str
    world_from_device: Array
    device: PinholeModel
    existing: str = ""
    body: Body | None = None
