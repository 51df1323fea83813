"""Planned devices: projectors with their rings, and cameras."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from geometry.arrays import Array
from geometry.devices import ParallelModel, PinholeModel
from planning.model.light.dense_code import DenseCode

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
            edges, increasing, shape (n_rings,); of a dense code none.
        existing: Name of the device that stands already; empty: it is planned.
        body: Its housing; None: it takes no room.
        pattern: What it shows, as in `Requirements`.
        keeps_rings: Whether its rings stay as they are.
        exposure_s: What cameras expose each of its frames for [s]; None: not planned.
        model: Which of the rig's models it is; empty where there is one.
        code: What a `dense` pattern codes its pixels by.
        station: Where it stands with those that it measures with, see `meet`.
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
    exposure_s: float | None = None
    model: str = ""
    code: DenseCode | None = None
    station: str = ""


def meet(station: str, other: str) -> bool:
    """Return whether devices at two stations make a pair.

    They do at one station (a pose of a sensor head, a step of a turntable), and where
    either belongs to none.
    """
    return station == other or not (station and other)


def code_bits(n_rings: int) -> int:
    """Return how many bits number the annuli that so many rings part."""
    return max(1, n_rings.bit_length())


# Variance of a drawn edge: two pixels, the area of one, and its square [px^2].
EDGE_VARIANCE = 4.0 / 12.0 + 1.0 / 12.0 + 1.0 / 12.0
_LEAST_OFF_PX = 0.005


def edge_linearity_px(blur_px: Array) -> Array:
    """Return how far off a drawn edge may lie, rms in pixels of the projector.

    Squares of one grey level are stairs on the ramp that an edge is drawn as; what a
    blur b of light and image leaves of their first harmonic moves the edge by::

        exp(-2 pi^2 b^2) / (sqrt(2) pi)

    and ends of the ramp and rounding by 0.005 px. Measured by
    `benchmarks/pixels/panel_edges.py`: 0.02 px or less from b = 0.36 px on.

    Args:
        blur_px: b, all that blurs the pixels' squares, any shape [px].
    """
    stairs = np.exp(-2.0 * (np.pi * blur_px) ** 2) / (np.sqrt(2.0) * np.pi)
    return np.hypot(stairs, _LEAST_OFF_PX)


@dataclass(frozen=True, eq=False)
class PlannedCamera:
    """One camera of a plan.

    Attributes:
        id: Name, `C1` and so on.
        world_from_device: Pose, shape (4, 4) [m].
        device: Its optics.
        existing: Name of the device that stands already; empty: it is planned.
        body: Its housing; None: it takes no room.
        model: Which of the rig's models it is; empty where there is one.
        station: As of projectors.
    """

    id: str
    world_from_device: Array
    device: PinholeModel
    existing: str = ""
    body: Body | None = None
    model: str = ""
    station: str = ""
